//! Helpers that turn a bad value into a sentence with its file, line and key.

use serde::de::DeserializeOwned;

use super::FileError;

/// A file being validated: its name and text, kept so that an error can say where.
#[derive(Debug, Clone, Copy)]
pub(super) struct Source<'a> {
    pub(super) file: &'a str,
    pub(super) text: &'a str,
}

impl Source<'_> {
    pub(super) fn parse<T: DeserializeOwned>(self) -> Result<T, FileError> {
        toml::from_str(self.text).map_err(|error| {
            let offset = error
                .span()
                .map_or(0, |span| span.start)
                .min(self.text.len());
            let line = self.text[..offset].matches('\n').count();
            let key = self
                .text
                .lines()
                .nth(line)
                .and_then(|line| line.split_once('='));
            let place = key.map_or_else(String::new, |(key, _)| format!("{}: ", key.trim()));
            let message = error.message().replace('\n', " ");
            FileError::Syntax {
                file: self.file.to_owned(),
                line: line + 1,
                message: place + &in_plain_words(&message),
            }
        })
    }

    /// The error for `key` (with its section), which holds `found`.
    pub(super) fn refuse(
        self,
        key: &str,
        found: impl std::fmt::Debug,
        expected: impl Into<String>,
    ) -> FileError {
        FileError::Value {
            file: self.file.to_owned(),
            line: self.line_of(key),
            key: key.to_owned(),
            found: format!("{found:?}"),
            expected: expected.into(),
        }
    }

    pub(super) fn require(
        self,
        holds: bool,
        key: &str,
        found: impl std::fmt::Debug,
        expected: &str,
    ) -> Result<(), FileError> {
        if holds {
            Ok(())
        } else {
            Err(self.refuse(key, found, expected))
        }
    }

    /// Requires `low < value < high`; infinite limits only ask for a finite value.
    pub(super) fn between(
        self,
        key: &str,
        value: f64,
        low: f64,
        high: f64,
    ) -> Result<(), FileError> {
        if value.is_finite() && value > low && value < high {
            return Ok(());
        }
        let expected = match (low.is_finite(), high.is_finite()) {
            (true, true) => format!("a number above {low} and below {high}"),
            (true, false) => format!("a finite number above {low}"),
            (false, true) => format!("a finite number below {high}"),
            (false, false) => "a finite number".to_owned(),
        };
        Err(self.refuse(key, value, expected))
    }

    pub(super) fn positive(self, key: &str, value: f64) -> Result<(), FileError> {
        self.between(key, value, 0.0, f64::INFINITY)
    }

    pub(super) fn not_negative(self, key: &str, value: f64) -> Result<(), FileError> {
        self.require(
            value.is_finite() && value >= 0.0,
            key,
            value,
            "a finite number, zero or more",
        )
    }

    /// Requires a number from `low` to `high`, both allowed; `unit` is a word such as `mm`, or empty.
    pub(super) fn within(
        self,
        key: &str,
        value: f64,
        low: f64,
        high: f64,
        unit: &str,
    ) -> Result<(), FileError> {
        let expected = format!("a number from {low} to {high} {unit}");
        self.require(
            (low..=high).contains(&value),
            key,
            value,
            expected.trim_end(),
        )
    }

    /// Requires a length that the simulator accepts, mm.
    pub(super) fn length(self, key: &str, value: f64) -> Result<(), FileError> {
        self.within(key, value, 1e-4, 1e6, "mm")
    }

    /// Requires a tip rounding radius that the simulator accepts, mm; zero is a sharp edge.
    pub(super) fn tip_radius(self, key: &str, value: f64) -> Result<(), FileError> {
        self.within(key, value, 0.0, 1e6, "mm")
    }

    /// Requires a root fillet radius that the simulator accepts, mm.
    pub(super) fn root_radius(self, key: &str, value: f64) -> Result<(), FileError> {
        self.within(key, value, 1e-6, 1e6, "mm")
    }

    /// Requires a pressure angle that the simulator accepts, degrees.
    pub(super) fn pressure_angle(self, key: &str, value: f64) -> Result<(), FileError> {
        self.within(key, value, 1.0, 45.0, "degrees")
    }

    /// Requires a helix angle that the simulator accepts, degrees.
    pub(super) fn helix_angle(self, key: &str, value: f64) -> Result<(), FileError> {
        self.within(key, value, -60.0, 60.0, "degrees")
    }

    /// Requires a whole number within `low..=high`.
    pub(super) fn count(self, key: &str, value: u32, low: u32, high: u32) -> Result<(), FileError> {
        self.require(
            (low..=high).contains(&value),
            key,
            value,
            &format!("a whole number from {low} to {high}"),
        )
    }

    /// Requires two finite values in ascending order within `[low, high]`.
    pub(super) fn ordered(
        self,
        key: &str,
        range: [f64; 2],
        low: f64,
        high: f64,
    ) -> Result<(), FileError> {
        let holds = range
            .iter()
            .all(|bound| bound.is_finite() && (low..=high).contains(bound))
            && range[0] < range[1];
        self.require(
            holds,
            key,
            range,
            &format!("[low, high] with low < high, both within {low} and {high}"),
        )
    }

    /// The line on which `section.key` stands, or on which its section starts, or 1.
    fn line_of(self, key: &str) -> usize {
        let (section, name) = key.rsplit_once('.').unwrap_or(("", key));
        let mut current = String::new();
        let mut fallback = 1;
        for (index, line) in self.text.lines().enumerate() {
            let line = line.trim();
            if let Some(header) = line.strip_prefix('[').and_then(|rest| rest.split_once(']')) {
                current = header.0.trim().to_owned();
                if current == section {
                    fallback = index + 1;
                }
            } else if current == section
                && line
                    .split_once('=')
                    .is_some_and(|(left, _)| left.trim() == name)
            {
                return index + 1;
            }
        }
        fallback
    }
}

/// Replaces the names of Rust's types by what a user would call them.
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
