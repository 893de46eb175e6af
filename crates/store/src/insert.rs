//! What one transaction of the writer may do, each within a savepoint of the caller.

use std::path::Path;

use sqlx::Executor as _;
use sqlx::sqlite::SqliteConnection;

use crate::Error;
use crate::keyed::{self, Approach, Keyed};
use crate::query;
use crate::rounds;
use crate::rows::{
    Batch, CampaignRow, DesignRow, FailureRow, ModelRow, OptimumRow, Receipt, ResponseRow,
};
use crate::tables::{finite, fits, number};
use crate::tally::{self, Tally};

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
        Some(held) if held == digest => Ok(Receipt {
            duplicate_rows: 1,
            ..Receipt::default()
        }),
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

/// Stores batches, all of them or, with an error, none: the caller then goes back to its
/// savepoint. One receipt each, in their order; a row that two of them bring is new to the first.
pub(crate) async fn batches(
    connection: &mut SqliteConnection,
    path: &Path,
    batches: &[&Batch],
) -> Result<Vec<Receipt>, Error> {
    let failed = |e| Error::sqlite("set a savepoint", path, e);
    let mut receipts = Vec::with_capacity(batches.len());
    for batch in batches {
        receipts.push(Receipt {
            is_stale: is_stale(connection, path, batch).await?,
            ..Receipt::default()
        });
    }
    let fresh: Vec<&Batch> = batches
        .iter()
        .zip(&receipts)
        .filter(|(_, receipt)| !receipt.is_stale)
        .map(|(batch, _)| *batch)
        .collect();
    connection
        .execute("SAVEPOINT trust")
        .await
        .map_err(failed)?;
    let stored = match batches_in(connection, path, &fresh, Approach::Trust).await? {
        Some(receipts) => receipts,
        None => {
            connection
                .execute("ROLLBACK TO trust")
                .await
                .map_err(failed)?;
            batches_in(connection, path, &fresh, Approach::Look)
                .await?
                // No one else writes, so what was not there a moment ago can go in.
                .ok_or_else(|| Error::Damaged {
                    path: path.to_owned(),
                    detail: "rows that it does not hold cannot be inserted".into(),
                })?
        }
    };
    connection.execute("RELEASE trust").await.map_err(failed)?;
    let taken = receipts.iter_mut().filter(|receipt| !receipt.is_stale);
    for (receipt, stored) in taken.zip(stored) {
        *receipt = stored;
    }
    Ok(receipts)
}

/// Whether a batch is of another generation than is wanted.
async fn is_stale(
    connection: &mut SqliteConnection,
    path: &Path,
    batch: &Batch,
) -> Result<bool, Error> {
    let Some((stream, generation)) = &batch.only_for else {
        return Ok(false);
    };
    let wanted = sqlx::query_scalar!(
        "SELECT generation FROM stream_generation WHERE stream = ?",
        stream
    )
    .fetch_optional(connection)
    .await
    .map_err(|e| Error::sqlite("read what is wanted", path, e))?;
    Ok(wanted != Some(generation.cast_signed()))
}

/// Says which generations are wanted; the samples of others are removed.
pub(crate) async fn generations(
    connection: &mut SqliteConnection,
    path: &Path,
    rows: &[(String, u64)],
) -> Result<Receipt, Error> {
    for (stream, generation) in rows {
        let generation = generation.cast_signed();
        let failed = |e| Error::insertion("stream_generation", path, e);
        let done = sqlx::query!(
            "UPDATE stream_generation SET generation = ?1 WHERE stream = ?2 AND generation <> ?1",
            generation,
            stream,
        )
        .execute(&mut *connection)
        .await
        .map_err(failed)?;
        if done.rows_affected() > 0 {
            remove_samples(connection, path, stream).await?;
        }
        sqlx::query!(
            "INSERT INTO stream_generation (stream, generation) VALUES (?, ?)
             ON CONFLICT DO NOTHING",
            stream,
            generation,
        )
        .execute(&mut *connection)
        .await
        .map_err(failed)?;
    }
    Ok(new(rows.len() as u64))
}

/// Removes the samples of a point.
async fn remove_samples(
    connection: &mut SqliteConnection,
    path: &Path,
    point: &str,
) -> Result<(), Error> {
    for table in [
        "DELETE FROM verify_sample WHERE approach = ?",
        "DELETE FROM verify_tally WHERE approach = ?",
    ] {
        sqlx::query(table)
            .bind(point)
            .execute(&mut *connection)
            .await
            .map_err(|e| Error::sqlite("remove derived rows", path, e))?;
    }
    Ok(())
}

async fn batches_in(
    connection: &mut SqliteConnection,
    path: &Path,
    batches: &[&Batch],
    approach: Approach,
) -> Result<Option<Vec<Receipt>>, Error> {
    let mut receipts = vec![Receipt::default(); batches.len()];
    let to = &mut receipts;
    let mut tally = Tally::default();

    let rows = owned(batches, |batch| &batch.criteria);
    if keyed::insert(connection, path, &rows, approach, to)
        .await?
        .is_none()
    {
        return Ok(None);
    }
    let rows = owned(batches, |batch| &batch.samples);
    match keyed::insert(connection, path, &rows, approach, to).await? {
        Some(fresh) => fresh.into_iter().for_each(|row| tally.add_sample(row)),
        None => return Ok(None),
    }
    let rows = owned(batches, |batch| &batch.verify);
    match keyed::insert(connection, path, &rows, approach, to).await? {
        Some(fresh) => fresh
            .into_iter()
            .for_each(|row| tally.add_verify_sample(row)),
        None => return Ok(None),
    }
    let rows = owned(batches, |batch| &batch.runs);
    if keyed::insert(connection, path, &rows, approach, to)
        .await?
        .is_none()
    {
        return Ok(None);
    }
    let rows = owned(batches, |batch| &batch.times);
    if keyed::insert(connection, path, &rows, approach, to)
        .await?
        .is_none()
    {
        return Ok(None);
    }
    for (owner, row) in owned(batches, |batch| &batch.failures) {
        if failure(connection, path, row).await? {
            to[owner].new_rows += 1;
        } else {
            to[owner].duplicate_rows += 1;
        }
    }
    tally.write(connection, path).await?;
    Ok(Some(receipts))
}

