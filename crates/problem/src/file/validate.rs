//! Invalid values, and their places in the file.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::FileError;

/// The numbers of teeth that files accept.
pub(super) const TEETH: RangeInclusive<u32> = 4..=2000;
/// [`TEETH`] in words. An internal gear has a negative number of teeth in ISO 21771.
pub(super) const TEETH_IN_WORDS: &str = "a number of teeth from 4 to 2000; internal gears, whose numbers are negative, are not supported";

/// An invalid value, whose place in the file is not known yet.
///
/// A section that is deserialised through another type returns it as its error. [`Source::parse`] recognises the
/// text and finds the line.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{key} is {found}, but must be {expected}")]
pub(crate) struct InvalidValue {
    key: String,
    found: String,
    expected: String,
}

impl InvalidValue {
    /// The value `found` of `key`, which has its section before it.
    pub(super) fn new(key: &str, found: &impl Serialize, expected: impl Into<String>) -> Self {
        Self::in_words(key, shown(found), expected)
    }

    /// The absence of `key`.
    pub(super) fn missing(key: &str, expected: impl Into<String>) -> Self {
        Self::in_words(key, "missing", expected)
    }

    /// A fault of `key` with `found` in words instead of a value.
    pub(super) fn in_words(
        key: &str,
        found: impl Into<String>,
        expected: impl Into<String>,
    ) -> Self {
        Self {
            key: key.to_owned(),
            found: found.into(),
            expected: expected.into(),
        }
    }

    /// The invalid value that the text of an error states.
    fn of_text(text: &str) -> Option<Self> {
        let (key, rest) = text.split_once(" is ")?;
        let (found, expected) = rest.split_once(", but must be ")?;
        let is_key = key
            .chars()
            .all(|c| c.is_ascii_alphanumeric() || "_.[]".contains(c));
        is_key.then(|| Self::in_words(key, found, expected))
    }

    /// The whole number below zero or beyond its key's limit that the text of an error states, as the value of `key`.
    fn of_whole_number(key: &str, text: &str) -> Option<Self> {
        let number = text.strip_prefix("invalid value: integer `");
        let number = number.or_else(|| text.strip_prefix("invalid type: integer `"))?;
        let (number, expected) = number.split_once('`')?;
        let bits: u32 = expected.rsplit_once("expected u")?.1.parse().ok()?;
        // TOML's numbers have a sign.
        let most = i64::MAX as u64 >> (64 - bits).saturating_sub(1);
        let expected = match (key.ends_with("teeth"), number.starts_with('-')) {
            (true, _) => TEETH_IN_WORDS.to_owned(),
            (false, true) => "a whole number, zero or more".to_owned(),
            (false, false) => format!("a whole number, at most {most}"),
        };
        Some(Self::in_words(key, number, expected))
    }

    /// The unknown name that the text of an error states, as the value of `key`.
    fn of_unknown_name(key: &str, text: &str) -> Option<Self> {
        let rest = text.strip_prefix("unknown variant `")?;
        let (name, expected) = rest.split_once("`, expected ")?;
        Some(Self::new(key, &name, expected.replace('`', "\"")))
    }
}

/// A value as TOML.
fn shown(value: &impl Serialize) -> String {
    fn of(value: &toml::Value) -> String {
        match value {
            // Very small and very large numbers get an exponent.
            toml::Value::Float(number) => format!("{number:?}").to_lowercase(),
            toml::Value::Array(values) => {
                let values: Vec<String> = values.iter().map(of).collect();
                format!("[{}]", values.join(", "))
            }
            other => other.to_string(),
        }
    }
    match toml::Value::try_from(value) {
        Ok(value) => of(&value),
        // TOML cannot hold this number.
        Err(_) => serde_json::to_string(value).unwrap_or_default(),
    }
}

/// A file that is parsed and validated: its name, and its text, in which the line of an error is found.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Source<'a> {
    pub(crate) file: &'a str,
    pub(crate) text: &'a str,
}

