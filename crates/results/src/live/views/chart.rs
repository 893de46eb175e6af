//! A chart with a table of its numbers.

use serde::Serialize;

/// A chart.
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
        drawn: Result<String, crate::report::Error>,
        columns: &[&str],
        rows: Vec<Vec<String>>,
    ) -> Option<Self> {
        let svg = drawn.ok()?;
        let title = svg.split_once("<title>")?.1.split_once("</title>")?.0;
        Some(Self {
            // The report escapes the titles of its charts.
            description: title
                .replace("&lt;", "<")
                .replace("&gt;", ">")
                .replace("&quot;", "\"")
                .replace("&#39;", "'")
                .replace("&amp;", "&"),
            columns: columns.iter().map(|&column| column.to_owned()).collect(),
            rows,
            svg,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_description_is_the_pictures_title() {
        let svg = "<svg><title>P90 &lt; 2 &amp; more</title></svg>".to_owned();
        let chart = Chart::new(Ok(svg), &["x"], Vec::new()).unwrap();
        assert_eq!(chart.description, "P90 < 2 & more");
        let nothing = crate::report::Error::NothingToDraw {
            chart: "map",
            why: "no design",
        };
        assert_eq!(Chart::new(Err(nothing), &[], Vec::new()), None);
    }
}
