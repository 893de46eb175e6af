//! Tables in memory, column by column.

use anyhow::Context as _;

use crate::cell::{Cell, Column, Kind};

/// A table column by column.
#[derive(Debug, Clone, Default)]
pub struct Columns {
    pub columns: Vec<Column>,
    /// The values of each column, all of one length.
    pub values: Vec<Values>,
}

/// The values of a column; a missing number is `None`.
#[derive(Debug, Clone, PartialEq)]
pub enum Values {
    Text(Vec<String>),
    Whole(Vec<Option<i64>>),
    Number(Vec<Option<f64>>),
}

impl Columns {
    /// Columns without values.
    pub(crate) fn new(columns: &[Column]) -> Self {
        Self {
            columns: columns.to_vec(),
            values: columns.iter().map(Values::new).collect(),
        }
    }

    /// Adds a row, which fits the columns.
    pub(crate) fn push(&mut self, row: &[Cell]) -> anyhow::Result<()> {
        let mut cells = self.values.iter_mut().zip(row);
        cells.try_for_each(|(values, cell)| values.push(cell))
    }
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
            (Self::Text(values), Cell::Text(text)) => values.push(text.clone()),
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
}
