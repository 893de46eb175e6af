//! The points of rounds of infill.

use crate::Error;
use crate::connection::Connection;
use crate::row::{self, Columns, Row};
use crate::values::{Numbers, bytes};

/// A point that a round adds.
#[derive(Debug, Clone, PartialEq)]
pub struct InfillRow {
    /// Number of the point over all rounds, from 0.
    pub infill: u64,
    /// The round.
    pub round: u64,
    /// Name of the point among those with samples of their own.
    pub name: String,
    /// Number of the point's random streams.
    pub number: u64,
    /// The reason why it was chosen.
    pub reason: String,
    /// Its variables, in the order of [`DesignRow::x`](crate::DesignRow::x).
    pub x: Vec<f64>,
    /// Constraint violation with exact constraints; 0 while only models of the constraints are
    /// known.
    pub violation: f64,
    /// Number of samples to be taken.
    pub samples: u64,
    /// Whether the point got no samples, as a later round found: it failed or is
    /// [ruled out](Self::is_ruled_out).
    pub failed: bool,
}

impl InfillRow {
    /// Whether the simulator evaluated the point's constraints and one is violated.
    #[must_use]
    pub fn is_ruled_out(&self) -> bool {
        self.failed && self.violation > 0.0
    }

    /// Whether the point got no samples for another reason than a violated constraint.
    #[must_use]
    pub fn has_failed(&self) -> bool {
        self.failed && self.violation <= 0.0
    }
}

impl Row for InfillRow {
    const TABLE: &'static str = "infill";

    fn key(&self) -> String {
        format!("infill {}", self.infill)
    }

    fn add_to(&self, columns: &mut Columns) {
        columns
            .count("infill", self.infill)
            .count("round", self.round)
            .text(&self.name)
            .count("number", self.number)
            .text(&self.reason)
            .numbers("x", &self.x)
            .number("violation", self.violation)
            .count("samples", self.samples)
            .bits(self.failed.into());
    }
}

pub(crate) async fn all(connection: &mut Connection<'_>) -> Result<Vec<InfillRow>, Error> {
    let query = sqlx::query!(
        r#"SELECT infill AS "infill: u64", round AS "round: u64", name, number AS "number: u64",
                  reason, x AS "x: Numbers", violation, samples AS "samples: u64",
                  failed AS "failed: bool", seal
           FROM infill ORDER BY infill"#
    );
    let rows = connection.all(query).await?;
    rows.into_iter()
        .map(|row| {
            let point = InfillRow {
                infill: row.infill,
                round: row.round,
                name: row.name,
                number: row.number,
                reason: row.reason,
                x: row.x.0,
                violation: row.violation,
                samples: row.samples,
                failed: row.failed,
            };
            connection.check(point, row.seal)
        })
        .collect()
}

/// Stores a new point.
pub(crate) async fn insert(connection: &mut Connection<'_>, row: &InfillRow) -> Result<(), Error> {
    let seal = row::seal(row)?;
    let [infill, round, number, samples] =
        [row.infill, row.round, row.number, row.samples].map(u64::cast_signed);
    let x = bytes(&row.x);
    let query = sqlx::query!(
        "INSERT INTO infill (infill, round, name, number, reason, x, violation, samples, failed, seal)
         VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
        infill,
        round,
        row.name,
        number,
        row.reason,
        x,
        row.violation,
        samples,
        row.failed,
        seal,
    );
    connection.execute(query).await.map(drop)
}

/// Stores whether a point has failed, and its constraint violation.
pub(crate) async fn mark(connection: &mut Connection<'_>, row: &InfillRow) -> Result<(), Error> {
    let seal = row::seal(row)?;
    let infill = row.infill.cast_signed();
    let query = sqlx::query!(
        "UPDATE infill SET violation = ?, failed = ?, seal = ? WHERE infill = ?",
        row.violation,
        row.failed,
        seal,
        infill,
    );
    connection.execute(query).await.map(drop)
}

/// Removes the points of a round.
pub(crate) async fn remove(connection: &mut Connection<'_>, round: u64) -> Result<(), Error> {
    let round = round.cast_signed();
    let query = sqlx::query!("DELETE FROM infill WHERE round = ?", round);
    connection.execute(query).await.map(drop)
}
