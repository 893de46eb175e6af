//! `[simulator.read]`: where a number stands in a result file that is written for people.

use regex::Regex;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::FileError;
use super::validate::Source;

/// The place of a number in a program's result file. The last line that matches counts: of an iteration it is the
/// last step.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "a section with `line`, and `column` unless a group of `line` is the number")]
pub struct ResultLine {
    /// A regular expression for the line; its group, if it has one, is the number.
    line: Pattern,
    /// The number's column, from 1. Blanks, commas and semicolons separate columns.
    #[serde(skip_serializing_if = "Option::is_none")]
    column: Option<u32>,
}

/// A regular expression.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "String", into = "String")]
#[schemars(with = "String")]
struct Pattern(Regex);

impl TryFrom<String> for Pattern {
    type Error = regex::Error;

    fn try_from(text: String) -> Result<Self, Self::Error> {
        Regex::new(&text).map(Self)
    }
}

impl From<Pattern> for String {
    fn from(pattern: Pattern) -> Self {
        pattern.0.as_str().to_owned()
    }
}

impl PartialEq for Pattern {
    fn eq(&self, other: &Self) -> bool {
        self.0.as_str() == other.0.as_str()
    }
}

impl ResultLine {
    /// The text of the number in a result file.
    ///
    /// # Errors
    ///
    /// The part of a sentence after the file's name: no line matches, or it has too few columns.
    pub fn find<'a>(&self, text: &'a str) -> Result<&'a str, String> {
        let pattern = &self.line.0;
        let last = text.lines().rev().find_map(|line| {
            let groups = pattern.captures(line)?;
            Some((line, groups.get(1).map(|group| group.as_str())))
        });
        let Some((line, group)) = last else {
            return Err(format!(" has no line that matches {:?}", pattern.as_str()));
        };
        let Some(column) = self.column else {
            return group.ok_or_else(|| {
                format!(
                    " has no number in the group of {:?}: {line:?}",
                    pattern.as_str()
                )
            });
        };
        let separates = |c: char| c.is_whitespace() || c == ',' || c == ';';
        let mut columns = line.split(separates).filter(|text| !text.is_empty());
        columns
            .nth(column as usize - 1)
            .ok_or_else(|| format!(" has no column {column} in the line {line:?}"))
    }

    pub(super) fn validate(&self, source: Source<'_>, key: &str) -> Result<(), FileError> {
        let groups = self.line.0.captures_len() - 1;
        let pattern = self.line.0.as_str();
        match self.column {
            None => source.require(
                groups == 1,
                key,
                pattern,
                "a line with one group (…) for the number, unless column is given",
            ),
            Some(column) => {
                let expected = "a line without a group (…) beside column";
                source.require(groups == 0, key, pattern, expected)?;
                source.count(key, column, 1, 10_000)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Campaign;

    fn place(text: &str) -> ResultLine {
        toml::from_str(text).unwrap()
    }

    const OUTPUT: &str = "step 1: force = 1.0 N\n  node   ux    uy\n  12   0.5D-3;-2.0\nstep 2: force = 3.5 N\nend\n";

    #[test]
    fn the_last_matching_line_has_the_number_in_a_group_or_a_column() {
        let force = place(r"line = 'force = (\S+)'");
        assert_eq!(force.find(OUTPUT), Ok("3.5"));
        let sideways = place("line = '^ *12 '\ncolumn = 3");
        assert_eq!(sideways.find(OUTPUT), Ok("-2.0"));
        for (read, why) in [
            (
                "line = 'moment = (.*)'",
                " has no line that matches \"moment = (.*)\"",
            ),
            ("line = '^end(x)?$'", " has no number in the group of"),
            (
                "line = 'force'\ncolumn = 9",
                " has no column 9 in the line \"step 2",
            ),
        ] {
            let error = place(read).find(OUTPUT).unwrap_err();
            assert!(error.starts_with(why), "{error}");
        }
    }

    #[test]
    fn what_cannot_be_read_is_refused_by_its_line() {
        const BEAM: &str = include_str!("../../../../campaigns/cantilever/campaign.toml");
        let program = "template = 'beam.in'\nresult = 'beam.out'";
        let area = "area = { line = '^area', column = 3 }";
        for (program, read, says) in [
            (
                program,
                format!("{area}\n"),
                "simulator.read.displacement is missing",
            ),
            (
                program,
                format!("{area}\ndisplacement = {{ line = 'd = ' }}\n"),
                "simulator.read.displacement is \"d = \", but must be a line with one group",
            ),
            (
                program,
                format!("{area}\ndisplacement = {{ line = '(d)', column = 2 }}\n"),
                "but must be a line without a group",
            ),
            (
                program,
                format!("{area}\ndisplacement = {{ line = 'd', column = 0 }}\n"),
                "but must be a whole number from 1",
            ),
            (
                program,
                format!("{area}\ndisplacement = {{ line = 'd (.*' }}\n"),
                "unclosed group",
            ),
            (
                program,
                format!(
                    "{area}\ndisplacement = {{ line = 'd (.*)' }}\nstress = {{ line = 's (.*)' }}\n"
                ),
                "but must be one of the responses: area, displacement",
            ),
            (
                "command = 'beam'",
                format!("{area}\ndisplacement = {{ line = 'd (.*)' }}\n"),
                "but must be absent without template and result",
            ),
        ] {
            let text = format!("{BEAM}\n[simulator]\n{program}\n[simulator.read]\n{read}");
            let error = Campaign::parse("beam.toml", &text).unwrap_err().to_string();
            assert!(error.contains(says), "{error}");
            let line: usize = error.split([' ', ':']).nth(2).unwrap().parse().unwrap();
            assert!(line > BEAM.lines().count(), "{error}");
        }
    }
}
