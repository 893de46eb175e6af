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

use crate::cell::{Cell, Column, Kind, SCHEMA_VERSION};
use crate::columnar::{Columns, Values};

/// Number of rows in a row group. Rows are kept in memory until their group is full.
const ROWS: usize = 1 << 16;

/// Writes the rows of a table, which fit its columns.
pub(crate) struct ParquetWriter<W: Write + Send> {
    file: SerializedFileWriter<W>,
    /// The rows that are not written yet.
    group: Columns,
    rows: usize,
}

impl<W: Write + Send> ParquetWriter<W> {
    /// Begins the table of this name.
    pub(crate) fn new(out: W, table: &str, columns: &[Column]) -> anyhow::Result<Self> {
        let fields = columns.iter().map(schema).collect::<Result<_, _>>()?;
        let schema = Type::group_type_builder(table)
            .with_fields(fields)
            .build()?;
        let with_unit = columns.iter().filter(|column| !column.unit.is_empty());
        let units: BTreeMap<&str, &str> = with_unit
            .map(|column| (&*column.name, &*column.unit))
            .collect();
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
        Ok(Self {
            file: SerializedFileWriter::new(out, Arc::new(schema), Arc::new(properties))?,
            group: Columns::new(columns),
            rows: 0,
        })
    }

    pub(crate) fn write(&mut self, row: &[Cell]) -> anyhow::Result<()> {
        self.group.push(row)?;
        self.rows += 1;
        if self.rows == ROWS {
            self.write_group()?;
        }
        Ok(())
    }

    pub(crate) fn finish(mut self) -> anyhow::Result<()> {
        if self.rows > 0 {
            self.write_group()?;
        }
        self.file.finish()?;
        Ok(self.file.inner_mut().flush()?)
    }

    /// Writes the values of all columns, and forgets them.
    fn write_group(&mut self) -> anyhow::Result<()> {
        let mut group = self.file.next_row_group()?;
        for values in &mut self.group.values {
            let mut out = group.next_column()?.context("unknown column")?;
            write(values, &mut out)?;
            out.close()?;
        }
        group.close()?;
        self.rows = 0;
        Ok(())
    }
}

fn schema(column: &Column) -> parquet::errors::Result<Arc<Type>> {
    let (physical, logical, repetition) = match column.kind {
        Kind::Text => (
            Physical::BYTE_ARRAY,
            Some(LogicalType::String),
            Repetition::REQUIRED,
        ),
        Kind::Whole => (Physical::INT64, None, Repetition::OPTIONAL),
        Kind::Number => (Physical::DOUBLE, None, Repetition::OPTIONAL),
    };
    let column = Type::primitive_type_builder(&column.name, physical)
        .with_logical_type(logical)
        .with_repetition(repetition);
    Ok(Arc::new(column.build()?))
}

/// Writes the values of a column, and forgets them.
fn write(values: &mut Values, out: &mut SerializedColumnWriter<'_>) -> anyhow::Result<()> {
    match values {
        Values::Text(values) => {
            let values = std::mem::take(values).into_iter();
            let values: Vec<ByteArray> = values.map(|text| text.into_bytes().into()).collect();
            out.typed::<ByteArrayType>()
                .write_batch(&values, None, None)?;
        }
        Values::Whole(values) => {
            let (values, levels) = present(std::mem::take(values));
            out.typed::<Int64Type>()
                .write_batch(&values, Some(&levels), None)?;
        }
        Values::Number(values) => {
            let (values, levels) = present(std::mem::take(values));
            out.typed::<DoubleType>()
                .write_batch(&values, Some(&levels), None)?;
        }
    }
    Ok(())
}

/// The values that are present, and for each row whether there is one.
fn present<T: Copy>(values: Vec<Option<T>>) -> (Vec<T>, Vec<i16>) {
    let levels = values.iter().map(|value| value.is_some().into()).collect();
    (values.into_iter().flatten().collect(), levels)
}

#[cfg(test)]
mod tests {
    use parquet::file::reader::{FileReader as _, SerializedFileReader};
    use parquet::record::RowAccessor as _;

    use super::*;
    use crate::row;

    fn written(rows: &[Vec<Cell>]) -> anyhow::Result<SerializedFileReader<std::fs::File>> {
        let mut file = tempfile::tempfile()?;
        let p90 = Column::number("p90_um").in_unit("µm");
        let columns = [Column::text("job"), Column::whole("lease"), p90];
        let mut out = ParquetWriter::new(&mut file, "failures", &columns)?;
        for row in rows {
            out.write(row)?;
        }
        out.finish()?;
        Ok(SerializedFileReader::new(file)?)
    }

    #[test]
    fn rows_are_read_back_with_types_and_units() {
        let rows = [
            row!["7", 2_u64, 1.5].to_vec(),
            row!["a,b", 3_u64, None::<f64>].to_vec(),
        ];
        let file = written(&rows).unwrap();
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
        let empty = written(&[]).unwrap();
        let metadata = empty.metadata().file_metadata();
        assert_eq!(metadata.num_rows(), 0);
        assert_eq!(metadata.schema_descr().num_columns(), 3);
    }

    #[test]
    fn a_long_table_has_several_row_groups() {
        let many = ROWS + 3;
        let file = written(&vec![row!["", 1_u64, 0.25].to_vec(); many]).unwrap();
        assert_eq!(file.metadata().num_row_groups(), 2);
        assert_eq!(file.get_row_iter(None).unwrap().count(), many);
    }
}
