//! The statements that read.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;

use sqlx::SqliteExecutor;
use sqlx::sqlite::{SqliteConnection, SqlitePool};
use tokio_stream::StreamExt as _;

use crate::Error;
use crate::cause::first_line;
use crate::digest::SamplesDigest;
use crate::rows::{
    CampaignRow, DesignRow, FailureGroup, FailureKind, FailureRow, JobHistory, MissingWork,
    ModelRow, OptimumRow, Progress, ResponseRow, SampleRow,
};

/// The migrations that made the schema: version and checksum, the oldest first.
pub(crate) async fn migrations(
    connection: &mut SqliteConnection,
) -> Result<Vec<(i64, Vec<u8>)>, sqlx::Error> {
    let rows = sqlx::query!(
        r#"SELECT version AS "version!: i64", checksum FROM _sqlx_migrations ORDER BY version"#
    )
    .fetch_all(connection)
    .await?;
    Ok(rows.into_iter().map(|r| (r.version, r.checksum)).collect())
}

pub(crate) async fn campaign(
    executor: impl SqliteExecutor<'_>,
    path: &Path,
) -> Result<CampaignRow, Error> {
    let row = sqlx::query!(
        "SELECT name, file_text, digest, seed, program_version, model_digest FROM campaign"
    )
    .fetch_optional(executor)
    .await
    .map_err(|e| Error::sqlite("read the campaign", path, e))?;
    // A store comes into being with its campaign in it.
    let r = row.ok_or_else(|| Error::Damaged {
        path: path.to_owned(),
        detail: "it names no campaign".into(),
    })?;
    Ok(CampaignRow {
        name: r.name,
        file_text: r.file_text,
        digest: r.digest,
        seed: r.seed.cast_unsigned(),
        program_version: r.program_version,
        model_digest: r.model_digest,
    })
}

pub(crate) async fn sampled_counts(
    pool: &SqlitePool,
    path: &Path,
) -> Result<Vec<(u64, u64)>, Error> {
    let rows = sqlx::query!(
        r#"SELECT design.design, coalesce(design_tally.samples, 0) AS "held!: i64"
           FROM design LEFT JOIN design_tally ON design_tally.design = design.design
           ORDER BY design.design"#
    )
    .fetch_all(pool)
    .await
    .map_err(|e| Error::sqlite("count samples", path, e))?;
    Ok(rows
        .into_iter()
        .map(|r| (index(r.design), index(r.held)))
        .collect())
}

/// Designs that lack their criteria, or are feasible, not ruled out, and lack samples below `wanted`,
/// or below what `more` says of them.
pub(crate) async fn missing_work(
    pool: &SqlitePool,
    path: &Path,
    wanted: u64,
    more: &BTreeMap<u64, u64>,
) -> Result<Vec<MissingWork>, Error> {
    let failed = |e| Error::sqlite("look for missing work", path, e);
    // Beyond i64::MAX no sample can be stored, so nothing more could be missing or held.
    let limit = i64::try_from(wanted).unwrap_or(i64::MAX);
    let mut missing = BTreeMap::new();
    // Designs with every sample up to their last one, and enough of them, stay in the database.
    let rows = sqlx::query!(
        r#"SELECT design.design AS "design!: i64",
                  design.x_p, design.x_r, design.ha0_p, design.ha0_r, design.hf0_p, design.hf0_r,
                  criteria.design IS NULL AS "without_criteria!: bool",
                  coalesce(design_tally.samples, 0) AS "held!: i64",
                  coalesce(design_tally.last_sample, -1) AS "last!: i64"
           FROM design
           LEFT JOIN criteria ON criteria.design = design.design
           LEFT JOIN design_tally ON design_tally.design = design.design
           WHERE criteria.design IS NULL
              OR criteria.feasible = 1 AND criteria.reason IS NULL
                 AND (coalesce(design_tally.samples, 0) < ?1
                      OR design_tally.samples <= design_tally.last_sample)
           ORDER BY design.design"#,
        limit,
    )
    .fetch_all(pool)
    .await
    .map_err(failed)?;

    for row in rows {
        let samples = if row.held > row.last {
            // Without holes: nothing has to be read to know what is missing.
            gaps(0..index(row.held), wanted)
        } else {
            missing_samples(pool, path, row.design, limit).await?
        };
        if row.without_criteria || !samples.is_empty() {
            let x = [row.x_p, row.x_r, row.ha0_p, row.ha0_r, row.hf0_p, row.hf0_r];
            let work = MissingWork {
                design: DesignRow::new(index(row.design), x),
                criteria: row.without_criteria,
                samples,
            };
            missing.insert(work.design.design, work);
        }
    }
    for (&design, &wanted) in more {
        let limit = i64::try_from(wanted).unwrap_or(i64::MAX);
        let samples = missing_samples(pool, path, design.cast_signed(), limit).await?;
        match missing.get_mut(&design) {
            Some(work) => work.samples = samples,
            None if samples.is_empty() => {}
            None => {
                let row = design_row(pool, path, design.cast_signed()).await?;
                let work = MissingWork {
                    design: row,
                    criteria: false,
                    samples,
                };
                missing.insert(design, work);
            }
        }
    }
    Ok(missing.into_values().collect())
}

