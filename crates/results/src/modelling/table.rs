//! Tables of users, as spreadsheets, statistics programs and simulators write them. Errors name file, line and
//! column.
//!
//! Delimiter, decimal comma and encoding are found from the text. A text with one possible reading is read, and
//! [`Table::format`] says how; a text with several is refused.

mod dialect;
mod number;
mod text;

use crate::modelling::InputError;
use number::Style;
use text::Record;

/// A table: the columns' names, then rows of as many fields.
#[derive(Debug, Clone)]
pub struct Table {
    file: String,
    header: Vec<String>,
    /// The units that a row below the header gives.
    units: Vec<Option<String>>,
    rows: Vec<Record>,
    style: Style,
    format: Vec<String>,
    /// A first column without a name, which was left out.
    index: Option<UnusedColumn>,
}

/// A column that is not used, and the reason.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct UnusedColumn {
    /// The column's name, or its number where it has none.
    pub column: String,
    /// Why the column is not used.
    pub reason: String,
}

/// Rows that were left out since a column has no value there.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct SkippedRows {
    pub column: String,
    /// The lines of the rows, from 1.
    pub lines: Vec<u64>,
}

/// The kind of a column's cells.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Content {
    /// At least one number, and not always the same.
    Numbers,
    /// The same number in all rows that have one.
    Constant(f64),
    /// No number; the first cell that has a text, and its line.
    Text(String, u64),
    /// No value at all.
    Empty,
}

impl Table {
    /// Reads a table from the bytes of `file`. Fields are separated by commas, semicolons, tabs, vertical bars
    /// or blanks; numbers may have decimal commas and Fortran's exponents. Spaces around a field, empty
    /// lines and comments are ignored, as is a first column without a name. The text is UTF-8, UTF-16 or
    /// Latin-1.
    ///
    /// # Errors
    ///
    /// The header or the rows are missing, a column has no name or the name of another one, a row has
    /// another number of fields than the header, or the text can be read in several ways.
    pub fn parse(file: &str, bytes: impl AsRef<[u8]>) -> Result<Self, InputError> {
        dialect::read(file, bytes.as_ref())
    }

    /// The file's name, as the user gave it.
    #[must_use]
    pub fn file(&self) -> &str {
        &self.file
    }

    /// How the text was read, if it is not plain CSV: delimiter, decimal comma, encoding, comments, units.
    #[must_use]
    pub fn format(&self) -> &[String] {
        &self.format
    }

    /// The names of the columns.
    #[must_use]
    pub fn columns(&self) -> &[String] {
        &self.header
    }

    /// A first column without a name, which was taken as an index of the rows.
    #[must_use]
    pub const fn index(&self) -> Option<&UnusedColumn> {
        self.index.as_ref()
    }

    /// The unit of the column at `position`, if a row below the header gives it.
    #[must_use]
    pub fn unit(&self, position: usize) -> Option<&str> {
        self.units[position].as_deref()
    }

    /// Number of rows, the header aside.
    #[must_use]
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Whether there are no rows, which happens only when all were skipped.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// The line of the file, from 1, on which a row (from 0) starts.
    ///
    /// # Panics
    ///
    /// If the row does not exist.
    #[must_use]
    pub fn line(&self, row: usize) -> u64 {
        self.rows[row].line
    }

    /// Position of the column of this name, from 0.
    ///
    /// # Errors
    ///
    /// The column does not exist.
    pub fn position(&self, name: &str) -> Result<usize, InputError> {
        let position = self.header.iter().position(|head| head == name);
        position.ok_or_else(|| {
            let columns = self.header.join(", ");
            let message = format!("has no column {name:?}; its columns are {columns}");
            InputError::in_file(&self.file, message)
        })
    }

    /// The finite numbers of a column, from top to bottom.
    ///
    /// # Errors
    ///
    /// The column does not exist, or one of its fields is not a finite number.
    pub fn numbers(&self, name: &str) -> Result<Vec<f64>, InputError> {
        let column = self.position(name)?;
        let number = |row: &Record| {
            let cell = &row.fields[column];
            self.style.number(cell).ok_or_else(|| {
                let message = if number::is_missing(cell) {
                    let found = match cell.as_str() {
                        "" => "is empty".to_owned(),
                        cell => format!("{cell:?} stands for a missing value"),
                    };
                    format!(
                        "{found}, but must be a finite number; --skip-missing leaves such rows out"
                    )
                } else {
                    format!("{cell:?} is not a finite number such as 0.5 or 1e-3")
                };
                InputError::in_file(&self.file, message)
                    .at_line(row.line)
                    .in_column(name)
            })
        };
        self.rows.iter().map(number).collect()
    }