impl Source<'_> {
    pub(super) fn parse<T: DeserializeOwned + Serialize>(self) -> Result<T, FileError> {
        let first = match toml::from_str(self.text) {
            Ok(parsed) => return self.whole(parsed),
            Err(error) => error,
        };
        if let Some(invalid) = self.invalid(&first) {
            return Err(invalid);
        }
        let mut found = vec![explained(self.text, &first)];
        let mut rest = without_unknown(self.text, &first);
        // The parser stops at the first unknown key, so the next one is found after removing it.
        while let Some(text) = rest {
            let Err(error) = toml::from_str::<T>(&text) else {
                break;
            };
            rest = without_unknown(&text, &error);
            if rest.is_some() {
                found.push(explained(&text, &error));
            }
        }
        // The parser may read a section before the rest of the file, so the findings are sorted by
        // line.
        found.sort();
        let (line, mut message) = found.remove(0);
        for (line, next) in found {
            message += &format!("; line {}: {next}", line + 1);
        }
        Err(FileError::Syntax {
            file: self.file.to_owned(),
            line: line + 1,
            message,
        })
    }

    /// The error as an invalid value, if it is one.
    fn invalid(self, error: &toml::de::Error) -> Option<FileError> {
        let (line, _) = place(self.text, error);
        let here = key_at(self.text, line);
        if let Some(mut invalid) = InvalidValue::of_text(error.message()) {
            if invalid.key.contains('.') {
                return Some(self.error(invalid));
            }
            // The value does not know its section.
            invalid.key = here.unwrap_or(invalid.key);
            return Some(self.error_at(line + 1, invalid));
        }
        let (key, text) = (here?, error.message());
        let invalid = InvalidValue::of_unknown_name(&key, text)
            .or_else(|| InvalidValue::of_whole_number(&key, text))?;
        Some(self.error_at(line + 1, invalid))
    }

    /// Refuses lists with more values than are read, since the parser silently ignores the rest.
    fn whole<T: Serialize>(self, parsed: T) -> Result<T, FileError> {
        let written = toml::from_str::<toml::Table>(self.text);
        let (Ok(written), Ok(read)) = (written, toml::Table::try_from(&parsed)) else {
            return Ok(parsed);
        };
        for (section, keys) in &written {
            let read = read.get(section).and_then(toml::Value::as_table);
            for (key, value) in keys.as_table().into_iter().flatten() {
                let count = |value: &toml::Value| value.as_array().map(Vec::len);
                let kept = read.and_then(|read| read.get(key)).and_then(count);
                if let (Some(found), Some(kept)) = (count(value), kept)
                    && found > kept
                {
                    let key = format!("{section}.{key}");
                    let found = format!("a list of {found} values");
                    let expected = format!("a list of {kept}");
                    return Err(self.error(InvalidValue::in_words(&key, found, expected)));
                }
            }
        }
        Ok(parsed)
    }

    /// Refuses keys of `section` whose values `chooser` sets.
    pub(crate) fn leaves_to(
        self,
        section: &str,
        keys: &[&str],
        chooser: &str,
    ) -> Result<(), FileError> {
        let file = toml::from_str::<toml::Table>(self.text).unwrap_or_default();
        let given = file.get(section).and_then(toml::Value::as_table);
        let mut given = given.into_iter().flatten();
        match given.find(|(key, _)| keys.contains(&key.as_str())) {
            Some((key, value)) => Err(self.refuse(
                &format!("{section}.{key}"),
                value,
                format!("left out beside {chooser}"),
            )),
            None => Ok(()),
        }
    }

    /// The error for an invalid value.
    pub(crate) fn error(self, invalid: InvalidValue) -> FileError {
        self.error_at(self.line_of(&invalid.key), invalid)
    }

    fn error_at(self, line: usize, invalid: InvalidValue) -> FileError {
        FileError::Value {
            file: self.file.to_owned(),
            line,
            key: invalid.key,
            found: invalid.found,
            expected: invalid.expected,
        }
    }

    /// The error for `key` (with its section), whose value is `found`.
    pub(crate) fn refuse(
        self,
        key: &str,
        found: impl Serialize,
        expected: impl Into<String>,
    ) -> FileError {
        self.error(InvalidValue::new(key, &found, expected))
    }

    /// The error for a key that is not given.
    pub(super) fn missing(self, key: &str, expected: impl Into<String>) -> FileError {
        self.error(InvalidValue::missing(key, expected))
    }

    /// The line of `section.key`, or else of its section, or else 1. The second `[[section]]` of an
    /// array is `section[2]`.
    pub(super) fn line_of(self, key: &str) -> usize {
        let (section, name) = key.rsplit_once('.').unwrap_or(("", key));
        let lines = || keys(self.text).zip(1..);
        let mut of_key = lines().filter(|((of, key), _)| of == section && *key == Some(name));
        // The first line of a section is its header. A key without a section may be one itself.
        let header = if section.is_empty() { name } else { section };
        let mut of_section = lines().filter(|((of, _), _)| of == header);
        let found = of_key.next().or_else(|| of_section.next());
        found.map_or(1, |(_, line)| line)
    }
}

