//! The optima of approaches.

use ledger::StreamId;

use crate::Error;
use crate::connection::Connection;
use crate::row::{self, Columns, Row};
use crate::values::{StreamKey, key};

/// The best design of one approach.
#[derive(Debug, Clone, PartialEq)]
pub struct OptimumRow {
    /// The point at which the optimum is verified; its index is the number of the approach.
    pub stream: StreamId,
    /// The values of all variables, as a JSON object keyed by name.
    pub x_json: String,
    /// What the approach minimised.
    pub criterion: f64,
    /// Whether every constraint holds.
    pub feasible: bool,
    /// The criteria at the optimum, as JSON.
    pub criteria_json: String,
    /// Calls of the simulator in all runs of the approach.
    pub simulator_calls: u64,
    /// Processor time of all runs of the approach, in seconds.
    pub cpu_seconds: f64,
    /// A remark for the report; empty if there is none.
    pub note: String,
}

impl Row for OptimumRow {
    const TABLE: &'static str = "optimum";

    fn key(&self) -> String {
        self.stream.to_string()
    }

    fn add_to(&self, columns: &mut Columns) {
        columns
            .stream(self.stream)
            .text(&self.x_json)
            .number("criterion", self.criterion)
            .bits(self.feasible.into())
            .text(&self.criteria_json)
            .count("simulator_calls", self.simulator_calls)
            .number("cpu_seconds", self.cpu_seconds)
            .text(&self.note);
    }
}

pub(crate) async fn all(connection: &mut Connection<'_>) -> Result<Vec<OptimumRow>, Error> {
    let query = sqlx::query!(
        r#"SELECT stream AS "stream: StreamKey", x_json, criterion, feasible AS "feasible: bool", criteria_json,
                  simulator_calls AS "simulator_calls: u64", cpu_seconds, note, seal
           FROM optimum ORDER BY stream"#
    );
    let rows = connection.all(query).await?;
    rows.into_iter()
        .map(|row| {
            let optimum = OptimumRow {
                stream: row.stream.0,
                x_json: row.x_json,
                criterion: row.criterion,
                feasible: row.feasible,
                criteria_json: row.criteria_json,
                simulator_calls: row.simulator_calls,
                cpu_seconds: row.cpu_seconds,
                note: row.note,
            };
            connection.check(optimum, row.seal)
        })
        .collect()
}

/// Stores the optimum in the place of the one of its approach.
pub(crate) async fn replace(
    connection: &mut Connection<'_>,
    row: &OptimumRow,
) -> Result<(), Error> {
    let seal = row::seal(row)?;
    let stream = key(row.stream);
    let calls = row.simulator_calls.cast_signed();
    let query = sqlx::query!(
        "INSERT OR REPLACE INTO optimum (stream, x_json, criterion, feasible, criteria_json,
             simulator_calls, cpu_seconds, note, seal)
         VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)",
        stream,
        row.x_json,
        row.criterion,
        row.feasible,
        row.criteria_json,
        calls,
        row.cpu_seconds,
        row.note,
        seal,
    );
    connection.execute(query).await.map(drop)
}

pub(crate) async fn remove(connection: &mut Connection<'_>, stream: StreamId) -> Result<(), Error> {
    let stream = key(stream);
    let query = sqlx::query!("DELETE FROM optimum WHERE stream = ?", stream);
    connection.execute(query).await.map(drop)
}
