//! The removal of results that a user does not trust.

use std::collections::BTreeSet;

use ledger::StreamId;

use crate::Error;
use crate::blocks::Streams;
use crate::connection::Connection;
use crate::derived::{self, DerivedResult};
use crate::values::StreamKey;
use crate::{criteria, evaluations, failures, origins, runs, samples, tally};

/// The results to remove.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Discard {
    /// Samples, criteria and recorded failures of the design with this number.
    Design(u32),
    /// All results of the worker with this name, or of all workers on this host: a process (`MACHINE:PROCESS`) or a
    /// machine.
    Worker(String),
}

/// Numbers of removed rows.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct RemovedRows {
    /// Samples of designs, optima and infill points.
    pub samples: u64,
    /// Designs whose criteria were removed.
    pub criteria: u64,
    /// Evaluations of candidates, including later ones of the same run.
    pub evaluations: u64,
    /// Runs of optimisers.
    pub runs: u64,
}

/// Removes results, or only counts them if `is_trial`. Results derived from them are found to be outdated at the next
/// start.
pub(crate) async fn discard(
    connection: &mut Connection<'_>,
    what: &Discard,
    is_trial: bool,
) -> Result<RemovedRows, Error> {
    connection.run("SAVEPOINT discard").await?;
    let removed = match what {
        Discard::Design(design) => of_design(connection, *design).await?,
        Discard::Worker(name) => of_worker(connection, name).await?,
    };
    if is_trial {
        connection.run("ROLLBACK TO discard").await?;
    }
    connection.run("RELEASE discard").await?;
    Ok(removed)
}

async fn of_design(connection: &mut Connection<'_>, design: u32) -> Result<RemovedRows, Error> {
    let stream = StreamId::design(design);
    let held = tally::of(connection, [stream]).await?;
    samples::remove(connection, Streams::One(stream)).await?;
    // The failures concern removed results, for example a contradiction of two workers.
    failures::remove_of(connection, stream).await?;
    Ok(RemovedRows {
        samples: held.values().map(|tally| tally.samples).sum(),
        criteria: criteria::remove_of_design(connection, design).await?,
        ..RemovedRows::default()
    })
}

async fn of_worker(connection: &mut Connection<'_>, name: &str) -> Result<RemovedRows, Error> {
    let mut origins = origins::all(connection).await?;
    let is_machine = |host: &str| {
        let parts = host.rsplit_once(':');
        parts.is_some_and(|(machine, _)| machine == name)
    };
    origins.retain(|(_, row)| row.worker == name || row.host == name || is_machine(&row.host));
    let origins: BTreeSet<i64> = origins.into_iter().map(|(origin, _)| origin).collect();
    let mut removed = RemovedRows::default();
    for origin in origins {
        removed.samples += samples::remove_from(connection, origin).await?;
        removed.criteria += criteria::remove_from(connection, origin).await?;
        for (stream, first) in evaluations::first_from(connection, origin).await? {
            removed.evaluations += evaluations::remove(connection, stream, first).await?;
            removed.runs += remove_run(connection, stream).await?;
        }
        let query = sqlx::query!(
            r#"SELECT stream AS "stream: StreamKey" FROM optimiser_run WHERE origin = ?"#,
            origin
        );
        for run in connection.all(query).await? {
            removed.runs += remove_run(connection, run.stream.0).await?;
        }
    }
    Ok(removed)
}

async fn remove_run(connection: &mut Connection<'_>, stream: StreamId) -> Result<u64, Error> {
    derived::remove_named(connection, &DerivedResult::Run(stream)).await?;
    runs::remove(connection, stream).await
}