/// The section of each line, and the key that is set there.
fn keys(text: &str) -> impl Iterator<Item = (String, Option<&str>)> {
    let mut section = String::new();
    let mut arrays = BTreeMap::new();
    text.lines().map(move |line| {
        let line = line.trim();
        let header = |open: &str, close: &str| {
            let (name, _) = line.strip_prefix(open)?.split_once(close)?;
            Some(name.trim().to_owned())
        };
        let key = line.split_once('=').map(|(key, _)| key.trim());
        if let Some(array) = header("[[", "]]") {
            let count = arrays.entry(array.clone()).or_insert(0_usize);
            *count += 1;
            section = format!("{array}[{count}]");
        } else if let Some(table) = header("[", "]") {
            section = table;
        } else {
            return (section.clone(), key);
        }
        (section.clone(), None)
    })
}

/// The key that is set in a line (from 0), with its section.
fn key_at(text: &str, line: usize) -> Option<String> {
    let (section, key) = keys(text).nth(line)?;
    let dot = if section.is_empty() { "" } else { "." };
    Some(format!("{section}{dot}{}", key?))
}

/// The line (from 0) and byte at which an error begins.
fn place(text: &str, error: &toml::de::Error) -> (usize, usize) {
    let start = error.span().map_or(0, |span| span.start).min(text.len());
    (text[..start].matches('\n').count(), start)
}

/// The line (from 0) of an error, and its message.
fn explained(text: &str, error: &toml::de::Error) -> (usize, String) {
    let (line, _) = place(text, error);
    let message = in_plain_words(&error.message().replace('\n', " "));
    let is_missing = message.starts_with("missing field");
    // A key that the whole file lacks has an empty place at its beginning.
    let is_of_file = is_missing && error.span().is_none_or(|span| span.is_empty());
    let message = match keys(text).nth(line) {
        _ if is_of_file => message,
        Some((section, None)) if is_missing && !section.is_empty() => {
            format!("{message} of [{section}]")
        }
        Some((_, Some(_))) => {
            let key = key_at(text, line).unwrap_or_default();
            format!("{key}: {message}")
        }
        _ => message,
    };
    (line, message)
}

/// The text with empty lines in place of the unknown key of `error`, or of the unknown section with
/// its contents; `None` for another error.
fn without_unknown(text: &str, error: &toml::de::Error) -> Option<String> {
    if !error.message().starts_with("unknown field") {
        return None;
    }
    let (_, start) = place(text, error);
    let begin = text[..start].rfind('\n').map_or(0, |end| end + 1);
    let is_section = text[begin..].trim_start().starts_with('[');
    let mut end = begin;
    for line in text[begin..].split_inclusive('\n') {
        if end > begin && (!is_section || line.trim_start().starts_with('[')) {
            break;
        }
        end += line.len();
    }
    let lines = "\n".repeat(text[begin..end].matches('\n').count());
    Some([&text[..begin], &lines, &text[end..]].concat())
}

/// Replaces the names of Rust's types by the user's terms.
fn in_plain_words(message: &str) -> String {
    [
        ("expected u32", "expected a whole number, zero or more"),
        ("expected u64", "expected a whole number, zero or more"),
        ("expected f64", "expected a number"),
        ("expected a string", "expected text in quotes"),
    ]
    .iter()
    .fold(message.to_owned(), |message, (from, to)| {
        message.replace(from, to)
    })
}

#[cfg(test)]
mod tests {
    use serde::{Deserialize, Serialize};

    use super::*;

