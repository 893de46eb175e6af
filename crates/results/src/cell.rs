//! The columns and cells of typed tables.

use serde::Serialize;

/// Version of the JSON of tables, views and commands; raised when a change would make programs misread
/// it.
pub const SCHEMA_VERSION: u32 = 1;

/// A JSON object with the version of its form in front.
#[derive(Debug, Serialize)]
pub struct VersionedObject<T> {
    schema_version: u32,
    #[serde(flatten)]
    content: T,
}

impl<T: Serialize> VersionedObject<T> {
    /// The content, a struct or a map, in the form of [`SCHEMA_VERSION`].
    pub const fn new(content: T) -> Self {
        Self {
            schema_version: SCHEMA_VERSION,
            content,
        }
    }
}

/// The kind of a column's values.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Text.
    Text,
    /// Whole numbers or nothing.
    Whole,
    /// Numbers or nothing.
    Number,
}

/// A column of a table.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Column {
    /// The name, with the unit where it is fixed.
    pub name: String,
    pub kind: Kind,
    /// The unit; empty for a number without one.
    pub unit: String,
}

impl Column {
    fn new(name: impl Into<String>, kind: Kind) -> Self {
        Self {
            name: name.into(),
            kind,
            unit: String::new(),
        }
    }

    /// A column of text.
    #[must_use]
    pub fn text(name: impl Into<String>) -> Self {
        Self::new(name, Kind::Text)
    }

    /// A column of whole numbers.
    #[must_use]
    pub fn whole(name: impl Into<String>) -> Self {
        Self::new(name, Kind::Whole)
    }

    /// A column of numbers.
    #[must_use]
    pub fn number(name: impl Into<String>) -> Self {
        Self::new(name, Kind::Number)
    }

    /// The column with a unit.
    #[must_use]
    pub fn in_unit(self, unit: impl Into<String>) -> Self {
        Self {
            unit: unit.into(),
            ..self
        }
    }
}

/// A field of a row.
#[derive(Debug, Clone, PartialEq)]
pub enum Cell {
    /// Text.
    Text(String),
    /// A whole number.
    Whole(u64),
    /// A number.
    Number(f64),
    /// No value.
    Missing,
}

impl Cell {
    /// Whether the field can be in a column of this kind.
    pub(crate) fn is_of(&self, kind: Kind) -> bool {
        match self {
            Self::Text(_) => kind == Kind::Text,
            Self::Whole(_) => kind == Kind::Whole,
            Self::Number(_) => kind == Kind::Number,
            Self::Missing => kind != Kind::Text,
        }
    }
}

impl From<String> for Cell {
    fn from(text: String) -> Self {
        Self::Text(text)
    }
}

impl From<&str> for Cell {
    fn from(text: &str) -> Self {
        Self::Text(text.to_owned())
    }
}

impl From<u32> for Cell {
    fn from(number: u32) -> Self {
        Self::Whole(number.into())
    }
}

impl From<u64> for Cell {
    fn from(number: u64) -> Self {
        Self::Whole(number)
    }
}

impl From<usize> for Cell {
    fn from(number: usize) -> Self {
        Self::Whole(number as u64)
    }
}

impl From<bool> for Cell {
    /// 1 or 0.
    fn from(holds: bool) -> Self {
        Self::Whole(holds.into())
    }
}

impl From<f64> for Cell {
    fn from(number: f64) -> Self {
        Self::Number(number)
    }
}

impl<T: Into<Self>> From<Option<T>> for Cell {
    fn from(value: Option<T>) -> Self {
        value.map_or(Self::Missing, Into::into)
    }
}

impl std::fmt::Display for Cell {
    /// Numbers have the fewest digits that read back as the same number.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Text(text) => f.write_str(text),
            Self::Whole(number) => write!(f, "{number}"),
            Self::Number(number) => write!(f, "{number}"),
            Self::Missing => Ok(()),
        }
    }
}

/// A row of cells.
#[macro_export]
macro_rules! row {
    ($($cell:expr),* $(,)?) => { [$($crate::cell::Cell::from($cell)),*] };
}
