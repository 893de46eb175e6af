//! Pages, tables and files that studies write.

use std::path::Path;

use problem::GearCriteria;
use results::number::estimate;
use results::table::{Cell, Table};
use serde_json::{Map, Value, json};
use stats::IntervalEstimate;

/// A table of a page: figures as people read them.
#[derive(Debug, Clone, PartialEq)]
pub struct PageTable {
    /// The head of each column.
    pub header: Vec<String>,
    /// The fields of each row.
    pub rows: Vec<Vec<String>>,
}

impl PageTable {
    /// A table without rows.
    #[must_use]
    pub fn new<S: ToString>(header: impl IntoIterator<Item = S>) -> Self {
        Self {
            header: header.into_iter().map(|head| head.to_string()).collect(),
            rows: Vec::new(),
        }
    }

    /// The table in Markdown; the first column to the left, the others to the right.
    #[must_use]
    pub fn markdown(&self) -> String {
        let line = |fields: &[String]| {
            let escaped = fields.iter().map(|field| field.replace('|', "\\|"));
            format!("| {} |\n", escaped.collect::<Vec<_>>().join(" | "))
        };
        let rule = "|---".to_owned() + &"|---:".repeat(self.header.len().saturating_sub(1)) + "|\n";
        let rows: String = self.rows.iter().map(|row| line(row)).collect();
        line(&self.header) + &rule + &rows
    }
}

/// The page and the tables of a study.
#[derive(Debug, Clone, PartialEq)]
pub struct Document {
    /// The page, in Markdown.
    pub page: String,
    /// The tables with all figures, by the names of their files.
    pub tables: Vec<(&'static str, Table)>,
}

impl Document {
    /// The tables as one JSON object, with the folder that they were written to.
    #[must_use]
    pub fn to_json(&self, out: &Path) -> Value {
        let tables = self.tables.iter();
        let tables = tables.map(|(name, table)| ((*name).to_owned(), table.json()));
        json!({
            "folder": out.display().to_string(),
            "tables": tables.collect::<Map<_, _>>(),
        })
    }
}

/// The columns of [`criteria_cells`].
pub(crate) const CRITERIA: [&str; 4] = [
    "contact_ratio",
    "specific_sliding",
    "hertz_pressure_mpa",
    "root_stress_mpa",
];

/// The criteria of a design that every table has.
pub(crate) fn criteria_cells(criteria: Option<&GearCriteria>) -> [Cell; 4] {
    let of: [fn(&GearCriteria) -> f64; 4] = [
        |criteria| criteria.contact_ratio,
        |criteria| criteria.specific_sliding,
        |criteria| criteria.hertz_pressure_mpa,
        |criteria| criteria.root_stress_mpa,
    ];
    of.map(|of| criteria.map(of).into())
}

/// A percentile with the ends of its interval.
pub(crate) fn percentile_cells(p90: Option<IntervalEstimate>) -> [Cell; 3] {
    let (low, high) = p90.and_then(|p90| p90.interval).unzip();
    [p90.map(|p90| p90.value), low, high].map(Cell::from)
}

/// A percentile and its interval for a page, as in `1.51 [1.49; 1.53]`.
pub(crate) fn with_interval(p90: &IntervalEstimate) -> String {
    estimate(p90.value, p90.interval, "")
}

#[cfg(test)]
mod tests {
    use results::row;
    use results::table::Column;

    use super::*;

    #[test]
    fn tables_are_written_for_people_and_for_programs() {
        let mut shown = PageTable::new(["a", "b"]);
        shown.rows.push(vec!["x|y".to_owned(), "1,5".to_owned()]);
        assert_eq!(shown.markdown(), "| a | b |\n|---|---:|\n| x\\|y | 1,5 |\n");
        let mut table = Table::new(vec![Column::text("source"), Column::number("b")]);
        table.rows.push(row!["x|y", 1.5].to_vec());
        let document = Document {
            page: String::new(),
            tables: vec![("t", table)],
        };
        let expected = json!({
            "folder": "out",
            "tables": {"t": [{"source": "x|y", "b": 1.5}]},
        });
        assert_eq!(document.to_json(Path::new("out")), expected);
    }
}
