//! The samples of the DoE. A row of their table holds a range of consecutive samples of one design.

use std::path::Path;

use crate::Error;
use crate::connection::Connection;
use crate::digest::SamplesDigest;
use crate::keyed::{self, Table as _, Value};
use crate::rows::{Batch, Receipt, SampleRow};
use crate::tables::{differ, number};
use crate::tally::{self, Tally};

/// Maximum number of samples in a row, as the schema also enforces. It bounds the memory of a
/// reader.
const LONGEST: usize = 4096;

/// Consecutive samples of one design.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct SampleRange {
    pub(crate) design: u64,
    pub(crate) first_sample: u64,
    /// 64 bits per sample, little-endian.
    pub(crate) samples: Vec<u8>,
}

impl SampleRange {
    fn values(&self) -> &[[u8; 8]] {
        self.samples.as_chunks().0
    }

    /// The index after the last sample.
    pub(crate) fn end(&self) -> u64 {
        self.first_sample.saturating_add(self.values().len() as u64)
    }

    pub(crate) fn rows(&self) -> impl Iterator<Item = SampleRow> {
        let samples = self.first_sample..self.end();
        samples.zip(self.values()).map(|(sample, value)| SampleRow {
            design: self.design,
            sample,
            value: f64::from_le_bytes(*value),
        })
    }
}

/// Refuses a sample that SQLite would not return unchanged.
pub(crate) fn check(row: &SampleRow) -> Result<(), Error> {
    for (column, value) in [("design", row.design), ("sample", row.sample)] {
        if i64::try_from(value).is_err() {
            let column = column.to_owned();
            return Err(Error::TooLarge { column, value });
        }
    }
    // An infinite one stands for a failed sample.
    if !row.value.is_nan() {
        return Ok(());
    }
    Err(Error::NotFinite {
        column: "value".to_owned(),
        key: format!("sample {} of design {}", row.sample, row.design),
        value: row.value,
    })
}

/// Stores the new samples of batches, updates the receipt of each batch, and adds the samples to
/// the tally.
pub(crate) async fn insert(
    connection: &mut Connection<'_>,
    batches: &[&Batch],
    receipts: &mut [Receipt],
    tally: &mut Tally,
) -> Result<(), Error> {
    let mut offered: Vec<(usize, SampleRow)> = Vec::new();
    for (owner, batch) in batches.iter().enumerate() {
        offered.extend(batch.samples.iter().map(|row| (owner, *row)));
    }
    if offered.is_empty() {
        return Ok(());
    }
    // The sort is stable: a sample in two batches counts as new for the first.
    offered.sort_by_key(|(_, row)| key(row));
    let held = held(connection, &offered).await?;
    let fresh = fresh(&held, &offered, receipts)?;
    fresh.iter().for_each(|range| tally.add_range(range));
    write(connection, &fresh).await
}

fn key(row: &SampleRow) -> (u64, u64) {
    (row.design, row.sample)
}

/// The offered samples that are not stored yet. Both inputs are sorted.
fn fresh(
    held: &[SampleRange],
    offered: &[(usize, SampleRow)],
    receipts: &mut [Receipt],
) -> Result<Vec<SampleRange>, Error> {
    let mut held = held.iter().flat_map(SampleRange::rows).peekable();
    let mut fresh = Vec::new();
    let mut last: Option<&SampleRow> = None;
    for (owner, row) in offered {
        while held.next_if(|held| key(held) < key(row)).is_some() {}
        let mut known = held.peek().into_iter().chain(last);
        if let Some(known) = known.find(|known| key(known) == key(row)) {
            agree(known, row)?;
            receipts[*owner].duplicate_rows += 1;
        } else {
            append(&mut fresh, row);
            last = Some(row);
            receipts[*owner].new_rows += 1;
        }
    }
    Ok(fresh)
}

