//! Rounds of infill points.

use std::path::Path;

use sqlx::Executor as _;
use sqlx::sqlite::{SqliteConnection, SqlitePool};

use crate::Error;
use crate::query::index;
use crate::rows::Receipt;
use crate::tables::{finite, fits, number};

/// What one round of infill decided.
#[derive(Debug, Clone, PartialEq)]
pub struct RoundRow {
    /// The round, from 0.
    pub round: u64,
    /// The most that was expected of any observation, in µm; `None` where no model could tell.
    pub expected_improvement_um: Option<f64>,
    /// The best design so far, as JSON; `None` without a model or a feasible design.
    pub recommendation_json: Option<String>,
    /// Why the enrichment ends, as JSON; `None` while it goes on.
    pub stop_json: Option<String>,
    /// What is to be known of the round, as JSON.
    pub notes_json: String,
    /// Analyses that the search for points took.
    pub simulator_calls: u64,
    /// Processor time of the decision, in seconds.
    pub cpu_seconds: f64,
}

/// A point that a round asked for.
#[derive(Debug, Clone, PartialEq)]
pub struct InfillRow {
    /// Counts over all rounds, from 0.
    pub infill: u64,
    /// The round.
    pub round: u64,
    /// Its name among the verified points.
    pub name: String,
    /// The number of its random streams.
    pub number: u64,
    /// Why it was chosen.
    pub reason: String,
    /// Its variables, in the order of [`DesignRow::point`](crate::DesignRow::point).
    pub x: [f64; 6],
    /// How far the exact constraints are missed.
    pub violation: f64,
    /// How many samples it gets.
    pub samples: u64,
    /// Whether they were given up, as the round after found.
    pub failed: bool,
}

/// A round as it is written: what it decided, the points it asks for, and which earlier points
/// (by [`InfillRow::infill`]) it found to have failed.
#[derive(Debug, Clone, PartialEq)]
pub struct NewRound {
    /// What it decided.
    pub row: RoundRow,
    /// Its points.
    pub infill: Vec<InfillRow>,
    /// The points before it that have failed.
    pub failed: Vec<u64>,
}

pub(crate) async fn insert(
    connection: &mut SqliteConnection,
    path: &Path,
    new: &NewRound,
) -> Result<Receipt, Error> {
    check(new)?;
    let row = &new.row;
    let round = row.round.cast_signed();
    let expected = row.expected_improvement_um.map(number);
    let simulator_calls = row.simulator_calls.cast_signed();
    let cpu_seconds = number(row.cpu_seconds);
    sqlx::query!(
        "INSERT INTO enrichment_round
            (round, expected_improvement_um, recommendation_json, stop_json, notes_json,
             simulator_calls, cpu_seconds)
         VALUES (?, ?, ?, ?, ?, ?, ?)",
        round,
        expected,
        row.recommendation_json,
        row.stop_json,
        row.notes_json,
        simulator_calls,
        cpu_seconds,
    )
    .execute(&mut *connection)
    .await
    .map_err(|e| Error::insertion("enrichment_round", path, e))?;
    for point in &new.infill {
        let [x_p, x_r, ha0_p, ha0_r, hf0_p, hf0_r] = point.x.map(number);
        let infill = point.infill.cast_signed();
        let round = point.round.cast_signed();
        let stream = point.number.cast_signed();
        let violation = number(point.violation);
        let samples = point.samples.cast_signed();
        sqlx::query!(
            "INSERT INTO infill
                (infill, round, name, number, reason, x_p, x_r, ha0_p, ha0_r, hf0_p, hf0_r,
                 violation, samples, failed)
             VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
            infill,
            round,
            point.name,
            stream,
            point.reason,
            x_p,
            x_r,
            ha0_p,
            ha0_r,
            hf0_p,
            hf0_r,
            violation,
            samples,
            point.failed,
        )
        .execute(&mut *connection)
        .await
        .map_err(|e| Error::insertion("infill", path, e))?;
    }
    for &failed in &new.failed {
        let infill = failed.cast_signed();
        sqlx::query!("UPDATE infill SET failed = 1 WHERE infill = ?", infill)
            .execute(&mut *connection)
            .await
            .map_err(|e| Error::insertion("infill", path, e))?;
    }
    Ok(Receipt {
        new_rows: 1 + new.infill.len() as u64,
        ..Receipt::default()
    })
}