    /// Removes the rows in which one of these columns has no value, and returns them.
    ///
    /// # Errors
    ///
    /// The column does not exist, or no row is left.
    pub fn skip_missing(&mut self, columns: &[&str]) -> Result<Vec<SkippedRows>, InputError> {
        let mut skipped = Vec::new();
        for name in columns {
            let column = self.position(name)?;
            let is_missing = |row: &Record| number::is_missing(&row.fields[column]);
            let (missing, rows): (Vec<Record>, Vec<Record>) = std::mem::take(&mut self.rows)
                .into_iter()
                .partition(is_missing);
            self.rows = rows;
            if !missing.is_empty() {
                skipped.push(SkippedRows {
                    column: (*name).to_owned(),
                    lines: missing.iter().map(|row| row.line).collect(),
                });
            }
        }
        if self.rows.is_empty() {
            let columns = columns.join(", ");
            let message = format!("no row has a value in each of the columns {columns}");
            return Err(InputError::in_file(&self.file, message));
        }
        Ok(skipped)
    }

    /// The kind of the cells of the column at `position`.
    pub(crate) fn content(&self, position: usize) -> Content {
        let mut numbers = self
            .cells(position)
            .filter_map(|(_, cell)| self.style.number(cell));
        if let Some(first) = numbers.next() {
            let mut cells = self.cells(position);
            let differs = cells.any(|(_, cell)| {
                let value = self.style.number(cell);
                value.map_or(!number::is_missing(cell), |value| value != first)
            });
            return if differs || self.rows.len() == 1 {
                Content::Numbers
            } else {
                Content::Constant(first)
            };
        }
        let mut texts = self
            .cells(position)
            .filter(|(_, cell)| !number::is_missing(cell));
        texts.next().map_or(Content::Empty, |(line, cell)| {
            Content::Text(cell.to_owned(), line)
        })
    }

    /// Whether the column at `position` has the name of a counter and counts the rows.
    pub(crate) fn counts_rows(&self, position: usize) -> bool {
        const COUNTERS: [&str; 14] = [
            "id", "idx", "index", "no", "no.", "nr", "nr.", "number", "row", "run", "eval_id",
            "sample", "case", "obs",
        ];
        let name = self.header[position].to_ascii_lowercase();
        let values = self
            .cells(position)
            .map(|(_, cell)| self.style.number(cell));
        let values: Option<Vec<f64>> = values.collect();
        let rises = |values: Vec<f64>| values.windows(2).all(|pair| pair[1] - pair[0] == 1.0);
        COUNTERS.contains(&name.as_str()) && self.rows.len() > 2 && values.is_some_and(rises)
    }

    /// The cells of a column, each with its line.
    fn cells(&self, position: usize) -> impl Iterator<Item = (u64, &str)> {
        self.rows
            .iter()
            .map(move |row| (row.line, row.fields[position].as_str()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refusal(text: &str) -> String {
        Table::parse("t.csv", text).unwrap_err().to_string()
    }

    #[test]
    fn rows_know_their_lines_whatever_the_line_ends() {
        for text in [
            "a,b\n1,2\n\n3,x\n",
            "a,b\r\n1,2\r\n\r\n3,x\r\n",
            "\u{feff}a, b\n1 ,2\n\n 3,x",
        ] {
            let table = Table::parse("t.csv", text).unwrap();
            assert_eq!(table.columns(), ["a", "b"]);
            assert_eq!(table.numbers("a").unwrap(), [1.0, 3.0]);
            assert_eq!((table.line(0), table.line(1)), (2, 4), "{text:?}");
            let error = table.numbers("b").unwrap_err().to_string();
            assert_eq!(
                error,
                "t.csv, line 4, column \"b\": \"x\" is not a finite number such as 0.5 or 1e-3"
            );
        }
    }

    #[test]
    fn quoted_fields_may_span_lines() {
        let table = Table::parse("t.csv", "name,y\n\"two\nlines\",1\nc,\n").unwrap();
        assert_eq!((table.line(0), table.line(1)), (2, 4));
        let error = table.numbers("y").unwrap_err().to_string();
        assert!(error.contains("line 4, column \"y\": is empty"), "{error}");
        assert_eq!(table.content(1), Content::Constant(1.0));
        assert_eq!(table.content(0), Content::Text("two\nlines".to_owned(), 2));
    }

    #[test]
    fn tables_of_no_sense_are_refused() {
        for (text, parts) in [
            ("", ["t.csv", "is empty"]),
            ("a,b\n", ["t.csv", "no rows"]),
            ("a,b\n1,2\n1,2,3\n", ["line 3", "has 3 fields"]),
            ("a,,b\n1,2,3\n", ["line 1", "column 2 has no name"]),
            ("a,a\n1,2\n", ["line 1, column \"a\"", "two columns"]),
        ] {
            let refusal = refusal(text);
            for part in parts {
                assert!(refusal.contains(part), "no {part:?} in {refusal}");
            }
        }
        let table = Table::parse("t.csv", "a,b\n1,inf\n").unwrap();
        assert!(table.numbers("b").is_err(), "infinity is no observation");
        let error = table.numbers("c").unwrap_err().to_string();
        assert!(error.contains("\"c\"; its columns are a, b"), "{error}");
    }
}
