//! The keys of the campaign file and of the pair file.

use super::*;

/// A kind of file: its schema, and its parser.
struct Format<'a> {
    /// The schema that defines the types.
    schema: &'a Value,
    /// The schema of the whole file.
    top: &'a Value,
    parse: fn(&str) -> Result<(), String>,
    /// A file of this kind.
    text: String,
}

impl Format<'_> {
    /// The schema that a reference leads to, and the name of its type.
    fn resolved<'b>(&'b self, node: &'b Value) -> (&'b Value, Option<&'b str>) {
        if let Some(any) = node["anyOf"].as_array() {
            // An optional value: the type, or null.
            let mut others = any.iter().filter(|one| one["type"] != "null");
            if let (Some(one), None) = (others.next(), others.next()) {
                return self.resolved(one);
            }
        }
        let name = node["$ref"]
            .as_str()
            .and_then(|path| path.strip_prefix("#/$defs/"));
        match name {
            Some(name) => (&self.schema["$defs"][name], Some(name)),
            None => (node, None),
        }
    }

    /// The keys that the parser knows in a section, in the order of the code.
    fn keys(&self, head: &str) -> Vec<String> {
        let change = format!("{head}\nno_such_key = 1\n");
        let text = match head {
            "" => format!("{change}\n{}", self.text),
            _ => merged(&self.text, &change),
        };
        let message = (self.parse)(&text).expect_err("it must be refused");
        let (_, expected) = message
            .split_once("unknown field `no_such_key`, expected ")
            .unwrap_or_else(|| panic!("{head}: {message}"));
        let names = expected.split('`').skip(1).step_by(2);
        names.map(str::to_owned).collect()
    }
}

/// A description on one line of a table.
fn line(node: &Value) -> String {
    let text = node["description"].as_str().unwrap_or_default();
    assert!(!text.contains("[`"), "a link into the code: {text}");
    let words: Vec<&str> = text.split_whitespace().collect();
    words.join(" ").replace('|', "\\|")
}

/// The names that a value may have, with their meanings.
fn names(node: &Value) -> Vec<(&str, String)> {
    let all = node["oneOf"].as_array().map_or(&[][..], Vec::as_slice);
    let name = |one: &'_ Value| one["const"].as_str().is_some();
    let all = all.iter().filter(|one| name(one));
    all.map(|one| (one["const"].as_str().unwrap_or_default(), line(one)))
        .collect()
}

/// The kind of a value, in words.
fn kind(node: &Value) -> String {
    if let Some(title) = node["title"].as_str() {
        return title.replace('|', "\\|");
    }
    if !names(node).is_empty() {
        return "name, see below".to_owned();
    }
    let of = |node: &Value| {
        let types = &node["type"];
        let first = types.as_array().and_then(|types| types.first());
        let name = first.unwrap_or(types).as_str();
        name.unwrap_or_default().to_owned()
    };
    match (&*of(node), &*of(&node["items"]), &node["maxItems"]) {
        ("number", ..) => "number",
        ("integer", ..) => "whole number",
        ("boolean", ..) => "`true` or `false`",
        ("string", ..) => "text",
        ("array", "number", Value::Number(_)) => "two numbers",
        ("array", "integer", Value::Number(_)) => "two whole numbers",
        ("array", "integer", _) => "list of whole numbers",
        ("array", "number", _) => "list of numbers",
        ("array", "string", Value::Number(_)) => "two texts",
        ("array", "array", _) if node["items"]["items"]["type"] == "array" => {
            "list of lists of lists of numbers"
        }
        ("array", "array", _) => "list of lists of numbers",
        ("array", ..) if node["items"]["$ref"].is_string() => "list of sections, see below",
        ("object", ..) if node["additionalProperties"]["$ref"].is_string() => "table of sections",
        ("object", ..) if node["properties"].is_object() => "table",
        ("object", ..) => "table of texts",
        _ => panic!("a value has no name: {node}"),
    }
    .to_owned()
}

/// A value as in a file.
fn shown(value: &Value) -> String {
    value.to_string()
}

/// A file as Markdown: its sections with their keys, but for those that were `shown_before`.
fn page(format: &Format<'_>, shown_before: &mut BTreeSet<String>) -> String {
    let mut out = String::new();
    for name in format.keys("") {
        let property = &format.top["properties"][&name];
        assert!(!property.is_null(), "the schema has no {name}");
        let is_array = property["type"] == "array";
        let of = if is_array {
            &property["items"]
        } else {
            property
        };
        let (section, of_type) = format.resolved(of);
        let Some(of_type) = of_type.filter(|_| section["type"] == "object") else {
            continue;
        };
        let head = match is_array {
            true => format!("[[{name}]]"),
            false => format!("[{name}]"),
        };
        let is_required = requires(format.top, &name);
        let optional = if is_required { "" } else { ", optional" };
        let _ = write!(out, "### `{head}`{optional}\n\n");
        let table = table(format, &head, section);
        let without = without(&property["default"], section);
        if shown_before.insert(of_type.to_owned()) {
            let about = about(&line(section));
            let text = [about.as_str(), &without].join(" ");
            if !text.trim().is_empty() {
                let _ = write!(out, "{}\n\n", text.trim());
            }
            out += &table;
            out += &lists(format, &name, section);
        } else {
            let _ = write!(
                out,
                "{}\n\n",
                format!("As in a gear campaign. {without}").trim()
            );
        }
    }
    out.trim_end().to_owned()
}

