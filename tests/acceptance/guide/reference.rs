//! The reference pages of the guide are those of the code.
//!
//! Keys come from the structs that the files are parsed into, columns from the programs and the store, exit
//! codes from their table, and commands from `-h`. `PITCHLINE_WRITE_GUIDE=1` writes the pages anew;
//! meanings of columns, which no code holds, stay as they are on the page.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

use acceptance::{FIGURE_7, Sandbox, assert_code, printed, root};
use campaign::Campaign;
use campaign::file::PairFile;
use protocol::exit;

use super::sources::{EXPLAINED_BY, Item, Sources, about, inner, names, plain, value_of};
use super::{header, merged, pages, read, run, sections};

/// What opens a part of a page that is compared; a name and `-->` follow.
pub(super) const BEGIN: &str = "<!-- generated: ";
pub(super) const END: &str = "<!-- end of the generated part -->";

/// Compares a part of a page with `expected`, or writes it there.
fn compare(page: &str, part: &str, expected: &str) {
    let path = pages().join(page);
    let text = read(&path);
    let begin = format!("{BEGIN}{part} -->\n");
    let (before, rest) = text
        .split_once(&begin)
        .unwrap_or_else(|| panic!("{page} has no part {part}"));
    let (held, after) = rest.split_once(END).expect("a part ends");
    let expected = format!("\n{expected}\n");
    if std::env::var_os("PITCHLINE_WRITE_GUIDE").is_some() {
        let text = [before, &begin, &expected, END, after].concat();
        std::fs::write(&path, text).expect("the page can be written");
        return;
    }
    let mut lines = held.lines().zip(expected.lines());
    let first = lines.find(|(held, expected)| held != expected);
    assert!(
        held == expected,
        "{page} is not what the code says: {first:?}; PITCHLINE_WRITE_GUIDE=1 writes it anew"
    );
}

/// A kind of file: how it is read, and a file of this kind.
struct Format {
    root: &'static str,
    parse: fn(&str) -> Result<String, String>,
    text: String,
    /// What the reader takes for absent keys: section and key, and the value.
    defaults: BTreeMap<(String, String), String>,
}

impl Format {
    /// What the parser says to the file with this change.
    fn refusal(&self, change: &str) -> String {
        let text = match change.starts_with('[') {
            true => merged(&self.text, change),
            false => format!("{change}\n{}", self.text),
        };
        (self.parse)(&text).expect_err("it must be refused")
    }

    /// The keys that the parser knows in a section.
    fn known_keys(&self, head: &str) -> BTreeSet<String> {
        let separator = if head.is_empty() { "" } else { "\n" };
        let message = self.refusal(&format!("{head}{separator}no_such_key = 1\n"));
        let (_, expected) = message
            .split_once("unknown field `no_such_key`, expected ")
            .unwrap_or_else(|| panic!("{head}: {message}"));
        expected
            .split('`')
            .skip(1)
            .step_by(2)
            .map(str::to_owned)
            .collect()
    }

    /// Requires that the parser names all of these where it refuses another name.
    fn require_names(&self, head: &str, key: &str, names: &[(String, String)]) {
        let held = sections(&self.text)
            .into_iter()
            .find(|section| header(section) == header(head));
        let held = held.unwrap_or_else(|| {
            let keys = self
                .defaults
                .iter()
                .filter(|((section, _), _)| head == format!("[{section}]"));
            let keys = keys.map(|((_, key), value)| format!("{key} = {value}\n"));
            format!("{head}\n{}", keys.collect::<String>())
        });
        let others = held
            .lines()
            .filter(|line| line.split('=').next().map(str::trim) != Some(key));
        let changed: String = others.map(|line| format!("{line}\n")).collect();
        let message = self.refusal(&format!("{changed}{key} = \"no-such-name\"\n"));
        for (_, name) in names {
            assert!(
                message.contains(name.as_str()),
                "{head} {key}: no {name} in {message}"
            );
        }
    }
}

