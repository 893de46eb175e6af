//! The samples of designs, optima and infill points. A row of their table holds a block of consecutive samples of one
//! stream.

use std::path::Path;

use ledger::{Kind, StreamId};

use crate::Error;
use crate::connection::Connection;
use crate::keyed::{self, Table as _, Value};
use crate::rows::{Batch, Receipt};
use crate::tables::{differ, number};
use crate::tally::{self, Tallies};

/// Maximum number of samples in a row, as the schema also enforces. It bounds the memory of a
/// reader.
const LONGEST: usize = 4096;

/// Consecutive samples of one stream.
#[derive(Debug, Clone, PartialEq)]
pub struct SampleBlock {
    /// The design, optimum or infill point.
    pub stream: StreamId,
    /// Index of the first sample.
    pub first_sample: u64,
    /// The sampled response. An infinite value stands for a sample that failed.
    pub samples: Vec<f64>,
}

impl SampleBlock {
    /// The index after the last sample.
    #[must_use]
    pub fn end(&self) -> u64 {
        self.first_sample.saturating_add(self.samples.len() as u64)
    }

    /// The samples with their indices.
    pub fn indexed(&self) -> impl Iterator<Item = (u64, f64)> {
        (self.first_sample..self.end()).zip(self.samples.iter().copied())
    }

    /// Refuses samples that SQLite would not return unchanged.
    pub(crate) fn check(&self) -> Result<(), Error> {
        let last = self
            .first_sample
            .saturating_add((self.samples.len() as u64).saturating_sub(1));
        if i64::try_from(last).is_err() {
            let column = "sample_block.first_sample".to_owned();
            return Err(Error::TooLarge {
                column,
                value: last,
            });
        }
        // An infinite one stands for a failed sample.
        match self.indexed().find(|(_, value)| value.is_nan()) {
            None => Ok(()),
            Some((sample, value)) => Err(Error::NotFinite {
                column: "sample_block.samples".to_owned(),
                key: format!("sample {sample} of {}", self.stream),
                value,
            }),
        }
    }
}

/// A sample that a batch offers.
#[derive(Debug, Clone, Copy)]
struct Offered {
    /// The index of the batch's receipt.
    owner: usize,
    stream: StreamId,
    sample: u64,
    value: f64,
}

impl Offered {
    fn place(&self) -> (StreamId, u64) {
        (self.stream, self.sample)
    }
}

/// Stores the new samples of batches, updates the receipt of each batch, and adds the samples to
/// the tallies.
pub(crate) async fn insert(
    connection: &mut Connection<'_>,
    batches: &[&Batch],
    receipts: &mut [Receipt],
) -> Result<(), Error> {
    let mut offered: Vec<Offered> = Vec::new();
    for (owner, batch) in batches.iter().enumerate() {
        for block in &batch.samples {
            let stream = block.stream;
            offered.extend(block.indexed().map(|(sample, value)| Offered {
                owner,
                stream,
                sample,
                value,
            }));
        }
    }
    if offered.is_empty() {
        return Ok(());
    }
    // The sort is stable: a sample in two batches counts as new for the first.
    offered.sort_by_key(Offered::place);
    refuse_unknown_designs(connection, &offered).await?;
    let held = held(connection, &offered).await?;
    let fresh = fresh(&held, &offered, receipts)?;
    let mut tallies = Tallies::default();
    fresh.iter().for_each(|block| tallies.add(block));
    write(connection, &fresh).await?;
    tallies.write(connection).await
}

async fn refuse_unknown_designs(
    connection: &mut Connection<'_>,
    offered: &[Offered],
) -> Result<(), Error> {
    let of_each = offered.chunk_by(|a, b| a.stream == b.stream);
    let designs = of_each.filter_map(|of_one| {
        let stream = of_one.first()?.stream;
        (stream.kind == Kind::Design).then(|| format!("[{}]", stream.index))
    });
    let designs = format!("[{}]", designs.collect::<Vec<_>>().join(","));
    let unknown = connection
        .optional(
            "look for designs",
            sqlx::query!(
                r#"SELECT of.value ->> 0 AS "design!: i64" FROM json_each(?) AS of
                   WHERE of.value ->> 0 NOT IN (SELECT design FROM design) LIMIT 1"#,
                designs,
            ),
        )
        .await?;
    match unknown {
        None => Ok(()),
        Some(row) => Err(Error::UnknownDesign {
            design: row.design.cast_unsigned(),
        }),
    }
}

