//! Rows that are stored together.

use ledger::StreamId;

use crate::Error;
use crate::blocks::SampleBlock;
use crate::connection::Connection;
use crate::criteria::CriteriaRow;
use crate::derived::Derivation;
use crate::evaluations::EvaluationRow;
use crate::failures::FailureRow;
use crate::origins::OriginRow;
use crate::receipt::Receipt;
use crate::runs::OptimiserRunRow;
use crate::times::JobTimeRow;
use crate::{criteria, derived, evaluations, failures, generations, origins, runs, samples, times};

/// Rows that are stored together or not at all.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Batch {
    /// Criteria of designs.
    pub criteria: Vec<CriteriaRow>,
    /// Samples of designs, optima and infill points.
    pub samples: Vec<SampleBlock>,
    /// Optimiser runs.
    pub runs: Vec<OptimiserRunRow>,
    /// Evaluations of optimiser runs.
    pub evaluations: Vec<EvaluationRow>,
    /// Costs of jobs.
    pub times: Vec<JobTimeRow>,
    /// Derivations of the optimiser runs.
    pub derivations: Vec<Derivation>,
    /// Failures. They are appended, except those stored already under the same worker and number.
    pub failures: Vec<FailureRow>,
    /// The stream and the generation of these results, if they may be out of date. They are stored
    /// only if that generation was the last one given to
    /// [`Store::put_generations`](crate::Store::put_generations).
    pub only_for: Option<(StreamId, u64)>,
    /// The worker that computed these rows.
    pub origin: Option<OriginRow>,
}

impl Batch {
    /// Appends the rows of another batch, which must not have an `only_for` of its own, and must be of the same origin.
    pub fn append(&mut self, mut other: Self) {
        self.criteria.append(&mut other.criteria);
        self.samples.append(&mut other.samples);
        self.runs.append(&mut other.runs);
        self.evaluations.append(&mut other.evaluations);
        self.times.append(&mut other.times);
        self.derivations.append(&mut other.derivations);
        self.failures.append(&mut other.failures);
        self.only_for = self.only_for.take().or(other.only_for);
        self.origin = self.origin.take().or(other.origin);
    }

    /// The number of rows of all kinds, with a row for each sample.
    pub fn len(&self) -> usize {
        let samples = self.samples.iter().map(|block| block.samples.len());
        self.criteria.len()
            + samples.sum::<usize>()
            + self.runs.len()
            + self.evaluations.len()
            + self.times.len()
            + self.failures.len()
    }

    /// Whether there is nothing to store.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// Stores all batches, or returns an error, after which the caller rolls back to its savepoint.
/// Returns one receipt per batch, in order. A row that two batches contain counts as new for the
/// first.
pub(crate) async fn insert(
    connection: &mut Connection<'_>,
    batches: &[&Batch],
) -> Result<Vec<Receipt>, Error> {
    let mut receipts = vec![Receipt::default(); batches.len()];
    let mut current = Vec::new();
    for (owner, batch) in batches.iter().enumerate() {
        if generations::is_stale(connection, batch.only_for).await? {
            receipts[owner].is_stale = true;
        } else {
            let origin = match &batch.origin {
                Some(origin) => Some(origins::number(connection, origin).await?),
                None => None,
            };
            insert_rows(connection, batch, origin, &mut receipts[owner]).await?;
            current.push((owner, origin, *batch));
        }
    }
    // For all batches at once, since a statement costs more than a row: most batches have a design's criteria, its
    // samples and their time. Samples of neighbouring batches share a block.
    let criteria: Vec<_> = current
        .iter()
        .flat_map(|(owner, origin, batch)| batch.criteria.iter().map(|row| (*owner, *origin, row)))
        .collect();
    criteria::insert(connection, &criteria, &mut receipts).await?;
    let samples: Vec<_> = current
        .iter()
        .map(|(owner, origin, batch)| (*owner, *origin, &*batch.samples))
        .collect();
    samples::insert(connection, &samples, &mut receipts).await?;
    let times: Vec<_> = current
        .iter()
        .flat_map(|(_, _, batch)| &batch.times)
        .collect();
    times::insert_jobs(connection, &times).await?;
    Ok(receipts)
}

/// Stores everything but criteria, samples and times.
async fn insert_rows(
    connection: &mut Connection<'_>,
    batch: &Batch,
    origin: Option<i64>,
    receipt: &mut Receipt,
) -> Result<(), Error> {
    for row in &batch.runs {
        receipt.count(runs::insert(connection, row, origin).await?);
    }
    for row in &batch.evaluations {
        receipt.count(evaluations::insert(connection, row, origin).await?);
    }
    for row in &batch.derivations {
        derived::replace(connection, row).await?;
    }
    for row in &batch.failures {
        receipt.count(failures::insert(connection, row).await?);
    }
    Ok(())
}
