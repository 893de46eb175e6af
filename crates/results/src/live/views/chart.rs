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
