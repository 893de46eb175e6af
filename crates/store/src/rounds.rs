//! Rounds of infill.

use ledger::StreamId;

use crate::Error;
use crate::blocks::Streams;
use crate::connection::Connection;
use crate::generations;
use crate::infill::{self, InfillRow};
use crate::models::{self, ModelRow};
use crate::receipt::Receipt;
use crate::row::{self, Columns, Row};
use crate::samples;

/// The decision of one round of infill.
#[derive(Debug, Clone, PartialEq)]
pub struct RoundRow {
    /// The round, from 0.
    pub round: u64,
    /// The largest expected improvement of any observation; `None` without a model.
    pub expected_improvement: Option<f64>,
    /// The best design so far, as JSON; `None` without a model or a feasible design.
    pub recommendation_json: Option<String>,
    /// Why the enrichment ends, as JSON; `None` while it continues.
    pub stop_json: Option<String>,
    /// Remarks on the round, as JSON.
    pub notes_json: String,
    /// Number of calls of the simulator made by the search for points.
    pub simulator_calls: u64,
    /// Processor time of the decision, in seconds.
    pub cpu_seconds: f64,
}

impl Row for RoundRow {
    const TABLE: &'static str = "enrichment_round";

    fn key(&self) -> String {
        format!("round {}", self.round)
    }

    fn add_to(&self, columns: &mut Columns) {
        columns
            .count("round", self.round)
            .option(self.expected_improvement, |to, value| {
                to.number("expected_improvement", value)
            })
            .option(self.recommendation_json.as_deref(), Columns::text)
            .option(self.stop_json.as_deref(), Columns::text)
            .text(&self.notes_json)
            .count("simulator_calls", self.simulator_calls)
            .number("cpu_seconds", self.cpu_seconds);
    }
}

/// An earlier point that got no samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UnsampledPoint {
    /// [`InfillRow::infill`] of the point.
    pub infill: u64,
    /// Its constraint violation, as far as it is known.
    pub violation: f64,
}

/// A round to be stored.
#[derive(Debug, Clone, PartialEq)]
pub struct NewRound {
    /// The decision of the round.
    pub row: RoundRow,
    /// The points of the round.
    pub infill: Vec<InfillRow>,
    /// The earlier points that got no samples.
    pub failed: Vec<UnsampledPoint>,
    /// With the last round: the model of the DoE and all points.
    pub model: Option<ModelRow>,
}

pub(crate) async fn all(connection: &mut Connection<'_>) -> Result<Vec<RoundRow>, Error> {
    let query = sqlx::query!(
        r#"SELECT round AS "round: u64", expected_improvement, recommendation_json, stop_json,
                  notes_json, simulator_calls AS "simulator_calls: u64", cpu_seconds, seal
           FROM enrichment_round ORDER BY round"#
    );
    let rows = connection.all(query).await?;
    rows.into_iter()
        .map(|row| {
            let round = RoundRow {
                round: row.round,
                expected_improvement: row.expected_improvement,
                recommendation_json: row.recommendation_json,
                stop_json: row.stop_json,
                notes_json: row.notes_json,
                simulator_calls: row.simulator_calls,
                cpu_seconds: row.cpu_seconds,
            };
            connection.check(round, row.seal)
        })
        .collect()
}

async fn insert_row(connection: &mut Connection<'_>, row: &RoundRow) -> Result<(), Error> {
    let seal = row::seal(row)?;
    let [round, calls] = [row.round, row.simulator_calls].map(u64::cast_signed);
    let query = sqlx::query!(
        "INSERT INTO enrichment_round (round, expected_improvement, recommendation_json, stop_json,
             notes_json, simulator_calls, cpu_seconds, seal)
         VALUES (?, ?, ?, ?, ?, ?, ?, ?)",
        round,
        row.expected_improvement,
        row.recommendation_json,
        row.stop_json,
        row.notes_json,
        calls,
        row.cpu_seconds,
        seal,
    );
    connection.execute(query).await.map(drop)
}

/// Stores a round with its points, and marks the earlier points that it found to have failed.
pub(crate) async fn insert(
    connection: &mut Connection<'_>,
    new: &NewRound,
) -> Result<Receipt, Error> {
    insert_row(connection, &new.row).await?;
    for point in &new.infill {
        infill::insert(connection, point).await?;
    }
    if let Some(model) = &new.model {
        models::replace(connection, model).await?;
    }
    for mut point in infill::all(connection).await? {
        let mut failed = new.failed.iter();
        if let Some(unsampled) = failed.find(|one| one.infill == point.infill) {
            (point.failed, point.violation) = (true, unsampled.violation);
            infill::mark(connection, &point).await?;
        }
    }
    Ok(Receipt::new(1 + new.infill.len() as u64))
}

/// Removes a round with its points and their samples. The points that it found to have failed are open again.
pub(crate) async fn remove(connection: &mut Connection<'_>, round: u64) -> Result<(), Error> {
    for mut point in infill::all(connection).await? {
        if point.round == round {
            let stream = StreamId::point(point.number);
            samples::remove(connection, Streams::One(stream)).await?;
            generations::forget(connection, stream).await?;
        } else if point.round + 1 == round && point.failed {
            point.failed = false;
            infill::mark(connection, &point).await?;
        }
    }
    infill::remove(connection, round).await?;
    models::remove(connection, ModelRow::ENRICHED).await?;
    let round = round.cast_signed();
    let query = sqlx::query!("DELETE FROM enrichment_round WHERE round = ?", round);
    connection.execute(query).await.map(drop)
}
