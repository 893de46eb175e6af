//! What is known of samples and failures without reading them.

use std::collections::BTreeMap;
use std::path::Path;

use sqlx::SqliteExecutor;
use sqlx::sqlite::SqliteConnection;

use crate::Error;
use crate::cause::cause;
use crate::digest::SamplesDigest;
use crate::query;
use crate::rows::{SampleRow, VerifyRow};
use crate::tables::number;

/// What new rows add to the tallies.
#[derive(Debug, Default)]
pub(crate) struct Tally {
    samples: i64,
    digest: SamplesDigest,
    /// Count and highest index by design.
    designs: BTreeMap<u64, (u64, u64)>,
    verify: BTreeMap<String, i64>,
}

impl Tally {
    pub(crate) fn add_sample(&mut self, row: &SampleRow) {
        self.samples += 1;
        self.digest += SamplesDigest::of(row.design, row.sample, number(row.delta_ste_um));
        let (count, last) = self.designs.entry(row.design).or_default();
        *count += 1;
        *last = row.sample.max(*last);
    }

    pub(crate) fn add_verify_sample(&mut self, row: &VerifyRow) {
        match self.verify.get_mut(&row.approach) {
            Some(count) => *count += 1,
            None => {
                self.verify.insert(row.approach.clone(), 1);
            }
        }
    }

    /// Adds this to the tallies in the store, in the transaction that stored the rows.
    pub(crate) async fn write(
        &self,
        connection: &mut SqliteConnection,
        path: &Path,
    ) -> Result<(), Error> {
        let failed = |e| Error::insertion("tally", path, e);
        if self.samples > 0 {
            let mut digest = query::tally(&mut *connection, path).await?;
            digest += self.digest;
            let digest = digest.to_bytes().to_vec();
            sqlx::query!(
                "UPDATE tally SET samples = samples + ?, samples_digest = ?",
                self.samples,
                digest,
            )
            .execute(&mut *connection)
            .await
            .map_err(failed)?;
            // An array of arrays: one statement for any number of designs, prepared once.
            let designs: Vec<String> = self
                .designs
                .iter()
                .map(|(design, (count, last))| format!("[{design},{count},{last}]"))
                .collect();
            let designs = format!("[{}]", designs.join(","));
            sqlx::query!(
                "INSERT INTO design_tally (design, samples, last_sample)
                 SELECT value ->> 0, value ->> 1, value ->> 2 FROM json_each(?) WHERE TRUE
                 ON CONFLICT DO UPDATE SET
                    samples = samples + excluded.samples,
                    last_sample = max(last_sample, excluded.last_sample)",
                designs,
            )
            .execute(&mut *connection)
            .await
            .map_err(failed)?;
        }
        for (approach, count) in &self.verify {
            sqlx::query!(
                "INSERT INTO verify_tally (approach, samples) VALUES (?, ?)
                 ON CONFLICT DO UPDATE SET samples = samples + excluded.samples",
                approach,
                count,
            )
            .execute(&mut *connection)
            .await
            .map_err(failed)?;
        }
        Ok(())
    }
}

/// Counts a commit, in its own transaction.
pub(crate) async fn count_commit(
    connection: &mut SqliteConnection,
    path: &Path,
) -> Result<u64, Error> {
    sqlx::query_scalar!("UPDATE tally SET commits = commits + 1 RETURNING commits")
        .fetch_one(connection)
        .await
        .map(query::index)
        .map_err(|e| Error::sqlite("count a commit", path, e))
}

/// Counts a failure, in the transaction that stored it.
pub(crate) async fn count_failure(
    connection: &mut SqliteConnection,
    path: &Path,
    kind: &str,
    error: &str,
    failure: i64,
) -> Result<(), Error> {
    let cause = cause(error);
    sqlx::query!(
        "INSERT INTO failure_tally (kind, cause, failures, last_failure) VALUES (?, ?, 1, ?)
         ON CONFLICT DO UPDATE SET
            failures = failures + 1,
            last_failure = excluded.last_failure",
        kind,
        cause,
        failure,
    )
    .execute(connection)
    .await
    .map_err(|e| Error::insertion("failure_tally", path, e))?;
    Ok(())
}

/// The digest of the samples that are there.
pub(crate) async fn recompute(
    executor: impl SqliteExecutor<'_>,
    path: &Path,
) -> Result<SamplesDigest, Error> {
    let mut digest = SamplesDigest::default();
    query::visit_samples(executor, path, |row| {
        digest += SamplesDigest::of(row.design, row.sample, row.delta_ste_um);
        Ok::<(), Error>(())
    })
    .await?;
    Ok(digest)
}

/// Does what the migration that brought the tallies cannot: SQL has neither SHA-256 nor causes.
pub(crate) async fn fill(connection: &mut SqliteConnection, path: &Path) -> Result<(), Error> {
    let digest = recompute(&mut *connection, path).await?;
    let digest = digest.to_bytes().to_vec();
    sqlx::query!("UPDATE tally SET samples_digest = ?", digest)
        .execute(&mut *connection)
        .await
        .map_err(|e| Error::insertion("tally", path, e))?;
    let failures = sqlx::query!("SELECT failure, kind, error FROM failure ORDER BY failure")
        .fetch_all(&mut *connection)
        .await
        .map_err(|e| Error::sqlite("read failures", path, e))?;
    for row in failures {
        count_failure(connection, path, &row.kind, &row.error, row.failure).await?;
    }
    Ok(())
}
