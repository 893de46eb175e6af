//! Rows of tables as CSV, JSON or Parquet.

use std::collections::BTreeMap;
use std::io::Write;

use anyhow::Context as _;
use clap::ValueEnum;
use serde_json::{Map, Value};

/// Version of the JSON of tables, studies and comparisons; raised when a change would make programs misread
/// it.
pub const SCHEMA_VERSION: u32 = 1;

/// Columns, of whichever table, that hold text. All others hold numbers or nothing.
const TEXT: [&str; 14] = [
    "approach",
    "corrections",
    "error",
    "input",
    "job",
    "kind",
    "output",
    "parameter",
    "point",
    "reason",
    "remark",
    "source",
    "stop",
    "worker",
];

/// Columns that hold whole numbers.
#[cfg(feature = "parquet")]
const WHOLE: [&str; 10] = [
    "lease",
    "design",
    "failed",
    "feasible",
    "points",
    "round",
    "sample",
    "samples",
    "simulable",
    "simulator_calls",
];

/// What a column holds.
#[cfg(feature = "parquet")]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    /// Text.
    Text,
    /// Whole numbers or nothing.
    Whole,
    /// Numbers or nothing.
    Number,
}

/// What the column of this name holds.
#[cfg(feature = "parquet")]
pub(crate) fn kind(column: &str) -> Kind {
    if TEXT.contains(&column) {
        Kind::Text
    } else if WHOLE.contains(&column) {
        Kind::Whole
    } else {
        Kind::Number
    }
}

/// The form of a table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub enum Format {
    /// One header line, units in the names
    #[default]
    Csv,
    /// One JSON object, with `schema_version` and the rows as objects
    Json,
    /// A Parquet file, units in its metadata
    #[cfg(feature = "parquet")]
    Parquet,
}

/// Writes the rows of a table in any form; the first record is the header.
pub struct RowWriter<W: Write + Send>(Form<W>);

enum Form<W: Write + Send> {
    Csv(Box<csv::Writer<W>>),
    Json {
        out: W,
        table: String,
        header: Option<Vec<String>>,
        rows: u64,
    },
    #[cfg(feature = "parquet")]
    Parquet(Box<crate::parquet::ParquetWriter<W>>),
}

impl<W: Write + Send> RowWriter<W> {
    /// A writer of the table of this name; `units` are those of its columns, for the forms that have a place
    /// for them.
    #[cfg_attr(
        not(feature = "parquet"),
        expect(unused_variables, reason = "the other forms have no place for units")
    )]
    pub fn new(out: W, format: Format, table: &str, units: BTreeMap<String, String>) -> Self {
        Self(match format {
            Format::Csv => Form::Csv(Box::new(csv::Writer::from_writer(out))),
            Format::Json => Form::Json {
                out,
                table: table.to_owned(),
                header: None,
                rows: 0,
            },
            #[cfg(feature = "parquet")]
            Format::Parquet => {
                let writer = crate::parquet::ParquetWriter::new(out, table, units);
                Form::Parquet(Box::new(writer))
            }
        })
    }

    /// Writes the header, then each row.
    ///
    /// # Errors
    ///
    /// The output cannot be written, or a row is not as long as the header.
    pub fn write_record<T: AsRef<str>>(
        &mut self,
        record: impl IntoIterator<Item = T>,
    ) -> anyhow::Result<()> {
        let record = record.into_iter();
        match &mut self.0 {
            Form::Csv(out) => {
                for field in record {
                    out.write_field(field.as_ref())?;
                }
                out.write_record(None::<&[u8]>)?;
            }
            Form::Json {
                out,
                table,
                header,
                rows,
            } => {
                let fields: Vec<String> = record.map(|field| field.as_ref().to_owned()).collect();
                match header {
                    None => {
                        write!(
                            out,
                            "{{\"schema_version\":{SCHEMA_VERSION},\"table\":{},\"columns\":{},\"rows\":[",
                            serde_json::to_string(table)?,
                            serde_json::to_string(&fields)?
                        )?;
                        *header = Some(fields);
                    }
                    Some(header) => {
                        let start = if *rows == 0 { "\n" } else { ",\n" };
                        write!(out, "{start}{}", Value::Object(object(header, &fields)?))?;
                        *rows += 1;
                    }
                }
            }
            #[cfg(feature = "parquet")]
            Form::Parquet(out) => {
                let fields: Vec<String> = record.map(|field| field.as_ref().to_owned()).collect();
                out.write_record(&fields)?;
            }
        }
        Ok(())
    }

    /// Ends the table.
    ///
    /// # Errors
    ///
    /// The output cannot be written.
    pub fn finish(self) -> anyhow::Result<()> {
        match self.0 {
            Form::Csv(mut out) => out.flush()?,
            Form::Json { mut out, .. } => {
                writeln!(out, "\n]}}")?;
                out.flush()?;
            }
            #[cfg(feature = "parquet")]
            Form::Parquet(out) => out.finish()?,
        }
        Ok(())
    }
}

