//! The statements that write, each within a transaction of the caller.
//!
//! Tables where the first write wins are filled with `ON CONFLICT DO NOTHING`; rows that did not
//! go in are then compared with those held.

use std::collections::BTreeMap;
use std::path::Path;

use sqlx::sqlite::{Sqlite, SqliteConnection};
use sqlx::{QueryBuilder, Row as _};

use crate::Error;
use crate::query;
use crate::rows::{
    Batch, CampaignRow, CriteriaRow, DesignRow, FailureRow, JobTimeRow, ModelRow, OptimiserRunRow,
    OptimumRow, Receipt, ResponseRow, SampleRow, VerifyRow,
};

/// Rows per statement: enough to make the hop to SQLite's thread cheap, few enough that three
/// values each stay far below SQLite's 32 766 parameters.
const ROWS_PER_STATEMENT: usize = 1000;

pub(crate) async fn campaign(
    connection: &mut SqliteConnection,
    path: &Path,
    row: &CampaignRow,
) -> Result<(), Error> {
    let seed = row.seed.cast_signed();
    sqlx::query!(
        "INSERT INTO campaign
            (one, name, file_text, digest, seed, program_version, model_digest)
         VALUES (1, ?, ?, ?, ?, ?, ?)",
        row.name,
        row.file_text,
        row.digest,
        seed,
        row.program_version,
        row.model_digest,
    )
    .execute(connection)
    .await
    .map_err(|e| Error::insertion("campaign", path, e))?;
    Ok(())
}

/// Sets the digest of the gear model if there is none yet, and refuses another one.
pub(crate) async fn model_digest(
    connection: &mut SqliteConnection,
    path: &Path,
    digest: &str,
) -> Result<Receipt, Error> {
    let held = query::campaign(&mut *connection, path).await?.model_digest;
    match held {
        Some(held) if held == digest => Ok(duplicates(1)),
        Some(held) => Err(Error::ModelDigestConflict {
            held,
            offered: digest.to_owned(),
        }),
        None => {
            sqlx::query!("UPDATE campaign SET model_digest = ?", digest)
                .execute(connection)
                .await
                .map_err(|e| Error::insertion("campaign", path, e))?;
            Ok(new(1))
        }
    }
}

pub(crate) async fn batch(
    connection: &mut SqliteConnection,
    path: &Path,
    batch: &Batch,
) -> Result<Receipt, Error> {
    let mut receipt = Receipt::default();
    for row in &batch.criteria {
        receipt += criteria(connection, path, row).await?;
    }
    for rows in batch.samples.chunks(ROWS_PER_STATEMENT) {
        receipt += samples(connection, path, rows).await?;
    }
    for rows in batch.verify.chunks(ROWS_PER_STATEMENT) {
        receipt += verify_samples(connection, path, rows).await?;
    }
    for row in &batch.runs {
        receipt += optimiser_run(connection, path, row).await?;
    }
    for row in &batch.times {
        receipt += job_time(connection, path, row).await?;
    }
    for row in &batch.failures {
        receipt += failure(connection, path, row).await?;
    }
    Ok(receipt)
}

pub(crate) async fn designs(
    connection: &mut SqliteConnection,
    path: &Path,
    rows: &[DesignRow],
) -> Result<Receipt, Error> {
    let mut receipt = Receipt::default();
    for row in rows {
        receipt += design(connection, path, row).await?;
    }
    Ok(receipt)
}

async fn design(
    connection: &mut SqliteConnection,
    path: &Path,
    row: &DesignRow,
) -> Result<Receipt, Error> {
    let key = || format!("design {}", row.design);
    let index = integer("design.design", row.design)?;
    let x_p = finite("design.x_p", key, row.x_p)?;
    let x_r = finite("design.x_r", key, row.x_r)?;
    let ha0_p = finite("design.ha0_p", key, row.ha0_p)?;
    let ha0_r = finite("design.ha0_r", key, row.ha0_r)?;
    let hf0_p = finite("design.hf0_p", key, row.hf0_p)?;
    let hf0_r = finite("design.hf0_r", key, row.hf0_r)?;
    let done = sqlx::query!(
        "INSERT INTO design (design, x_p, x_r, ha0_p, ha0_r, hf0_p, hf0_r)
         VALUES (?, ?, ?, ?, ?, ?, ?) ON CONFLICT DO NOTHING",
        index,
        x_p,
        x_r,
        ha0_p,
        ha0_r,
        hf0_p,
        hf0_r,
    )
    .execute(&mut *connection)
    .await
    .map_err(|e| Error::insertion("design", path, e))?;
    if done.rows_affected() == 1 {
        return Ok(new(1));
    }
    let held = query::design(connection, path, index).await?;
    if held == *row {
        Ok(duplicates(1))
    } else {
        Err(Error::DesignConflict { design: row.design })
    }
}

