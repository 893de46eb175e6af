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
    /// How far the exact constraints are missed; while only models of the constraints are known, 0.
    pub violation: f64,
    /// How many samples it gets.
    pub samples: u64,
    /// Whether it got none, as the round after found: it failed, or it is [ruled out](Self::is_ruled_out).
    pub failed: bool,
}

impl InfillRow {
    /// Whether the simulator was asked for the point's constraints and one is broken.
    #[must_use]
    pub fn is_ruled_out(&self) -> bool {
        self.failed && self.violation > 0.0
    }

    /// Whether it got no samples for another reason than a broken constraint.
    #[must_use]
    pub fn has_failed(&self) -> bool {
        self.failed && self.violation <= 0.0
    }
}

/// An earlier point that got no samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unsampled {
    /// [`InfillRow::infill`] of the point.
    pub infill: u64,
    /// How far it misses the constraints, as far as is known.
    pub violation: f64,
}

/// A round as it is written: what it decided, the points it asks for, and which earlier points got no
/// samples.
#[derive(Debug, Clone, PartialEq)]
pub struct NewRound {
    /// What it decided.
    pub row: RoundRow,
    /// Its points.
    pub infill: Vec<InfillRow>,
    /// The points before it that got no samples.
    pub failed: Vec<Unsampled>,
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
        failed.retain_mut(|point| {
            let mut unsampled = new.failed.iter();
            let Some(unsampled) = unsampled.find(|one| one.infill == point.infill) else {
                return false;
            };
            (point.failed, point.violation) = (true, unsampled.violation);
            true
        });
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
        "DELETE FROM evaluation WHERE stream IN (SELECT name FROM infill)",
        "DELETE FROM infill",
        "DELETE FROM enrichment_round",
    ] {
        connection.run(REMOVING, statement).await?;
    }
    Ok(())
}
