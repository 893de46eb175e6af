//! Rows of a table as a Parquet file: typed columns, and their units in the file's metadata.
//!
//! The key `units` holds a JSON object from column to unit, `table` the table's name and `schema_version` that of
//! the rows as JSON.

use std::collections::BTreeMap;
use std::io::Write;
use std::sync::Arc;

use anyhow::Context as _;
use parquet::basic::{Compression, LogicalType, Repetition, Type as Physical};
use parquet::data_type::{ByteArray, ByteArrayType, DoubleType, Int64Type};
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedColumnWriter, SerializedFileWriter};
use parquet::schema::types::Type;

use crate::rows::{Kind, SCHEMA_VERSION, kind};

/// Rows that are held until they are written as a row group.
const ROWS: usize = 1 << 16;

/// Writes the rows of a table; the first record is the header.
pub(crate) struct ParquetWriter<W: Write + Send> {
    table: String,
    units: BTreeMap<String, String>,
    state: State<W>,
}

enum State<W: Write + Send> {
    New(W),
    Begun {
        file: Box<SerializedFileWriter<W>>,
        columns: Vec<Column>,
    },
    /// The header could not be written.
    Failed,
}

/// A column with the values that are not written yet; a number that is missing is none.
struct Column {
    name: String,
    values: Values,
}

enum Values {
    Text(Vec<ByteArray>),
    Whole(Vec<Option<i64>>),
    Number(Vec<Option<f64>>),
}

impl<W: Write + Send> ParquetWriter<W> {
    /// A writer of the table of this name, whose columns have these units.
    pub(crate) fn new(out: W, table: &str, units: BTreeMap<String, String>) -> Self {
        Self {
            table: table.to_owned(),
            units,
            state: State::New(out),
        }
    }

    /// Writes the header, then each row.
    pub(crate) fn write_record(&mut self, fields: &[String]) -> anyhow::Result<()> {
        match &mut self.state {
            State::Begun { file, columns } => {
                anyhow::ensure!(
                    columns.len() == fields.len(),
                    "a row has {} fields, but its header {}",
                    fields.len(),
                    columns.len()
                );
                for (column, field) in columns.iter_mut().zip(fields) {
                    column.push(field)?;
                }
                if columns.first().is_some_and(|column| column.len() == ROWS) {
                    write_group(file, columns)?;
                }
                Ok(())
            }
            state => {
                let State::New(out) = std::mem::replace(state, State::Failed) else {
                    anyhow::bail!("the table's header could not be written");
                };
                *state = begin(out, &self.table, &self.units, fields)?;
                Ok(())
            }
        }
    }

    /// Ends the table.
    pub(crate) fn finish(self) -> anyhow::Result<()> {
        let State::Begun {
            mut file,
            mut columns,
        } = self.state
        else {
            anyhow::bail!("the table has no header");
        };
        if columns.first().is_some_and(|column| column.len() > 0) {
            write_group(&mut file, &mut columns)?;
        }
        file.finish()?;
        Ok(file.inner_mut().flush()?)
    }
}

fn begin<W: Write + Send>(
    out: W,
    table: &str,
    units: &BTreeMap<String, String>,
    header: &[String],
) -> anyhow::Result<State<W>> {
    let columns: Vec<Column> = header.iter().map(|name| Column::new(name)).collect();
    let fields = columns.iter().map(Column::schema);
    let fields = fields.collect::<Result<_, _>>()?;
    let schema = Type::group_type_builder(table)
        .with_fields(fields)
        .build()?;
    let named = |name: &&String| Some((name.to_string(), units.get(*name)?.clone()));
    let units: BTreeMap<String, String> = header.iter().filter_map(|name| named(&name)).collect();
    let metadata = [
        ("table", table.to_owned()),
        ("schema_version", SCHEMA_VERSION.to_string()),
        ("units", serde_json::to_string(&units)?),
    ];
    let metadata = metadata.map(|(key, value)| KeyValue::new(key.to_owned(), value));
    let properties = WriterProperties::builder()
        .set_created_by("pitchline".to_owned())
        .set_compression(Compression::SNAPPY)
        .set_key_value_metadata(Some(metadata.to_vec()))
        .build();
    let file = SerializedFileWriter::new(out, Arc::new(schema), Arc::new(properties))?;
    let file = Box::new(file);
    Ok(State::Begun { file, columns })
}

/// Writes the values of all columns, and forgets them.
fn write_group<W: Write + Send>(
    file: &mut SerializedFileWriter<W>,
    columns: &mut [Column],
) -> anyhow::Result<()> {
    let mut group = file.next_row_group()?;
    for column in columns {
        let mut out = group.next_column()?.context("a column without a place")?;
        column.write(&mut out)?;
        out.close()?;
    }
    group.close()?;
    Ok(())
}

impl Column {
    fn new(name: &str) -> Self {
        let values = match kind(name) {
            Kind::Text => Values::Text(Vec::new()),
            Kind::Whole => Values::Whole(Vec::new()),
            Kind::Number => Values::Number(Vec::new()),
        };
        Self {
            name: name.to_owned(),
            values,
        }
    }