/// Refuses what SQLite would not give back as it was.
fn check(new: &NewRound) -> Result<(), Error> {
    let row = &new.row;
    let key = || format!("round {}", row.round);
    fits("enrichment_round.round", row.round)?;
    fits("enrichment_round.simulator_calls", row.simulator_calls)?;
    finite(
        "enrichment_round.expected_improvement_um",
        key,
        row.expected_improvement_um.unwrap_or(0.0),
    )?;
    finite("enrichment_round.cpu_seconds", key, row.cpu_seconds)?;
    for point in &new.infill {
        let key = || format!("\"{}\"", point.name);
        fits("infill.infill", point.infill)?;
        fits("infill.round", point.round)?;
        fits("infill.number", point.number)?;
        fits("infill.samples", point.samples)?;
        finite("infill.violation", key, point.violation)?;
        for value in point.x {
            finite("infill.x", key, value)?;
        }
    }
    Ok(())
}

/// Removes all rounds with their points and the samples of those.
pub(crate) async fn clear(connection: &mut SqliteConnection, path: &Path) -> Result<(), Error> {
    for statement in [
        "DELETE FROM verify_sample WHERE approach IN (SELECT name FROM infill)",
        "DELETE FROM verify_tally WHERE approach IN (SELECT name FROM infill)",
        "DELETE FROM stream_generation WHERE stream IN (SELECT name FROM infill)",
        "DELETE FROM infill",
        "DELETE FROM enrichment_round",
    ] {
        connection
            .execute(statement)
            .await
            .map_err(|e| Error::sqlite("remove derived rows", path, e))?;
    }
    Ok(())
}

pub(crate) async fn rounds(pool: &SqlitePool, path: &Path) -> Result<Vec<RoundRow>, Error> {
    let rows = sqlx::query!(
        "SELECT round, expected_improvement_um, recommendation_json, stop_json, notes_json,
                simulator_calls, cpu_seconds
         FROM enrichment_round ORDER BY round"
    )
    .fetch_all(pool)
    .await
    .map_err(|e| Error::sqlite("read rounds", path, e))?;
    Ok(rows
        .into_iter()
        .map(|r| RoundRow {
            round: index(r.round),
            expected_improvement_um: r.expected_improvement_um,
            recommendation_json: r.recommendation_json,
            stop_json: r.stop_json,
            notes_json: r.notes_json,
            simulator_calls: index(r.simulator_calls),
            cpu_seconds: r.cpu_seconds,
        })
        .collect())
}

pub(crate) async fn infill(pool: &SqlitePool, path: &Path) -> Result<Vec<InfillRow>, Error> {
    let rows = sqlx::query!(
        r#"SELECT infill, round, name, number, reason, x_p, x_r, ha0_p, ha0_r, hf0_p, hf0_r,
                  violation, samples, failed AS "failed: bool"
           FROM infill ORDER BY infill"#
    )
    .fetch_all(pool)
    .await
    .map_err(|e| Error::sqlite("read infill points", path, e))?;
    Ok(rows
        .into_iter()
        .map(|r| InfillRow {
            infill: index(r.infill),
            round: index(r.round),
            name: r.name,
            number: index(r.number),
            reason: r.reason,
            x: [r.x_p, r.x_r, r.ha0_p, r.ha0_r, r.hf0_p, r.hf0_r],
            violation: r.violation,
            samples: index(r.samples),
            failed: r.failed,
        })
        .collect())
}