async fn criteria(
    connection: &mut SqliteConnection,
    path: &Path,
    row: &CriteriaRow,
) -> Result<Receipt, Error> {
    let key = || format!("design {}", row.design);
    let number = |column, value: Option<f64>| value.map(|v| finite(column, key, v)).transpose();
    let index = integer("criteria.design", row.design)?;
    let contact_ratio = number("criteria.contact_ratio", row.contact_ratio)?;
    let specific_sliding = number("criteria.specific_sliding", row.specific_sliding)?;
    let hertz_pressure = number("criteria.hertz_pressure_mpa", row.hertz_pressure_mpa)?;
    let hertz_pressure_worn = number(
        "criteria.hertz_pressure_worn_mpa",
        row.hertz_pressure_worn_mpa,
    )?;
    let root_stress = number("criteria.root_stress_mpa", row.root_stress_mpa)?;
    let clearance_p = number("criteria.clearance_p_mm", row.clearance_p_mm)?;
    let clearance_r = number("criteria.clearance_r_mm", row.clearance_r_mm)?;
    let flank_margin_p = number("criteria.flank_margin_p_mm", row.flank_margin_p_mm)?;
    let flank_margin_r = number("criteria.flank_margin_r_mm", row.flank_margin_r_mm)?;
    let delta_ste = number("criteria.delta_ste_um", row.delta_ste_um)?;
    let delta_ste_archard = number("criteria.delta_ste_archard_um", row.delta_ste_archard_um)?;
    let done = sqlx::query!(
        "INSERT INTO criteria
            (design, feasible, reason, contact_ratio, specific_sliding, hertz_pressure_mpa,
             hertz_pressure_worn_mpa, root_stress_mpa, clearance_p_mm, clearance_r_mm,
             flank_margin_p_mm, flank_margin_r_mm, delta_ste_um, delta_ste_archard_um)
         VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?) ON CONFLICT DO NOTHING",
        index,
        row.feasible,
        row.reason,
        contact_ratio,
        specific_sliding,
        hertz_pressure,
        hertz_pressure_worn,
        root_stress,
        clearance_p,
        clearance_r,
        flank_margin_p,
        flank_margin_r,
        delta_ste,
        delta_ste_archard,
    )
    .execute(&mut *connection)
    .await
    .map_err(|e| Error::insertion("criteria", path, e))?;
    if done.rows_affected() == 1 {
        return Ok(new(1));
    }
    let held = query::criteria_of(connection, path, index).await?;
    if held == *row {
        Ok(duplicates(1))
    } else {
        Err(Error::CriteriaConflict {
            design: row.design,
            held: Box::new(held),
            offered: Box::new(row.clone()),
        })
    }
}

/// At most [`ROWS_PER_STATEMENT`] samples.
async fn samples(
    connection: &mut SqliteConnection,
    path: &Path,
    rows: &[SampleRow],
) -> Result<Receipt, Error> {
    let mut checked = Vec::with_capacity(rows.len());
    for row in rows {
        let key = || format!("sample {} of design {}", row.sample, row.design);
        checked.push((
            integer("sample.design", row.design)?,
            integer("sample.sample", row.sample)?,
            finite("sample.delta_ste_um", key, row.delta_ste_um)?,
        ));
    }
    // The number of rows varies, which a compile-time checked statement cannot.
    let inserted =
        QueryBuilder::<Sqlite>::new("INSERT INTO sample (design, sample, delta_ste_um) ")
            .push_values(&checked, |mut tuple, (design, sample, delta_ste_um)| {
                tuple
                    .push_bind(*design)
                    .push_bind(*sample)
                    .push_bind(*delta_ste_um);
            })
            .push(" ON CONFLICT DO NOTHING")
            .build()
            .execute(&mut *connection)
            .await
            .map_err(|e| Error::insertion("sample", path, e))?
            .rows_affected();
    if inserted == rows.len() as u64 {
        return Ok(new(inserted));
    }

    let failed = |e| Error::sqlite("read samples", path, e);
    let held: BTreeMap<(i64, i64), f64> = QueryBuilder::<Sqlite>::new(
        "SELECT design, sample, delta_ste_um FROM sample WHERE (design, sample) IN (",
    )
    .push_values(&checked, |mut tuple, (design, sample, _)| {
        tuple.push_bind(*design).push_bind(*sample);
    })
    .push(")")
    .build()
    .fetch_all(connection)
    .await
    .map_err(failed)?
    .iter()
    .map(|r| Ok(((r.try_get(0)?, r.try_get(1)?), r.try_get(2)?)))
    .collect::<Result<_, sqlx::Error>>()
    .map_err(failed)?;
    for (row, (design, sample, offered)) in rows.iter().zip(&checked) {
        if let Some(&held) = held.get(&(*design, *sample))
            && held.to_bits() != offered.to_bits()
        {
            return Err(Error::Conflict {
                design: row.design,
                sample: row.sample,
                held,
                offered: *offered,
            });
        }
    }
    Ok(Receipt {
        new_rows: inserted,
        duplicate_rows: rows.len() as u64 - inserted,
    })
}

