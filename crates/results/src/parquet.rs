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

/// Rows of a row group; they are kept in memory until it is full.
const ROWS: usize = 1 << 16;

/// Writes the rows of a table, which fit its columns.
pub(crate) struct ParquetWriter<W: Write + Send> {
    file: SerializedFileWriter<W>,
    columns: Vec<Values>,
    rows: usize,
}

/// The unwritten values of a column; a missing number is `None`.
enum Values {
    Text(Vec<ByteArray>),
    Whole(Vec<Option<i64>>),
    Number(Vec<Option<f64>>),
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
            columns: columns.iter().map(Values::new).collect(),
            rows: 0,
        })
    }

    pub(crate) fn write(&mut self, row: &[Cell]) -> anyhow::Result<()> {
        for (values, cell) in self.columns.iter_mut().zip(row) {
            values.push(cell)?;
        }
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
        for values in &mut self.columns {
            let mut out = group.next_column()?.context("unknown column")?;
            values.write(&mut out)?;
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

impl Values {
    fn new(column: &Column) -> Self {
        match column.kind {
            Kind::Text => Self::Text(Vec::new()),
            Kind::Whole => Self::Whole(Vec::new()),
            Kind::Number => Self::Number(Vec::new()),
        }
    }

    fn push(&mut self, cell: &Cell) -> anyhow::Result<()> {
        match (self, cell) {
            (Self::Text(values), Cell::Text(text)) => values.push(text.as_str().into()),
            (Self::Whole(values), Cell::Whole(number)) => {
                let number = i64::try_from(*number).context("a number of more than 63 bits")?;
                values.push(Some(number));
            }
            (Self::Whole(values), Cell::Missing) => values.push(None),
            (Self::Number(values), Cell::Number(number)) => values.push(Some(*number)),
            (Self::Number(values), Cell::Missing) => values.push(None),
            (_, cell) => anyhow::bail!("{cell:?} does not fit its column"),
        }
        Ok(())
    }

    fn write(&mut self, out: &mut SerializedColumnWriter<'_>) -> anyhow::Result<()> {
        match self {
            Self::Text(values) => {
                let values = std::mem::take(values);
                out.typed::<ByteArrayType>()
                    .write_batch(&values, None, None)?;
            }
            Self::Whole(values) => {
                let (values, levels) = present(std::mem::take(values));
                out.typed::<Int64Type>()
                    .write_batch(&values, Some(&levels), None)?;
            }
            Self::Number(values) => {
                let (values, levels) = present(std::mem::take(values));
                out.typed::<DoubleType>()
                    .write_batch(&values, Some(&levels), None)?;
            }
        }
        Ok(())
    }
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
