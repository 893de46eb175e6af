//! Runs of optimisers.

use ledger::StreamId;

use crate::Error;
use crate::connection::Connection;
use crate::row::{self, Columns, Row};
use crate::values::{StreamKey, key};

/// One run of an optimiser from one start.
#[derive(Debug, Clone, PartialEq)]
pub struct OptimiserRunRow {
    /// The run.
    pub stream: StreamId,
    /// The result, as JSON. Two rows are the same run if this and `simulator_calls` agree.
    pub result_json: String,
    /// Number of calls of the simulator.
    pub simulator_calls: u64,
    /// Processor time, in seconds. It is measured and therefore not compared.
    pub cpu_seconds: f64,
}

impl Row for OptimiserRunRow {
    const TABLE: &'static str = "optimiser_run";

    fn key(&self) -> String {
        self.stream.to_string()
    }

    fn add_to(&self, columns: &mut Columns) {
        columns
            .stream(self.stream)
            .text(&self.result_json)
            .count("simulator_calls", self.simulator_calls)
            .number("cpu_seconds", self.cpu_seconds);
    }
}

/// The runs with keys `first..=last`.
async fn range(
    connection: &mut Connection<'_>,
    first: i64,
    last: i64,
) -> Result<Vec<OptimiserRunRow>, Error> {
    let query = sqlx::query!(
        r#"SELECT stream AS "stream: StreamKey", result_json,
                  simulator_calls AS "simulator_calls: u64", cpu_seconds, seal
           FROM optimiser_run WHERE stream BETWEEN ? AND ? ORDER BY stream"#,
        first,
        last,
    );
    let rows = connection.all(query).await?;
    rows.into_iter()
        .map(|row| {
            let run = OptimiserRunRow {
                stream: row.stream.0,
                result_json: row.result_json,
                simulator_calls: row.simulator_calls,
                cpu_seconds: row.cpu_seconds,
            };
            connection.check(run, row.seal)
        })
        .collect()
}

pub(crate) async fn all(connection: &mut Connection<'_>) -> Result<Vec<OptimiserRunRow>, Error> {
    range(connection, 0, i64::MAX).await
}

/// Stores a run and returns whether it was new.
pub(crate) async fn insert(
    connection: &mut Connection<'_>,
    row: &OptimiserRunRow,
    origin: Option<i64>,
) -> Result<bool, Error> {
    let seal = row::seal(row)?;
    let (stream, calls) = (key(row.stream), row.simulator_calls.cast_signed());
    let query = sqlx::query!(
        "INSERT INTO optimiser_run (stream, result_json, simulator_calls, cpu_seconds, seal, origin)
         VALUES (?, ?, ?, ?, ?, ?) ON CONFLICT DO NOTHING",
        stream,
        row.result_json,
        calls,
        row.cpu_seconds,
        seal,
        origin,
    );
    if connection.execute(query).await? > 0 {
        return Ok(true);
    }
    let mut stored = range(connection, stream, stream).await?.pop();
    if let Some(stored) = &mut stored {
        // It is measured and differs between attempts.
        stored.cpu_seconds = row.cpu_seconds;
    }
    row::agree(stored.as_ref(), row)?;
    Ok(false)
}

/// Removes a run and returns the number of rows removed.
pub(crate) async fn remove(
    connection: &mut Connection<'_>,
    stream: StreamId,
) -> Result<u64, Error> {
    let stream = key(stream);
    let query = sqlx::query!("DELETE FROM optimiser_run WHERE stream = ?", stream);
    connection.execute(query).await
}