/// A row as an object: text where the column holds text, otherwise a number, or null for an empty field and
/// for what JSON has no number for.
///
/// # Errors
///
/// The row is not as long as the header, or a column of numbers holds text.
pub fn object(header: &[String], fields: &[String]) -> anyhow::Result<Map<String, Value>> {
    anyhow::ensure!(
        header.len() == fields.len(),
        "a row has {} fields, but its header {}",
        fields.len(),
        header.len()
    );
    let pairs = header.iter().zip(fields);
    pairs
        .map(|(name, field)| Ok((name.clone(), value(name, field)?)))
        .collect()
}

fn value(column: &str, field: &str) -> anyhow::Result<Value> {
    if TEXT.contains(&column) {
        return Ok(field.into());
    }
    if field.is_empty() {
        return Ok(Value::Null);
    }
    if let Ok(whole) = field.parse::<i64>() {
        return Ok(whole.into());
    }
    let number: f64 = field
        .parse()
        .with_context(|| format!("column {column} holds {field:?}, which is not a number"))?;
    Ok(number.into())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn written(format: Format, rows: &[&[&str]]) -> anyhow::Result<String> {
        let mut bytes = Vec::new();
        let mut out = RowWriter::new(&mut bytes, format, "failures", BTreeMap::new());
        for row in rows {
            out.write_record(*row)?;
        }
        out.finish()?;
        Ok(String::from_utf8(bytes)?)
    }

    #[test]
    fn rows_are_the_same_in_both_forms() {
        let header: &[&str] = &["job", "lease", "p90_um"];
        let rows: [&[&str]; 3] = [header, &["7", "2", "1.5"], &["a,b", "3", ""]];
        assert_eq!(
            written(Format::Csv, &rows).unwrap(),
            "job,lease,p90_um\n7,2,1.5\n\"a,b\",3,\n"
        );
        let json: Value = serde_json::from_str(&written(Format::Json, &rows).unwrap()).unwrap();
        assert_eq!(
            json,
            serde_json::json!({
                "schema_version": 1,
                "table": "failures",
                "columns": ["job", "lease", "p90_um"],
                "rows": [
                    {"job": "7", "lease": 2, "p90_um": 1.5},
                    {"job": "a,b", "lease": 3, "p90_um": null},
                ],
            })
        );
        let empty: Value =
            serde_json::from_str(&written(Format::Json, &[header]).unwrap()).unwrap();
        assert_eq!(empty["rows"], serde_json::json!([]));
    }

    #[test]
    fn what_is_no_row_of_the_table_is_an_error() {
        for format in [Format::Csv, Format::Json] {
            assert!(written(format, &[&["design", "p90_um"], &["1"]]).is_err());
        }
        let text = written(Format::Json, &[&["p90_um"], &["much"]]).unwrap_err();
        assert!(text.to_string().contains("p90_um holds \"much\""), "{text}");
        let infinite = written(Format::Json, &[&["p90_um"], &["inf"]]).unwrap();
        assert!(infinite.contains("{\"p90_um\":null}"), "{infinite}");
    }
}