/// At most [`ROWS_PER_STATEMENT`] samples.
async fn verify_samples(
    connection: &mut SqliteConnection,
    path: &Path,
    rows: &[VerifyRow],
) -> Result<Receipt, Error> {
    let mut checked = Vec::with_capacity(rows.len());
    for row in rows {
        let key = || format!("sample {} of \"{}\"", row.sample, row.approach);
        checked.push((
            row.approach.as_str(),
            integer("verify_sample.sample", row.sample)?,
            finite("verify_sample.delta_ste_um", key, row.delta_ste_um)?,
        ));
    }
    let inserted =
        QueryBuilder::<Sqlite>::new("INSERT INTO verify_sample (approach, sample, delta_ste_um) ")
            .push_values(&checked, |mut tuple, (approach, sample, delta_ste_um)| {
                tuple
                    .push_bind(*approach)
                    .push_bind(*sample)
                    .push_bind(*delta_ste_um);
            })
            .push(" ON CONFLICT DO NOTHING")
            .build()
            .execute(&mut *connection)
            .await
            .map_err(|e| Error::insertion("verify_sample", path, e))?
            .rows_affected();
    if inserted == rows.len() as u64 {
        return Ok(new(inserted));
    }

    let failed = |e| Error::sqlite("read verification samples", path, e);
    let held: BTreeMap<(String, i64), f64> = QueryBuilder::<Sqlite>::new(
        "SELECT approach, sample, delta_ste_um FROM verify_sample WHERE (approach, sample) IN (",
    )
    .push_values(&checked, |mut tuple, (approach, sample, _)| {
        tuple.push_bind(*approach).push_bind(*sample);
    })
    .push(")")
    .build()
    .fetch_all(connection)
    .await
    .map_err(failed)?
    .iter()
    .map(|r| Ok(((r.try_get(0)?, r.try_get(1)?), r.try_get(2)?)))
    .collect::<Result<_, sqlx::Error>>()
    .map_err(failed)?;
    for (row, (approach, sample, offered)) in rows.iter().zip(&checked) {
        if let Some(&held) = held.get(&((*approach).to_owned(), *sample))
            && held.to_bits() != offered.to_bits()
        {
            return Err(Error::VerifyConflict {
                approach: row.approach.clone(),
                sample: row.sample,
                held,
                offered: *offered,
            });
        }
    }
    Ok(Receipt {
        new_rows: inserted,
        duplicate_rows: rows.len() as u64 - inserted,
    })
}

async fn optimiser_run(
    connection: &mut SqliteConnection,
    path: &Path,
    row: &OptimiserRunRow,
) -> Result<Receipt, Error> {
    let key = || format!("run {} of \"{}\"", row.start, row.approach);
    let start = integer("optimiser_run.start", row.start)?;
    let simulator_calls = integer("optimiser_run.simulator_calls", row.simulator_calls)?;
    let cpu_seconds = finite("optimiser_run.cpu_seconds", key, row.cpu_seconds)?;
    let done = sqlx::query!(
        "INSERT INTO optimiser_run (approach, start, result_json, simulator_calls, cpu_seconds)
         VALUES (?, ?, ?, ?, ?) ON CONFLICT DO NOTHING",
        row.approach,
        start,
        row.result_json,
        simulator_calls,
        cpu_seconds,
    )
    .execute(&mut *connection)
    .await
    .map_err(|e| Error::insertion("optimiser_run", path, e))?;
    if done.rows_affected() == 1 {
        return Ok(new(1));
    }
    let held = sqlx::query!(
        "SELECT result_json, simulator_calls FROM optimiser_run WHERE approach = ? AND start = ?",
        row.approach,
        start,
    )
    .fetch_one(connection)
    .await
    .map_err(|e| Error::sqlite("read an optimiser run", path, e))?;
    if held.result_json == row.result_json && held.simulator_calls == simulator_calls {
        Ok(duplicates(1))
    } else {
        Err(Error::RunConflict {
            approach: row.approach.clone(),
            start: row.start,
        })
    }
}

async fn job_time(
    connection: &mut SqliteConnection,
    path: &Path,
    row: &JobTimeRow,
) -> Result<Receipt, Error> {
    let key = || format!("job {:#x}", row.job);
    // A job's number uses all 64 bits as flags, not as a count.
    let job = row.job.cast_signed();
    let cpu_seconds = finite("job_time.cpu_seconds", key, row.cpu_seconds)?;
    let done = sqlx::query!(
        "INSERT INTO job_time (job, cpu_seconds) VALUES (?, ?) ON CONFLICT DO NOTHING",
        job,
        cpu_seconds,
    )
    .execute(connection)
    .await
    .map_err(|e| Error::insertion("job_time", path, e))?;
    Ok(if done.rows_affected() == 1 {
        new(1)
    } else {
        duplicates(1)
    })
}