/// What a value of this type is called, and the enum whose names it takes.
fn values<'a>(
    sources: &'a Sources,
    key: &Item,
    file: &str,
) -> (String, Option<&'a (Item, String)>) {
    let kind = inner(&key.kind);
    let simple = match kind {
        "f64" => "number",
        "bool" => "`true` or `false`",
        "u32" | "u64" if key.kind.contains("Vec<") => "list of whole numbers",
        "u32" | "u64" => "whole number",
        "[f64; 2]" => "two numbers",
        "[u32; 2]" => "two whole numbers",
        "String" => "text",
        _ => "",
    };
    // A name that is parsed later: the words say where it is defined.
    let linked = key
        .doc
        .split("see [`")
        .nth(1)
        .and_then(|rest| rest.split_once("`]"));
    let named = match kind {
        "String" => linked.and_then(|(path, _)| sources.resolve(path, file)),
        _ if simple.is_empty() => sources.resolve(kind, file),
        _ => None,
    };
    match named {
        Some((item, _)) => match value_of(&item.attributes, "expecting") {
            Some(expected) => {
                let shape = expected.trim_start_matches("expected ").to_owned();
                (shape.replace('|', "\\|"), None)
            }
            None => ("name, see below".to_owned(), named),
        },
        None => {
            assert!(!simple.is_empty(), "a value of type {kind} has no name");
            (simple.to_owned(), None)
        }
    }
}

/// A file as Markdown: its sections with their keys, but for those that were `shown` before.
fn file(sources: &Sources, format: &Format, shown: &mut BTreeSet<String>) -> String {
    let (top, _) = sources
        .of("campaign", format.root)
        .expect("the file's struct");
    let is_section = |key: &&Item| {
        let kind = sources.of("campaign", inner(&key.kind));
        kind.is_some_and(|(item, _)| {
            item.attributes.contains("deny_unknown_fields") || item.attributes.contains("try_from")
        })
    };
    let name = |key: &Item| match value_of(&key.attributes, "rename") {
        Some(name) => name,
        None => key.name.clone(),
    };
    let known: BTreeSet<String> = top.members.iter().map(name).collect();
    assert_eq!(known, format.known_keys(""), "{}", format.root);
    let mut out = String::new();
    for key in top.members.iter().filter(is_section) {
        let kind = inner(&key.kind);
        let (section, of_file) = sources.section(kind);
        let (documented, _) = sources.of("campaign", kind).expect("it was found");
        let head = match key.kind.starts_with("Vec<") {
            true => format!("[[{}]]", key.name),
            false => format!("[{}]", key.name),
        };
        let optional = key.kind.starts_with("Option<") || key.attributes.contains("default");
        let optional = if optional { ", optional" } else { "" };
        let explained = EXPLAINED_BY.iter().find(|(name, _)| *name == kind);
        let explained = explained.and_then(|(_, other)| sources.of("campaign", other));
        let about = about(explained.map_or(documented, |(item, _)| item));
        let _ = write!(out, "### `{head}`{optional}\n\n");
        let keys = keys(sources, format, &head, section, of_file);
        if !shown.insert(kind.to_owned()) {
            let defaults = format
                .defaults
                .iter()
                .filter(|((of, _), _)| *of == key.name);
            let defaults: Vec<String> = defaults
                .map(|((_, key), value)| format!("`{key} = {value}`"))
                .collect();
            let without = match defaults.join(", ") {
                none if none.is_empty() => none,
                defaults => format!(" Without the section: {defaults}."),
            };
            let _ = write!(out, "As in a gear campaign.{without}\n\n");
            continue;
        }
        if !about.is_empty() {
            let _ = write!(out, "{about}\n\n");
        }
        out += &keys;
    }
    out.trim_end().to_owned()
}

