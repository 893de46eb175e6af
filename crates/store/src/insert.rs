//! The operations of the writer's transactions, each within a savepoint of the caller.

use ledger::StreamId;

use crate::Error;
use crate::connection::Connection;
use crate::derived::{self, Derived, REMOVING};
use crate::keyed::{self, Keyed, Table};
use crate::query;
use crate::rows::{Batch, CampaignRow, DesignRow, FailureRow, Receipt};
use crate::samples::{self, Of, SampleBlock};
use crate::tally;

/// Sets the digest of the gear model if there is none yet, and refuses another one.
pub(crate) async fn model_digest(
    connection: &mut Connection<'_>,
    digest: &str,
) -> Result<Receipt, Error> {
    let mut row = query::campaign(connection).await?;
    match row.model_digest {
        Some(held) if held == digest => Ok(Receipt {
            duplicate_rows: 1,
            ..Receipt::default()
        }),
        Some(held) => Err(Error::ModelDigestConflict {
            held,
            offered: digest.to_owned(),
        }),
        None => {
            row.model_digest = Some(digest.to_owned());
            replace(connection, &[row]).await
        }
    }
}

/// Stores rows, replacing those with the same keys.
pub(crate) async fn replace<T: Table>(
    connection: &mut Connection<'_>,
    rows: &[T],
) -> Result<Receipt, Error> {
    keyed::replace(connection, rows).await?;
    Ok(new(rows.len() as u64))
}

/// Stores all batches, or returns an error, after which the caller rolls back to its savepoint.
/// Returns one receipt per batch, in order. A row that two batches contain counts as new for the
/// first.
pub(crate) async fn batches(
    connection: &mut Connection<'_>,
    batches: &[&Batch],
) -> Result<Vec<Receipt>, Error> {
    let mut receipts = Vec::with_capacity(batches.len());
    for batch in batches {
        receipts.push(Receipt {
            is_stale: is_stale(connection, batch).await?,
            ..Receipt::default()
        });
    }
    let fresh: Vec<&Batch> = batches
        .iter()
        .zip(&receipts)
        .filter(|(_, receipt)| !receipt.is_stale)
        .map(|(batch, _)| *batch)
        .collect();
    let stored = fresh_batches(connection, &fresh).await?;
    let taken = receipts.iter_mut().filter(|receipt| !receipt.is_stale);
    for (receipt, stored) in taken.zip(stored) {
        *receipt = stored;
    }
    Ok(receipts)
}

/// Whether a batch is for another generation than the wanted one.
async fn is_stale(connection: &mut Connection<'_>, batch: &Batch) -> Result<bool, Error> {
    let Some((stream, generation)) = batch.only_for else {
        return Ok(false);
    };
    let key = stream.key().cast_signed();
    let wanted = connection
        .optional(
            "read what is wanted",
            sqlx::query!(
                "SELECT generation FROM stream_generation WHERE stream = ?",
                key
            ),
        )
        .await?;
    Ok(wanted.map(|r| r.generation) != Some(generation.cast_signed()))
}

/// Sets the wanted generations and removes the samples of others.
pub(crate) async fn generations(
    connection: &mut Connection<'_>,
    rows: &[(StreamId, u64)],
) -> Result<Receipt, Error> {
    for (stream, generation) in rows {
        let (generation, key) = (generation.cast_signed(), stream.key().cast_signed());
        let done = connection.insert("stream_generation", sqlx::query!(
            "UPDATE stream_generation SET generation = ?1 WHERE stream = ?2 AND generation <> ?1",
            generation,
            key,
        )).await?;
        if done.rows_affected() > 0 {
            samples::remove(connection, Of::One(*stream)).await?;
        }
        connection
            .insert(
                "stream_generation",
                sqlx::query!(
                    "INSERT INTO stream_generation (stream, generation) VALUES (?, ?)
             ON CONFLICT DO NOTHING",
                    key,
                    generation,
                ),
            )
            .await?;
    }
    Ok(new(rows.len() as u64))
}

