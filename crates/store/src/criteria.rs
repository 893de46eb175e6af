//! The deterministic results of designs.

use crate::Error;
use crate::connection::Connection;
use crate::row::{self, Columns, Row};
use crate::values::{Numbers, bytes};

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

/// The criteria of the designs `first..=last`.
async fn range(
    connection: &mut Connection<'_>,
    first: i64,
    last: i64,
) -> Result<Vec<CriteriaRow>, Error> {
    let query = sqlx::query!(
        r#"SELECT design AS "design: u64", simulable AS "simulable: bool", reason,
                  responses AS "responses: Numbers", seal
           FROM criteria WHERE design BETWEEN ? AND ? ORDER BY design"#,
        first,
        last,
    );
    let rows = connection.all(query).await?;
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

pub(crate) async fn all(connection: &mut Connection<'_>) -> Result<Vec<CriteriaRow>, Error> {
    range(connection, 0, i64::MAX).await
}

/// Stores the criteria of a design and returns whether they were new.
pub(crate) async fn insert(
    connection: &mut Connection<'_>,
    row: &CriteriaRow,
    origin: Option<i64>,
) -> Result<bool, Error> {
    let seal = row::seal(row)?;
    let design = row.design.cast_signed();
    let responses = row.responses.as_deref().map(bytes);
    let query = sqlx::query!(
        "INSERT INTO criteria (design, simulable, reason, responses, seal, origin)
         VALUES (?, ?, ?, ?, ?, ?) ON CONFLICT DO NOTHING",
        design,
        row.simulable,
        row.reason,
        responses,
        seal,
        origin,
    );
    if connection.execute(query).await? > 0 {
        return Ok(true);
    }
    row::agree(range(connection, design, design).await?.pop(), row)?;
    Ok(false)
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
