//! The samples of designs, optima and infill points. A row of their table holds a block of consecutive samples of one
//! stream.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt::Debug;

use ledger::{Kind, StreamId};
use stats::Samples;
use tokio_stream::StreamExt as _;

use crate::Error;
use crate::blocks::{SampleBlock, StoredBlock, Streams};
use crate::connection::Connection;
use crate::designs;
use crate::receipt::Receipt;
use crate::row::{self, Row};
use crate::tally::{self, SampleTally, TallyRow};
use crate::values::{Numbers, StreamKey, bytes, key, number};

/// Maximum number of values in a row of the table, as the schema also enforces. It bounds the memory of a
/// reader.
const LONGEST: usize = 4096;

/// A sample of a batch.
#[derive(Debug, Clone)]
struct Offer<'a> {
    /// The index of the batch's receipt.
    owner: usize,
    origin: Option<i64>,
    stream: StreamId,
    sample: u64,
    values: Cow<'a, [f64]>,
}

/// Stores the new samples of batches, each given with the index of its receipt and its origin, and updates the tallies.
pub(crate) async fn insert(
    connection: &mut Connection<'_>,
    batches: &[(usize, Option<i64>, &[SampleBlock])],
    receipts: &mut [Receipt],
) -> Result<(), Error> {
    let mut offers: Vec<Offer> = Vec::new();
    for (owner, origin, blocks) in batches {
        for block in *blocks {
            block.refuse_unstorable()?;
            offers.extend(block.indexed().map(|(sample, values)| Offer {
                owner: *owner,
                origin: *origin,
                stream: block.stream,
                sample,
                values: as_returned(values),
            }));
        }
    }
    if offers.is_empty() {
        return Ok(());
    }
    // The sort is stable: a sample in two batches counts as new for the first.
    offers.sort_by_key(|offer| (offer.stream, offer.sample));
    let by_stream: Vec<&[Offer]> = offers.chunk_by(|a, b| a.stream == b.stream).collect();
    let streams = || by_stream.iter().map(|offers| offers[0].stream);
    let tallies = tally::of(connection, streams()).await?;
    let new = streams().filter(|stream| !tallies.contains_key(stream));
    refuse_unknown_designs(connection, new).await?;
    let mut additions = Additions::default();
    for offers in by_stream {
        let stream = offers[0].stream;
        let tally = tallies.get(&stream).copied();
        let stored = match tally {
            Some(tally) => stored(connection, tally, offers).await?,
            None => Vec::new(),
        };
        let blocks = match fresh(&stored, offers, receipts) {
            Ok(blocks) => blocks,
            Err((sample, conflict)) => {
                return Err(named(connection, stream, sample, conflict).await?);
            }
        };
        additions.add(stream, tally.unwrap_or_default(), blocks);
    }
    additions.write(connection).await
}

/// The values as SQLite returns them.
fn as_returned(values: &[f64]) -> Cow<'_, [f64]> {
    let is_changed = |value: &&f64| number(**value).to_bits() != value.to_bits();
    match values.iter().any(|value| is_changed(&value)) {
        true => values.iter().copied().map(number).collect(),
        false => values.into(),
    }
}