async fn design_row(pool: &SqlitePool, path: &Path, design: i64) -> Result<DesignRow, Error> {
    let row = sqlx::query!(
        "SELECT x_p, x_r, ha0_p, ha0_r, hf0_p, hf0_r FROM design WHERE design = ?",
        design
    )
    .fetch_one(pool)
    .await
    .map_err(|e| Error::sqlite("read a design", path, e))?;
    let x = [row.x_p, row.x_r, row.ha0_p, row.ha0_r, row.hf0_p, row.hf0_r];
    Ok(DesignRow::new(index(design), x))
}

/// What is missing of the samples `0..limit` of one design.
async fn missing_samples(
    pool: &SqlitePool,
    path: &Path,
    design: i64,
    limit: i64,
) -> Result<Vec<Range<u64>>, Error> {
    let held = sqlx::query_scalar!(
        "SELECT sample FROM sample WHERE design = ? AND sample < ? ORDER BY sample",
        design,
        limit,
    )
    .fetch_all(pool)
    .await
    .map_err(|e| Error::sqlite("look for missing work", path, e))?;
    Ok(gaps(held.into_iter().map(index), index(limit)))
}

/// What `held`, ascending, leaves of `0..wanted`.
fn gaps(held: impl Iterator<Item = u64>, wanted: u64) -> Vec<Range<u64>> {
    let mut gaps = Vec::new();
    let mut next = 0;
    for sample in held.take_while(|sample| *sample < wanted) {
        if sample > next {
            gaps.push(next..sample);
        }
        next = sample + 1;
    }
    if next < wanted {
        gaps.push(next..wanted);
    }
    gaps
}

/// How many commits the store holds.
pub(crate) async fn commits(connection: &mut SqliteConnection, path: &Path) -> Result<u64, Error> {
    sqlx::query_scalar!("SELECT commits FROM tally")
        .fetch_one(connection)
        .await
        .map(index)
        .map_err(|e| Error::sqlite("read the tally", path, e))
}

/// The digest as the tally has it.
pub(crate) async fn tally(
    executor: impl SqliteExecutor<'_>,
    path: &Path,
) -> Result<SamplesDigest, Error> {
    let digest = sqlx::query_scalar!("SELECT samples_digest FROM tally")
        .fetch_one(executor)
        .await
        .map_err(|e| Error::sqlite("read the tally", path, e))?;
    let bytes = <&[u8; 32]>::try_from(digest.as_slice()).map_err(|_| Error::Damaged {
        path: path.to_owned(),
        detail: format!("the digest of its samples has {} bytes", digest.len()),
    })?;
    Ok(SamplesDigest::from_bytes(bytes))
}

pub(crate) async fn visit_samples<E: From<Error>>(
    executor: impl SqliteExecutor<'_>,
    path: &Path,
    mut visit: impl FnMut(SampleRow) -> Result<(), E>,
) -> Result<(), E> {
    let mut rows =
        sqlx::query!("SELECT design, sample, delta_ste_um FROM sample ORDER BY design, sample")
            .fetch(executor);
    while let Some(row) = rows.next().await {
        let row = row.map_err(|e| Error::sqlite("read samples", path, e))?;
        visit(SampleRow {
            design: index(row.design),
            sample: index(row.sample),
            delta_ste_um: row.delta_ste_um,
        })?;
    }
    Ok(())
}

pub(crate) async fn verify_counts(
    pool: &SqlitePool,
    path: &Path,
) -> Result<Vec<(String, u64)>, Error> {
    let rows = sqlx::query!("SELECT approach, samples FROM verify_tally ORDER BY approach")
        .fetch_all(pool)
        .await
        .map_err(|e| Error::sqlite("count verification samples", path, e))?;
    Ok(rows
        .into_iter()
        .map(|r| (r.approach, index(r.samples)))
        .collect())
}

