//! The optima of approaches.

use ledger::StreamId;

use crate::Error;
use crate::connection::Connection;
use crate::row::{self, Columns, Row};
use crate::values::{Numbers, StreamKey, bytes, key};

/// The best design of one approach.
#[derive(Debug, Clone, PartialEq)]
pub struct OptimumRow {
    /// The point at which the optimum is verified; its index is the number of the approach.
    pub stream: StreamId,
    /// Why the approach found no design. The next three fields are then `None`.
    pub reason: Option<String>,
    /// The values of all variables.
    pub x: Option<Vec<f64>>,
    /// The value that the approach minimised.
    pub criterion: Option<f64>,
    /// The values that constraints are set on.
    pub criteria: Option<Vec<f64>>,
    /// Whether every constraint holds.
    pub feasible: bool,
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
            .option(self.reason.as_deref(), Columns::text)
            .option(self.x.as_deref(), |to, x| to.numbers("x", x))
            .option(self.criterion, |to, value| to.number("criterion", value))
            .option(self.criteria.as_deref(), |to, criteria| {
                to.numbers("criteria", criteria)
            })
            .bits(self.feasible.into())
            .count("simulator_calls", self.simulator_calls)
            .number("cpu_seconds", self.cpu_seconds)
            .text(&self.note);
    }
}

pub(crate) async fn all(connection: &mut Connection<'_>) -> Result<Vec<OptimumRow>, Error> {
    let query = sqlx::query!(
        r#"SELECT stream AS "stream: StreamKey", reason, x AS "x: Numbers", criterion,
                  criteria AS "criteria: Numbers", feasible AS "feasible: bool",
                  simulator_calls AS "simulator_calls: u64", cpu_seconds, note, seal
           FROM optimum ORDER BY stream"#
    );
    let rows = connection.all(query).await?;
    rows.into_iter()
        .map(|row| {
            let optimum = OptimumRow {
                stream: row.stream.0,
                reason: row.reason,
                x: row.x.map(|numbers| numbers.0),
                criterion: row.criterion,
                criteria: row.criteria.map(|numbers| numbers.0),
                feasible: row.feasible,
                simulator_calls: row.simulator_calls,
                cpu_seconds: row.cpu_seconds,
                note: row.note,
            };
            connection.check(optimum, row.seal)
        })
        .collect()
}

/// Stores the optimum, replacing that of the same approach.
pub(crate) async fn replace(
    connection: &mut Connection<'_>,
    row: &OptimumRow,
) -> Result<(), Error> {
    let seal = row::seal(row)?;
    let stream = key(row.stream);
    let [x, criteria] = [&row.x, &row.criteria].map(|list| list.as_deref().map(bytes));
    let calls = row.simulator_calls.cast_signed();
    let query = sqlx::query!(
        "INSERT OR REPLACE INTO optimum (stream, reason, x, criterion, criteria, feasible,
             simulator_calls, cpu_seconds, note, seal)
         VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
        stream,
        row.reason,
        x,
        row.criterion,
        criteria,
        row.feasible,
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
