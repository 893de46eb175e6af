//! The reference pages of the guide are those of the code.
//!
//! Keys come from the JSON Schema of the types that the files are parsed into, columns from the programs and the
//! store, exit codes from their table, and commands from `-h`. `PITCHLINE_WRITE_GUIDE=1` writes the pages and the
//! files in `share/` anew; meanings of columns, which no code holds, stay as they are on the page.

mod keys;

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use acceptance::{FIGURE_7, Sandbox, assert_code, printed, root};
use problem::Campaign;
use problem::file::PairFile;
use runner::exit;
use serde_json::Value;

use super::{merged, pages, read, run};

/// The opening of a part of a page that is compared; a name and `-->` follow.
pub(super) const BEGIN: &str = "<!-- generated: ";
pub(super) const END: &str = "<!-- end of the generated part -->";

/// Whether the pages are written instead of compared.
fn writes() -> bool {
    std::env::var_os("PITCHLINE_WRITE_GUIDE").is_some()
}

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
    if writes() {
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

#[test]
fn what_packages_share_is_what_the_program_writes() {
    let sandbox = Sandbox::new();
    let output = sandbox.coordinator(&["share", "share"]);
    assert_code(&output, 0);
    let written = files(&sandbox.path("share"));
    let share = root().join("share");
    if writes() {
        // Pages of commands that are gone do not stay.
        std::fs::remove_dir_all(&share).expect("the folder can be removed");
        for (name, text) in &written {
            let path = share.join(name);
            let folder = path.parent().expect("in a folder");
            std::fs::create_dir_all(folder).expect("the folder can be made");
            std::fs::write(&path, text).expect("the file can be written");
        }
    }
    assert!(
        written == files(&share),
        "share/ is not what the program writes: PITCHLINE_WRITE_GUIDE=1 writes it anew"
    );
    for shell in ["bash", "zsh", "fish"] {
        let text = printed(&sandbox.coordinator(&["completions", shell]));
        assert!(
            text.contains("undelivered"),
            "{shell}: options of the worker are missing"
        );
    }
}

/// The texts of all files in a folder by their paths in it.
fn files(folder: &Path) -> BTreeMap<PathBuf, String> {
    let mut found = BTreeMap::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(next) = folders.pop() {
        for entry in std::fs::read_dir(&next).expect("a folder") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                folders.push(path);
            } else {
                let name = path.strip_prefix(folder).expect("in the folder");
                found.insert(name.to_owned(), read(&path));
            }
        }
    }
    found
}

/// The meanings on a page, by the heading of the table and the name of the row.
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

/// A table of columns with the meaning of each from the page.
fn columns(heading: &str, columns: &[(String, String)]) -> String {
    let known = meanings("tables.md");
    let mut out = format!("### {heading}\n\n| column | unit or type | meaning |\n|---|---|---|\n");
    for (name, unit) in columns {
        let key = |table: &str| (table.to_owned(), format!("`{name}`"));
        // A column of this name in another table tells the same, unless the page says otherwise.
        let elsewhere = || known.iter().find(|((_, of), _)| *of == format!("`{name}`"));
        let meaning = known.get(&key(heading)).or_else(|| Some(elsewhere()?.1));
        let meaning = meaning.map_or("", String::as_str);
        let is_asked = !writes();
        assert!(
            !is_asked || !meaning.is_empty(),
            "{heading}: nothing is said of {name}"
        );
        let _ = writeln!(out, "| `{name}` | {unit} | {meaning} |");
    }
    out.push('\n');
    out
}

/// The unit at the end of a column's name.
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

const TABLES: [&str; 10] = [
    "designs",
    "samples",
    "responses",
    "loo",
    "optima",
    "rounds",
    "infill",
    "evaluations",
    "failures",
    "blocks",
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
                 evaluations = 8\nstarts = 1\n";
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

/// The output of a program with `-h`, without the parts that the pages on variables and exit codes have.
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
        // Continuations of a long line are indented.
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
