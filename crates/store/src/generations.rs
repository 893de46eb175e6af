//! The wanted generations of streams, and batches of other generations.

use std::collections::BTreeMap;

use ledger::StreamId;

use crate::Error;
use crate::batch::{Batch, Receipt};
use crate::connection::Connection;
use crate::samples::{self, Streams};
use crate::values::{StreamKey, key};

pub(crate) async fn all(connection: &mut Connection<'_>) -> Result<BTreeMap<StreamId, u64>, Error> {
    let query =
        sqlx::query!(r#"SELECT stream AS "stream: StreamKey", generation FROM stream_generation"#);
    let rows = connection.all(query).await?;
    let generations = rows
        .into_iter()
        .map(|row| (row.stream.0, row.generation.cast_unsigned()));
    Ok(generations.collect())
}

/// Whether a batch is for another generation than the wanted one.
pub(crate) async fn is_stale(
    connection: &mut Connection<'_>,
    batch: &Batch,
) -> Result<bool, Error> {
    let Some((stream, generation)) = batch.only_for else {
        return Ok(false);
    };
    let stream = key(stream);
    let query = sqlx::query!(
        "SELECT generation FROM stream_generation WHERE stream = ?",
        stream
    );
    let wanted = connection.optional(query).await?;
    Ok(wanted.map(|row| row.generation) != Some(generation.cast_signed()))
}

/// Sets the wanted generations and removes the samples of others.
pub(crate) async fn put(
    connection: &mut Connection<'_>,
    rows: &[(StreamId, u64)],
) -> Result<Receipt, Error> {
    for (stream, generation) in rows {
        let (generation, key) = (generation.cast_signed(), key(*stream));
        let query = sqlx::query!(
            "UPDATE stream_generation SET generation = ?1 WHERE stream = ?2 AND generation <> ?1",
            generation,
            key,
        );
        if connection.execute(query).await? > 0 {
            samples::remove(connection, Streams::One(*stream)).await?;
        }
        let query = sqlx::query!(
            "INSERT INTO stream_generation (stream, generation) VALUES (?, ?) ON CONFLICT DO NOTHING",
            key,
            generation,
        );
        connection.execute(query).await?;
    }
    Ok(Receipt::new(rows.len() as u64))
}

pub(crate) async fn remove(connection: &mut Connection<'_>, stream: StreamId) -> Result<(), Error> {
    let stream = key(stream);
    let query = sqlx::query!("DELETE FROM stream_generation WHERE stream = ?", stream);
    connection.execute(query).await.map(drop)
}
