//! Digests and tallies of samples are those of the rows, in whatever order these were stored.

use ledger::StreamId;
use sha2::{Digest as _, Sha256};
use store::{Error, SampleBlock};

use crate::{POINT, at, folder, of, open, sample, samples, samples_of, store_with};

/// The sum of the hashes, added byte by byte.
pub(crate) fn documented_digest(rows: &[(u64, u64, f64)]) -> String {
    let mut sum = [0_u8; 32];
    for (design, sample, value) in rows {
        let mut bytes = Vec::new();
        bytes.extend(design.to_le_bytes());
        bytes.extend(sample.to_le_bytes());
        bytes.extend(value.to_le_bytes());
        let mut carry = 0;
        for (sum, byte) in sum.iter_mut().zip(Sha256::digest(&bytes)) {
            let total = u16::from(*sum) + u16::from(byte) + carry;
            *sum = (total & 0xff) as u8;
            carry = total >> 8;
        }
    }
    hex::encode(sum)
}

#[tokio::test]
async fn the_digest_is_the_documented_one_whatever_the_order() {
    let rows: Vec<(u64, u64, f64)> = (0..7)
        .flat_map(|d| (0..300).map(move |s| (d, s, (d * 1000 + s) as f64 / 7.0)))
        .collect();
    let expected = documented_digest(&rows);

    let mut shuffled = rows.clone();
    // A permutation: 1201 is coprime to 2100.
    for (i, row) in rows.iter().enumerate() {
        shuffled[(i * 1201) % rows.len()] = *row;
    }
    for (order, size) in [(&rows, 2100), (&shuffled, 2100), (&shuffled, 37)] {
        let (_folder, path) = folder();
        let store = store_with(&path, 7).await;
        let writer = store.writer().unwrap();
        for chunk in order.chunks(size) {
            let blocks = chunk.iter().map(|(d, s, value)| sample(*d, *s, *value));
            writer.submit(samples(blocks)).await.unwrap();
        }
        assert_eq!(store.samples_digest().await.unwrap(), expected);
    }
}

#[tokio::test]
async fn the_digest_of_nothing_is_nought() {
    let (_folder, path) = folder();
    let store = open(&path).await;
    assert_eq!(store.samples_digest().await.unwrap(), "0".repeat(64));
}

#[tokio::test]
async fn tallies_are_what_a_count_of_the_rows_would_say() {
    let (_folder, path) = folder();
    let store = store_with(&path, 3).await;
    let writer = store.writer().unwrap();
    let points = [POINT, StreamId::point(1 << 27)];
    // New rows, stored ones, repeated ones, negative zeros, and refused ones.
    let mut held = Vec::new();
    let mut count = [0, 0];
    for round in 0..40_u64 {
        let rows: Vec<SampleBlock> = (0..30)
            .map(|i| {
                let key = (round * 7 + i * i) % 400;
                let value = if key % 50 == 0 { -0.0 } else { key as f64 };
                sample(key % 3, key / 3, value)
            })
            .collect();
        let of_points = (0..4).map(|i| at(points[i % 2], round / 2 + i as u64, 1.0));
        let good = samples(rows.iter().cloned().chain(of_points));
        let bad = samples([
            sample(0, 1000 + round, 1.0),
            at(points[0], 1000 + round, 1.0),
            at(points[0], 0, 2.0),
        ]);
        let (good, bad) = tokio::join!(writer.submit(good), writer.submit(bad));
        assert!(good.is_ok());
        assert!(matches!(bad, Err(Error::Conflict { .. })));
        held.extend(rows.iter().map(|row| (row.stream.index, row.first_sample)));
        held.sort_unstable();
        held.dedup();
        store.visit_samples(|_| Ok::<(), Error>(())).await.unwrap();
        let counts = store.sampled_counts().await.unwrap();
        for (design, samples) in counts {
            let really = held.iter().filter(|(d, _)| *d == design).count() as u64;
            assert_eq!(samples, really, "design {design}");
            assert_eq!(
                samples_of(&store, of(design)).await.unwrap().len() as u64,
                really
            );
        }
        let tallies = store.sample_tallies().await.unwrap();
        for (count, point) in count.iter_mut().zip(points) {
            *count = samples_of(&store, point).await.unwrap().len() as u64;
            assert_eq!(tallies[&point].samples, *count);
        }
        let progress = store.progress().await.unwrap();
        assert_eq!(progress.samples, held.len() as u64);
        assert_eq!(progress.point_samples, count[0] + count[1]);
    }
    assert!(
        count[0] > 10 && held.len() > 100,
        "the test stored too little"
    );
}

#[tokio::test]
async fn the_digest_of_verification_samples_is_that_of_any_order() {
    let (_first, one) = folder();
    let (_second, other) = folder();
    let rows: Vec<SampleBlock> = [POINT, StreamId::point(1 << 27)]
        .into_iter()
        .flat_map(|point| (0..50).map(move |i| at(point, i, 1.0 + i as f64)))
        .collect();
    let mut digests = Vec::new();
    for (path, step) in [(one, 7), (other, 31)] {
        let store = store_with(&path, 1).await;
        let none = store.samples_digest().await.unwrap();
        assert_eq!(store.point_samples_digest().await.unwrap(), none);
        let mut rows = rows.clone();
        if step == 31 {
            rows.reverse();
        }
        for part in rows.chunks(step) {
            // Twice: the repetition changes nothing.
            for _ in 0..2 {
                let batch = samples(part.to_vec());
                store.writer().unwrap().submit(batch).await.unwrap();
            }
        }
        let digest = store.point_samples_digest().await.unwrap();
        assert_eq!(
            store.samples_digest().await.unwrap(),
            none,
            "those of the DoE"
        );
        digests.push(digest);
    }
    assert_eq!(digests[0], digests[1]);
    assert_ne!(digests[0], "0".repeat(64));
}