/// The rows of one table, with the index of the batch that brings them.
fn owned<'b, T>(
    batches: &[&'b Batch],
    rows: impl Fn(&'b Batch) -> &'b Vec<T>,
) -> Vec<(usize, &'b T)> {
    let owned = batches.iter().enumerate();
    owned
        .flat_map(|(owner, batch)| rows(batch).iter().map(move |row| (owner, row)))
        .collect()
}

pub(crate) async fn designs(
    connection: &mut SqliteConnection,
    path: &Path,
    rows: &[DesignRow],
) -> Result<Receipt, Error> {
    let mut receipts = [Receipt::default()];
    let rows: Vec<(usize, &DesignRow)> = rows.iter().map(|row| (0, row)).collect();
    keyed::insert(connection, path, &rows, Approach::Look, &mut receipts).await?;
    let [receipt] = receipts;
    Ok(receipt)
}

/// Whether the failure was new.
async fn failure(
    connection: &mut SqliteConnection,
    path: &Path,
    row: &FailureRow,
) -> Result<bool, Error> {
    let kind = row.kind.as_str();
    let serial = row.serial.map(u64::cast_signed);
    let done = sqlx::query!(
        "INSERT INTO failure (job, attempt, worker, serial, kind, error, at_unix_ms)
         VALUES (?, ?, ?, ?, ?, ?, ?)
         ON CONFLICT (worker, serial) WHERE serial IS NOT NULL DO NOTHING",
        row.job,
        row.attempt,
        row.worker,
        serial,
        kind,
        row.error,
        row.at_unix_ms,
    )
    .execute(&mut *connection)
    .await
    .map_err(|e| Error::insertion("failure", path, e))?;
    if done.rows_affected() == 0 {
        return Ok(false);
    }
    tally::count_failure(connection, path, kind, &row.error, done.last_insert_rowid()).await?;
    Ok(true)
}

/// Replaces the responses of these designs.
pub(crate) async fn responses(
    connection: &mut SqliteConnection,
    path: &Path,
    rows: &[ResponseRow],
) -> Result<Receipt, Error> {
    use keyed::Columns as _;
    for row in rows {
        row.check()?;
    }
    let offered: Vec<&ResponseRow> = rows.iter().collect();
    keyed::write(connection, path, "INSERT OR REPLACE INTO", "", &offered).await?;
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
    finite("optimum.criterion_um", key, row.criterion_um)?;
    finite("optimum.cpu_seconds", key, row.cpu_seconds)?;
    fits("optimum.simulator_calls", row.simulator_calls)?;
    let criterion_um = number(row.criterion_um);
    let cpu_seconds = number(row.cpu_seconds);
    let simulator_calls = row.simulator_calls.cast_signed();
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

/// Puts a larger campaign in the place of the one held, and clears what was derived from the
/// smaller one.
pub(crate) async fn extension(
    connection: &mut SqliteConnection,
    path: &Path,
    row: &CampaignRow,
    derived: &[String],
) -> Result<Receipt, Error> {
    let held = query::campaign(&mut *connection, path).await?;
    if held.seed != row.seed {
        return Err(Error::OtherSeed {
            held: held.seed,
            offered: row.seed,
        });
    }
    sqlx::query!(
        "UPDATE campaign SET name = ?, file_text = ?, digest = ?",
        row.name,
        row.file_text,
        row.digest,
    )
    .execute(&mut *connection)
    .await
    .map_err(|e| Error::insertion("campaign", path, e))?;
    clear(connection, path, derived).await?;
    Ok(new(1))
}

/// Removes all responses, models and rounds of infill, and of these approaches the runs, the optima
/// and their samples.
pub(crate) async fn clear(
    connection: &mut SqliteConnection,
    path: &Path,
    approaches: &[String],
) -> Result<Receipt, Error> {
    let failed = |e| Error::sqlite("remove derived rows", path, e);
    for table in ["DELETE FROM response", "DELETE FROM model"] {
        connection.execute(table).await.map_err(failed)?;
    }
    rounds::clear(connection, path).await?;
    for approach in approaches {
        for table in [
            "DELETE FROM optimiser_run WHERE approach = ?",
            "DELETE FROM optimum WHERE approach = ?",
            "DELETE FROM stream_generation
             WHERE stream = ?1 OR stream LIKE 'run ' || ?1 || ' %'",
        ] {
            sqlx::query(table)
                .bind(approach)
                .execute(&mut *connection)
                .await
                .map_err(failed)?;
        }
        remove_samples(connection, path, approach).await?;
    }
    Ok(Receipt::default())
}

fn new(rows: u64) -> Receipt {
    Receipt {
        new_rows: rows,
        ..Receipt::default()
    }
}

/// Whether any row of this kind cannot be stored whatever the store holds.
pub(crate) fn check(batch: &Batch) -> Result<(), Error> {
    fn all<T: Keyed>(rows: &[T]) -> Result<(), Error> {
        rows.iter().try_for_each(T::check)
    }
    all(&batch.criteria)?;
    all(&batch.samples)?;
    all(&batch.verify)?;
    all(&batch.runs)?;
    all(&batch.times)
}