/// The stored ranges between the first and last offered sample of each design. The samples are
/// sorted.
async fn held(
    connection: &mut Connection<'_>,
    offered: &[(usize, SampleRow)],
) -> Result<Vec<SampleRange>, Error> {
    let designs = offered.chunk_by(|(_, a), (_, b)| a.design == b.design);
    let spans = designs.filter_map(|rows| {
        let ((_, first), (_, last)) = (rows.first()?, rows.last()?);
        Some(format!(
            "[{},{},{}]",
            first.design, first.sample, last.sample
        ))
    });
    let spans = format!("[{}]", spans.collect::<Vec<_>>().join(","));
    // The first range that may overlap is the last one that begins at or before the first sample.
    let filter = "WHERE (design, first_sample) IN (
        SELECT held.design, held.first_sample
        FROM json_each(?) AS span CROSS JOIN sample_range AS held
        WHERE held.design = span.value ->> 0
          AND held.first_sample <= span.value ->> 2
          AND held.first_sample >= coalesce(
                (SELECT max(first_sample) FROM sample_range
                 WHERE design = span.value ->> 0 AND first_sample <= span.value ->> 1), 0)
          AND held.first_sample + length(held.samples) / 8 > span.value ->> 1)";
    keyed::all_where(connection, filter, &[Value::Text(&spans)]).await
}

fn agree(held: &SampleRow, offered: &SampleRow) -> Result<(), Error> {
    match differ(held.value, offered.value) {
        None => Ok(()),
        Some((held, value)) => Err(Error::Conflict {
            design: offered.design,
            sample: offered.sample,
            held,
            offered: value,
        }),
    }
}

/// Appends a sample to the last range, or begins a new one. Samples arrive in order.
fn append(ranges: &mut Vec<SampleRange>, row: &SampleRow) {
    let value = number(row.value).to_le_bytes();
    match ranges.last_mut() {
        Some(range)
            if (range.design, range.end()) == (row.design, row.sample)
                && range.values().len() < LONGEST =>
        {
            range.samples.extend(value);
        }
        _ => ranges.push(SampleRange {
            design: row.design,
            first_sample: row.sample,
            samples: value.to_vec(),
        }),
    }
}

/// Inserts ranges with one statement: the values as one byte array, and the place of each range in
/// it.
pub(crate) async fn write(
    connection: &mut Connection<'_>,
    ranges: &[SampleRange],
) -> Result<(), Error> {
    if ranges.is_empty() {
        return Ok(());
    }
    let mut values = Vec::new();
    let mut places = Vec::with_capacity(ranges.len());
    for range in ranges {
        let SampleRange {
            design,
            first_sample,
            samples,
        } = range;
        let (from, length, seal) = (values.len() + 1, samples.len(), range.seal());
        places.push(format!("[{design},{first_sample},{seal},{from},{length}]"));
        values.extend_from_slice(samples);
    }
    let places = format!("[{}]", places.join(","));
    let query = sqlx::query!(
        "INSERT INTO sample_range (design, first_sample, seal, samples)
         SELECT value ->> 0, value ->> 1, value ->> 2, substr(?1, value ->> 3, value ->> 4)
         FROM json_each(?2)",
        values,
        places,
    );
    connection.insert(SampleRange::NAME, query).await.map(drop)
}

/// Passes every sample to `visit`, and compares the samples with the tallies of the same moment.
pub(crate) async fn visit<E: From<Error>>(
    connection: &mut Connection<'_>,
    mut visit: impl FnMut(SampleRow) -> Result<(), E>,
) -> Result<(), E> {
    let mut moment = connection.moment().await?;
    let mut found = Tally::default();
    ranges(&mut moment, None, |range| {
        found.add_range(range);
        range.rows().try_for_each(&mut visit)
    })
    .await?;
    tally::compare(&mut moment, &found).await?;
    Ok(moment.commit().await?)
}

