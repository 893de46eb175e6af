//! Counts and digests of the samples of each stream, which are known without reading the samples.

use std::collections::BTreeMap;

use ledger::StreamId;

use crate::Error;
use crate::blocks::{SampleBlock, StoredBlock, Streams};
use crate::connection::Connection;
use crate::digest::SamplesDigest;
use crate::row::{self, Columns, Row};
use crate::values::{StreamKey, key, list};

/// Counts and digest of a stream's samples, known without reading the samples.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct SampleTally {
    /// The number of samples.
    pub samples: u64,
    /// The number of failed samples.
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

    /// Counts the samples of a block.
    pub(crate) fn count(&mut self, block: &SampleBlock) {
        self.samples += block.samples.len() as u64;
        self.failed += block.samples.failed() as u64;
        self.last = self.last.max(block.end() - 1);
    }

    /// Counts the samples of a block and adds them to the digest.
    pub(crate) fn add(&mut self, block: &SampleBlock) {
        self.count(block);
        for (sample, values) in block.indexed() {
            self.digest += SamplesDigest::of(block.stream.index, sample, values);
        }
    }

    /// The counts without the digest.
    fn counts(self) -> (u64, u64, u64) {
        (self.samples, self.failed, self.last)
    }
}

/// The tally of a stream.
pub(crate) struct TallyRow {
    pub(crate) stream: StreamId,
    pub(crate) tally: SampleTally,
}

impl Row for TallyRow {
    const TABLE: &'static str = "sample_tally";

    fn key(&self) -> String {
        self.stream.to_string()
    }

    fn add_to(&self, columns: &mut Columns) {
        columns
            .stream(self.stream)
            .count("samples", self.tally.samples)
            .count("last_sample", self.tally.last)
            .count("failed", self.tally.failed);
        for limb in self.tally.digest.limbs() {
            columns.bits(limb);
        }
    }
}

/// A row of the table as it is read.
struct Stored {
    stream: StreamKey,
    samples: u64,
    last_sample: u64,
    failed: u64,
    digest: SamplesDigest,
    seal: i64,
}

/// The tallies of streams.
pub(crate) async fn all(
    connection: &mut Connection<'_>,
    streams: Streams,
) -> Result<BTreeMap<StreamId, SampleTally>, Error> {
    let (first, last) = streams.keys();
    let query = sqlx::query_as!(
        Stored,
        r#"SELECT stream AS "stream: StreamKey", samples AS "samples: u64",
                  last_sample AS "last_sample: u64", failed AS "failed: u64",
                  digest AS "digest: SamplesDigest", seal
           FROM sample_tally WHERE stream BETWEEN ? AND ?"#,
        first,
        last,
    );
    let rows = connection.all(query).await?;
    checked(connection, rows)
}

/// The tallies of these streams. A stream without samples has none.
pub(crate) async fn of(
    connection: &mut Connection<'_>,
    streams: impl IntoIterator<Item = StreamId>,
) -> Result<BTreeMap<StreamId, SampleTally>, Error> {
    let streams = list(streams.into_iter().map(key));
    let query = sqlx::query_as!(
        Stored,
        r#"SELECT stream AS "stream: StreamKey", samples AS "samples: u64",
                  last_sample AS "last_sample: u64", failed AS "failed: u64",
                  digest AS "digest: SamplesDigest", seal
           FROM sample_tally WHERE stream IN (SELECT value FROM json_each(?))"#,
        streams,
    );
    let rows = connection.all(query).await?;
    checked(connection, rows)
}

fn checked(
    connection: &Connection<'_>,
    rows: Vec<Stored>,
) -> Result<BTreeMap<StreamId, SampleTally>, Error> {
    rows.into_iter()
        .map(|row| {
            let tally = SampleTally {
                samples: row.samples,
                failed: row.failed,
                last: row.last_sample,
                digest: row.digest,
            };
            let stream = row.stream.0;
            let checked = connection.check(TallyRow { stream, tally }, row.seal)?;
            Ok((checked.stream, checked.tally))
        })
        .collect()
}

/// Stores tallies of streams, in the transaction that stores their samples.
pub(crate) async fn replace(
    connection: &mut Connection<'_>,
    tallies: &[TallyRow],
) -> Result<(), Error> {
    let seals = tallies.iter().map(row::seal);
    let seals = seals.collect::<Result<Vec<i64>, Error>>()?;
    let rows: Vec<_> = tallies.iter().zip(seals).collect();
    let statement = [
        "INSERT OR REPLACE INTO sample_tally (stream, samples, last_sample, failed, digest, seal) ",
        "",
    ];
    connection
        .insert_many(statement, &rows, |values, (row, seal)| {
            values
                .push_bind(key(row.stream))
                .push_bind(row.tally.samples.cast_signed())
                .push_bind(row.tally.last.cast_signed())
                .push_bind(row.tally.failed.cast_signed())
                .push_bind(row.tally.digest.to_bytes().to_vec())
                .push_bind(*seal);
        })
        .await
}

pub(crate) async fn remove(connection: &mut Connection<'_>, streams: Streams) -> Result<(), Error> {
    let (first, last) = streams.keys();
    let query = sqlx::query!(
        "DELETE FROM sample_tally WHERE stream BETWEEN ? AND ?",
        first,
        last
    );
    connection.execute(query).await.map(drop)
}

/// The digest of all samples of the tallies.
pub(crate) fn sum<'t>(tallies: impl IntoIterator<Item = &'t SampleTally>) -> SamplesDigest {
    let mut sum = SamplesDigest::default();
    tallies.into_iter().for_each(|tally| sum += tally.digest);
    sum
}

/// Compares the counts of the samples that were read with their tallies: a block that is missing, or that was added
/// by another program, changes them.
pub(crate) fn compare(
    connection: &Connection<'_>,
    tallies: &BTreeMap<StreamId, SampleTally>,
    counted: &BTreeMap<StreamId, SampleTally>,
) -> Result<(), Error> {
    for stream in tallies.keys().chain(counted.keys()) {
        let [acknowledged, counted] = [tallies, counted]
            .map(|tallies| tallies.get(stream).copied().unwrap_or_default().counts());
        if acknowledged == counted {
            continue;
        }
        let in_words =
            |(samples, failed, last)| format!("{samples} up to number {last}, {failed} failed");
        let detail = format!(
            "the stored samples ({}) are not those that were acknowledged ({})",
            in_words(counted),
            in_words(acknowledged)
        );
        let row = format!("one of {stream}");
        return Err(connection.damaged_rows(StoredBlock::TABLE, row, &detail));
    }
    Ok(())
}