async fn failure(
    connection: &mut SqliteConnection,
    path: &Path,
    row: &FailureRow,
) -> Result<Receipt, Error> {
    let kind = row.kind.as_str();
    sqlx::query!(
        "INSERT INTO failure (job, attempt, worker, kind, error, at_unix_ms)
         VALUES (?, ?, ?, ?, ?, ?)",
        row.job,
        row.attempt,
        row.worker,
        kind,
        row.error,
        row.at_unix_ms,
    )
    .execute(connection)
    .await
    .map_err(|e| Error::insertion("failure", path, e))?;
    Ok(new(1))
}

/// Replaces the responses of these designs.
pub(crate) async fn responses(
    connection: &mut SqliteConnection,
    path: &Path,
    rows: &[ResponseRow],
) -> Result<Receipt, Error> {
    for row in rows {
        let key = || format!("design {}", row.design);
        let index = integer("response.design", row.design)?;
        let mean_um = finite("response.mean_um", key, row.mean_um)?;
        let sd_um = finite("response.sd_um", key, row.sd_um)?;
        let p90_um = finite("response.p90_um", key, row.p90_um)?;
        let p90_variance_um2 = finite("response.p90_variance_um2", key, row.p90_variance_um2)?;
        let lilliefors_p = row
            .lilliefors_p
            .map(|p| finite("response.lilliefors_p", key, p))
            .transpose()?;
        sqlx::query!(
            "INSERT OR REPLACE INTO response
                (design, mean_um, sd_um, p90_um, p90_variance_um2, lilliefors_p)
             VALUES (?, ?, ?, ?, ?, ?)",
            index,
            mean_um,
            sd_um,
            p90_um,
            p90_variance_um2,
            lilliefors_p,
        )
        .execute(&mut *connection)
        .await
        .map_err(|e| Error::insertion("response", path, e))?;
    }
    Ok(new(rows.len() as u64))
}

/// Replaces the model of this name.
pub(crate) async fn model(
    connection: &mut SqliteConnection,
    path: &Path,
    row: &ModelRow,
) -> Result<Receipt, Error> {
    sqlx::query!(
        "INSERT OR REPLACE INTO model (name, json, summary_json) VALUES (?, ?, ?)",
        row.name,
        row.json,
        row.summary_json,
    )
    .execute(connection)
    .await
    .map_err(|e| Error::insertion("model", path, e))?;
    Ok(new(1))
}

/// Replaces the optimum of this approach.
pub(crate) async fn optimum(
    connection: &mut SqliteConnection,
    path: &Path,
    row: &OptimumRow,
) -> Result<Receipt, Error> {
    let key = || format!("\"{}\"", row.approach);
    let criterion_um = finite("optimum.criterion_um", key, row.criterion_um)?;
    let cpu_seconds = finite("optimum.cpu_seconds", key, row.cpu_seconds)?;
    let simulator_calls = integer("optimum.simulator_calls", row.simulator_calls)?;
    sqlx::query!(
        "INSERT OR REPLACE INTO optimum
            (approach, x_json, criterion_um, feasible, criteria_json, simulator_calls,
             cpu_seconds, note)
         VALUES (?, ?, ?, ?, ?, ?, ?, ?)",
        row.approach,
        row.x_json,
        criterion_um,
        row.feasible,
        row.criteria_json,
        simulator_calls,
        cpu_seconds,
        row.note,
    )
    .execute(connection)
    .await
    .map_err(|e| Error::insertion("optimum", path, e))?;
    Ok(new(1))
}

impl std::ops::AddAssign for Receipt {
    fn add_assign(&mut self, other: Self) {
        self.new_rows += other.new_rows;
        self.duplicate_rows += other.duplicate_rows;
    }
}

fn new(rows: u64) -> Receipt {
    Receipt {
        new_rows: rows,
        duplicate_rows: 0,
    }
}

fn duplicates(rows: u64) -> Receipt {
    Receipt {
        new_rows: 0,
        duplicate_rows: rows,
    }
}

fn integer(column: &'static str, value: u64) -> Result<i64, Error> {
    i64::try_from(value).map_err(|_| Error::TooLarge { column, value })
}

/// The value as SQLite gives it back: NaN would become NULL and -0.0 would lose its sign.
fn finite(column: &'static str, key: impl Fn() -> String, value: f64) -> Result<f64, Error> {
    if value.is_finite() {
        Ok(value + 0.0)
    } else {
        Err(Error::NotFinite {
            column,
            key: key(),
            value,
        })
    }
}
