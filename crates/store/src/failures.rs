//! Crashes, failures and quarantines.

use std::collections::BTreeMap;

use ledger::{Death, History, StreamId};

use crate::Error;
use crate::cause::{cause, first_line};
use crate::connection::Connection;
use crate::values::{StreamKey, key};

/// The kinds of event recorded against a job.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, sqlx::Type)]
#[sqlx(rename_all = "lowercase")]
pub enum FailureKind {
    /// The worker died while it held the stream.
    Crash,
    /// The job returned an error.
    Failure,
    /// The job was quarantined.
    Quarantine,
}

impl FailureKind {
    /// The name of the kind in the table.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Crash => "crash",
            Self::Failure => "failure",
            Self::Quarantine => "quarantine",
        }
    }
}

/// One crash, failure or quarantine of a stream.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FailureRow {
    /// The stream.
    pub stream: StreamId,
    /// The first sample that failed, or that a dead worker held; `None` for a failure of the stream as a whole.
    pub sample: Option<u32>,
    /// Whether the worker that died held other streams, too, any of which may be the cause.
    pub shared: bool,
    /// The number of the lease.
    pub lease: u32,
    /// The worker that had the lease.
    pub worker: String,
    /// The worker's own number of the report. A second row with the same worker and number is not
    /// stored; rows without a number are always stored.
    pub serial: Option<u64>,
    /// The kind of the event.
    pub kind: FailureKind,
    /// The reported error.
    pub error: String,
    /// The time in milliseconds since 1970 (UTC), if the caller records it.
    pub at_unix_ms: Option<i64>,
}

/// Failures of one kind with one cause.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FailureGroup {
    /// The kind of the failures.
    pub kind: FailureKind,
    /// The first line of the error with `#` for numbers and random names and short paths, cut after
    /// 200 bytes: the part that the failures of the group have in common.
    pub cause: String,
    /// Number of failures in the group.
    pub count: u64,
    /// The first line of the latest error, with its numbers.
    pub last_error: String,
    /// The stream of the latest failure.
    pub last_stream: StreamId,
    /// The worker of the latest failure.
    pub last_worker: String,
}

/// Stores a failure and returns whether it was new.
pub(crate) async fn insert(
    connection: &mut Connection<'_>,
    row: &FailureRow,
) -> Result<bool, Error> {
    let (stream, serial) = (key(row.stream), row.serial.map(u64::cast_signed));
    let query = sqlx::query!(
        "INSERT INTO failure (stream, sample, shared, lease, worker, serial, kind, error, at_unix_ms)
         VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)
         ON CONFLICT (worker, serial) WHERE serial IS NOT NULL DO NOTHING
         RETURNING failure",
        stream,
        row.sample,
        row.shared,
        row.lease,
        row.worker,
        serial,
        row.kind,
        row.error,
        row.at_unix_ms,
    );
    let Some(stored) = connection.optional(query).await? else {
        return Ok(false);
    };
    let cause = cause(&row.error);
    let query = sqlx::query!(
        "INSERT INTO failure_tally (kind, cause, failures, last_failure) VALUES (?, ?, 1, ?)
         ON CONFLICT DO UPDATE SET
             failures = failures + 1,
             last_failure = excluded.last_failure",
        row.kind,
        cause,
        stored.failure,
    );
    connection.execute(query).await?;
    Ok(true)
}

pub(crate) async fn all(connection: &mut Connection<'_>) -> Result<Vec<FailureRow>, Error> {
    let query = sqlx::query!(
        r#"SELECT stream AS "stream: StreamKey", sample AS "sample: u32", shared AS "shared: bool", lease AS "lease: u32",
                  worker, serial, kind AS "kind: FailureKind", error, at_unix_ms
           FROM failure ORDER BY failure"#
    );
    let rows = connection.all(query).await?;
    let failures = rows.into_iter().map(|row| FailureRow {
        stream: row.stream.0,
        sample: row.sample,
        shared: row.shared,
        lease: row.lease,
        worker: row.worker,
        serial: row.serial.map(i64::cast_unsigned),
        kind: row.kind,
        error: row.error,
        at_unix_ms: row.at_unix_ms,
    });
    Ok(failures.collect())
}

/// Whether the failure with this number of its worker is stored.
pub(crate) async fn is_known(
    connection: &mut Connection<'_>,
    worker: &str,
    serial: u64,
) -> Result<bool, Error> {
    let serial = serial.cast_signed();
    let query = sqlx::query!(
        r#"SELECT EXISTS (SELECT 1 FROM failure WHERE worker = ? AND serial = ?) AS "known!: bool""#,
        worker,
        serial,
    );
    Ok(connection.one(query).await?.known)
}

/// The deaths and failures of each stream since it was last quarantined.
pub(crate) async fn histories(
    connection: &mut Connection<'_>,
) -> Result<BTreeMap<StreamId, History>, Error> {
    let mut histories: BTreeMap<StreamId, History> = BTreeMap::new();
    for row in all(connection).await? {
        let history = histories.entry(row.stream).or_default();
        match row.kind {
            FailureKind::Crash => {
                let death = Death {
                    is_alone: !row.shared,
                    first: row.sample.unwrap_or(0),
                };
                history.deaths.insert(row.worker.as_str().into(), death);
            }
            FailureKind::Failure => history.failures += 1,
            FailureKind::Quarantine => *history = History::default(),
        }
    }
    Ok(histories)
}

/// The failures, grouped and ordered by kind and then by cause.
pub(crate) async fn groups(connection: &mut Connection<'_>) -> Result<Vec<FailureGroup>, Error> {
    let query = sqlx::query!(
        r#"SELECT failure_tally.kind AS "kind: FailureKind", cause, failures AS "failures: u64",
                  stream AS "stream: StreamKey", worker, error
           FROM failure_tally JOIN failure ON failure = last_failure
           ORDER BY failure_tally.kind, cause"#
    );
    let rows = connection.all(query).await?;
    let groups = rows.into_iter().map(|row| FailureGroup {
        kind: row.kind,
        cause: row.cause,
        count: row.failures,
        last_error: first_line(&row.error).to_owned(),
        last_stream: row.stream.0,
        last_worker: row.worker,
    });
    Ok(groups.collect())
}