/// The table of a section's keys, and the names that some of them take.
fn keys(sources: &Sources, format: &Format, head: &str, section: &Item, file: &str) -> String {
    let mut out = "| key | value | if absent | meaning |\n|---|---|---|---|\n".to_owned();
    let mut lists = String::new();
    let mut known = BTreeSet::new();
    let name = head.trim_matches(&['[', ']'][..]);
    let members = || {
        let all = section.members.iter();
        all.filter(|member| !member.attributes.contains("serde(skip)"))
    };
    let named = members().filter_map(|key| values(sources, key, file).1);
    let of_section: Vec<_> = named.flat_map(|(item, file)| names(item, file)).collect();
    for key in members() {
        let aliases = key.attributes.split("alias = \"").skip(1);
        known.extend(aliases.filter_map(|rest| Some(rest.split('"').next()?.to_owned())));
        known.insert(key.name.clone());
        let (value, named) = values(sources, key, file);
        let is_optional = key.kind.starts_with("Option<")
            || key.attributes.contains("default")
            || section.attributes.contains("default");
        let default = format.defaults.get(&(name.to_owned(), key.name.clone()));
        let of_enum = named.and_then(|(item, file)| {
            let mut members = item.members.iter();
            let place = members.position(|variant| variant.attributes.contains("#[default]"))?;
            Some(format!("\"{}\"", names(item, file)[place].1))
        });
        let default = default.cloned().or(of_enum.filter(|_| is_optional));
        let absent = match (is_optional, default) {
            (true, Some(value)) => format!("`{value}`"),
            (true, None) => "optional".to_owned(),
            (false, Some(value)) => format!("required; `{value}` without the section"),
            (false, None) => "required".to_owned(),
        };
        let of_key = named
            .map(|(item, file)| names(item, file))
            .unwrap_or_default();
        let meaning = sources.doc(section, key, &of_section);
        let _ = writeln!(out, "| `{}` | {value} | {absent} | {meaning} |", key.name);
        if let Some((item, _)) = named {
            format.require_names(head, &key.name, &of_key);
            let _ = write!(lists, "\n`{}`:\n\n", key.name);
            for (variant, (_, name)) in item.members.iter().zip(&of_key) {
                let meaning = plain(&variant.doc, &of_key);
                let _ = writeln!(lists, "- `\"{name}\"`: {meaning}");
            }
        }
    }
    let of_parser = format.known_keys(head);
    let unknown: Vec<_> = of_parser.difference(&known).collect();
    assert!(
        unknown.is_empty(),
        "{head}: the reference lacks {unknown:?}"
    );
    let section: BTreeSet<String> = members().map(|key| key.name.clone()).collect();
    let gone: Vec<_> = section.difference(&of_parser).collect();
    assert!(gone.is_empty(), "{head}: the parser does not know {gone:?}");
    format!("{out}{lists}\n")
}

fn campaign_json(text: &str) -> Result<String, String> {
    let campaign = Campaign::parse("c.toml", text).map_err(|error| error.to_string())?;
    Ok(campaign.to_json())
}

fn pair_toml(text: &str) -> Result<String, String> {
    let pair = PairFile::parse("p.toml", text).map_err(|error| error.to_string())?;
    Ok(pair.to_toml())
}