pub(crate) async fn samples_of(
    pool: &SqlitePool,
    path: &Path,
    design: u64,
) -> Result<Vec<(u64, f64)>, Error> {
    let Ok(design) = i64::try_from(design) else {
        return Ok(Vec::new());
    };
    let rows = sqlx::query!(
        "SELECT sample, delta_ste_um FROM sample WHERE design = ? ORDER BY sample",
        design,
    )
    .fetch_all(pool)
    .await
    .map_err(|e| Error::sqlite("read the samples of a design", path, e))?;
    Ok(rows
        .into_iter()
        .map(|r| (index(r.sample), r.delta_ste_um))
        .collect())
}

pub(crate) async fn responses(pool: &SqlitePool, path: &Path) -> Result<Vec<ResponseRow>, Error> {
    let rows = sqlx::query!(
        "SELECT design, mean_um, sd_um, p90_um, p90_variance_um2, lilliefors_p
         FROM response ORDER BY design"
    )
    .fetch_all(pool)
    .await
    .map_err(|e| Error::sqlite("read responses", path, e))?;
    Ok(rows
        .into_iter()
        .map(|r| ResponseRow {
            design: index(r.design),
            mean_um: r.mean_um,
            sd_um: r.sd_um,
            p90_um: r.p90_um,
            p90_variance_um2: r.p90_variance_um2,
            lilliefors_p: r.lilliefors_p,
        })
        .collect())
}

pub(crate) async fn model(
    pool: &SqlitePool,
    path: &Path,
    name: &str,
) -> Result<Option<ModelRow>, Error> {
    sqlx::query_as!(
        ModelRow,
        "SELECT name, json, summary_json FROM model WHERE name = ?",
        name
    )
    .fetch_optional(pool)
    .await
    .map_err(|e| Error::sqlite("read a model", path, e))
}

pub(crate) async fn models(pool: &SqlitePool, path: &Path) -> Result<Vec<ModelRow>, Error> {
    sqlx::query_as!(
        ModelRow,
        "SELECT name, json, summary_json FROM model ORDER BY name"
    )
    .fetch_all(pool)
    .await
    .map_err(|e| Error::sqlite("read models", path, e))
}

pub(crate) async fn optima(pool: &SqlitePool, path: &Path) -> Result<Vec<OptimumRow>, Error> {
    let rows = sqlx::query!(
        "SELECT approach, x_json, criterion_um, feasible, criteria_json, simulator_calls,
                cpu_seconds, note
         FROM optimum ORDER BY approach"
    )
    .fetch_all(pool)
    .await
    .map_err(|e| Error::sqlite("read optima", path, e))?;
    Ok(rows
        .into_iter()
        .map(|r| OptimumRow {
            approach: r.approach,
            x_json: r.x_json,
            criterion_um: r.criterion_um,
            feasible: r.feasible != 0,
            criteria_json: r.criteria_json,
            simulator_calls: index(r.simulator_calls),
            cpu_seconds: r.cpu_seconds,
            note: r.note,
        })
        .collect())
}

pub(crate) async fn failures(pool: &SqlitePool, path: &Path) -> Result<Vec<FailureRow>, Error> {
    let rows = sqlx::query!(
        r#"SELECT job, attempt AS "attempt: u32", worker, serial, kind, error, at_unix_ms
           FROM failure ORDER BY failure"#
    )
    .fetch_all(pool)
    .await
    .map_err(|e| Error::sqlite("read failures", path, e))?;
    rows.into_iter()
        .map(|r| {
            Ok(FailureRow {
                job: r.job,
                attempt: r.attempt,
                worker: r.worker,
                serial: r.serial.map(i64::cast_unsigned),
                kind: kind(r.kind)?,
                error: r.error,
                at_unix_ms: r.at_unix_ms,
            })
        })
        .collect()
}

pub(crate) async fn knows_failure(
    pool: &SqlitePool,
    path: &Path,
    worker: &str,
    serial: u64,
) -> Result<bool, Error> {
    let serial = serial.cast_signed();
    sqlx::query_scalar!(
        r#"SELECT EXISTS (SELECT 1 FROM failure WHERE worker = ? AND serial = ?) AS "known!: bool""#,
        worker,
        serial,
    )
    .fetch_one(pool)
    .await
    .map_err(|e| Error::sqlite("look for a failure", path, e))
}

pub(crate) async fn generations(
    pool: &SqlitePool,
    path: &Path,
) -> Result<BTreeMap<String, u64>, Error> {
    let rows = sqlx::query!("SELECT stream, generation FROM stream_generation")
        .fetch_all(pool)
        .await
        .map_err(|e| Error::sqlite("read what is wanted", path, e))?;
    let rows = rows.into_iter();
    Ok(rows
        .map(|r| (r.stream, r.generation.cast_unsigned()))
        .collect())
}