/// The lists of sections within a section, such as `[[load.cases]]`.
fn lists(format: &Format<'_>, name: &str, section: &Value) -> String {
    let mut out = String::new();
    for (key, property) in section["properties"].as_object().into_iter().flatten() {
        let (of, of_type) = format.resolved(&property["items"]);
        if of_type.is_some() && of["type"] == "object" {
            let head = format!("[[{name}.{key}]]");
            let _ = write!(
                out,
                "### `{head}`, optional\n\n{}",
                table(format, &head, of)
            );
        }
    }
    out
}

fn requires(of: &Value, key: &str) -> bool {
    let required = of["required"].as_array();
    required.is_some_and(|keys| keys.iter().any(|one| one == key))
}

/// The values of a section that is absent, but for those of absent keys.
fn without(default: &Value, section: &Value) -> String {
    let values = default.as_object().into_iter().flatten();
    let values = values.filter(|(key, value)| {
        !value.is_null() && section["properties"][*key]["default"] != **value
    });
    let values: Vec<String> = values
        .map(|(key, value)| format!("`{key} = {}`", shown(value)))
        .collect();
    match values.is_empty() {
        true => String::new(),
        false => format!("Without the section: {}.", values.join(", ")),
    }
}

/// The description of a section, without the section's name.
fn about(text: &str) -> String {
    let Some((_, text)) = text
        .strip_prefix("`[")
        .and_then(|rest| rest.split_once("]`"))
    else {
        return text.to_owned();
    };
    let text = text.trim_start_matches(&[',', ':', ' '][..]);
    let text = text.strip_prefix("optional").unwrap_or(text);
    let text = text.trim_start_matches(&[',', ':', ' ', '.'][..]);
    let mut chars = text.chars();
    let first = chars.next().into_iter().flat_map(char::to_uppercase);
    first.chain(chars).collect()
}

/// The table of a section's keys, and the names that some of them take.
fn table(format: &Format<'_>, head: &str, section: &Value) -> String {
    let mut out = "| key | value | if absent | meaning |\n|---|---|---|---|\n".to_owned();
    let mut lists = String::new();
    let known = format.keys(head);
    let properties = section["properties"]
        .as_object()
        .expect("a section has keys");
    let of_schema: BTreeSet<&String> = properties.keys().collect();
    assert_eq!(
        of_schema,
        known.iter().collect(),
        "{head}: keys of schema and parser"
    );
    for key in &known {
        let property = &properties[key];
        let (of_type, _) = format.resolved(property);
        let absent = match (requires(section, key), &property["default"]) {
            (true, _) => "required".to_owned(),
            (false, Value::Null) => "optional".to_owned(),
            (false, value) => format!("`{}`", shown(value)),
        };
        let meaning = line(property);
        assert!(!meaning.is_empty(), "{head}: nothing is said of {key}");
        let _ = writeln!(
            out,
            "| `{key}` | {} | {absent} | {meaning} |",
            kind(of_type)
        );
        let names = names(of_type);
        if !names.is_empty() {
            let _ = write!(lists, "\n`{key}`:\n\n");
        }
        for (name, meaning) in names {
            let _ = writeln!(lists, "- `\"{name}\"`: {meaning}");
        }
    }
    format!("{out}{lists}\n")
}

fn parse_campaign(text: &str) -> Result<(), String> {
    let campaign = Campaign::parse("c.toml", text);
    campaign.map(|_| ()).map_err(|error| error.to_string())
}

fn parse_pair(text: &str) -> Result<(), String> {
    let pair = PairFile::parse("p.toml", text);
    pair.map(|_| ()).map_err(|error| error.to_string())
}

#[test]
fn the_keys_of_files_are_those_of_the_code() {
    let (campaign, pair) = (Campaign::schema(), PairFile::schema());
    let shown_before = &mut BTreeSet::new();
    let forms = campaign["anyOf"].as_array().expect("two kinds of files");
    let examples = ["campaigns/pair.toml", "campaigns/ishigami/campaign.toml"];
    let parts = ["gear campaigns", "external campaigns"];
    for ((form, example), part) in forms.iter().zip(examples).zip(parts) {
        let mut format = Format {
            schema: &campaign,
            top: form,
            parse: parse_campaign,
            text: read(&root().join(example)),
        };
        format.top = match form["$ref"].as_str() {
            Some(path) => &campaign["$defs"][path.trim_start_matches("#/$defs/")],
            None => form,
        };
        compare("campaign-file.md", part, &page(&format, shown_before));
    }
    let format = Format {
        schema: &pair,
        top: &pair,
        parse: parse_pair,
        text: FIGURE_7.to_owned(),
    };
    compare(
        "campaign-file.md",
        "pair files",
        &page(&format, shown_before),
    );
}
