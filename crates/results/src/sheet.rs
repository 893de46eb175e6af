//! The data sheet of a gear pair: the same rows for text, pages and JSON.
//!
//! [`gear::inspection::Sheet`] computes what ISO 21771 defines; [`sections`] puts it beside the file's values. The
//! basic rack is named from the gear's side: h_fP* is the addendum of the tool, which cuts the root, and h_aP* its
//! dedendum.

use std::fmt::Write as _;

use serde_json::{Map, Value};

use crate::number;

mod conditions;
mod mesh;
mod unloaded;

pub(crate) use mesh::amplitude;
pub use mesh::{stiffness, transmission_error};
pub use unloaded::{of_design, sections};

/// Rows under a common title.
#[derive(Debug, Clone, PartialEq)]
pub struct Section {
    /// The title, for example `Diameters`.
    pub title: &'static str,
    /// The rows in the order in which they are shown.
    pub rows: Vec<Row>,
}

/// One quantity of a pair.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Name in JSON, with the unit.
    pub key: &'static str,
    /// The quantity in words.
    pub quantity: &'static str,
    /// Symbol of ISO 21771 or ISO 6336, the index after a `_`; may be empty.
    pub symbol: &'static str,
    /// Unit; empty for a pure number.
    pub unit: &'static str,
    /// One value of the pair, or those of pinion and mate.
    pub values: Vec<Entry>,
}

/// A value of a row.
#[derive(Debug, Clone, PartialEq)]
pub enum Entry {
    /// A number, and the decimals that are shown.
    Number(f64, usize),
    /// Words.
    Text(String),
    /// No value: the quantity does not exist for this gear.
    None,
}

impl Entry {
    fn json(&self) -> Value {
        match self {
            Self::Number(value, 0) if value.fract() == 0.0 => (*value as i64).into(),
            Self::Number(value, _) => (*value).into(),
            Self::Text(text) => text.as_str().into(),
            Self::None => Value::Null,
        }
    }
}

/// The value as it is shown.
impl std::fmt::Display for Entry {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Number(value, decimals) => f.pad(&number::fixed(*value, *decimals)),
            Self::Text(text) => f.pad(text),
            Self::None => f.pad(number::MISSING),
        }
    }
}

impl Row {
    /// A row with one number of the pair.
    fn one(
        key: &'static str,
        [quantity, symbol, unit]: [&'static str; 3],
        value: f64,
        decimals: usize,
    ) -> Self {
        Self {
            key,
            quantity,
            symbol,
            unit,
            values: vec![Entry::Number(value, decimals)],
        }
    }

    /// A row with numbers of pinion and mate; a number that is not finite counts as missing.
    fn each(
        key: &'static str,
        words: [&'static str; 3],
        values: [f64; 2],
        decimals: usize,
    ) -> Self {
        let entry = |value: f64| match value.is_finite() {
            true => Entry::Number(value, decimals),
            false => Entry::None,
        };
        Self {
            values: values.map(entry).to_vec(),
            ..Self::one(key, words, 0.0, 0)
        }
    }

    /// A row with words.
    fn text(key: &'static str, quantity: &'static str, text: String) -> Self {
        Self {
            values: vec![Entry::Text(text)],
            ..Self::one(key, [quantity, "", ""], 0.0, 0)
        }
    }

    /// A row with words of pinion and mate.
    fn texts(key: &'static str, quantity: &'static str, texts: [String; 2]) -> Self {
        Self {
            values: texts.map(Entry::Text).to_vec(),
            ..Self::one(key, [quantity, "", ""], 0.0, 0)
        }
    }

    /// The symbol as HTML, with its index.
    #[must_use]
    pub fn markup(&self) -> String {
        match self.symbol.split_once('_') {
            Some((letter, index)) => format!("<var>{letter}</var><sub>{index}</sub>"),
            None if self.symbol.is_empty() => String::new(),
            None => format!("<var>{}</var>", self.symbol),
        }
    }
}

/// The sections as text, a line for each row.
#[must_use]
pub fn describe(sections: &[Section]) -> String {
    let mut text = String::new();
    for section in sections {
        // Writing to a string does not fail.
        let _ = writeln!(text, "{}", section.title);
        for row in &section.rows {
            let values: String = row
                .values
                .iter()
                .map(|value| format!(" {value:>12}"))
                .collect();
            let line = format!(
                "  {:<40}{:<7}{values:<26} {}",
                row.quantity, row.symbol, row.unit
            );
            let _ = writeln!(text, "{}", line.trim_end());
        }
        text.push('\n');
    }
    text
}

/// The sections as one JSON object: a number or words for a value of the pair, a list of two for pinion and mate, null
/// where a quantity does not exist.
#[must_use]
pub fn json(sections: &[Section]) -> Map<String, Value> {
    let rows = sections.iter().flat_map(|section| &section.rows);
    rows.map(|row| {
        let value = match &row.values[..] {
            [one] => one.json(),
            all => all.iter().map(Entry::json).collect(),
        };
        (row.key.to_owned(), value)
    })
    .collect()
}