async fn fresh_batches(
    connection: &mut Connection<'_>,
    batches: &[&Batch],
) -> Result<Vec<Receipt>, Error> {
    let mut receipts = vec![Receipt::default(); batches.len()];
    let to = &mut receipts;

    let rows = owned(batches, |batch| &batch.criteria);
    keyed::insert(connection, &rows, to).await?;
    samples::insert(connection, batches, to).await?;
    let rows = owned(batches, |batch| &batch.runs);
    keyed::insert(connection, &rows, to).await?;
    let rows = owned(batches, |batch| &batch.evaluations);
    keyed::insert(connection, &rows, to).await?;
    let rows = owned(batches, |batch| &batch.times);
    keyed::insert(connection, &rows, to).await?;
    for batch in batches {
        derived::derivations(connection, &batch.derivations).await?;
    }
    for (owner, row) in owned(batches, |batch| &batch.failures) {
        if failure(connection, row).await? {
            to[owner].new_rows += 1;
        } else {
            to[owner].duplicate_rows += 1;
        }
    }
    Ok(receipts)
}

/// The rows of one table, each with the index of its batch.
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
    connection: &mut Connection<'_>,
    rows: &[DesignRow],
) -> Result<Receipt, Error> {
    let mut receipts = [Receipt::default()];
    let rows: Vec<(usize, &DesignRow)> = rows.iter().map(|row| (0, row)).collect();
    keyed::insert(connection, &rows, &mut receipts).await?;
    let [receipt] = receipts;
    Ok(receipt)
}

/// Stores a failure and returns whether it was new.
async fn failure(connection: &mut Connection<'_>, row: &FailureRow) -> Result<bool, Error> {
    let kind = row.kind.as_str();
    let serial = row.serial.map(u64::cast_signed);
    let key = row.stream.key().cast_signed();
    let done = connection
        .insert(
            "failure",
            sqlx::query!(
                "INSERT INTO failure (stream, shared, lease, worker, serial, kind, error, at_unix_ms)
         VALUES (?, ?, ?, ?, ?, ?, ?, ?)
         ON CONFLICT (worker, serial) WHERE serial IS NOT NULL DO NOTHING",
                key,
                row.shared,
                row.lease,
                row.worker,
                serial,
                kind,
                row.error,
                row.at_unix_ms,
            ),
        )
        .await?;
    if done.rows_affected() == 0 {
        return Ok(false);
    }
    tally::count_failure(connection, kind, &row.error, done.last_insert_rowid()).await?;
    Ok(true)
}

/// Replaces the campaign by a larger one. The responses go, so that all that rests on them goes while the larger
/// campaign samples.
pub(crate) async fn extension(
    connection: &mut Connection<'_>,
    row: &CampaignRow,
) -> Result<Receipt, Error> {
    let held = query::campaign(connection).await?;
    if held.seed != row.seed {
        return Err(Error::OtherSeed {
            held: held.seed,
            offered: row.seed,
        });
    }
    let row = CampaignRow {
        name: row.name.clone(),
        file_text: row.file_text.clone(),
        digest: row.digest.clone(),
        ..held
    };
    keyed::replace(connection, &[row]).await?;
    derived::remove(connection, &[Derived::Responses]).await?;
    Ok(new(1))
}

/// Removes the evaluations of a run.
pub(crate) async fn no_evaluations(
    connection: &mut Connection<'_>,
    stream: StreamId,
) -> Result<Receipt, Error> {
    let key = stream.key().cast_signed();
    let query = sqlx::query!("DELETE FROM evaluation WHERE stream = ?", key);
    connection.execute(REMOVING, query).await?;
    Ok(Receipt::default())
}

fn new(rows: u64) -> Receipt {
    Receipt {
        new_rows: rows,
        ..Receipt::default()
    }
}

/// Refuses rows that cannot be stored whatever the store holds.
pub(crate) fn check(batch: &Batch) -> Result<(), Error> {
    fn all<T: Keyed>(rows: &[T]) -> Result<(), Error> {
        rows.iter().try_for_each(T::check)
    }
    all(&batch.criteria)?;
    batch.samples.iter().try_for_each(SampleBlock::check)?;
    all(&batch.runs)?;
    all(&batch.evaluations)?;
    all(&batch.times)
}
