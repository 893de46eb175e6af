//! Counts and digests of samples and failures, which are known without reading the rows.

use std::collections::BTreeMap;

use crate::Error;
use crate::cause::cause;
use crate::connection::Connection;
use crate::digest::SamplesDigest;
use crate::keyed::{self, Table as _, Value};
use crate::query;
use crate::rows::PointSampleRow;
use crate::samples::SampleRange;
use crate::tables::number;

/// The counts and digests of a set of samples: those of a batch, or all stored ones.
#[derive(Debug, Default)]
pub(crate) struct Tally {
    samples: u64,
    digest: SamplesDigest,
    /// Count and highest index of the samples, by design.
    designs: BTreeMap<u64, (u64, u64)>,
    /// Count and digest of the samples, by point.
    points: BTreeMap<String, (u64, SamplesDigest)>,
}

impl Tally {
    /// Adds a non-empty range.
    pub(crate) fn add_range(&mut self, range: &SampleRange) {
        let (count, last) = self.designs.entry(range.design).or_default();
        for row in range.rows() {
            self.samples += 1;
            self.digest += SamplesDigest::of(row.design, row.sample, row.value);
            *count += 1;
            *last = row.sample.max(*last);
        }
    }

    pub(crate) fn samples(&self) -> u64 {
        self.samples
    }

    pub(crate) fn digest(&self) -> SamplesDigest {
        self.digest
    }

    pub(crate) fn add_point_sample(&mut self, row: &PointSampleRow) {
        let digest = SamplesDigest::of_point(&row.point, row.sample, number(row.value));
        let (count, sum) = match self.points.get_mut(&row.point) {
            Some(point) => point,
            None => self.points.entry(row.point.clone()).or_default(),
        };
        *count += 1;
        *sum += digest;
    }

    /// Adds these counts to the tallies in the store, in the transaction that stored the rows.
    pub(crate) async fn write(&self, connection: &mut Connection<'_>) -> Result<(), Error> {
        if self.samples > 0 {
            let (_, mut digest) = samples(connection).await?;
            digest += self.digest;
            let digest = digest.to_bytes().to_vec();
            let count = self.samples.cast_signed();
            let query = sqlx::query!(
                "UPDATE tally SET samples = samples + ?, samples_digest = ?",
                count,
                digest,
            );
            connection.insert("tally", query).await?;
            // An array of arrays: one statement for any number of designs, prepared once.
            let designs: Vec<String> = self
                .designs
                .iter()
                .map(|(design, (count, last))| format!("[{design},{count},{last}]"))
                .collect();
            let designs = format!("[{}]", designs.join(","));
            let query = sqlx::query!(
                "INSERT INTO design_tally (design, samples, last_sample)
                 SELECT value ->> 0, value ->> 1, value ->> 2 FROM json_each(?) WHERE TRUE
                 ON CONFLICT DO UPDATE SET
                    samples = samples + excluded.samples,
                    last_sample = max(last_sample, excluded.last_sample)",
                designs,
            );
            connection.insert("design_tally", query).await?;
        }
        if self.points.is_empty() {
            return Ok(());
        }
        let held = points(connection).await?;
        for (point, (count, digest)) in &self.points {
            let (_, mut sum) = held.get(point).copied().unwrap_or_default();
            sum += *digest;
            let sum = sum.to_bytes().to_vec();
            let count = count.cast_signed();
            let query = sqlx::query!(
                "INSERT INTO point_tally (point, samples, samples_digest) VALUES (?, ?, ?)
                 ON CONFLICT DO UPDATE SET
                    samples = samples + excluded.samples,
                    samples_digest = excluded.samples_digest",
                point,
                count,
                sum,
            );
            connection.insert("point_tally", query).await?;
        }
        Ok(())
    }
}

/// Count and digest of the samples of the DoE, from the tally.
pub(crate) async fn samples(
    connection: &mut Connection<'_>,
) -> Result<(u64, SamplesDigest), Error> {
    let query = sqlx::query!("SELECT samples, samples_digest FROM tally");
    let row = connection.one("read the tally", query).await?;
    let digest = SamplesDigest::from_blob(&row.samples_digest)
        .ok_or_else(|| connection.damaged_rows("tally", "one 1".into(), NO_DIGEST))?;
    Ok((query::index(row.samples), digest))
}

/// Count and digest of the samples of each point that has any, from the tallies.
pub(crate) async fn points(
    connection: &mut Connection<'_>,
) -> Result<BTreeMap<String, (u64, SamplesDigest)>, Error> {
    let query = sqlx::query!("SELECT point, samples, samples_digest FROM point_tally");
    let rows = connection.all("count verification samples", query).await?;
    rows.into_iter()
        .map(|r| {
            let digest = SamplesDigest::from_blob(&r.samples_digest).ok_or_else(|| {
                let row = format!("point {:?}", r.point);
                connection.damaged_rows("point_tally", row, NO_DIGEST)
            })?;
            Ok((r.point, (query::index(r.samples), digest)))
        })
        .collect()
}

