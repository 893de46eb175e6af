//! Crashes, failures and quarantines.

use std::collections::BTreeMap;

use ledger::{CrashRecord, History, StreamId};

use crate::Error;
use crate::cause::{cause, first_line};
use crate::connection::Connection;
use crate::row::{self, Columns, Row};
use crate::values::{StreamKey, key};

/// The kinds of event recorded against a job.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, sqlx::Type)]
#[sqlx(rename_all = "lowercase")]
pub enum FailureKind {
    /// The worker crashed while it held the stream.
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
    /// The first sample that failed, or that a crashed worker held; `None` for a failure of the stream as a whole.
    pub sample: Option<u32>,
    /// Whether the worker that crashed held other streams, too, any of which may be the cause.
    pub shared: bool,
    /// The number of the lease.
    pub lease: u32,
    /// The worker that had the lease.
    pub worker: String,
    /// The worker's own number of the failure. A second row with the same worker and number is not stored; rows
    /// without a number are always stored.
    pub serial: Option<u64>,
    /// The kind of the event.
    pub kind: FailureKind,
    /// The reported error.
    pub error: String,
    /// The time in milliseconds since 1970 (UTC), if the caller records it.
    pub at_unix_ms: Option<i64>,
}

/// A failure with its place in the order of the reports, which decides whether it came after a quarantine.
struct NumberedFailure {
    failure: i64,
    row: FailureRow,
}

impl Row for NumberedFailure {
    const TABLE: &'static str = "failure";

    fn key(&self) -> String {
        format!("failure {}", self.failure)
    }

    fn add_to(&self, columns: &mut Columns) {
        let row = &self.row;
        columns
            .bits(self.failure.cast_unsigned())
            .stream(row.stream)
            .option(row.sample, |columns, sample| columns.bits(sample.into()))
            .bits(row.shared.into())
            .bits(row.lease.into())
            .text(&row.worker)
            .option(row.serial, Columns::bits)
            .text(row.kind.as_str())
            .text(&row.error)
            .option(row.at_unix_ms.map(i64::cast_unsigned), Columns::bits);
    }
}

/// The failures of one kind with one cause.
struct Tally<'a> {
    kind: FailureKind,
    cause: &'a str,
    failures: u64,
    last_failure: i64,
}

impl Row for Tally<'_> {
    const TABLE: &'static str = "failure_tally";

    fn key(&self) -> String {
        format!("kind {}, cause {:?}", self.kind.as_str(), self.cause)
    }

    fn add_to(&self, columns: &mut Columns) {
        columns
            .text(self.kind.as_str())
            .text(self.cause)
            .count("failures", self.failures)
            .bits(self.last_failure.cast_unsigned());
    }
}

/// Failures of one kind with one cause.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FailureGroup {
    /// The kind of the failures.
    pub kind: FailureKind,
    /// The first line of the error with short paths and with `#` for numbers and random names, cut after 200 bytes:
    /// the part that the failures of the group have in common.
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
    let last = sqlx::query!(r#"SELECT coalesce(max(failure), 0) AS "failure!: i64" FROM failure"#);
    let failure = connection.one(last).await?.failure + 1;
    let row = row.clone();
    let numbered = NumberedFailure { failure, row };
    let (row, seal) = (&numbered.row, row::seal(&numbered)?);
    let (stream, serial) = (key(row.stream), row.serial.map(u64::cast_signed));
    let query = sqlx::query!(
        "INSERT INTO failure (failure, stream, sample, shared, lease, worker, serial, kind, error, at_unix_ms, seal)
         VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)
         ON CONFLICT (worker, serial) WHERE serial IS NOT NULL DO NOTHING",
        failure,
        stream,
        row.sample,
        row.shared,
        row.lease,
        row.worker,
        serial,
        row.kind,
        row.error,
        row.at_unix_ms,
        seal,
    );
    if connection.execute(query).await? == 0 {
        return Ok(false);
    }
    count(connection, &numbered).await?;
    Ok(true)
}