#[test]
fn the_keys_of_files_are_those_of_the_code() {
    let sources = Sources::read();
    let shown = &mut BTreeSet::new();
    let gears = Format {
        root: "GearFile",
        parse: campaign_json,
        text: read(&root().join("campaigns/pair.toml")),
        defaults: BTreeMap::new(),
    };
    compare(
        "campaign-file.md",
        "gear campaigns",
        &file(&sources, &gears, shown),
    );
    // The example leaves out all that has a default.
    let text = read(&root().join("campaigns/ishigami/campaign.toml"));
    let written: serde_json::Value =
        serde_json::from_str(&campaign_json(&text).expect("it is shipped")).expect("JSON");
    let mut defaults = BTreeMap::new();
    for (section, keys) in written.as_object().expect("an object") {
        let is_given = sections(&text)
            .iter()
            .any(|held| header(held) == format!("[{section}"));
        for (key, value) in keys.as_object().into_iter().flatten() {
            if !is_given {
                defaults.insert((section.clone(), key.clone()), value.to_string());
            }
        }
    }
    let external = Format {
        root: "ExternalFile",
        parse: campaign_json,
        text,
        defaults,
    };
    compare(
        "campaign-file.md",
        "external campaigns",
        &file(&sources, &external, shown),
    );
    let mut defaults = BTreeMap::new();
    let written = pair_toml(FIGURE_7).expect("a pair");
    for section in sections(&written) {
        let head = header(&section).trim_start_matches('[').to_owned();
        let is_given = sections(FIGURE_7)
            .iter()
            .any(|held| header(held) == header(&section));
        for (key, value) in section.lines().filter_map(|line| line.split_once(" = ")) {
            let is_given = is_given && FIGURE_7.contains(&format!("\n{key} = "));
            if !is_given {
                defaults.insert((head.clone(), key.to_owned()), value.to_owned());
            }
        }
    }
    let pair = Format {
        root: "PairFile",
        parse: pair_toml,
        // A shape can only be given beside a relief.
        text: format!(
            "{FIGURE_7}[corrections]\ntip_relief_um = [6.0, 6.0]\ntip_relief_length_mm = [2.0, 2.0]\n"
        ),
        defaults,
    };
    compare(
        "campaign-file.md",
        "pair files",
        &file(&sources, &pair, shown),
    );
}

/// The meanings on a page, by what a table is of and the name of the row.
fn meanings(page: &str) -> BTreeMap<(String, String), String> {
    let mut table = String::new();
    let mut meanings = BTreeMap::new();
    for line in read(&pages().join(page)).lines() {
        if let Some(heading) = line.strip_prefix("### ") {
            heading.clone_into(&mut table);
        }
        let cells: Vec<&str> = line.trim_matches('|').split(" | ").map(str::trim).collect();
        if let [name, _, meaning] = cells[..] {
            meanings.insert((table.clone(), name.to_owned()), meaning.to_owned());
        }
    }
    meanings
}

/// A table of columns with what the page says of each.
fn columns(heading: &str, columns: &[(String, String)]) -> String {
    let known = meanings("tables.md");
    let mut out = format!("### {heading}\n\n| column | unit or type | meaning |\n|---|---|---|\n");
    for (name, unit) in columns {
        let key = |table: &str| (table.to_owned(), format!("`{name}`"));
        // A column of this name in another table tells the same, unless the page says otherwise.
        let elsewhere = || known.iter().find(|((_, of), _)| *of == format!("`{name}`"));
        let meaning = known.get(&key(heading)).or_else(|| Some(elsewhere()?.1));
        let meaning = meaning.map_or("", String::as_str);
        let is_asked = std::env::var_os("PITCHLINE_WRITE_GUIDE").is_none();
        assert!(
            !is_asked || !meaning.is_empty(),
            "{heading}: nothing is said of {name}"
        );
        let _ = writeln!(out, "| `{name}` | {unit} | {meaning} |");
    }
    out.push('\n');
    out
}

/// The unit that the end of a column's name says.
fn unit(column: &str) -> &'static str {
    let units = [
        ("_um2", "µm²"),
        ("_um", "µm"),
        ("_mm", "mm"),
        ("_mpa", "MPa"),
        ("_deg", "°"),
        ("_seconds", "s"),
    ];
    let unit = units.into_iter().find(|(end, _)| column.ends_with(end));
    unit.map_or("", |(_, unit)| unit)
}

const TABLES: [&str; 9] = [
    "designs",
    "samples",
    "responses",
    "loo",
    "optima",
    "rounds",
    "infill",
    "evaluations",
    "failures",
];

/// The columns of an exported table.
fn exported(sandbox: &Sandbox, store: &str, table: &str) -> Vec<String> {
    let table = sandbox.coordinator(&["export", "--db", store, "--table", table, "--out", "-"]);
    assert_code(&table, 0);
    let header = printed(&table)
        .lines()
        .next()
        .unwrap_or_default()
        .to_owned();
    header.split(',').map(str::to_owned).collect()
}

