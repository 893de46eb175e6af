//! A chart with a table of its numbers.

use serde::Serialize;

use crate::report::{Error, Picture};

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Chart {
    /// The image's alternative text, in a sentence.
    pub description: String,
    /// The image, a complete SVG file that adapts to a light or dark theme.
    pub svg: String,
    /// The headings of the table's columns.
    pub columns: Vec<String>,
    /// The rows of the table; empty if another table of the page has the numbers.
    pub rows: Vec<Vec<String>>,
}

impl Chart {
    /// A chart of the report; `None` if there is nothing to draw.
    #[must_use]
    pub fn new(
        drawn: Result<Picture, Error>,
        columns: &[&str],
        rows: Vec<Vec<String>>,
    ) -> Option<Self> {
        let picture = drawn.ok()?;
        Some(Self {
            description: picture.label().to_owned(),
            svg: picture.standalone(),
            columns: columns.iter().map(|&column| column.to_owned()).collect(),
            rows,
        })
    }
}

/// The rows of a table with these columns of equal length.
pub(super) fn rows_of(columns: &[Vec<String>]) -> Vec<Vec<String>> {
    let count = columns.first().map_or(0, Vec::len);
    let row = |k: usize| columns.iter().map(|column| column[k].clone()).collect();
    (0..count).map(row).collect()
}
