//! Counts and digests of samples and failures, which are known without reading the rows.

use std::collections::BTreeMap;

use ledger::StreamId;

use crate::Error;
use crate::cause::cause;
use crate::connection::Connection;
use crate::digest::SamplesDigest;
use crate::keyed::Table as _;
use crate::query;
use crate::samples::{Of, SampleBlock};

/// What is known of a stream's samples without reading them.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct SampleTally {
    /// How many there are.
    pub samples: u64,
    /// How many of them failed.
    pub failed: u64,
    /// The highest index.
    pub(crate) last: u64,
    pub(crate) digest: SamplesDigest,
}

impl SampleTally {
    /// The digest of the samples, which does not depend on their order, as 64 hex digits.
    #[must_use]
    pub fn digest(&self) -> String {
        self.digest.to_hex()
    }

    fn add(&mut self, other: &Self) {
        self.samples += other.samples;
        self.failed += other.failed;
        self.last = self.last.max(other.last);
        self.digest += other.digest;
    }
}

/// The tallies of some samples: those of a batch, or all stored ones.
#[derive(Debug, Default)]
pub(crate) struct Tallies(BTreeMap<StreamId, SampleTally>);

impl Tallies {
    pub(crate) fn add(&mut self, block: &SampleBlock) {
        let tally = self.0.entry(block.stream).or_default();
        for (sample, value) in block.indexed() {
            tally.add(&SampleTally {
                samples: 1,
                failed: u64::from(value.is_infinite()),
                last: sample,
                digest: SamplesDigest::of(block.stream.index, sample, value),
            });
        }
    }

    /// Adds these tallies to those in the store, in the transaction that stored the samples.
    pub(crate) async fn write(mut self, connection: &mut Connection<'_>) -> Result<(), Error> {
        if self.0.is_empty() {
            return Ok(());
        }
        // Arrays of arrays: one statement for any number of streams, prepared once.
        let keys: Vec<String> = self
            .0
            .keys()
            .map(|stream| stream.key().to_string())
            .collect();
        let keys = format!("[{}]", keys.join(","));
        let query = sqlx::query!(
            "SELECT stream, samples, last_sample, failed, digest FROM sample_tally
             WHERE stream IN (SELECT value FROM json_each(?))",
            keys,
        );
        for row in connection.all(COUNTING, query).await? {
            let counts = [row.samples, row.last_sample, row.failed];
            let (stream, held) = read(connection, row.stream, counts, &row.digest)?;
            self.0.entry(stream).or_default().add(&held);
        }
        let mut digests = Vec::new();
        let mut rows = Vec::with_capacity(self.0.len());
        for (stream, tally) in &self.0 {
            let from = digests.len() + 1;
            digests.extend(tally.digest.to_bytes());
            let SampleTally {
                samples,
                failed,
                last,
                ..
            } = tally;
            rows.push(format!(
                "[{},{samples},{last},{failed},{from}]",
                stream.key()
            ));
        }
        let rows = format!("[{}]", rows.join(","));
        let query = sqlx::query!(
            "INSERT OR REPLACE INTO sample_tally (stream, samples, last_sample, failed, digest)
             SELECT value ->> 0, value ->> 1, value ->> 2, value ->> 3, substr(?1, value ->> 4, 32)
             FROM json_each(?2)",
            digests,
            rows,
        );
        connection.insert("sample_tally", query).await.map(drop)
    }
}

/// Completes "the database could not".
const COUNTING: &str = "count samples";

/// The stored tallies of streams.
pub(crate) async fn all(
    connection: &mut Connection<'_>,
    of: Of,
) -> Result<BTreeMap<StreamId, SampleTally>, Error> {
    let (first, last) = of.keys();
    let (first, last) = (first.cast_signed(), last.cast_signed());
    let query = sqlx::query!(
        "SELECT stream, samples, last_sample, failed, digest FROM sample_tally
         WHERE stream BETWEEN ? AND ?",
        first,
        last,
    );
    let rows = connection.all(COUNTING, query).await?;
    rows.into_iter()
        .map(|row| {
            let counts = [row.samples, row.last_sample, row.failed];
            read(connection, row.stream, counts, &row.digest)
        })
        .collect()
}

fn read(
    connection: &Connection<'_>,
    key: i64,
    [samples, last, failed]: [i64; 3],
    digest: &[u8],
) -> Result<(StreamId, SampleTally), Error> {
    let read = StreamId::from_key(query::index(key)).zip(SamplesDigest::from_blob(digest));
    let (stream, digest) = read.ok_or_else(|| {
        let row = format!("stream {key}");
        connection.damaged_rows(
            "sample_tally",
            row,
            "it has no digest of 32 bytes, or is of no stream",
        )
    })?;
    let tally = SampleTally {
        samples: query::index(samples),
        failed: query::index(failed),
        last: query::index(last),
        digest,
    };
    Ok((stream, tally))
}

/// The digest of all samples of the tallies.
pub(crate) fn sum<'t>(tallies: impl IntoIterator<Item = &'t SampleTally>) -> SamplesDigest {
    let mut sum = SamplesDigest::default();
    tallies.into_iter().for_each(|tally| sum += tally.digest);
    sum
}

/// Checks the samples of streams against their tallies.
pub(crate) async fn compare(
    connection: &mut Connection<'_>,
    of: Of,
    found: &Tallies,
) -> Result<(), Error> {
    let held = all(connection, of).await?;
    for stream in held.keys().chain(found.0.keys()) {
        let (held, found) = (held.get(stream), found.0.get(stream));
        if held == found {
            continue;
        }
        let in_words = |tally: Option<&SampleTally>| {
            let tally = tally.copied().unwrap_or_default();
            let SampleTally {
                samples,
                last,
                digest,
                ..
            } = tally;
            format!("{samples} up to number {last}, digest {}", digest.to_hex())
        };
        let detail = format!(
            "its samples ({}) are not those that were acknowledged ({})",
            in_words(found),
            in_words(held)
        );
        let row = format!("one of {stream}");
        return Err(connection.damaged_rows(SampleBlock::NAME, row, &detail));
    }
    Ok(())
}

/// Counts a commit, in the commit's own transaction.
pub(crate) async fn count_commit(connection: &mut Connection<'_>) -> Result<u64, Error> {
    connection
        .one(
            "count a commit",
            sqlx::query!("UPDATE commit_tally SET commits = commits + 1 RETURNING commits"),
        )
        .await
        .map(|r| query::index(r.commits))
}

/// Counts a failure, in the transaction that stored it.
pub(crate) async fn count_failure(
    connection: &mut Connection<'_>,
    kind: &str,
    error: &str,
    failure: i64,
) -> Result<(), Error> {
    let cause = cause(error);
    connection
        .insert(
            "failure_tally",
            sqlx::query!(
        "INSERT INTO failure_tally (kind, cause, failures, last_failure) VALUES (?, ?, 1, ?)
         ON CONFLICT DO UPDATE SET
            failures = failures + 1,
            last_failure = excluded.last_failure",
        kind,
        cause,
        failure,
    ),
        )
        .await?;
    Ok(())
}
