//! Rounds of infill points.

use ledger::StreamId;

use crate::Error;
use crate::connection::Connection;
use crate::derived::{self, Derivation, REMOVING};
use crate::keyed::{self, Table, Value};
use crate::rows::{ModelRow, Receipt};
use crate::samples::{self, Of};

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
    /// Whether the point got no samples, as found by a later round: it failed or is
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

/// An earlier point that got no samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unsampled {
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
    pub failed: Vec<Unsampled>,
    /// With the last round: the model of the DoE and all points.
    pub model: Option<ModelRow>,
}

pub(crate) async fn insert(
    connection: &mut Connection<'_>,
    new: &NewRound,
    derivation: &Derivation,
) -> Result<Receipt, Error> {
    new.row.check()?;
    new.infill.iter().try_for_each(Table::check)?;
    keyed::write(connection, "INSERT INTO", "", &[&new.row]).await?;
    for point in &new.infill {
        keyed::write(connection, "INSERT INTO", "", &[point]).await?;
    }
    if let Some(model) = &new.model {
        keyed::replace(connection, std::slice::from_ref(model)).await?;
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
    derived::derivations(connection, std::slice::from_ref(derivation)).await?;
    Ok(Receipt {
        new_rows: 1 + new.infill.len() as u64,
        ..Receipt::default()
    })
}

/// Removes a round with its points and their samples. The points that it found to have failed are open again.
pub(crate) async fn remove(connection: &mut Connection<'_>, round: u64) -> Result<(), Error> {
    let of_round = async |connection: &mut Connection<'_>, round: u64| {
        keyed::all_where(connection, "WHERE round = ?", &[Value::Count(round)]).await
    };
    let points: Vec<InfillRow> = of_round(connection, round).await?;
    for point in points {
        let stream = StreamId::point(point.number);
        samples::remove(connection, Of::One(stream)).await?;
        derived::forget_stream(connection, stream).await?;
    }
    let number = round.cast_signed();
    let query = sqlx::query!("DELETE FROM infill WHERE round = ?", number);
    connection.execute(REMOVING, query).await?;
    derived::remove_model(connection, ModelRow::ENRICHED).await?;
    let query = sqlx::query!("DELETE FROM enrichment_round WHERE round = ?", number);
    connection.execute(REMOVING, query).await?;
    if let Some(before) = round.checked_sub(1) {
        let mut points: Vec<InfillRow> = of_round(connection, before).await?;
        points.iter_mut().for_each(|point| point.failed = false);
        keyed::replace(connection, &points).await?;
    }
    Ok(())
}
