//! What the sources say of the structs and enums that files are parsed into: names, types and doc comments.
//!
//! The sources are read as text. The reference test compares the keys found here with those that the parser
//! knows, so that nothing is overlooked.

use std::collections::BTreeMap;
use std::path::PathBuf;

use acceptance::root;

use super::read;

/// A struct or an enum, or one of its fields or variants.
#[derive(Debug, Clone, Default)]
pub(super) struct Item {
    pub(super) name: String,
    /// The type of a field.
    pub(super) kind: String,
    pub(super) attributes: String,
    pub(super) doc: String,
    pub(super) members: Vec<Item>,
}

/// The structs and enums of a crate's source, with the file that each stands in.
fn items(folder: &str) -> Vec<(Item, String)> {
    let mut files = vec![root().join(folder)];
    let mut found = Vec::new();
    while let Some(path) = files.pop() {
        if path.is_dir() {
            let entries = std::fs::read_dir(&path).expect("a folder");
            let mut entries: Vec<PathBuf> = entries
                .map(|entry| entry.expect("an entry").path())
                .collect();
            entries.sort();
            files.extend(entries);
        } else if path.extension().is_some_and(|kind| kind == "rs") {
            let text = read(&path);
            found.extend(items_of(&text).into_iter().map(|item| (item, text.clone())));
        }
    }
    found
}

/// The structs and enums of a file that rustfmt has formatted, without those of its modules.
fn items_of(text: &str) -> Vec<Item> {
    let mut found: Vec<Item> = Vec::new();
    let mut is_inside = false;
    let (mut doc, mut attributes) = (String::new(), String::new());
    let mut lines = text.lines();
    while let Some(line) = lines.next() {
        let indent = if is_inside { "    " } else { "" };
        let Some(line) = line
            .strip_prefix(indent)
            .filter(|line| !line.starts_with(' '))
        else {
            is_inside &= line != "}";
            continue;
        };
        if let Some(text) = line.strip_prefix("///") {
            doc += text;
            doc.push('\n');
        } else if line.starts_with("#[") {
            attributes += line;
            while !attributes.ends_with(']') {
                let next = lines.next().expect("an attribute ends");
                attributes += next.trim();
            }
        } else if line.starts_with("//") {
            // A reason for people who read the code.
        } else if is_inside {
            let item = found.last_mut().expect("its head was read");
            if let Some(member) = member(line) {
                item.members.push(Item {
                    attributes: std::mem::take(&mut attributes),
                    doc: std::mem::take(&mut doc),
                    ..member
                });
            }
        } else {
            let words: Vec<&str> = line.split_whitespace().collect();
            let place = words
                .iter()
                .position(|word| ["struct", "enum"].contains(word));
            if let Some(name) = place
                .and_then(|place| words.get(place + 1))
                .filter(|_| line.ends_with('{'))
            {
                found.push(Item {
                    name: (*name).to_owned(),
                    kind: String::new(),
                    attributes: std::mem::take(&mut attributes),
                    doc: std::mem::take(&mut doc),
                    members: Vec::new(),
                });
                is_inside = true;
            }
            doc.clear();
            attributes.clear();
        }
    }
    found
}

/// The name and type of a field, or the name of a variant.
fn member(line: &str) -> Option<Item> {
    let line = line
        .trim_end_matches(['{', ' '])
        .strip_suffix(',')
        .unwrap_or(line);
    let line = match line.strip_prefix("pub") {
        Some(rest) => rest.split_once(' ')?.1,
        None => line,
    };
    let (name, kind) = line.split_once(": ").unwrap_or((line, ""));
    let name = name.split('(').next()?;
    let is_name = !name.is_empty() && name.chars().all(|c| c.is_alphanumeric() || c == '_');
    is_name.then(|| Item {
        name: name.to_owned(),
        kind: kind.to_owned(),
        ..Item::default()
    })
}

/// All that files are parsed into.
pub(super) struct Sources {
    /// By crate.
    crates: BTreeMap<&'static str, Vec<(Item, String)>>,
}

/// Structs that only say which keys there are, and the one that says what they mean.
pub(super) const EXPLAINED_BY: [(&str, &str); 3] = [
    ("PenalisedOptimise", "Optimise"),
    ("MaterialSection", "Material"),
    ("ExternalSimulator", "SimulatorSection"),
];

impl Sources {
    pub(super) fn read() -> Self {
        let crates = ["campaign", "doe", "enrich", "gear", "kriging"];
        let folder = |name: &str| match name {
            "campaign" => "crates/campaign/src/file".to_owned(),
            name => format!("crates/{name}/src"),
        };
        Self {
            crates: crates
                .into_iter()
                .map(|name| (name, items(&folder(name))))
                .collect(),
        }
    }

    pub(super) fn of(&self, krate: &str, name: &str) -> Option<&(Item, String)> {
        let all = self.crates.get(krate)?;
        all.iter().find(|(item, _)| item.name == name)
    }

