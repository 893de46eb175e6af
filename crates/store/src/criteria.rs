//! The deterministic results of designs.

use std::collections::BTreeMap;

use crate::Error;
use crate::connection::Connection;
use crate::receipt::Receipt;
use crate::row::{self, Columns, Row};
use crate::values::{Numbers, bytes, list};

/// The deterministic results of a design.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct CriteriaRow {
    /// Index of the design.
    pub design: u64,
    /// Whether the simulator gives numbers for the design.
    pub simulable: bool,
    /// Why the design is not simulable, or why it gets no samples although it is: a code and a
    /// sentence.
    pub reason: Option<String>,
    /// The deterministic responses in their problem's order; `None` if the design is not simulable.
    pub responses: Option<Vec<f64>>,
}

impl Row for CriteriaRow {
    const TABLE: &'static str = "criteria";

    fn key(&self) -> String {
        format!("design {}", self.design)
    }

    fn add_to(&self, columns: &mut Columns) {
        columns
            .count("design", self.design)
            .bits(self.simulable.into())
            .option(self.reason.as_deref(), Columns::text)
            .option(self.responses.as_deref(), |to, responses| {
                to.numbers("responses", responses)
            });
    }
}

/// A row of the table as it is read.
struct Stored {
    design: u64,
    simulable: bool,
    reason: Option<String>,
    responses: Option<Numbers>,
    seal: i64,
}

pub(crate) async fn all(connection: &mut Connection<'_>) -> Result<Vec<CriteriaRow>, Error> {
    let query = sqlx::query_as!(
        Stored,
        r#"SELECT design AS "design: u64", simulable AS "simulable: bool", reason,
                  responses AS "responses: Numbers", seal
           FROM criteria ORDER BY design"#
    );
    let rows = connection.all(query).await?;
    checked(connection, rows)
}

/// The criteria of these designs, as far as they are stored.
async fn of(
    connection: &mut Connection<'_>,
    designs: impl IntoIterator<Item = u64>,
) -> Result<Vec<CriteriaRow>, Error> {
    let designs = list(designs.into_iter().map(u64::cast_signed));
    let query = sqlx::query_as!(
        Stored,
        r#"SELECT design AS "design: u64", simulable AS "simulable: bool", reason,
                  responses AS "responses: Numbers", seal
           FROM criteria WHERE design IN (SELECT value FROM json_each(?))"#,
        designs,
    );
    let rows = connection.all(query).await?;
    checked(connection, rows)
}

fn checked(connection: &Connection<'_>, rows: Vec<Stored>) -> Result<Vec<CriteriaRow>, Error> {
    rows.into_iter()
        .map(|row| {
            let criteria = CriteriaRow {
                design: row.design,
                simulable: row.simulable,
                reason: row.reason,
                responses: row.responses.map(|numbers| numbers.0),
            };
            connection.check(criteria, row.seal)
        })
        .collect()
}

/// Stores the criteria of designs, each given with the index of its receipt and its origin.
pub(crate) async fn insert(
    connection: &mut Connection<'_>,
    rows: &[(usize, Option<i64>, &CriteriaRow)],
    receipts: &mut [Receipt],
) -> Result<(), Error> {
    if rows.is_empty() {
        return Ok(());
    }
    let stored = of(connection, rows.iter().map(|(_, _, row)| row.design)).await?;
    let mut held: BTreeMap<u64, &CriteriaRow> =
        stored.iter().map(|row| (row.design, row)).collect();
    let mut new = Vec::new();
    for &(owner, origin, row) in rows {
        let earlier = held.insert(row.design, row);
        receipts[owner].count(earlier.is_none());
        match earlier {
            Some(earlier) => row::agree(Some(earlier), row)?,
            None => new.push((row, row::seal(row)?, origin)),
        }
    }
    let statement = [
        "INSERT INTO criteria (design, simulable, reason, responses, seal, origin) ",
        "",
    ];
    connection
        .insert_many(statement, &new, |values, (row, seal, origin)| {
            values
                .push_bind(row.design.cast_signed())
                .push_bind(row.simulable)
                .push_bind(row.reason.clone())
                .push_bind(row.responses.as_deref().map(bytes))
                .push_bind(*seal)
                .push_bind(*origin);
        })
        .await
}

/// The digest of all criteria: their number and the sums of the halves of their digests.
pub(crate) async fn digest(connection: &mut Connection<'_>) -> Result<String, Error> {
    let query = sqlx::query!(
        r#"SELECT count(*) AS "count!: i64", coalesce(sum(seal & 4294967295), 0) AS "low!: i64",
                  coalesce(sum((seal >> 32) & 4294967295), 0) AS "high!: i64" FROM criteria"#
    );
    let row = connection.one(query).await?;
    Ok(format!("{:x}-{:x}-{:x}", row.count, row.low, row.high))
}

pub(crate) async fn remove(connection: &mut Connection<'_>) -> Result<(), Error> {
    let query = sqlx::query!("DELETE FROM criteria");
    connection.execute(query).await.map(drop)
}

/// Removes the criteria of a design, and returns their number.
pub(crate) async fn remove_of_design(
    connection: &mut Connection<'_>,
    design: u32,
) -> Result<u64, Error> {
    let query = sqlx::query!("DELETE FROM criteria WHERE design = ?", design);
    connection.execute(query).await
}

/// Removes the criteria of this origin, and returns their number.
pub(crate) async fn remove_from(
    connection: &mut Connection<'_>,
    origin: i64,
) -> Result<u64, Error> {
    let query = sqlx::query!("DELETE FROM criteria WHERE origin = ?", origin);
    connection.execute(query).await
}

/// Removes the criteria whose reason begins with `reason`, and returns their number.
pub(crate) async fn remove_failed(
    connection: &mut Connection<'_>,
    reason: &str,
) -> Result<u64, Error> {
    let query = sqlx::query!(
        "DELETE FROM criteria WHERE substr(reason, 1, length(?1)) = ?1",
        reason
    );
    connection.execute(query).await
}
