//! Typed tables as CSV, JSON or Parquet, or in memory.

use std::io::{self, Write};

use clap::ValueEnum;
use serde_json::{Map, Number, Value};

pub use crate::cell::{Cell, Column, Kind, SCHEMA_VERSION, VersionedObject};
use crate::columnar::Columns;

/// A table in memory.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    pub columns: Vec<Column>,
    /// The rows, each as long as the columns.
    pub rows: Vec<Vec<Cell>>,
}

impl Table {
    /// A table without rows.
    #[must_use]
    pub fn new(columns: Vec<Column>) -> Self {
        Self {
            columns,
            rows: Vec::new(),
        }
    }

    /// The table as CSV.
    ///
    /// # Errors
    ///
    /// A row does not fit the columns.
    pub fn csv(&self) -> anyhow::Result<Vec<u8>> {
        let mut bytes = Vec::new();
        let mut out = TableWriter::new(&mut bytes, Format::Csv, "", self.columns.clone())?;
        for row in &self.rows {
            out.write(row)?;
        }
        out.finish()?;
        Ok(bytes)
    }

    /// The rows as JSON objects.
    #[must_use]
    pub fn json(&self) -> Value {
        let rows = self.rows.iter();
        rows.map(|row| Value::Object(object(&self.columns, row)))
            .collect()
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

/// Writes the rows of a table in any form.
pub struct TableWriter<'a, W: Write + Send> {
    columns: Vec<Column>,
    rows: u64,
    form: Form<'a, W>,
}

enum Form<'a, W: Write + Send> {
    Memory(&'a mut Columns),
    Csv(Box<csv::Writer<W>>),
    Json(W),
    #[cfg(feature = "parquet")]
    Parquet(Box<crate::parquet::ParquetWriter<W>>),
}

impl<'a, W: Write + Send> TableWriter<'a, W> {
    /// Begins a table that replaces `kept`.
    pub(crate) fn in_memory(kept: &'a mut Columns, columns: Vec<Column>) -> Self {
        *kept = Columns::new(&columns);
        Self {
            columns,
            rows: 0,
            form: Form::Memory(kept),
        }
    }

    /// Begins the table of this name.
    ///
    /// # Errors
    ///
    /// The output cannot be written.
    pub fn new(
        mut out: W,
        format: Format,
        name: &str,
        columns: Vec<Column>,
    ) -> anyhow::Result<Self> {
        let names: Vec<&str> = columns.iter().map(|column| &*column.name).collect();
        let form = match format {
            Format::Csv => {
                let mut out = csv::Writer::from_writer(out);
                out.write_record(&names).map_err(of_output)?;
                Form::Csv(Box::new(out))
            }
            Format::Json => {
                write!(
                    out,
                    "{{\"schema_version\":{SCHEMA_VERSION},\"table\":{},\"columns\":{},\"rows\":[",
                    serde_json::to_string(name)?,
                    serde_json::to_string(&names)?
                )?;
                Form::Json(out)
            }
            #[cfg(feature = "parquet")]
            Format::Parquet => {
                let writer = crate::parquet::ParquetWriter::new(out, name, &columns)?;
                Form::Parquet(Box::new(writer))
            }
        };
        Ok(Self {
            columns,
            rows: 0,
            form,
        })
    }

    /// Writes a row.
    ///
    /// # Errors
    ///
    /// The output cannot be written, or the row does not fit the columns.
    pub fn write(&mut self, row: &[Cell]) -> anyhow::Result<()> {
        let columns = &self.columns;
        anyhow::ensure!(
            row.len() == columns.len(),
            "a row has {} fields, but the table {} columns",
            row.len(),
            columns.len()
        );
        for (cell, column) in row.iter().zip(columns) {
            anyhow::ensure!(
                cell.is_of(column.kind),
                "column {} of {:?} cannot hold {cell:?}",
                column.name,
                column.kind
            );
        }
        match &mut self.form {
            Form::Memory(kept) => kept.push(row)?,
            Form::Csv(out) => {
                let fields = row.iter().map(ToString::to_string);
                out.write_record(fields).map_err(of_output)?;
            }
            Form::Json(out) => {
                let start = if self.rows == 0 { "\n" } else { ",\n" };
                write!(out, "{start}{}", Value::Object(object(columns, row)))?;
            }
            #[cfg(feature = "parquet")]
            Form::Parquet(out) => out.write(row)?,
        }
        self.rows += 1;
        Ok(())
    }

    /// Ends the table.
    ///
    /// # Errors
    ///
    /// The output cannot be written.
    pub fn finish(self) -> anyhow::Result<()> {
        match self.form {
            Form::Memory(_) => {}
            Form::Csv(mut out) => out.flush()?,
            Form::Json(mut out) => {
                writeln!(out, "\n]}}")?;
                out.flush()?;
            }
            #[cfg(feature = "parquet")]
            Form::Parquet(out) => out.finish()?,
        }
        Ok(())
    }
}

/// The error of the output, which [`csv::Error`] does not name as its source.
fn of_output(error: csv::Error) -> io::Error {
    match error.into_kind() {
        csv::ErrorKind::Io(error) => error,
        other => io::Error::other(format!("{other:?}")),
    }
}

/// A row as a JSON object; null for a missing value and for a number that is not finite.
fn object(columns: &[Column], row: &[Cell]) -> Map<String, Value> {
    let value = |cell: &Cell| match cell {
        Cell::Text(text) => Value::from(text.as_str()),
        Cell::Whole(number) => Value::from(*number),
        Cell::Number(number) => Number::from_f64(*number).map_or(Value::Null, Value::Number),
        Cell::Missing => Value::Null,
    };
    let pairs = columns.iter().zip(row);
    pairs
        .map(|(column, cell)| (column.name.clone(), value(cell)))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::row;

    fn columns() -> Vec<Column> {
        let p90 = Column::number("p90_um").in_unit("µm");
        vec![Column::text("job"), Column::whole("lease"), p90]
    }

    fn written(format: Format, rows: &[Vec<Cell>]) -> anyhow::Result<String> {
        let mut bytes = Vec::new();
        let mut out = TableWriter::new(&mut bytes, format, "failures", columns())?;
        for row in rows {
            out.write(row)?;
        }
        out.finish()?;
        Ok(String::from_utf8(bytes)?)
    }

    #[test]
    fn rows_are_the_same_in_both_forms() {
        let rows = [
            row!["7", 2_u64, 1.5].to_vec(),
            row!["a,b", 3_u64, None::<f64>].to_vec(),
        ];
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
        let empty: Value = serde_json::from_str(&written(Format::Json, &[]).unwrap()).unwrap();
        assert_eq!(empty["rows"], serde_json::json!([]));
    }

    #[test]
    fn a_row_that_does_not_fit_is_an_error() {
        for format in [Format::Csv, Format::Json] {
            assert!(written(format, &[row!["7", 2_u64].to_vec()]).is_err());
            let error = written(format, &[row!["7", 2.0, 1.5].to_vec()]).unwrap_err();
            assert!(error.to_string().contains("column lease"), "{error}");
        }
    }

    #[test]
    fn what_has_no_number_in_json_is_null() {
        let rows = [row!["7", 2_u64, f64::INFINITY].to_vec()];
        assert!(
            written(Format::Json, &rows)
                .unwrap()
                .contains("\"p90_um\":null")
        );
        assert!(written(Format::Csv, &rows).unwrap().ends_with("7,2,inf\n"));
    }
}
