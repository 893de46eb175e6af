//! Rounds of infill points.

use crate::Error;
use crate::connection::Connection;
use crate::insert::REMOVING;
use crate::keyed::{self, Table};
use crate::rows::Receipt;

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
    /// Its variables, in the order of [`DesignRow::x`](crate::DesignRow::x).
    pub x: Vec<f64>,
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
    connection: &mut Connection<'_>,
    new: &NewRound,
) -> Result<Receipt, Error> {
    new.row.check()?;
    new.infill.iter().try_for_each(Table::check)?;
    keyed::write(connection, "INSERT INTO", "", &[&new.row]).await?;
    for point in &new.infill {
        keyed::write(connection, "INSERT INTO", "", &[point]).await?;
    }
    if !new.failed.is_empty() {
        let mut failed: Vec<InfillRow> = keyed::all(connection).await?;
        failed.retain(|point| new.failed.contains(&point.infill));
        failed.iter_mut().for_each(|point| point.failed = true);
        keyed::replace(connection, &failed).await?;
    }
    Ok(Receipt {
        new_rows: 1 + new.infill.len() as u64,
        ..Receipt::default()
    })
}

/// Removes all rounds with their points and the samples of those.
pub(crate) async fn clear(connection: &mut Connection<'_>) -> Result<(), Error> {
    for statement in [
        "DELETE FROM verify_sample WHERE approach IN (SELECT name FROM infill)",
        "DELETE FROM verify_tally WHERE approach IN (SELECT name FROM infill)",
        "DELETE FROM stream_generation WHERE stream IN (SELECT name FROM infill)",
        "DELETE FROM infill",
        "DELETE FROM enrichment_round",
    ] {
        connection.run(REMOVING, statement).await?;
    }
    Ok(())
}
