//! The wanted generations of streams, and batches of other generations.

use std::collections::BTreeMap;

use ledger::StreamId;

use crate::blocks::Streams;
use crate::connection::Connection;
use crate::receipt::Receipt;
use crate::samples;
use crate::values::{StreamKey, key};
use crate::{Error, evaluations};

pub(crate) async fn all(connection: &mut Connection<'_>) -> Result<BTreeMap<StreamId, u64>, Error> {
    let query =
        sqlx::query!(r#"SELECT stream AS "stream: StreamKey", generation FROM stream_generation"#);
    let rows = connection.all(query).await?;
    let generations = rows
        .into_iter()
        .map(|row| (row.stream.0, row.generation.cast_unsigned()));
    Ok(generations.collect())
}

/// Whether a batch that is only for this stream and generation is out of date.
pub(crate) async fn is_stale(
    connection: &mut Connection<'_>,
    only_for: Option<(StreamId, u64)>,
) -> Result<bool, Error> {
    let Some((stream, generation)) = only_for else {
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

/// Sets the wanted generations, and removes the samples of the generations that they replace.
pub(crate) async fn put(
    connection: &mut Connection<'_>,
    rows: &[(StreamId, u64)],
) -> Result<Receipt, Error> {
    let stored = all(connection).await?;
    let mut new = Vec::new();
    for &(stream, generation) in rows {
        match stored.get(&stream) {
            Some(earlier) if *earlier == generation => continue,
            Some(_) => samples::remove(connection, Streams::One(stream)).await?,
            None => {}
        }
        new.push((stream, generation));
    }
    let statement = [
        "INSERT OR REPLACE INTO stream_generation (stream, generation) ",
        "",
    ];
    connection
        .insert_many(statement, &new, |values, (stream, generation)| {
            values
                .push_bind(key(*stream))
                .push_bind(generation.cast_signed());
        })
        .await?;
    Ok(Receipt::new(rows.len() as u64))
}

async fn remove(connection: &mut Connection<'_>, stream: StreamId) -> Result<(), Error> {
    let stream = key(stream);
    let query = sqlx::query!("DELETE FROM stream_generation WHERE stream = ?", stream);
    connection.execute(query).await.map(drop)
}

/// Removes the evaluations and the wanted generation of a stream.
pub(crate) async fn forget(connection: &mut Connection<'_>, stream: StreamId) -> Result<(), Error> {
    evaluations::remove(connection, stream, 0).await?;
    remove(connection, stream).await
}