/// The digest of all verification and infill samples, from the tallies.
pub(crate) async fn point_samples_digest(
    connection: &mut Connection<'_>,
) -> Result<SamplesDigest, Error> {
    let points = points(connection).await?;
    Ok(sum(points.values()))
}

fn sum<'p>(points: impl Iterator<Item = &'p (u64, SamplesDigest)>) -> SamplesDigest {
    let mut sum = SamplesDigest::default();
    points.for_each(|(_, digest)| sum += *digest);
    sum
}

const NO_DIGEST: &str = "it has no digest of 32 bytes";

/// Checks the samples of the DoE against their tallies.
pub(crate) async fn compare(connection: &mut Connection<'_>, found: &Tally) -> Result<(), Error> {
    let table = SampleRange::NAME;
    let (count, digest) = samples(connection).await?;
    let held = design_tallies(connection).await?;
    for design in held.keys().chain(found.designs.keys()) {
        let (held, found) = (held.get(design), found.designs.get(design));
        if held != found {
            let numbers = |numbers: Option<&(u64, u64)>| {
                let (count, last) = numbers.copied().unwrap_or_default();
                format!("{count} up to number {last}")
            };
            let (held, found) = (numbers(held), numbers(found));
            let detail = format!("it has samples ({found}) other than were counted ({held})");
            let row = format!("design {design}");
            return Err(connection.damaged_rows(table, row, &detail));
        }
    }
    if (count, digest) != (found.samples, found.digest) {
        let detail = format!(
            "{} samples have the digest {}, the {count} that were acknowledged had {}: a number \
             has changed on the disk",
            found.samples,
            found.digest.to_hex(),
            digest.to_hex()
        );
        let row = "one of all".to_owned();
        return Err(connection.damaged_rows(table, row, &detail));
    }
    Ok(())
}

/// Count and highest index of each design's samples, from the tallies.
async fn design_tallies(
    connection: &mut Connection<'_>,
) -> Result<BTreeMap<u64, (u64, u64)>, Error> {
    let query = sqlx::query!("SELECT design, samples, last_sample FROM design_tally");
    let rows = connection.all("count samples", query).await?.into_iter();
    Ok(rows
        .map(|r| {
            let tally = (query::index(r.samples), query::index(r.last_sample));
            (query::index(r.design), tally)
        })
        .collect())
}

/// The samples of one point, checked against its tally of the same moment.
pub(crate) async fn point_samples(
    connection: &mut Connection<'_>,
    point: &str,
) -> Result<Vec<PointSampleRow>, Error> {
    let mut moment = connection.moment().await?;
    let (filter, name) = ("WHERE point = ?", Value::Text(point));
    let rows: Vec<PointSampleRow> = keyed::all_where(&mut moment, filter, &[name]).await?;
    let held = points(&mut moment).await?;
    let held: BTreeMap<_, _> = held.into_iter().filter(|(name, _)| name == point).collect();
    compare_points(&moment, &rows, &held)?;
    moment.commit().await?;
    Ok(rows)
}

/// Checks all verification and infill samples against their tallies.
pub(crate) async fn check_point_samples(connection: &mut Connection<'_>) -> Result<(), Error> {
    let mut moment = connection.moment().await?;
    let rows: Vec<PointSampleRow> = keyed::all(&mut moment).await?;
    let held = points(&mut moment).await?;
    compare_points(&moment, &rows, &held)?;
    moment.commit().await
}

fn compare_points(
    connection: &Connection<'_>,
    rows: &[PointSampleRow],
    held: &BTreeMap<String, (u64, SamplesDigest)>,
) -> Result<(), Error> {
    let mut found = Tally::default();
    rows.iter().for_each(|row| found.add_point_sample(row));
    for point in held.keys().chain(found.points.keys()) {
        let (held, found) = (held.get(point), found.points.get(point));
        if held != found {
            let numbers = |numbers: Option<&(u64, SamplesDigest)>| {
                let (count, digest) = numbers.copied().unwrap_or_default();
                format!("{count} with the digest {}", digest.to_hex())
            };
            let (held, found) = (numbers(held), numbers(found));
            let detail =
                format!("its samples ({found}) are not those that were acknowledged ({held})");
            let row = format!("one of point {point:?}");
            return Err(connection.damaged_rows("point_sample", row, &detail));
        }
    }
    Ok(())
}

/// Counts a commit, in the commit's own transaction.
pub(crate) async fn count_commit(connection: &mut Connection<'_>) -> Result<u64, Error> {
    connection
        .one(
            "count a commit",
            sqlx::query!("UPDATE tally SET commits = commits + 1 RETURNING commits"),
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

/// The digest computed from the stored verification and infill samples.
pub(crate) async fn recompute_point_samples(
    connection: &mut Connection<'_>,
) -> Result<SamplesDigest, Error> {
    let rows: Vec<PointSampleRow> = keyed::all(connection).await?;
    let mut found = Tally::default();
    rows.iter().for_each(|row| found.add_point_sample(row));
    Ok(sum(found.points.values()))
}