    #[derive(Debug, Serialize, Deserialize)]
    #[serde(deny_unknown_fields)]
    struct File {
        seed: u32,
        load: Load,
    }

    #[derive(Debug, Serialize, Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Load {
        torque: f64,
        #[serde(default)]
        teeth: [u32; 2],
    }

    #[test]
    fn an_error_has_the_line_of_its_key_or_of_its_section() {
        let text = "# a comment\n\nseed = 1\n\n[load]  # x = 2\ntorque = 2.0\n[[rows]]\na = 1\n[[rows]]\na = 2\n";
        let source = Source {
            file: "c.toml",
            text,
        };
        for (key, line) in [
            ("seed", 3),
            ("load.torque", 6),
            ("load.teeth", 5),
            ("load", 5),
            ("rows[2].a", 10),
            ("rows[2].b", 9),
            ("other", 1),
        ] {
            assert_eq!(source.line_of(key), line, "{key}");
        }
    }

    #[test]
    fn a_list_with_a_value_too_many_is_refused() {
        let text = "seed = 1\n[load]\ntorque = 2.0\nteeth = [23, 47, 12]\n";
        assert_eq!(
            parsed(text).unwrap_err().to_string(),
            "c.toml, line 4: load.teeth is a list of 3 values, but must be a list of 2"
        );
        let whole = parsed(&text.replace(", 12", "")).unwrap();
        assert_eq!(whole.load.teeth, [23, 47]);
    }

    fn parsed(text: &str) -> Result<File, FileError> {
        let file = "c.toml";
        Source { file, text }.parse()
    }

    #[test]
    fn a_missing_key_is_named_with_its_section_and_a_whole_number_with_its_limit() {
        let refused = |text: &str| parsed(text).unwrap_err().to_string();
        assert_eq!(
            refused("seed = 1\n[load]\nteeth = [1, 2]\n"),
            "c.toml, line 2: missing field `torque` of [load]"
        );
        assert_eq!(
            refused("[load]\ntorque = 1.0\n"),
            "c.toml, line 1: missing field `seed`"
        );
        assert_eq!(
            refused("[load]\nteeth = [1, 2]\n[other]\n"),
            "c.toml, line 1: missing field `torque` of [load]"
        );
        assert_eq!(
            refused("load = { torque = 1.0 }\n"),
            "c.toml, line 1: missing field `seed`"
        );
        assert_eq!(
            refused("seed = 1\nload = { teeth = [1, 2] }\n"),
            "c.toml, line 2: load: missing field `torque`"
        );
        for (seed, expected) in [
            ("-3", "zero or more"),
            ("4294967296", "at most 4294967295"),
            ("99999999999999999999999", "at most 4294967295"),
        ] {
            let error = refused(&format!("seed = {seed}\n[load]\ntorque = 2.0\n"));
            let wanted =
                format!("c.toml, line 1: seed is {seed}, but must be a whole number, {expected}");
            assert_eq!(error, wanted);
        }
    }

    #[test]
    fn all_unknown_keys_and_sections_are_reported_with_their_lines() {
        let whole = parsed("seed = 1\n[load]\ntorque = 2.0\n").unwrap();
        assert_eq!((whole.seed, whole.load.torque), (1, 2.0));
        let text =
            "seed = 1\nsed = 2\n[lod]\ntorque = 1.0\nx = [\n1]\n[load]\ntorque = 2.0\ntorqe = 3.0";
        let FileError::Syntax { line, message, .. } = parsed(text).unwrap_err() else {
            panic!("no error of syntax");
        };
        assert_eq!(line, 2, "{message}");
        for part in ["`sed`", "`lod`", "`torqe`"] {
            assert!(message.contains(part), "no {part} in {message}");
        }
        let places: Vec<usize> = ["; line 3: ", "; line 9: "]
            .map(|place| message.find(place).expect(place))
            .into();
        assert!(places.is_sorted(), "{message}");
    }

    #[test]
    fn an_unknown_key_does_not_hide_behind_a_missing_one() {
        let error = parsed("sed = 1\n[load]\ntorque = 2.0\n").unwrap_err();
        assert!(
            error
                .to_string()
                .contains("c.toml, line 1: sed: unknown field"),
            "{error}"
        );
    }
}
