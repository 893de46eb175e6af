//! Any file is refused with its name and a line, or is valid.

use acceptance::FIGURE_7;
use problem::formulation::Problem;
use problem::{Campaign, FileError, PairFile};
use proptest::prelude::*;

/// A change of a text.
#[derive(Debug, Clone)]
enum Change {
    Drop(usize),
    Double(usize),
    /// Replaces the value of a key.
    Value(usize, String),
    /// Replaces a line.
    Line(usize, String),
    /// Cuts the text after a line.
    Cut(usize),
}

fn a_change() -> impl Strategy<Value = Change> {
    let values = [
        "0",
        "-0",
        "-1",
        "1",
        "2",
        "1e308",
        "-1e308",
        "1e-308",
        "5e-324",
        "nan",
        "inf",
        "-inf",
        "4294967295",
        "4294967296",
        "18446744073709551615",
        "18446744073709551616",
        "true",
        "\"\"",
        "\"x\"",
        "[]",
        "[1.0, 1.0]",
        "[2.0, 1.0]",
        "[nan, 1.0]",
        "[0.0, inf]",
        "[1e308, -1e308]",
        "{}",
        "[[]]",
        "1979-05-27",
        "0x10",
        "1_0.5",
        "'''",
        "# no value",
    ];
    let value = prop_oneof![
        prop::sample::select(values.to_vec()).prop_map(str::to_owned),
        any::<f64>().prop_map(|value| format!("{value:?}")),
        any::<i64>().prop_map(|value| value.to_string()),
    ];
    let line = || 0..200_usize;
    prop_oneof![
        1 => line().prop_map(Change::Drop),
        1 => line().prop_map(Change::Double),
        6 => (line(), value).prop_map(|(line, value)| Change::Value(line, value)),
        1 => (line(), "\\PC{0,30}").prop_map(|(line, text)| Change::Line(line, text)),
        1 => (0..1000_usize).prop_map(Change::Cut),
    ]
}

fn changed(text: &str, changes: &[Change]) -> String {
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    for change in changes {
        if lines.is_empty() {
            break;
        }
        let count = lines.len();
        match change {
            Change::Drop(line) => drop(lines.remove(line % count)),
            Change::Double(line) => lines.insert(line % count, lines[line % count].clone()),
            Change::Value(line, value) => {
                let line = &mut lines[line % count];
                if let Some((key, _)) = line.split_once('=') {
                    *line = format!("{key}= {value}");
                }
            }
            Change::Line(line, text) => lines[line % count].clone_from(text),
            Change::Cut(place) => lines.truncate(count * place / 1000),
        }
    }
    lines.join("\n")
}

fn assert_names_the_line(error: &FileError, text: &str) {
    let sentence = error.to_string();
    let line = sentence.strip_prefix("some.toml, line ").and_then(|rest| {
        let (line, _) = rest.split_once(':')?;
        line.parse::<usize>().ok()
    });
    let last = text.lines().count().max(1);
    // A missing item may be reported on the line after the last.
    assert!(
        line.is_some_and(|line| (1..=last + 1).contains(&line)),
        "{sentence}"
    );
}

fn config(cases: u32) -> ProptestConfig {
    ProptestConfig {
        cases,
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

fn shipped() -> Vec<String> {
    let folder = acceptance::root().join("campaigns");
    let mut texts = Vec::new();
    let mut folders = vec![folder];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).expect("campaigns are shipped") {
            let path = entry.expect("the folder can be read").path();
            if path.is_dir() {
                folders.push(path);
            } else if path
                .extension()
                .is_some_and(|extension| extension == "toml")
            {
                texts.push(std::fs::read_to_string(path).expect("it is text"));
            }
        }
    }
    texts.sort();
    texts
}

#[test]
fn a_campaign_file_makes_sense_or_is_refused_by_its_line() {
    let texts = shipped();
    assert!(texts.len() >= 2, "the paper's campaign and the quick one");
    let good = |text: &&String| Campaign::parse("some.toml", text).is_ok();
    assert!(texts.iter().filter(good).count() >= 2);
    let changes = prop::collection::vec(a_change(), 1..4);
    let mutated =
        (prop::sample::select(texts), changes).prop_map(|(text, changes)| changed(&text, &changes));
    let text = prop_oneof![8 => mutated, 1 => "\\PC{0,200}", 1 => "[a-z =\\[\\]\"0-9.\n]{0,200}"];
    proptest!(config(2000), |(text in text)| {
        match Campaign::parse("some.toml", &text) {
            Err(error) => assert_names_the_line(&error, &text),
            Ok(campaign) => {
                // An accepted file can be used and survives serialisation.
                let json = campaign.to_json();
                let again = Campaign::from_json(&json).expect("what was written can be read");
                prop_assert_eq!(&again, &campaign);
                prop_assert_eq!(again.digest(), campaign.digest());
                let _ = campaign.warnings();
                let _ = Problem::new(campaign);
            }
        }
    });
}

#[test]
fn a_pair_file_makes_sense_or_is_refused_by_its_line() {
    assert!(PairFile::parse("some.toml", FIGURE_7).is_ok());
    let changes = prop::collection::vec(a_change(), 0..4);
    let mutated = changes.prop_map(|changes| changed(FIGURE_7, &changes));
    let text = prop_oneof![8 => mutated, 1 => "\\PC{0,200}"];
    proptest!(config(2000), |(text in text)| {
        match PairFile::parse("some.toml", &text) {
            Err(error) => assert_names_the_line(&error, &text),
            Ok(pair) => drop(pair.to_gear()),
        }
    });
}
