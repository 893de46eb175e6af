//! Tables and files that studies write.

use std::fmt::Write as _;
use std::path::Path;

use anyhow::Context as _;
use report::Percentile;
use results::rows;
use serde_json::{Value, json};

/// Text of a field without a value.
pub(crate) const NOTHING: &str = "–";

/// A table, to be written in more than one form.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    /// The head of each column.
    pub header: Vec<String>,
    /// The fields of each row.
    pub rows: Vec<Vec<String>>,
}

impl Table {
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

    /// The table as CSV.
    ///
    /// # Errors
    ///
    /// A row is not as long as the header.
    pub fn csv(&self) -> anyhow::Result<Vec<u8>> {
        let mut out = csv::Writer::from_writer(Vec::new());
        out.write_record(&self.header)?;
        for row in &self.rows {
            out.write_record(row)?;
        }
        Ok(out.into_inner()?)
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
    ///
    /// # Errors
    ///
    /// A table has a row that does not fit its header.
    pub fn to_json(&self, out: &Path) -> anyhow::Result<Value> {
        let rows = |table: &Table| -> anyhow::Result<Vec<Value>> {
            let row = |row: &Vec<String>| Ok(rows::object(&table.header, row)?.into());
            table.rows.iter().map(row).collect()
        };
        let tables = self.tables.iter();
        let tables = tables.map(|(name, table)| Ok(((*name).to_owned(), rows(table)?.into())));
        Ok(json!({
            "schema_version": rows::SCHEMA_VERSION,
            "folder": out.display().to_string(),
            "tables": tables.collect::<anyhow::Result<serde_json::Map<_, _>>>()?,
        }))
    }
}

/// Writes a file into the folder `out`, which is created if need be. The file is never left
/// half-written.
///
/// # Errors
///
/// The folder or the file cannot be written.
pub fn write(out: &Path, name: &str, content: impl AsRef<[u8]>) -> anyhow::Result<()> {
    std::fs::create_dir_all(out)
        .with_context(|| format!("cannot make the folder {}", out.display()))?;
    let path = out.join(name);
    let draft = out.join(format!("{name}.part"));
    std::fs::write(&draft, content)
        .and_then(|()| std::fs::rename(&draft, &path))
        .with_context(|| format!("cannot write {}", path.display()))
}

/// A number for a CSV file: the shortest digits that read back as the same number.
pub(crate) fn exact(value: f64) -> String {
    format!("{value}")
}

pub(crate) fn maybe_exact(value: Option<f64>) -> String {
    value.map_or_else(String::new, exact)
}

/// A percentile and its interval for a table, as in `1.51 [1.49; 1.53]`.
pub(crate) fn with_interval(p90: &Percentile) -> String {
    let mut text = format!("{:.3}", p90.value);
    if p90.low.is_finite() {
        // Writing to a String cannot fail.
        let _ = write!(text, " [{:.3}; {:.3}]", p90.low, p90.high);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_is_the_same_in_both_forms() {
        let mut table = Table::new(["a", "b"]);
        table.rows.push(vec!["x|y".to_owned(), "1,5".to_owned()]);
        assert_eq!(table.markdown(), "| a | b |\n|---|---:|\n| x\\|y | 1,5 |\n");
        assert_eq!(table.csv().unwrap(), b"a,b\nx|y,\"1,5\"\n");
        let found = Document {
            page: String::new(),
            tables: vec![("t", table.clone())],
        };
        assert!(found.to_json(Path::new("out")).is_err(), "a is no text");
        table.header = vec!["source".to_owned(), "b".to_owned()];
        table.rows[0][1] = "1.5".to_owned();
        let found = Document {
            tables: vec![("t", table.clone())],
            ..found
        };
        let expected = json!({
            "schema_version": 1,
            "folder": "out",
            "tables": {"t": [{"source": "x|y", "b": 1.5}]},
        });
        assert_eq!(found.to_json(Path::new("out")).unwrap(), expected);
        table.rows.push(vec!["short".to_owned()]);
        assert!(table.csv().is_err());
    }
}
