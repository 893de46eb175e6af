//! Samples are packed in blocks, with the same results and refusals as with one row per sample.

use std::collections::BTreeMap;
use std::path::Path;

use proptest::prelude::*;
use proptest::test_runner::TestCaseError;
use sqlx::sqlite::{SqliteConnectOptions, SqliteConnection};
use sqlx::{Connection as _, Row as _};
use store::{Batch, Error, Receipt, SampleBlock, Store};

use crate::digests::documented_digest;
use crate::{campaign, folder, of, receipt, sample, samples, samples_of, store_with};

/// Design, first sample and values of each row in the file.
async fn ranges(path: &Path) -> Vec<(i64, i64, Vec<f64>)> {
    let options = SqliteConnectOptions::new().filename(path).read_only(true);
    let mut connection = SqliteConnection::connect_with(&options).await.unwrap();
    let rows = sqlx::query(
        "SELECT stream, first_sample, samples FROM sample_block ORDER BY stream, first_sample",
    )
    .fetch_all(&mut connection)
    .await
    .unwrap();
    let range = |row: &sqlx::sqlite::SqliteRow| {
        let bytes: Vec<u8> = row.get(2);
        let values = bytes.as_chunks().0.iter().copied().map(f64::from_le_bytes);
        (row.get(0), row.get(1), values.collect())
    };
    rows.iter().map(range).collect()
}

fn value(design: u64, sample: u64) -> f64 {
    (design * 1000 + sample) as f64 / 7.0
}

fn range(design: u64, range: std::ops::Range<u64>) -> Batch {
    samples(range.map(|i| sample(design, i, value(design, i))))
}

#[tokio::test]
async fn a_range_stores_what_is_missing() {
    let (_folder, path) = folder();
    let store = store_with(&path, 2).await;
    let writer = store.writer().unwrap();
    let submit = async |batch| writer.submit(batch).await.unwrap();
    assert_eq!(submit(range(1, 10..20)).await, receipt(10, 0));
    assert_eq!(submit(range(1, 30..40)).await, receipt(10, 0));
    // Within a stored range, overlapping its beginning or end, and across all ranges and gaps.
    assert_eq!(submit(range(1, 12..18)).await, receipt(0, 6));
    assert_eq!(submit(range(1, 5..15)).await, receipt(5, 5));
    assert_eq!(submit(range(1, 35..45)).await, receipt(5, 5));
    assert_eq!(submit(range(1, 0..50)).await, receipt(20, 30));
    assert_eq!(submit(range(1, 0..50)).await, receipt(0, 50));
    // A neighbouring design in the table does not affect design 1.
    assert_eq!(submit(range(0, 45..55)).await, receipt(10, 0));
    let expected: Vec<(u64, f64)> = (0..50).map(|i| (i, value(1, i))).collect();
    assert_eq!(samples_of(&store, of(1)).await.unwrap(), expected);
    let places: Vec<_> = ranges(&path)
        .await
        .into_iter()
        .map(|(design, first, values)| (design, first, values.len()))
        .collect();
    assert_eq!(
        places,
        [
            (0, 45, 10),
            (1, 0, 5),
            (1, 5, 5),
            (1, 10, 10),
            (1, 20, 10),
            (1, 30, 10),
            (1, 40, 5),
            (1, 45, 5)
        ]
    );
    store.visit_samples(|_| Ok::<(), Error>(())).await.unwrap();
}

#[tokio::test]
async fn another_value_within_a_range_is_refused_by_its_number() {
    let (_folder, path) = folder();
    let store = store_with(&path, 2).await;
    let writer = store.writer().unwrap();
    writer.submit(range(1, 0..100)).await.unwrap();
    let mut other = range(1, 50..150);
    other.samples[23].samples = vec![-1.0].into();
    let error = writer.submit(other).await.unwrap_err();
    assert!(error.is_refusal());
    let said = error.to_string();
    assert!(
        said.contains("sample 73 of design-1") && said.contains("-1.0"),
        "{said}"
    );
    assert_eq!(samples_of(&store, of(1)).await.unwrap().len(), 100);
    assert_eq!(ranges(&path).await.len(), 1, "no part of it is stored");
}

#[tokio::test]
async fn a_long_run_is_cut_into_ranges_of_4096() {
    let (_folder, path) = folder();
    let store = store_with(&path, 1).await;
    let writer = store.writer().unwrap();
    writer.submit(range(0, 0..10_000)).await.unwrap();
    let cut: Vec<_> = ranges(&path)
        .await
        .into_iter()
        .map(|(_, first, values)| (first, values.len()))
        .collect();
    assert_eq!(cut, [(0, 4096), (4096, 4096), (8192, 1808)]);
    let again = writer.submit(range(0, 4000..9000)).await.unwrap();
    assert_eq!(again, receipt(0, 5000));
    let last = writer.submit(range(0, 9999..10_001)).await.unwrap();
    assert_eq!(last, receipt(1, 1));
}