/// Counts a failure in the tally of its kind and cause.
async fn count(connection: &mut Connection<'_>, new: &NumberedFailure) -> Result<(), Error> {
    let (kind, cause) = (new.row.kind, cause(&new.row.error));
    let query = sqlx::query!(
        r#"SELECT failures AS "failures: u64", last_failure, seal
           FROM failure_tally WHERE kind = ? AND cause = ?"#,
        kind,
        cause,
    );
    let counted = match connection.optional(query).await? {
        None => 0,
        Some(row) => {
            let tally = Tally {
                kind,
                cause: &cause,
                failures: row.failures,
                last_failure: row.last_failure,
            };
            connection.check(tally, row.seal)?.failures
        }
    };
    let tally = Tally {
        kind,
        cause: &cause,
        failures: counted + 1,
        last_failure: new.failure,
    };
    let (seal, failures) = (row::seal(&tally)?, tally.failures.cast_signed());
    let query = sqlx::query!(
        "INSERT OR REPLACE INTO failure_tally (kind, cause, failures, last_failure, seal)
         VALUES (?, ?, ?, ?, ?)",
        kind,
        cause,
        failures,
        tally.last_failure,
        seal,
    );
    connection.execute(query).await.map(drop)
}

/// Removes the failures of a stream, and counts the others again.
pub(crate) async fn remove_of(
    connection: &mut Connection<'_>,
    stream: StreamId,
) -> Result<(), Error> {
    let all = numbered(connection).await?;
    let stream_key = key(stream);
    let tallies = sqlx::query!("DELETE FROM failure_tally");
    connection.execute(tallies).await?;
    let rows = sqlx::query!("DELETE FROM failure WHERE stream = ?", stream_key);
    connection.execute(rows).await?;
    for kept in all.iter().filter(|one| one.row.stream != stream) {
        count(connection, kept).await?;
    }
    Ok(())
}

pub(crate) async fn all(connection: &mut Connection<'_>) -> Result<Vec<FailureRow>, Error> {
    let numbered = numbered(connection).await?.into_iter();
    Ok(numbered.map(|one| one.row).collect())
}

async fn numbered(connection: &mut Connection<'_>) -> Result<Vec<NumberedFailure>, Error> {
    let query = sqlx::query!(
        r#"SELECT failure, stream AS "stream: StreamKey", sample AS "sample: u32", shared AS "shared: bool",
                  lease AS "lease: u32", worker, serial, kind AS "kind: FailureKind", error, at_unix_ms, seal
           FROM failure ORDER BY failure"#
    );
    let rows = connection.all(query).await?;
    let failures = rows.into_iter().map(|stored| {
        let row = FailureRow {
            stream: stored.stream.0,
            sample: stored.sample,
            shared: stored.shared,
            lease: stored.lease,
            worker: stored.worker,
            serial: stored.serial.map(i64::cast_unsigned),
            kind: stored.kind,
            error: stored.error,
            at_unix_ms: stored.at_unix_ms,
        };
        let failure = stored.failure;
        connection.check(NumberedFailure { failure, row }, stored.seal)
    });
    failures.collect()
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

/// The crashes and failures of each stream since it was last quarantined.
pub(crate) async fn histories(
    connection: &mut Connection<'_>,
) -> Result<BTreeMap<StreamId, History>, Error> {
    let mut histories: BTreeMap<StreamId, History> = BTreeMap::new();
    for row in all(connection).await? {
        let history = histories.entry(row.stream).or_default();
        match row.kind {
            FailureKind::Crash => {
                let crash = CrashRecord {
                    is_alone: !row.shared,
                    first: row.sample.unwrap_or(0),
                };
                history.crashes.insert(row.worker.as_str().into(), crash);
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
                  last_failure, failure_tally.seal AS "seal!: i64",
                  stream AS "stream: StreamKey", worker, error
           FROM failure_tally JOIN failure ON failure = last_failure
           ORDER BY failure_tally.kind, cause"#
    );
    let rows = connection.all(query).await?;
    let groups = rows.into_iter().map(|row| {
        let tally = Tally {
            kind: row.kind,
            cause: &row.cause,
            failures: row.failures,
            last_failure: row.last_failure,
        };
        let count = connection.check(tally, row.seal)?.failures;
        Ok(FailureGroup {
            kind: row.kind,
            cause: row.cause,
            count,
            last_error: first_line(&row.error).to_owned(),
            last_stream: row.stream.0,
            last_worker: row.worker,
        })
    });
    groups.collect()
}