pub(crate) async fn job_histories(
    pool: &SqlitePool,
    path: &Path,
) -> Result<Vec<JobHistory>, Error> {
    let rows = sqlx::query!(
        r#"WITH given_up AS (
               SELECT job, max(failure) AS last FROM failure WHERE kind = 'quarantine' GROUP BY job
           )
           SELECT failure.job AS "job!",
                  max(attempt) AS "attempts!: u32",
                  count(DISTINCT CASE WHEN kind = 'crash' AND failure > coalesce(last, 0)
                                      THEN worker END) AS "crashes!: u32",
                  sum(kind = 'failure' AND failure > coalesce(last, 0)) AS "failures!: u32"
           FROM failure LEFT JOIN given_up ON given_up.job = failure.job
           GROUP BY failure.job ORDER BY failure.job"#
    )
    .fetch_all(pool)
    .await
    .map_err(|e| Error::sqlite("read what went wrong with jobs", path, e))?;
    Ok(rows
        .into_iter()
        .map(|r| JobHistory {
            job: r.job,
            attempts: r.attempts,
            crashes: r.crashes,
            failures: r.failures,
        })
        .collect())
}

pub(crate) async fn failure_groups(
    pool: &SqlitePool,
    path: &Path,
) -> Result<Vec<FailureGroup>, Error> {
    let rows = sqlx::query!(
        r#"SELECT failure_tally.kind, cause, failures, job, worker, error
           FROM failure_tally JOIN failure ON failure = last_failure
           ORDER BY failure_tally.kind, cause"#
    )
    .fetch_all(pool)
    .await
    .map_err(|e| Error::sqlite("read the causes of failures", path, e))?;
    rows.into_iter()
        .map(|r| {
            Ok(FailureGroup {
                kind: kind(r.kind)?,
                cause: r.cause,
                count: index(r.failures),
                last_error: first_line(&r.error).to_owned(),
                last_job: r.job,
                last_worker: r.worker,
            })
        })
        .collect()
}

fn kind(text: String) -> Result<FailureKind, Error> {
    FailureKind::parse(&text).ok_or(Error::UnknownValue {
        column: "failure.kind",
        value: text,
    })
}

pub(crate) async fn progress(pool: &SqlitePool, path: &Path) -> Result<Progress, Error> {
    // One statement, so that all counts are of one moment.
    let r = sqlx::query!(
        r#"SELECT (SELECT count(*) FROM design) AS "designs!: i64",
                  (SELECT count(*) FROM criteria) AS "criteria_done!: i64",
                  (SELECT count(*) FROM criteria WHERE feasible = 1) AS "feasible!: i64",
                  (SELECT count(*) FROM criteria WHERE feasible = 1 AND reason IS NOT NULL)
                      AS "ruled_out!: i64",
                  (SELECT samples FROM tally) AS "samples!: i64",
                  (SELECT count(*) FROM response) AS "responses!: i64",
                  (SELECT count(*) FROM model) AS "models!: i64",
                  (SELECT count(*) FROM optimiser_run) AS "optimiser_runs!: i64",
                  (SELECT count(*) FROM optimum) AS "optima!: i64",
                  (SELECT coalesce(sum(samples), 0) FROM verify_tally) AS "verify_samples!: i64",
                  (SELECT coalesce(sum(failures), 0) FROM failure_tally) AS "failures!: i64""#
    )
    .fetch_one(pool)
    .await
    .map_err(|e| Error::sqlite("count rows", path, e))?;
    Ok(Progress {
        designs: index(r.designs),
        criteria_done: index(r.criteria_done),
        feasible: index(r.feasible),
        ruled_out: index(r.ruled_out),
        samples: index(r.samples),
        responses: index(r.responses),
        models: index(r.models),
        optimiser_runs: index(r.optimiser_runs),
        optima: index(r.optima),
        verify_samples: index(r.verify_samples),
        failures: index(r.failures),
    })
}

/// The schema keeps indices and counts from being negative.
pub(crate) fn index(value: i64) -> u64 {
    value.cast_unsigned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_are_what_is_not_held() {
        let gaps = |held: &[u64], wanted| {
            gaps(held.iter().copied(), wanted)
                .into_iter()
                .map(|gap| (gap.start, gap.end))
                .collect::<Vec<_>>()
        };
        assert_eq!(gaps(&[], 0), []);
        assert_eq!(gaps(&[], 3), [(0, 3)]);
        assert_eq!(gaps(&[0, 1, 2], 3), []);
        assert_eq!(gaps(&[1, 2, 5], 8), [(0, 1), (3, 5), (6, 8)]);
        assert_eq!(gaps(&[0, 7], 8), [(1, 7)]);
    }
}