/// The stored blocks that may have some of these samples of one stream, which are sorted.
async fn stored(
    connection: &mut Connection<'_>,
    tally: SampleTally,
    offers: &[Offer<'_>],
) -> Result<Vec<SampleBlock>, Error> {
    match offers {
        [first, ..] if first.sample <= tally.last => {
            let last = offers.last().unwrap_or(first);
            between(connection, first.stream, first.sample, last.sample).await
        }
        _ => Ok(Vec::new()),
    }
}

async fn refuse_unknown_designs(
    connection: &mut Connection<'_>,
    streams: impl Iterator<Item = StreamId>,
) -> Result<(), Error> {
    let designs = streams.filter(|stream| stream.kind == Kind::Design);
    match designs::first_unknown(connection, designs.map(|stream| stream.index)).await? {
        Some(design) => Err(Error::UnknownDesign { design }),
        None => Ok(()),
    }
}

/// A conflict with the name of the worker that computed the stored sample.
async fn named(
    connection: &mut Connection<'_>,
    stream: StreamId,
    sample: u64,
    mut conflict: Error,
) -> Result<Error, Error> {
    let (stream, sample) = (key(stream), sample.cast_signed());
    let query = sqlx::query!(
        "SELECT origin.worker FROM sample_block JOIN origin ON origin.origin = sample_block.origin
         WHERE stream = ? AND first_sample <= ? ORDER BY first_sample DESC LIMIT 1",
        stream,
        sample,
    );
    let of = connection.optional(query).await?;
    if let Error::Conflict { worker, .. } = &mut conflict {
        *worker = of.map(|of| of.worker);
    }
    Ok(conflict)
}

/// The offered samples that are not stored yet, as blocks, or the first that differs from the stored one. Both inputs
/// are sorted.
fn fresh(
    stored: &[SampleBlock],
    offers: &[Offer<'_>],
    receipts: &mut [Receipt],
) -> Result<Vec<StoredBlock>, (u64, Error)> {
    let same = |a: &[f64], b: &[f64]| {
        let bits = |values: &[f64]| {
            values
                .iter()
                .map(|value| value.to_bits())
                .collect::<Vec<_>>()
        };
        a.len() == b.len() && bits(a) == bits(b)
    };
    let mut stored = stored.iter().flat_map(SampleBlock::indexed).peekable();
    let mut fresh = Vec::new();
    let mut last = None;
    for offer in offers {
        while stored
            .next_if(|(sample, _)| *sample < offer.sample)
            .is_some()
        {}
        let mut known = stored.peek().into_iter().chain(&last);
        match known.find(|(sample, _)| *sample == offer.sample) {
            Some((_, values)) if same(values, &offer.values) => {
                receipts[offer.owner].count(false);
            }
            Some((_, values)) => {
                let row = format!("sample {} of {}", offer.sample, offer.stream);
                let values: [&dyn Debug; 2] = match (&**values, &*offer.values) {
                    ([stored], [offered]) => [stored, offered],
                    _ => [values, &offer.values],
                };
                let conflict = Error::conflict(StoredBlock::TABLE, row, values);
                return Err((offer.sample, conflict));
            }
            None => {
                append(
                    &mut fresh,
                    offer.stream,
                    offer.origin,
                    (offer.sample, &offer.values),
                );
                last = Some((offer.sample, &*offer.values));
                receipts[offer.owner].count(true);
            }
        }
    }
    Ok(fresh)
}

/// Appends a sample to the last block, or begins a new one. Samples arrive in order.
fn append(
    blocks: &mut Vec<StoredBlock>,
    stream: StreamId,
    origin: Option<i64>,
    (sample, values): (u64, &[f64]),
) {
    let width = values.len();
    let continues = |last: &StoredBlock| {
        let SampleBlock { samples, .. } = &last.block;
        let is_next = last.origin == origin && last.block.end() == sample;
        is_next && samples.width() == width && samples.values().len() + width <= LONGEST
    };
    match blocks.last_mut() {
        Some(last) if continues(last) => last.block.samples.push(values),
        _ => {
            let mut samples = Samples::none(width);
            samples.push(values);
            blocks.push(StoredBlock {
                block: SampleBlock {
                    stream,
                    first_sample: sample,
                    samples,
                },
                origin,
            });
        }
    }
}

/// New blocks, and the tallies that include them.
#[derive(Default)]
struct Additions {
    blocks: Vec<StoredBlock>,
    tallies: Vec<TallyRow>,
}

impl Additions {
    /// Adds new blocks of a stream. `tally` is the stream's tally without them.
    fn add(&mut self, stream: StreamId, mut tally: SampleTally, mut blocks: Vec<StoredBlock>) {
        if blocks.is_empty() {
            return;
        }
        blocks.iter().for_each(|stored| tally.add(&stored.block));
        self.blocks.append(&mut blocks);
        self.tallies.push(TallyRow { stream, tally });
    }

    async fn write(self, connection: &mut Connection<'_>) -> Result<(), Error> {
        insert_blocks(connection, &self.blocks).await?;
        tally::replace(connection, &self.tallies).await
    }
}

async fn insert_blocks(
    connection: &mut Connection<'_>,
    blocks: &[StoredBlock],
) -> Result<(), Error> {
    let seals = blocks.iter().map(row::seal);
    let seals = seals.collect::<Result<Vec<i64>, Error>>()?;
    let rows: Vec<_> = blocks.iter().zip(seals).collect();
    let statement = [
        "INSERT INTO sample_block (stream, first_sample, responses, samples, seal, origin) ",
        "",
    ];
    connection
        .insert_many(statement, &rows, |values, (stored, seal)| {
            let block = &stored.block;
            values
                .push_bind(key(block.stream))
                .push_bind(block.first_sample.cast_signed())
                .push_bind(block.samples.width() as i64)
                .push_bind(bytes(block.samples.values()))
                .push_bind(*seal)
                .push_bind(stored.origin);
        })
        .await
}

/// The stored blocks that may have samples `first..=last` of a stream.
async fn between(
    connection: &mut Connection<'_>,
    stream: StreamId,
    first: u64,
    last: u64,
) -> Result<Vec<SampleBlock>, Error> {
    let key = key(stream);
    let (first, last) = (first.cast_signed(), last.cast_signed());
    // The first block that may overlap is the last one that begins at or before the first sample.
    let query = sqlx::query!(
        r#"SELECT first_sample AS "first_sample!: u64", responses AS "responses: u32",
                  samples AS "samples: Numbers", seal, origin
           FROM sample_block
           WHERE stream = ?1 AND first_sample <= ?3 AND first_sample >= coalesce(
                 (SELECT max(first_sample) FROM sample_block
                  WHERE stream = ?1 AND first_sample <= ?2), 0)
           ORDER BY first_sample"#,
        key,
        first,
        last,
    );
    let rows = connection.all(query).await?;
    rows.into_iter()
        .map(|row| {
            let block = SampleBlock {
                stream,
                first_sample: row.first_sample,
                samples: read(row.responses, row.samples),
            };
            let origin = row.origin;
            Ok(connection
                .check(StoredBlock { block, origin }, row.seal)?
                .block)
        })
        .collect()
}

/// Passes the blocks of streams to `visit`, ordered by stream and sample, and compares their number with the tallies
/// of the same moment.
pub(crate) async fn visit<E: From<Error>>(
    connection: &mut Connection<'_>,
    streams: Streams,
    mut visit: impl FnMut(&SampleBlock) -> Result<(), E>,
) -> Result<(), E> {
    visit_stored(connection, streams, |stored| visit(&stored.block)).await
}

/// Like [`visit`], with the origins of the blocks.
pub(crate) async fn visit_stored<E: From<Error>>(
    connection: &mut Connection<'_>,
    streams: Streams,
    mut visit: impl FnMut(&StoredBlock) -> Result<(), E>,
) -> Result<(), E> {
    let mut moment = connection.moment().await?;
    let path = moment.shared_path();
    let tallies = tally::all(&mut moment, streams).await?;
    let mut counted: BTreeMap<StreamId, SampleTally> = BTreeMap::new();
    let (first, last) = streams.keys();
    let query = sqlx::query!(
        r#"SELECT stream AS "stream: StreamKey", first_sample AS "first_sample: u64",
                  responses AS "responses: u32", samples AS "samples: Numbers", seal, origin
           FROM sample_block WHERE stream BETWEEN ? AND ? ORDER BY stream, first_sample"#,
        first,
        last,
    );
    let mut rows = moment.stream(query);
    while let Some(row) = rows.next().await {
        let row = row?;
        let block = SampleBlock {
            stream: row.stream.0,
            first_sample: row.first_sample,
            samples: read(row.responses, row.samples),
        };
        let origin = row.origin;
        let stored = row::check(StoredBlock { block, origin }, row.seal, &path)?;
        let of = counted.entry(stored.block.stream).or_default();
        of.count(&stored.block);
        visit(&stored)?;
    }
    drop(rows);
    tally::compare(&moment, &tallies, &counted)?;
    Ok(moment.commit().await?)
}

/// The samples of a row of the table. Bytes that end within a sample are filled up with NaN, so that the row's digest
/// differs: NaN is never stored.
fn read(responses: u32, values: Numbers) -> Samples {
    let width = (responses as usize).max(1);
    let mut values = values.0;
    values.resize(values.len().next_multiple_of(width), f64::NAN);
    Samples::new(width, values).unwrap_or_else(|| Samples::none(width))
}

/// The blocks of one stream.
pub(crate) async fn of(
    connection: &mut Connection<'_>,
    stream: StreamId,
) -> Result<Vec<SampleBlock>, Error> {
    let mut blocks = Vec::new();
    visit(connection, Streams::One(stream), |block| {
        blocks.push(block.clone());
        Ok::<(), Error>(())
    })
    .await?;
    Ok(blocks)
}

/// Removes the samples of streams and their tallies.
pub(crate) async fn remove(connection: &mut Connection<'_>, streams: Streams) -> Result<(), Error> {
    let (first, last) = streams.keys();
    let query = sqlx::query!(
        "DELETE FROM sample_block WHERE stream BETWEEN ? AND ?",
        first,
        last
    );
    connection.execute(query).await?;
    tally::remove(connection, streams).await
}

/// Removes the samples that failed, and returns their number.
pub(crate) async fn remove_failed(connection: &mut Connection<'_>) -> Result<u64, Error> {
    let mut removed = 0;
    for (stream, tally) in tally::all(connection, Streams::All).await? {
        if tally.failed > 0 {
            let is_kept =
                |_: Option<i64>, values: &[f64]| values.iter().all(|value| value.is_finite());
            removed += retain(connection, stream, is_kept).await?;
        }
    }
    Ok(removed)
}

/// Removes the samples of this origin, and returns their number.
pub(crate) async fn remove_from(
    connection: &mut Connection<'_>,
    origin: i64,
) -> Result<u64, Error> {
    let query = sqlx::query!(
        r#"SELECT DISTINCT stream AS "stream: StreamKey" FROM sample_block WHERE origin = ?"#,
        origin
    );
    let mut removed = 0;
    for row in connection.all(query).await? {
        let is_kept = |of: Option<i64>, _: &[f64]| of != Some(origin);
        removed += retain(connection, row.stream.0, is_kept).await?;
    }
    Ok(removed)
}

/// Removes the samples of a stream that `is_kept` refuses, given the origin and the values, and returns their number.
async fn retain(
    connection: &mut Connection<'_>,
    stream: StreamId,
    is_kept: impl Fn(Option<i64>, &[f64]) -> bool,
) -> Result<u64, Error> {
    let (mut kept, mut removed) = (Vec::new(), 0);
    visit_stored(connection, Streams::One(stream), |stored| {
        for (sample, values) in stored.block.indexed() {
            if is_kept(stored.origin, values) {
                append(&mut kept, stream, stored.origin, (sample, values));
            } else {
                removed += 1;
            }
        }
        Ok::<(), Error>(())
    })
    .await?;
    remove(connection, Streams::One(stream)).await?;
    let mut additions = Additions::default();
    additions.add(stream, SampleTally::default(), kept);
    additions.write(connection).await?;
    Ok(removed)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::open::tests::filled;
    use crate::store::Store;

    fn block(first_sample: u64, samples: &[f64]) -> SampleBlock {
        SampleBlock {
            stream: StreamId::design(0),
            first_sample,
            samples: samples.to_vec().into(),
        }
    }

    fn stored(first_sample: u64, samples: &[f64]) -> StoredBlock {
        let block = block(first_sample, samples);
        StoredBlock {
            block,
            origin: None,
        }
    }

    /// The digest fits, so the block was written by a fault of this program or by another program
    /// that computes it.
    #[tokio::test]
    async fn a_block_that_was_never_acknowledged_is_found() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("campaign.db");
        filled(&path, 10).await;
        let options = crate::open::writing(&path);
        let path = path.as_path().into();
        let mut connection = Connection::open(&options, &path).await.unwrap();
        insert_blocks(&mut connection, &[stored(9, &[1.0, 1.0])])
            .await
            .unwrap();
        connection.close().await.unwrap();
        let error = Store::open_read_only(&path).await.unwrap_err().to_string();
        let place =
            "table sample_block, row one of design-0: the stored samples (12 up to number 10";
        assert!(error.contains(place), "{error}");
    }

    #[test]
    fn what_is_stored_or_came_before_is_not_fresh() {
        let offers = [(0, 4), (1, 4), (0, 5), (1, 6), (1, 8)].map(|(owner, sample)| Offer {
            owner,
            origin: None,
            stream: StreamId::design(0),
            sample,
            values: vec![sample as f64].into(),
        });
        let mut receipts = [Receipt::default(); 2];
        let held = [block(2, &[2.0, 3.0]), block(5, &[5.0])];
        let fresh = fresh(&held, &offers, &mut receipts).unwrap();
        assert_eq!(
            fresh,
            [stored(4, &[4.0]), stored(6, &[6.0]), stored(8, &[8.0])]
        );
        let counts = receipts.map(|receipt| (receipt.new_rows, receipt.duplicate_rows));
        assert_eq!(counts, [(1, 1), (2, 1)]);
    }
}
