//! The current stage, and measured times. Times are not results, so they have no digests and are never compared.

use ledger::StreamId;

use crate::Error;
use crate::connection::Connection;
use crate::receipt::Receipt;
use crate::values::{StreamKey, key};

/// The measured cost of a job.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JobTimeRow {
    /// The stream.
    pub stream: StreamId,
    /// The key of the job within its stream.
    pub part: u64,
    /// Processor time, in seconds. It is measured and therefore never compared: the first value is
    /// kept.
    pub cpu_seconds: f64,
}

/// The wall time of a stage.
#[derive(Debug, Clone, PartialEq)]
pub struct StageTimeRow {
    /// The stage's name.
    pub stage: String,
    /// Time in the stage while a coordinator ran, in seconds. Measured, so never compared.
    pub wall_seconds: f64,
}

pub(crate) async fn jobs(connection: &mut Connection<'_>) -> Result<Vec<JobTimeRow>, Error> {
    let query = sqlx::query!(
        r#"SELECT stream AS "stream: StreamKey", part AS "part: u64", cpu_seconds
           FROM job_time ORDER BY stream, part"#
    );
    let rows = connection.all(query).await?;
    let times = rows.into_iter().map(|row| JobTimeRow {
        stream: row.stream.0,
        part: row.part,
        cpu_seconds: row.cpu_seconds,
    });
    Ok(times.collect())
}

/// Stores the costs of jobs that are not stored yet.
pub(crate) async fn insert_jobs(
    connection: &mut Connection<'_>,
    rows: &[&JobTimeRow],
) -> Result<(), Error> {
    let statement = [
        "INSERT INTO job_time (stream, part, cpu_seconds) ",
        " ON CONFLICT DO NOTHING",
    ];
    connection
        .insert_many(statement, rows, |values, row| {
            values
                .push_bind(key(row.stream))
                .push_bind(row.part.cast_signed())
                .push_bind(row.cpu_seconds);
        })
        .await
}

/// The name of the current stage; `None` before the first coordinator has seen one.
pub(crate) async fn stage(connection: &mut Connection<'_>) -> Result<Option<String>, Error> {
    let query = sqlx::query!("SELECT stage FROM stage");
    let rows = connection.all(query).await?;
    Ok(rows.into_iter().next().map(|row| row.stage))
}

/// Stores the name of the current stage, replacing the previous one.
pub(crate) async fn replace_current(
    connection: &mut Connection<'_>,
    stage: &str,
) -> Result<Receipt, Error> {
    let query = sqlx::query!(
        "INSERT OR REPLACE INTO stage (one, stage) VALUES (1, ?)",
        stage
    );
    connection.execute(query).await?;
    Ok(Receipt::new(1))
}

pub(crate) async fn stages(connection: &mut Connection<'_>) -> Result<Vec<StageTimeRow>, Error> {
    let query = sqlx::query!("SELECT stage, wall_seconds FROM stage_time ORDER BY stage");
    let rows = connection.all(query).await?;
    let times = rows.into_iter().map(|row| StageTimeRow {
        stage: row.stage,
        wall_seconds: row.wall_seconds,
    });
    Ok(times.collect())
}

/// Stores the wall time of a stage, replacing the previous one.
pub(crate) async fn replace_stage(
    connection: &mut Connection<'_>,
    row: &StageTimeRow,
) -> Result<Receipt, Error> {
    let query = sqlx::query!(
        "INSERT OR REPLACE INTO stage_time (stage, wall_seconds) VALUES (?, ?)",
        row.stage,
        row.wall_seconds,
    );
    connection.execute(query).await?;
    Ok(Receipt::new(1))
}
