//! The designs of the DoE.

use std::collections::BTreeMap;

use crate::Error;
use crate::connection::Connection;
use crate::receipt::Receipt;
use crate::row::{self, Columns, Row};
use crate::values::{Numbers, bytes, list};

/// One point of the design of experiments.
#[derive(Debug, Clone, PartialEq)]
pub struct DesignRow {
    /// Index in the design of experiments.
    pub design: u64,
    /// The variables of the design of experiments, in their problem's order.
    pub x: Vec<f64>,
}

impl DesignRow {
    /// The design at a point.
    #[must_use]
    pub fn new(design: u64, x: impl Into<Vec<f64>>) -> Self {
        Self {
            design,
            x: x.into(),
        }
    }
}

impl Row for DesignRow {
    const TABLE: &'static str = "design";

    fn key(&self) -> String {
        format!("design {}", self.design)
    }

    fn add_to(&self, columns: &mut Columns) {
        columns.count("design", self.design).numbers("x", &self.x);
    }
}

/// The designs `first..=last`.
async fn range(
    connection: &mut Connection<'_>,
    first: i64,
    last: i64,
) -> Result<Vec<DesignRow>, Error> {
    let query = sqlx::query!(
        r#"SELECT design AS "design: u64", x AS "x: Numbers", seal FROM design
           WHERE design BETWEEN ? AND ? ORDER BY design"#,
        first,
        last,
    );
    let rows = connection.all(query).await?;
    rows.into_iter()
        .map(|row| connection.check(DesignRow::new(row.design, row.x.0), row.seal))
        .collect()
}

pub(crate) async fn all(connection: &mut Connection<'_>) -> Result<Vec<DesignRow>, Error> {
    range(connection, 0, i64::MAX).await
}

/// The first of these designs that is not stored.
pub(crate) async fn first_unknown(
    connection: &mut Connection<'_>,
    designs: impl IntoIterator<Item = u64>,
) -> Result<Option<u64>, Error> {
    let designs = list(designs.into_iter().map(u64::cast_signed));
    let query = sqlx::query!(
        r#"SELECT value + 0 AS "design!: i64" FROM json_each(?)
           WHERE value NOT IN (SELECT design FROM design) LIMIT 1"#,
        designs,
    );
    let row = connection.optional(query).await?;
    Ok(row.map(|row| row.design.cast_unsigned()))
}

/// Stores the designs that are not stored yet.
pub(crate) async fn insert(
    connection: &mut Connection<'_>,
    rows: &[DesignRow],
) -> Result<Receipt, Error> {
    let seals: Vec<i64> = rows.iter().map(row::seal).collect::<Result<_, _>>()?;
    let designs = || rows.iter().map(|row| row.design.cast_signed());
    let (first, last) = (designs().min(), designs().max());
    let stored = range(connection, first.unwrap_or(0), last.unwrap_or(-1)).await?;
    let mut held: BTreeMap<u64, &DesignRow> = stored.iter().map(|row| (row.design, row)).collect();
    let mut receipt = Receipt::default();
    let mut new = Vec::new();
    for (row, seal) in rows.iter().zip(seals) {
        let earlier = held.insert(row.design, row);
        receipt.count(earlier.is_none());
        match earlier {
            Some(earlier) => row::agree(Some(earlier), row)?,
            None => new.push((row, seal)),
        }
    }
    let statement = ["INSERT INTO design (design, x, seal) ", ""];
    connection
        .insert_many(statement, &new, |values, (row, seal)| {
            values
                .push_bind(row.design.cast_signed())
                .push_bind(bytes(&row.x))
                .push_bind(*seal);
        })
        .await?;
    Ok(receipt)
}