    fn schema(&self) -> parquet::errors::Result<Arc<Type>> {
        let (physical, logical, repetition) = match self.values {
            Values::Text(_) => (
                Physical::BYTE_ARRAY,
                Some(LogicalType::String),
                Repetition::REQUIRED,
            ),
            Values::Whole(_) => (Physical::INT64, None, Repetition::OPTIONAL),
            Values::Number(_) => (Physical::DOUBLE, None, Repetition::OPTIONAL),
        };
        let column = Type::primitive_type_builder(&self.name, physical)
            .with_logical_type(logical)
            .with_repetition(repetition);
        Ok(Arc::new(column.build()?))
    }

    fn len(&self) -> usize {
        match &self.values {
            Values::Text(values) => values.len(),
            Values::Whole(values) => values.len(),
            Values::Number(values) => values.len(),
        }
    }

    fn push(&mut self, field: &str) -> anyhow::Result<()> {
        let name = &self.name;
        let what = |what| format!("column {name} holds {field:?}, which is no {what}");
        let is_given = !field.is_empty();
        match &mut self.values {
            Values::Text(values) => values.push(field.into()),
            Values::Whole(values) => {
                let whole = is_given.then(|| field.parse()).transpose();
                values.push(whole.with_context(|| what("whole number"))?);
            }
            Values::Number(values) => {
                let number = is_given.then(|| field.parse()).transpose();
                values.push(number.with_context(|| what("number"))?);
            }
        }
        Ok(())
    }

    fn write(&mut self, out: &mut SerializedColumnWriter<'_>) -> anyhow::Result<()> {
        match &mut self.values {
            Values::Text(values) => {
                let values = std::mem::take(values);
                out.typed::<ByteArrayType>()
                    .write_batch(&values, None, None)?;
            }
            Values::Whole(values) => {
                let (values, levels) = given(std::mem::take(values));
                out.typed::<Int64Type>()
                    .write_batch(&values, Some(&levels), None)?;
            }
            Values::Number(values) => {
                let (values, levels) = given(std::mem::take(values));
                out.typed::<DoubleType>()
                    .write_batch(&values, Some(&levels), None)?;
            }
        }
        Ok(())
    }
}

/// The values that there are, and for each row whether there is one.
fn given<T: Copy>(values: Vec<Option<T>>) -> (Vec<T>, Vec<i16>) {
    let levels = values.iter().map(|value| value.is_some().into()).collect();
    (values.into_iter().flatten().collect(), levels)
}

#[cfg(test)]
mod tests {
    use parquet::file::reader::{FileReader as _, SerializedFileReader};
    use parquet::record::RowAccessor as _;

    use super::*;

    fn written(rows: &[&[&str]]) -> anyhow::Result<SerializedFileReader<std::fs::File>> {
        let mut file = tempfile::tempfile()?;
        let units = BTreeMap::from([("p90_um".to_owned(), "µm".to_owned())]);
        let mut out = ParquetWriter::new(&mut file, "failures", units);
        for row in rows {
            let row: Vec<String> = row.iter().map(|&field| field.to_owned()).collect();
            out.write_record(&row)?;
        }
        out.finish()?;
        Ok(SerializedFileReader::new(file)?)
    }

    #[test]
    fn rows_are_read_back_with_types_and_units() {
        let header: &[&str] = &["job", "lease", "p90_um"];
        let file = written(&[header, &["7", "2", "1.5"], &["a,b", "3", ""]]).unwrap();
        let metadata = file.metadata().file_metadata().key_value_metadata();
        let value = |key: &str| {
            let pair = metadata.unwrap().iter().find(|pair| pair.key == key);
            pair.unwrap().value.clone().unwrap()
        };
        assert_eq!(value("table"), "failures");
        assert_eq!(value("units"), r#"{"p90_um":"µm"}"#);
        let rows: Vec<_> = file
            .get_row_iter(None)
            .unwrap()
            .map(Result::unwrap)
            .collect();
        assert_eq!(rows.len(), 2);
        assert_eq!(rows[0].get_string(0).unwrap(), "7");
        assert_eq!(rows[0].get_long(1).unwrap(), 2);
        assert_eq!(rows[0].get_double(2).unwrap(), 1.5);
        assert_eq!(rows[1].get_string(0).unwrap(), "a,b");
        assert!(rows[1].get_double(2).is_err(), "no value");
        let empty = written(&[header]).unwrap();
        assert_eq!(empty.metadata().file_metadata().num_rows(), 0);
        assert_eq!(
            empty
                .metadata()
                .file_metadata()
                .schema_descr()
                .num_columns(),
            3
        );
    }

    #[test]
    fn a_long_table_has_several_row_groups() {
        let many = ROWS + 3;
        let mut rows: Vec<&[&str]> = vec![&["p90_um"]];
        rows.extend(std::iter::repeat_n(&["0.25"][..], many));
        let file = written(&rows).unwrap();
        assert_eq!(file.metadata().num_row_groups(), 2);
        assert_eq!(file.get_row_iter(None).unwrap().count(), many);
    }

    #[test]
    fn what_is_no_row_of_the_table_is_an_error() {
        assert!(written(&[&["design", "p90_um"], &["1"]]).is_err());
        let error = written(&[&["design"], &["1.5"]]).err().unwrap();
        assert!(
            error.to_string().contains("design holds \"1.5\""),
            "{error}"
        );
        assert!(written(&[]).is_err());
    }
}