/// The offered samples that are not stored yet. Both inputs are sorted.
fn fresh(
    held: &[SampleBlock],
    offered: &[Offered],
    receipts: &mut [Receipt],
) -> Result<Vec<SampleBlock>, Error> {
    let held = held.iter().flat_map(|block| {
        let of_block = block.indexed();
        of_block.map(|(sample, value)| ((block.stream, sample), value))
    });
    let mut held = held.peekable();
    let mut fresh = Vec::new();
    let mut last = None;
    for one in offered {
        while held.next_if(|(place, _)| *place < one.place()).is_some() {}
        let mut known = held.peek().into_iter().chain(&last);
        if let Some((_, known)) = known.find(|(place, _)| *place == one.place()) {
            agree(*known, one)?;
            receipts[one.owner].duplicate_rows += 1;
        } else {
            append(&mut fresh, one.stream, one.sample, one.value);
            last = Some((one.place(), one.value));
            receipts[one.owner].new_rows += 1;
        }
    }
    Ok(fresh)
}

/// The stored blocks between the first and last offered sample of each stream. The samples are
/// sorted.
async fn held(
    connection: &mut Connection<'_>,
    offered: &[Offered],
) -> Result<Vec<SampleBlock>, Error> {
    let of_each = offered.chunk_by(|a, b| a.stream == b.stream);
    let spans = of_each.filter_map(|of_one| {
        let (first, last) = (of_one.first()?, of_one.last()?);
        let key = first.stream.key();
        Some(format!("[{key},{},{}]", first.sample, last.sample))
    });
    let spans = format!("[{}]", spans.collect::<Vec<_>>().join(","));
    // The first block that may overlap is the last one that begins at or before the first sample.
    let filter = "WHERE (stream, first_sample) IN (
        SELECT held.stream, held.first_sample
        FROM json_each(?) AS span CROSS JOIN sample_block AS held
        WHERE held.stream = span.value ->> 0
          AND held.first_sample <= span.value ->> 2
          AND held.first_sample >= coalesce(
                (SELECT max(first_sample) FROM sample_block
                 WHERE stream = span.value ->> 0 AND first_sample <= span.value ->> 1), 0)
          AND held.first_sample + length(held.samples) / 8 > span.value ->> 1)";
    keyed::all_where(connection, filter, &[Value::Text(&spans)]).await
}

fn agree(held: f64, offered: &Offered) -> Result<(), Error> {
    match differ(held, offered.value) {
        None => Ok(()),
        Some((held, value)) => Err(Error::Conflict {
            stream: offered.stream,
            sample: offered.sample,
            held,
            offered: value,
        }),
    }
}

/// Appends a sample to the last block, or begins a new one. Samples arrive in order.
fn append(blocks: &mut Vec<SampleBlock>, stream: StreamId, sample: u64, value: f64) {
    let value = number(value);
    match blocks.last_mut() {
        Some(block)
            if (block.stream, block.end()) == (stream, sample) && block.samples.len() < LONGEST =>
        {
            block.samples.push(value);
        }
        _ => blocks.push(SampleBlock {
            stream,
            first_sample: sample,
            samples: vec![value],
        }),
    }
}

/// Inserts blocks with one statement: the values as one byte array, and the place of each block in
/// it.
async fn write(connection: &mut Connection<'_>, blocks: &[SampleBlock]) -> Result<(), Error> {
    if blocks.is_empty() {
        return Ok(());
    }
    let mut values = Vec::new();
    let mut places = Vec::with_capacity(blocks.len());
    for block in blocks {
        let (from, length, seal) = (values.len() + 1, 8 * block.samples.len(), block.seal());
        let (key, first) = (block.stream.key(), block.first_sample);
        places.push(format!("[{key},{first},{seal},{from},{length}]"));
        values.extend(block.samples.iter().flat_map(|value| value.to_le_bytes()));
    }
    let places = format!("[{}]", places.join(","));
    let query = sqlx::query!(
        "INSERT INTO sample_block (stream, first_sample, seal, samples)
         SELECT value ->> 0, value ->> 1, value ->> 2, substr(?1, value ->> 3, value ->> 4)
         FROM json_each(?2)",
        values,
        places,
    );
    connection.insert(SampleBlock::NAME, query).await.map(drop)
}

/// Which streams are meant.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Of {
    /// The designs of the DoE.
    Designs,
    /// One stream.
    One(StreamId),
    /// All.
    All,
}

impl Of {
    /// The least and the greatest key.
    pub(crate) fn keys(self) -> (u64, u64) {
        match self {
            Self::Designs => (0, StreamId::point(0).key() - 1),
            Self::One(stream) => (stream.key(), stream.key()),
            Self::All => (0, i64::MAX.cast_unsigned()),
        }
    }
}

