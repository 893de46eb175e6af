//! The statements that read.

use std::ops::Range;
use std::path::Path;

use sqlx::SqliteExecutor;
use sqlx::sqlite::{SqliteConnection, SqlitePool};

use crate::Error;
use crate::rows::{
    CampaignRow, CriteriaRow, DesignRow, FailureKind, FailureRow, JobTimeRow, MissingWork,
    ModelRow, OptimiserRunRow, OptimumRow, Progress, ResponseRow, VerifyRow,
};

pub(crate) async fn schema_version(connection: &mut SqliteConnection) -> Result<i64, sqlx::Error> {
    let version = sqlx::query_scalar!(
        r#"SELECT coalesce(max(version), 0) AS "v!: i64" FROM _sqlx_migrations"#
    )
    .fetch_one(connection)
    .await?;
    Ok(version)
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

struct RawDesign {
    design: i64,
    x_p: f64,
    x_r: f64,
    ha0_p: f64,
    ha0_r: f64,
    hf0_p: f64,
    hf0_r: f64,
}

impl From<RawDesign> for DesignRow {
    fn from(r: RawDesign) -> Self {
        Self {
            design: index(r.design),
            x_p: r.x_p,
            x_r: r.x_r,
            ha0_p: r.ha0_p,
            ha0_r: r.ha0_r,
            hf0_p: r.hf0_p,
            hf0_r: r.hf0_r,
        }
    }
}

pub(crate) async fn designs(pool: &SqlitePool, path: &Path) -> Result<Vec<DesignRow>, Error> {
    let rows = sqlx::query_as!(RawDesign, "SELECT * FROM design ORDER BY design")
        .fetch_all(pool)
        .await
        .map_err(|e| Error::sqlite("read designs", path, e))?;
    Ok(rows.into_iter().map(DesignRow::from).collect())
}

pub(crate) async fn design(
    connection: &mut SqliteConnection,
    path: &Path,
    design: i64,
) -> Result<DesignRow, Error> {
    sqlx::query_as!(RawDesign, "SELECT * FROM design WHERE design = ?", design)
        .fetch_one(connection)
        .await
        .map(DesignRow::from)
        .map_err(|e| Error::sqlite("read a design", path, e))
}

struct RawCriteria {
    design: i64,
    feasible: i64,
    reason: Option<String>,
    contact_ratio: Option<f64>,
    specific_sliding: Option<f64>,
    hertz_pressure_mpa: Option<f64>,
    hertz_pressure_worn_mpa: Option<f64>,
    root_stress_mpa: Option<f64>,
    clearance_p_mm: Option<f64>,
    clearance_r_mm: Option<f64>,
    flank_margin_p_mm: Option<f64>,
    flank_margin_r_mm: Option<f64>,
    delta_ste_um: Option<f64>,
    delta_ste_archard_um: Option<f64>,
}

impl From<RawCriteria> for CriteriaRow {
    fn from(r: RawCriteria) -> Self {
        Self {
            design: index(r.design),
            feasible: r.feasible != 0,
            reason: r.reason,
            contact_ratio: r.contact_ratio,
            specific_sliding: r.specific_sliding,
            hertz_pressure_mpa: r.hertz_pressure_mpa,
            hertz_pressure_worn_mpa: r.hertz_pressure_worn_mpa,
            root_stress_mpa: r.root_stress_mpa,
            clearance_p_mm: r.clearance_p_mm,
            clearance_r_mm: r.clearance_r_mm,
            flank_margin_p_mm: r.flank_margin_p_mm,
            flank_margin_r_mm: r.flank_margin_r_mm,
            delta_ste_um: r.delta_ste_um,
            delta_ste_archard_um: r.delta_ste_archard_um,
        }
    }
}

pub(crate) async fn criteria(pool: &SqlitePool, path: &Path) -> Result<Vec<CriteriaRow>, Error> {
    let rows = sqlx::query_as!(RawCriteria, "SELECT * FROM criteria ORDER BY design")
        .fetch_all(pool)
        .await
        .map_err(|e| Error::sqlite("read criteria", path, e))?;
    Ok(rows.into_iter().map(CriteriaRow::from).collect())
}

pub(crate) async fn criteria_of(
    connection: &mut SqliteConnection,
    path: &Path,
    design: i64,
) -> Result<CriteriaRow, Error> {
    sqlx::query_as!(
        RawCriteria,
        "SELECT * FROM criteria WHERE design = ?",
        design
    )
    .fetch_one(connection)
    .await
    .map(CriteriaRow::from)
    .map_err(|e| Error::sqlite("read the criteria of a design", path, e))
}

pub(crate) async fn sampled_counts(
    pool: &SqlitePool,
    path: &Path,
) -> Result<Vec<(u64, u64)>, Error> {
    let rows = sqlx::query!(
        r#"SELECT design.design, count(sample.design) AS "held!: i64"
           FROM design LEFT JOIN sample ON sample.design = design.design
           GROUP BY design.design ORDER BY design.design"#
    )
    .fetch_all(pool)
    .await
    .map_err(|e| Error::sqlite("count samples", path, e))?;
    Ok(rows
        .into_iter()
        .map(|r| (index(r.design), index(r.held)))
        .collect())
}

/// Designs that lack their criteria, or are feasible and lack samples below `wanted`.
pub(crate) async fn missing_work(
    pool: &SqlitePool,
    path: &Path,
    wanted: u64,
) -> Result<Vec<MissingWork>, Error> {
    let failed = |e| Error::sqlite("look for missing work", path, e);
    // Beyond i64::MAX no sample can be stored, so nothing more could be missing or held.
    let limit = i64::try_from(wanted).unwrap_or(i64::MAX);
    let rows = sqlx::query!(
        r#"SELECT design.design AS "design!: i64",
                  criteria.design IS NULL AS "without_criteria!: bool",
                  (SELECT count(*) FROM sample
                   WHERE sample.design = design.design AND sample.sample < ?1) AS "held!: i64"
           FROM design LEFT JOIN criteria ON criteria.design = design.design
           WHERE coalesce(criteria.feasible, 1) = 1
           ORDER BY design.design"#,
        limit,
    )
    .fetch_all(pool)
    .await
    .map_err(failed)?;

    let mut missing = Vec::new();
    for row in rows {
        if !row.without_criteria && row.held >= limit {
            continue;
        }
        let mut samples = Vec::new();
        if row.held == 0 {
            // The usual case on a fresh campaign, without a statement per design.
            if wanted > 0 {
                samples.push(0..wanted);
            }
        } else if row.held < limit {
            let held = sqlx::query_scalar!(
                "SELECT sample FROM sample WHERE design = ? AND sample < ? ORDER BY sample",
                row.design,
                limit,
            )
            .fetch_all(pool)
            .await
            .map_err(failed)?;
            samples = gaps(held.into_iter().map(index), wanted);
        }
        missing.push(MissingWork {
            design: index(row.design),
            criteria: row.without_criteria,
            samples,
        });
    }
    Ok(missing)
}

/// What `held`, ascending, leaves of `0..wanted`.
fn gaps(held: impl Iterator<Item = u64>, wanted: u64) -> Vec<Range<u64>> {
    let mut gaps = Vec::new();
    let mut next = 0;
    for sample in held {
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

pub(crate) async fn optimiser_runs(
    pool: &SqlitePool,
    path: &Path,
) -> Result<Vec<OptimiserRunRow>, Error> {
    let rows = sqlx::query!(
        "SELECT approach, start, result_json, simulator_calls, cpu_seconds
         FROM optimiser_run ORDER BY approach, start"
    )
    .fetch_all(pool)
    .await
    .map_err(|e| Error::sqlite("read optimiser runs", path, e))?;
    Ok(rows
        .into_iter()
        .map(|r| OptimiserRunRow {
            approach: r.approach,
            start: index(r.start),
            result_json: r.result_json,
            simulator_calls: index(r.simulator_calls),
            cpu_seconds: r.cpu_seconds,
        })
        .collect())
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

pub(crate) async fn verify_samples(
    pool: &SqlitePool,
    path: &Path,
    approach: &str,
) -> Result<Vec<VerifyRow>, Error> {
    let rows = sqlx::query!(
        "SELECT approach, sample, delta_ste_um FROM verify_sample
         WHERE approach = ? ORDER BY sample",
        approach,
    )
    .fetch_all(pool)
    .await
    .map_err(|e| Error::sqlite("read verification samples", path, e))?;
    Ok(rows
        .into_iter()
        .map(|r| VerifyRow {
            approach: r.approach,
            sample: index(r.sample),
            delta_ste_um: r.delta_ste_um,
        })
        .collect())
}

pub(crate) async fn job_times(pool: &SqlitePool, path: &Path) -> Result<Vec<JobTimeRow>, Error> {
    let rows = sqlx::query!("SELECT job, cpu_seconds FROM job_time ORDER BY job")
        .fetch_all(pool)
        .await
        .map_err(|e| Error::sqlite("read what jobs cost", path, e))?;
    Ok(rows
        .into_iter()
        .map(|r| JobTimeRow {
            job: r.job.cast_unsigned(),
            cpu_seconds: r.cpu_seconds,
        })
        .collect())
}

pub(crate) async fn failures(pool: &SqlitePool, path: &Path) -> Result<Vec<FailureRow>, Error> {
    let rows = sqlx::query!(
        r#"SELECT job, attempt AS "attempt: u32", worker, kind, error, at_unix_ms
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
                kind: FailureKind::parse(&r.kind).ok_or(Error::UnknownValue {
                    column: "failure.kind",
                    value: r.kind,
                })?,
                error: r.error,
                at_unix_ms: r.at_unix_ms,
            })
        })
        .collect()
}

pub(crate) async fn progress(pool: &SqlitePool, path: &Path) -> Result<Progress, Error> {
    // One statement, so that all counts are of one moment.
    let r = sqlx::query!(
        r#"SELECT (SELECT count(*) FROM design) AS "designs!: i64",
                  (SELECT count(*) FROM criteria) AS "criteria_done!: i64",
                  (SELECT count(*) FROM criteria WHERE feasible = 1) AS "feasible!: i64",
                  (SELECT count(*) FROM sample) AS "samples!: i64",
                  (SELECT count(*) FROM response) AS "responses!: i64",
                  (SELECT count(*) FROM model) AS "models!: i64",
                  (SELECT count(*) FROM optimiser_run) AS "optimiser_runs!: i64",
                  (SELECT count(*) FROM optimum) AS "optima!: i64",
                  (SELECT count(*) FROM verify_sample) AS "verify_samples!: i64",
                  (SELECT count(*) FROM failure) AS "failures!: i64""#
    )
    .fetch_one(pool)
    .await
    .map_err(|e| Error::sqlite("count rows", path, e))?;
    Ok(Progress {
        designs: index(r.designs),
        criteria_done: index(r.criteria_done),
        feasible: index(r.feasible),
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
