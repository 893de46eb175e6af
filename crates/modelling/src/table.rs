//! CSV tables whose errors name file, line and column.

use std::collections::HashSet;

use crate::InputError;

/// A CSV table: a header line, then rows of as many fields.
#[derive(Debug, Clone)]
pub struct Table {
    file: String,
    header: Vec<String>,
    rows: Vec<Row>,
}

#[derive(Debug, Clone)]
struct Row {
    /// Line of the file on which the row starts, from 1.
    line: u64,
    fields: Vec<String>,
}

impl Table {
    /// Reads a table from the text of `file`. Fields are separated by commas; spaces around a field and
    /// empty lines are ignored.
    ///
    /// # Errors
    ///
    /// The header or the rows are missing, a column has no name or the name of another one, or a row has
    /// another number of fields than the header.
    pub fn parse(file: &str, text: &str) -> Result<Self, InputError> {
        let wrong = |message: String| InputError::in_file(file, message);
        let mut reader = csv::ReaderBuilder::new()
            .trim(csv::Trim::All)
            .has_headers(false)
            .flexible(true)
            .from_reader(text.as_bytes());
        let mut lines = Lines::new(text);
        let mut records = reader.records().map(|record| {
            let record = record.map_err(|error| wrong(error.to_string()))?;
            let start = record.position().map_or(0, |position| position.byte());
            let fields: Vec<String> = record.iter().map(str::to_owned).collect();
            Ok::<Row, InputError>(Row {
                line: lines.at(start as usize),
                fields,
            })
        });
        let Some(first) = records.next() else {
            return Err(wrong(
                "is empty, but must have a header line and rows of numbers".to_owned(),
            ));
        };
        let head = first?;
        let mut seen = HashSet::new();
        for (number, name) in head.fields.iter().enumerate() {
            if name.is_empty() {
                let message = format!(
                    "column {} has no name, but must have one in the header",
                    number + 1
                );
                return Err(wrong(message).at_line(head.line));
            }
            if !seen.insert(name) {
                let message = "is the name of two columns, but names must differ";
                return Err(wrong(message.to_owned()).at_line(head.line).in_column(name));
            }
        }
        let mut rows = Vec::new();
        for row in records {
            let row = row?;
            if row.fields.len() != head.fields.len() {
                let message = format!(
                    "has {} fields, but must have {}, as the header",
                    row.fields.len(),
                    head.fields.len()
                );
                return Err(wrong(message).at_line(row.line));
            }
            rows.push(row);
        }
        if rows.is_empty() {
            return Err(wrong("has a header, but no rows".to_owned()));
        }
        Ok(Self {
            file: file.to_owned(),
            header: head.fields,
            rows,
        })
    }

    /// The file's name, as the user gave it.
    #[must_use]
    pub fn file(&self) -> &str {
        &self.file
    }

    /// The names of the columns.
    #[must_use]
    pub fn columns(&self) -> &[String] {
        &self.header
    }

    /// Number of rows, the header aside.
    #[must_use]
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Whether there are no rows; never for a table that was read.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// The line of the file, from 1, on which a row (from 0) starts.
    ///
    /// # Panics
    ///
    /// If there is no such row.
    #[must_use]
    pub fn line(&self, row: usize) -> u64 {
        self.rows[row].line
    }

    /// Position of the column of this name, from 0.
    ///
    /// # Errors
    ///
    /// There is no such column.
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
    /// There is no such column, or one of its fields is no finite number.
    pub fn numbers(&self, name: &str) -> Result<Vec<f64>, InputError> {
        let column = self.position(name)?;
        let number = |row: &Row| {
            let field = &row.fields[column];
            finite(field).ok_or_else(|| {
                let message = match field.as_str() {
                    "" => "is empty, but must be a finite number".to_owned(),
                    field => format!("{field:?} is not a finite number such as 0.5 or 1e-3"),
                };
                InputError::in_file(&self.file, message)
                    .at_line(row.line)
                    .in_column(name)
            })
        };
        self.rows.iter().map(number).collect()
    }

    /// Whether any field of the column at `position` is a finite number.
    pub(crate) fn has_numbers(&self, position: usize) -> bool {
        let mut fields = self.rows.iter().map(|row| &row.fields[position]);
        fields.any(|field| finite(field).is_some())
    }
}

fn finite(field: &str) -> Option<f64> {
    field.parse().ok().filter(|value: &f64| value.is_finite())
}

/// Line numbers of ascending positions in a text. The CSV reader's own numbers are those of the end
/// of the row before: they are too small after an empty line or a carriage return.
struct Lines<'a> {
    text: &'a [u8],
    position: usize,
    line: u64,
}

impl<'a> Lines<'a> {
    fn new(text: &'a str) -> Self {
        Self {
            text: text.as_bytes(),
            position: 0,
            line: 1,
        }
    }

    /// The line of the first byte from `start` on that is no line end.
    fn at(&mut self, start: usize) -> u64 {
        while let Some(byte) = self.text.get(self.position) {
            if self.position >= start && !matches!(byte, b'\n' | b'\r') {
                break;
            }
            self.line += u64::from(*byte == b'\n');
            self.position += 1;
        }
        self.line
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
        assert!(table.has_numbers(1) && !table.has_numbers(0));
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