/// The samples that have not failed.
pub(crate) async fn finite(connection: &mut Connection<'_>) -> Result<Vec<SampleRange>, Error> {
    let mut kept = Vec::new();
    let keep = |row: SampleRow| {
        if row.value.is_finite() {
            append(&mut kept, &row);
        }
        Ok::<(), Error>(())
    };
    visit(connection, keep).await?;
    Ok(kept)
}

/// The samples of one design, as (index, value).
pub(crate) async fn of_design(
    connection: &mut Connection<'_>,
    design: u64,
) -> Result<Vec<(u64, f64)>, Error> {
    let mut samples = Vec::new();
    ranges(connection, Some(design), |range| {
        samples.extend(range.rows().map(|row| (row.sample, row.value)));
        Ok::<(), Error>(())
    })
    .await?;
    Ok(samples)
}

/// The digest computed from the stored samples.
pub(crate) async fn recompute(connection: &mut Connection<'_>) -> Result<SamplesDigest, Error> {
    let mut found = Tally::default();
    ranges(connection, None, |range| {
        found.add_range(range);
        Ok::<(), Error>(())
    })
    .await?;
    Ok(found.digest())
}

/// Passes the ranges of one design, or of all, to `visit` in order.
async fn ranges<E: From<Error>>(
    connection: &mut Connection<'_>,
    design: Option<u64>,
    mut visit: impl FnMut(&SampleRange) -> Result<(), E>,
) -> Result<(), E> {
    let path = connection.shared_path();
    let mut next = (0, 0);
    let visit = |range: SampleRange| {
        if (range.design, range.first_sample) < next {
            return Err(overlap(&path, &range).into());
        }
        next = (range.design, range.end());
        visit(&range)
    };
    let (filter, parameters) = match design {
        Some(design) => ("WHERE design = ?", vec![Value::Bits(design)]),
        None => ("", Vec::new()),
    };
    let parameters = keyed::arguments(connection, &parameters)?;
    keyed::visit(connection, filter, parameters, visit).await
}

fn overlap(path: &Path, range: &SampleRange) -> Error {
    let detail = "it overlaps the range before it: something else than this program has written it";
    Error::damaged_rows(path, SampleRange::NAME, range.name(), detail)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::open::tests::filled;
    use crate::store::Store;

    fn range(first_sample: u64, values: &[f64]) -> SampleRange {
        let bytes = values.iter().flat_map(|value| value.to_le_bytes());
        SampleRange {
            design: 0,
            first_sample,
            samples: bytes.collect(),
        }
    }

    /// The seal fits, so the range was written by a fault of this program or by another program
    /// that seals.
    #[tokio::test]
    async fn a_range_that_overlaps_another_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("campaign.db");
        filled(&path, 10).await;
        let options = crate::open::writing(&path);
        let path = path.as_path().into();
        let mut connection = Connection::open(&options, &path).await.unwrap();
        write(&mut connection, &[range(9, &[1.0, 1.0])])
            .await
            .unwrap();
        connection.close().await.unwrap();
        let error = Store::open_read_only(&path).await.unwrap_err().to_string();
        let place = "table sample_range, row first_sample 9 of design 0: it overlaps";
        assert!(error.contains(place), "{error}");
    }

    #[test]
    fn what_is_held_or_came_before_is_not_fresh() {
        let offered = [(0, 4), (1, 4), (0, 5), (1, 6), (1, 8)].map(|(owner, sample)| {
            let row = SampleRow {
                design: 0,
                sample,
                value: sample as f64,
            };
            (owner, row)
        });
        let mut receipts = [Receipt::default(); 2];
        let held = [range(2, &[2.0, 3.0]), range(5, &[5.0])];
        let fresh = fresh(&held, &offered, &mut receipts).unwrap();
        assert_eq!(
            fresh,
            [range(4, &[4.0]), range(6, &[6.0]), range(8, &[8.0])]
        );
        let counts = receipts.map(|receipt| (receipt.new_rows, receipt.duplicate_rows));
        assert_eq!(counts, [(1, 1), (2, 1)]);
    }
}