/// Passes the blocks of streams to `visit`, ordered by stream and sample, and compares them with the tallies of the
/// same moment.
pub(crate) async fn visit<E: From<Error>>(
    connection: &mut Connection<'_>,
    of: Of,
    mut visit: impl FnMut(&SampleBlock) -> Result<(), E>,
) -> Result<(), E> {
    let mut moment = connection.moment().await?;
    let path = moment.shared_path();
    let mut next = None;
    let mut found = Tallies::default();
    let (first, last) = of.keys();
    let keys = keyed::arguments(&moment, &[Value::Bits(first), Value::Bits(last)])?;
    let each = |block: SampleBlock| {
        if next.is_some_and(|next| (block.stream, block.first_sample) < next) {
            return Err(overlap(&path, &block).into());
        }
        next = Some((block.stream, block.end()));
        found.add(&block);
        visit(&block)
    };
    keyed::visit(&mut moment, "WHERE stream BETWEEN ? AND ?", keys, each).await?;
    tally::compare(&mut moment, of, &found).await?;
    Ok(moment.commit().await?)
}

/// The samples of one stream, as (index, value).
pub(crate) async fn of_stream(
    connection: &mut Connection<'_>,
    stream: StreamId,
) -> Result<Vec<(u64, f64)>, Error> {
    let mut samples = Vec::new();
    visit(connection, Of::One(stream), |block| {
        samples.extend(block.indexed());
        Ok::<(), Error>(())
    })
    .await?;
    Ok(samples)
}

/// Removes the samples of streams, and counts them.
pub(crate) async fn remove(connection: &mut Connection<'_>, of: Of) -> Result<(), Error> {
    let (first, last) = of.keys();
    for statement in [
        "DELETE FROM sample_block WHERE stream BETWEEN ? AND ?",
        "DELETE FROM sample_tally WHERE stream BETWEEN ? AND ?",
    ] {
        let query = sqlx::query(statement).bind(first.cast_signed());
        connection
            .execute(crate::derived::REMOVING, query.bind(last.cast_signed()))
            .await?;
    }
    Ok(())
}

/// Removes the samples that failed, and returns their number.
pub(crate) async fn remove_failed(connection: &mut Connection<'_>) -> Result<u64, Error> {
    let mut removed = 0;
    for (stream, tally) in tally::all(connection, Of::All).await? {
        if tally.failed == 0 {
            continue;
        }
        removed += tally.failed;
        let mut kept = Vec::new();
        for (sample, value) in of_stream(connection, stream).await? {
            if value.is_finite() {
                append(&mut kept, stream, sample, value);
            }
        }
        remove(connection, Of::One(stream)).await?;
        write(connection, &kept).await?;
        let mut tallies = Tallies::default();
        kept.iter().for_each(|block| tallies.add(block));
        tallies.write(connection).await?;
    }
    Ok(removed)
}

fn overlap(path: &Path, block: &SampleBlock) -> Error {
    let detail = "it overlaps the block before it: something else than this program has written it";
    Error::damaged_rows(path, SampleBlock::NAME, block.name(), detail)
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
            samples: samples.to_vec(),
        }
    }

    /// The seal fits, so the block was written by a fault of this program or by another program
    /// that seals.
    #[tokio::test]
    async fn a_block_that_overlaps_another_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("campaign.db");
        filled(&path, 10).await;
        let options = crate::open::writing(&path);
        let path = path.as_path().into();
        let mut connection = Connection::open(&options, &path).await.unwrap();
        write(&mut connection, &[block(9, &[1.0, 1.0])])
            .await
            .unwrap();
        connection.close().await.unwrap();
        let error = Store::open_read_only(&path).await.unwrap_err().to_string();
        let place = "table sample_block, row first_sample 9 of design-0: it overlaps";
        assert!(error.contains(place), "{error}");
    }

    #[test]
    fn what_is_held_or_came_before_is_not_fresh() {
        let offered = [(0, 4), (1, 4), (0, 5), (1, 6), (1, 8)].map(|(owner, sample)| Offered {
            owner,
            stream: StreamId::design(0),
            sample,
            value: sample as f64,
        });
        let mut receipts = [Receipt::default(); 2];
        let held = [block(2, &[2.0, 3.0]), block(5, &[5.0])];
        let fresh = fresh(&held, &offered, &mut receipts).unwrap();
        assert_eq!(
            fresh,
            [block(4, &[4.0]), block(6, &[6.0]), block(8, &[8.0])]
        );
        let counts = receipts.map(|receipt| (receipt.new_rows, receipt.duplicate_rows));
        assert_eq!(counts, [(1, 1), (2, 1)]);
    }
}