#[tokio::test]
async fn the_bytes_are_numbers_in_the_order_of_the_samples() {
    let (_folder, path) = folder();
    let store = store_with(&path, 1).await;
    // Submitted in descending order, one batch: the result is one range.
    let writer = store.writer().unwrap();
    let rows = [sample(0, 2, 0.25), sample(0, 1, -0.0), sample(0, 0, 1.5)];
    writer.submit(samples(rows)).await.unwrap();
    let held = ranges(&path).await;
    assert_eq!(held, [(0, 0, vec![1.5, 0.0, 0.25])]);
    assert!(held[0].2[1].is_sign_positive());
}

/// The largest index of a sample that SQLite can hold.
#[tokio::test]
async fn the_last_sample_of_all_has_a_range() {
    const LAST: u64 = i64::MAX as u64;
    let (_folder, path) = folder();
    let store = store_with(&path, 1).await;
    let writer = store.writer().unwrap();
    for _ in 0..2 {
        let rows = [sample(0, LAST - 1, 1.0), sample(0, LAST, 2.0)];
        writer.submit(samples(rows)).await.unwrap();
    }
    assert_eq!(
        samples_of(&store, of(0)).await.unwrap(),
        [(LAST - 1, 1.0), (LAST, 2.0)]
    );
    let missing = store.missing_work(3, &BTreeMap::new()).await.unwrap();
    assert_eq!(
        missing[0].samples,
        std::iter::once(0..3).collect::<Vec<_>>()
    );
}

/// A batch: ranges as (design, first, length), and the index of a sample whose value differs from
/// that in all other batches.
type Offer = (Vec<(u64, u64, u64)>, Option<usize>);

fn batch((ranges, other): &Offer) -> Batch {
    let mut rows: Vec<SampleBlock> = ranges
        .iter()
        .flat_map(|&(design, first, length)| range(design, first..first + length).samples)
        .collect();
    if let Some(other) = other {
        let other = other % rows.len();
        let value = rows[other].samples.values()[0] + 0.5;
        rows[other].samples = vec![value].into();
    }
    samples(rows)
}

/// The receipt from a model with one entry per sample, or `None` if it refuses the batch.
fn offer(table: &mut BTreeMap<(u64, u64), f64>, batch: &Batch) -> Option<Receipt> {
    let mut with = table.clone();
    let mut counts = receipt(0, 0);
    for row in &batch.samples {
        let value = row.samples.values()[0];
        match with.insert((row.stream.index, row.first_sample), value) {
            None => counts.new_rows += 1,
            Some(held) if held == value => counts.duplicate_rows += 1,
            Some(_) => return None,
        }
    }
    *table = with;
    Some(counts)
}

async fn agrees_with_a_row_for_each_sample(offers: &[(Offer, Offer)]) -> Result<(), TestCaseError> {
    let (_folder, path) = folder();
    let store = store_with(&path, 3).await;
    let mut table = BTreeMap::new();
    for pair in offers {
        let (one, other) = (batch(&pair.0), batch(&pair.1));
        let expected = [&one, &other].map(|batch| offer(&mut table, batch));
        let writer = store.writer().unwrap();
        // Queued together, so that they share a transaction.
        let (one, other) = tokio::join!(writer.submit(one), writer.submit(other));
        for (answer, expected) in [one, other].into_iter().zip(expected) {
            match answer {
                Ok(receipt) => prop_assert_eq!(Some(receipt), expected),
                Err(error) => {
                    let conflict = matches!(error, Error::Conflict { .. });
                    prop_assert!(conflict && expected.is_none(), "{}", error);
                }
            }
        }
    }
    let rows: Vec<(u64, u64, f64)> = table
        .iter()
        .map(|(&(design, number), &value)| (design, number, value))
        .collect();
    store.close().await.unwrap();
    let store = Store::create_or_open(&path, &campaign()).await.unwrap();
    let mut held = Vec::new();
    let visited = store.visit_samples(|block| {
        let of_block = block.indexed();
        held.extend(of_block.map(|(number, values)| (block.stream.index, number, values[0])));
        Ok::<(), Error>(())
    });
    visited.await.unwrap();
    prop_assert_eq!(&held, &rows);
    let digest = documented_digest(&rows);
    prop_assert_eq!(store.samples_digest().await.unwrap(), digest);
    for work in store.missing_work(70, &BTreeMap::new()).await.unwrap() {
        let design = work.design.design;
        let missing: Vec<u64> = work.samples.into_iter().flatten().collect();
        let expected = (0..70).filter(|number| !table.contains_key(&(design, *number)));
        prop_assert_eq!(missing, expected.collect::<Vec<u64>>());
    }
    store.close().await.unwrap();
    Ok(())
}

fn offers() -> impl Strategy<Value = Vec<(Offer, Offer)>> {
    let range = (0..3_u64, 0..60_u64, 1..30_u64);
    let other = prop::option::weighted(0.2, any::<usize>());
    let offer = (prop::collection::vec(range, 1..5), other);
    prop::collection::vec((offer.clone(), offer), 1..12)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn ranges_hold_what_rows_would_hold(offers in offers()) {
        let runtime = tokio::runtime::Runtime::new().unwrap();
        runtime.block_on(agrees_with_a_row_for_each_sample(&offers))?;
    }
}