    /// The item that `kind` names in a file of the campaign crate: one of this file, one of that crate, or
    /// one of another crate that is named with it or imported from it.
    pub(super) fn resolve(&self, kind: &str, file: &str) -> Option<&(Item, String)> {
        if let Some((krate, name)) = kind.split_once("::") {
            return self.of(krate, name);
        }
        let mut own = self.crates["campaign"].iter();
        let own = own.find(|(item, of)| item.name == kind && of == file);
        own.or_else(|| self.of("campaign", kind)).or_else(|| {
            let mut imports = file.lines().filter(|line| line.starts_with("use "));
            imports.find_map(|line| {
                let (krate, names) = line.strip_prefix("use ")?.split_once("::")?;
                let mut names = names.split(|c: char| !c.is_alphanumeric());
                names
                    .find(|name| *name == kind)
                    .and_then(|name| self.of(krate, name))
            })
        })
    }

    /// The struct of a section's keys as they are written.
    pub(super) fn section(&self, name: &str) -> &(Item, String) {
        let found = self
            .of("campaign", name)
            .unwrap_or_else(|| panic!("no struct {name}"));
        match value_of(&found.0.attributes, "try_from") {
            Some(name) => self.section(&name),
            None => found,
        }
    }

    /// What a key means: its own words, or those of the struct that explains this one. `names` are those
    /// that it takes.
    pub(super) fn doc(&self, section: &Item, key: &Item, names: &[(String, String)]) -> String {
        let other = EXPLAINED_BY.iter().find(|(name, _)| *name == section.name);
        let other = other.and_then(|(_, other)| self.of("campaign", other));
        let explained =
            other.and_then(|(item, _)| item.members.iter().find(|of| of.name == key.name));
        let doc = if key.doc.is_empty() {
            explained.map_or("", |key| &key.doc)
        } else {
            &key.doc
        };
        assert!(
            !doc.is_empty(),
            "{}.{} has no words",
            section.name,
            key.name
        );
        plain(doc, names)
    }
}

/// The value of `key = "value"` among attributes.
pub(super) fn value_of(attributes: &str, key: &str) -> Option<String> {
    let (_, rest) = attributes.split_once(&format!("{key} = \""))?;
    // A quote within is escaped.
    let rest = rest.replace("\\\"", "\u{0}");
    Some(rest.split('"').next()?.replace('\u{0}', "\""))
}

/// A doc comment for people who do not read the code: without links into it. Variants get their `names`.
pub(super) fn plain(doc: &str, names: &[(String, String)]) -> String {
    let mut text = doc.split_whitespace().collect::<Vec<_>>().join(" ");
    while let Some(begin) = text.find("[`") {
        let Some(length) = text[begin..].find("`]") else {
            break;
        };
        let inside = text[begin + 2..begin + length].to_owned();
        let mut end = begin + length + 2;
        if text[end..].starts_with('(') {
            end += text[end..].find(')').map_or(0, |length| length + 1);
        }
        let last = inside.rsplit("::").next().unwrap_or_default();
        let name = names.iter().find(|(variant, _)| variant == last);
        let asides = ["; see ", ", see ", ": see ", ": "];
        let aside = asides
            .into_iter()
            .find(|aside| text[..begin].ends_with(aside));
        let ends = text[end..].starts_with('.');
        match (name, aside) {
            (Some((_, name)), _) => text.replace_range(begin..end, &format!("`\"{name}\"`")),
            (None, Some(aside)) if ends => text.replace_range(begin - aside.len()..end, ""),
            _ => text.replace_range(begin..end, &format!("`{last}`")),
        }
    }
    text.replace('|', "\\|")
}

/// The names of an enum's variants in files.
pub(super) fn names(item: &Item, file: &str) -> Vec<(String, String)> {
    let named = |variant: &Item| {
        let of = &variant.name;
        let given = [format!(" {of} = \""), format!("::{of} => \"")];
        let given = given.iter().find_map(|begin| {
            let (_, rest) = file.split_once(begin)?;
            Some(rest.split('"').next()?.to_owned())
        });
        let renamed = value_of(&variant.attributes, "rename");
        let name = renamed.or(given).unwrap_or_else(|| kebab(&variant.name));
        (variant.name.clone(), name)
    };
    item.members.iter().map(named).collect()
}

fn kebab(name: &str) -> String {
    let mut kebab = String::new();
    for c in name.chars() {
        if c.is_uppercase() && !kebab.is_empty() {
            kebab.push('-');
        }
        kebab.extend(c.to_lowercase());
    }
    kebab
}

/// The first sentence of a section's words, without its own name.
pub(super) fn about(item: &Item) -> String {
    let text = plain(&item.doc, &[]);
    let text = text
        .strip_prefix('`')
        .and_then(|rest| Some(rest.split_once('`')?.1));
    let text = text
        .unwrap_or_default()
        .trim_start_matches(&[',', ':', ' '][..]);
    let text = text.strip_prefix("optional").unwrap_or(text);
    let text = text.trim_start_matches(&[',', ':', ' ', '.'][..]);
    let mut chars = text.chars();
    chars
        .next()
        .map(|first| first.to_uppercase().chain(chars).collect())
        .unwrap_or_default()
}

/// The type inside an `Option`, a `Vec` or a `Box`.
pub(super) fn inner(kind: &str) -> &str {
    ["Option<", "Vec<", "Box<"]
        .iter()
        .find_map(|outer| kind.strip_prefix(outer)?.strip_suffix('>'))
        .map_or(kind, inner)
}