/// Prints a line for each column of a store: table, column and type.
const SCHEMA: &str = "import sqlite3
store = sqlite3.connect('pair.db')
tables = store.execute(\"SELECT name FROM sqlite_master WHERE type = 'table' ORDER BY name\")
for (table,) in tables.fetchall():
    if not table.startswith(('_', 'sqlite_')):
        for column in store.execute(f'PRAGMA table_info({table})'):
            print(table, column[1], column[2], sep='|')
";

#[test]
fn the_columns_of_tables_are_those_of_the_programs() {
    let sandbox = Sandbox::new();
    // Tables have their columns before they have rows; the report needs some designs.
    let small = "[doe]\ndesigns = 8\n[optimise]\npopulation = 4\nparents = 2\nstep = 0.3\n\
                 evaluations = 8\nrestart_at = 4\nstarts = 1\npenalty = 10.0\nreference_um = 0.5\n\
                 failure_value = 100.0\n";
    let pair = merged(&read(&root().join("campaigns/pair.toml")), small);
    sandbox.write("pair.toml", &pair);
    let run_it = ["run", "pair.toml", "--db", "pair.db", "--out", "report"];
    assert_code(&sandbox.coordinator(&run_it), 0);
    let mut out = String::new();
    for table in TABLES {
        let names = exported(&sandbox, "pair.db", table).into_iter();
        let names: Vec<_> = names
            .map(|name| (name.clone(), unit(&name).to_owned()))
            .collect();
        out += &columns(&format!("`{table}`"), &names);
    }
    compare("tables.md", "exported tables", out.trim_end());

    let (code, schema) = run(
        &sandbox,
        &format!("python3 -c \"$(cat <<'EOF'\n{SCHEMA}EOF\n)\"\n"),
    );
    assert_eq!(code, Some(0), "{schema}");
    let mut tables: BTreeMap<&str, Vec<(String, String)>> = BTreeMap::new();
    for line in schema.lines() {
        let cells: Vec<&str> = line.split('|').collect();
        let column = (cells[1].to_owned(), cells[2].to_lowercase());
        tables.entry(cells[0]).or_default().push(column);
    }
    let tables = tables
        .iter()
        .map(|(table, names)| columns(&format!("Table `{table}`"), names));
    compare(
        "tables.md",
        "the store",
        tables.collect::<String>().trim_end(),
    );
}

#[test]
fn the_exit_codes_are_those_of_the_code() {
    let mut out = "| code | meaning |\n|---:|---|\n".to_owned();
    for (code, meaning) in exit::TABLE {
        let _ = writeln!(out, "| {code} | {meaning} |");
    }
    compare("exit-codes.md", "exit codes", out.trim_end());
}

/// What a program prints with `-h`, without what the pages on variables and exit codes say.
fn help(sandbox: &Sandbox, command: &str) -> String {
    let (code, text) = run(sandbox, &format!("{command} -h"));
    assert_eq!(code, Some(0), "{text}");
    let text = text.split("\nEnvironment:").next().unwrap_or_default();
    let lines = text.lines().map(|line| format!("{}\n", line.trim_end()));
    format!(
        "### `{command}`\n\n```text\n{}\n```\n\n",
        lines.collect::<String>().trim_end()
    )
}

#[test]
fn the_commands_are_those_of_the_programs() {
    let sandbox = Sandbox::new();
    let mut out = help(&sandbox, "coordinator");
    let commands = out.lines().skip_while(|line| *line != "Commands:").skip(1);
    let commands: Vec<String> = commands
        .take_while(|line| line.starts_with("  "))
        // What follows a long line is indented.
        .filter(|line| !line.starts_with("   "))
        .filter_map(|line| line.split_whitespace().next())
        .filter(|name| *name != "help")
        .map(|name| format!("coordinator {name}"))
        .collect();
    assert!(commands.len() > 10, "{out}");
    for command in commands {
        out += &help(&sandbox, &command);
    }
    out += &help(&sandbox, "worker");
    compare("commands.md", "commands", out.trim_end());
}
