//! Evaluations of candidates of optimiser runs by an external simulator.

use std::collections::BTreeMap;

use ledger::StreamId;

use crate::Error;
use crate::connection::Connection;
use crate::row::{self, Columns, Row};
use crate::values::{Numbers, StreamKey, bytes, key};

/// An external simulator's evaluation of a candidate of an optimiser run.
#[derive(Debug, Clone, PartialEq)]
pub struct EvaluationRow {
    /// The run, or an infill point.
    pub stream: StreamId,
    /// Index of the evaluation within the run, from 0.
    pub evaluation: u64,
    /// The values of all variables.
    pub x: Vec<f64>,
    /// Why the design is not simulable. The fields below are then `None`.
    pub refused: Option<String>,
    /// The response without random effects, if the problem has a baseline.
    pub value: Option<f64>,
    /// The values that constraints are set on.
    pub criteria: Option<Vec<f64>>,
    /// The same values in the baseline state, if they were requested.
    pub worn_criteria: Option<Vec<f64>>,
    /// The sampled response of a feasible design, for a direct search. An infinite value stands for a sample that
    /// failed.
    pub samples: Option<Vec<f64>>,
}

impl EvaluationRow {
    /// Whether the evaluation stands for a failure: it has an infinite sample, or its reason begins with `reason`.
    fn is_failure(&self, reason: &str) -> bool {
        let mut samples = self.samples.iter().flatten();
        self.refused
            .as_ref()
            .is_some_and(|why| why.starts_with(reason))
            || samples.any(|sample| sample.is_infinite())
    }
}

impl Row for EvaluationRow {
    const TABLE: &'static str = "evaluation";

    fn key(&self) -> String {
        format!("evaluation {} of {}", self.evaluation, self.stream)
    }

    fn add_to(&self, columns: &mut Columns) {
        columns
            .stream(self.stream)
            .count("evaluation", self.evaluation)
            .numbers("x", &self.x)
            .option(self.refused.as_deref(), Columns::text)
            .option(self.value, |to, value| to.number("value", value))
            .option(self.criteria.as_deref(), |to, criteria| {
                to.numbers("criteria", criteria)
            })
            .option(self.worn_criteria.as_deref(), |to, criteria| {
                to.numbers("worn_criteria", criteria)
            })
            .option(self.samples.as_deref(), |to, samples| {
                to.outcomes("samples", samples)
            });
    }
}

/// The evaluations of a stream, from the `first` one on.
pub(crate) async fn of(
    connection: &mut Connection<'_>,
    stream: StreamId,
    first: u64,
) -> Result<Vec<EvaluationRow>, Error> {
    let key = key(stream);
    range(connection, (key, first.cast_signed()), (key, i64::MAX)).await
}

pub(crate) async fn all(connection: &mut Connection<'_>) -> Result<Vec<EvaluationRow>, Error> {
    range(connection, (0, 0), (i64::MAX, i64::MAX)).await
}

/// The evaluations between two keys, each a stream and an evaluation.
async fn range(
    connection: &mut Connection<'_>,
    first: (i64, i64),
    last: (i64, i64),
) -> Result<Vec<EvaluationRow>, Error> {
    let query = sqlx::query!(
        r#"SELECT stream AS "stream: StreamKey", evaluation AS "evaluation: u64",
                  x AS "x: Numbers", refused, value, criteria AS "criteria: Numbers",
                  worn_criteria AS "worn_criteria: Numbers", samples AS "samples: Numbers", seal
           FROM evaluation
           WHERE (stream, evaluation) >= (?, ?) AND (stream, evaluation) <= (?, ?)
           ORDER BY stream, evaluation"#,
        first.0,
        first.1,
        last.0,
        last.1,
    );
    let rows = connection.all(query).await?;
    rows.into_iter()
        .map(|row| {
            let evaluation = EvaluationRow {
                stream: row.stream.0,
                evaluation: row.evaluation,
                x: row.x.0,
                refused: row.refused,
                value: row.value,
                criteria: row.criteria.map(|numbers| numbers.0),
                worn_criteria: row.worn_criteria.map(|numbers| numbers.0),
                samples: row.samples.map(|numbers| numbers.0),
            };
            connection.check(evaluation, row.seal)
        })
        .collect()
}

/// Stores an evaluation and returns whether it was new.
pub(crate) async fn insert(
    connection: &mut Connection<'_>,
    row: &EvaluationRow,
    origin: Option<i64>,
) -> Result<bool, Error> {
    let seal = row::seal(row)?;
    let (stream, evaluation) = (key(row.stream), row.evaluation.cast_signed());
    let x = bytes(&row.x);
    let [criteria, worn_criteria, samples] =
        [&row.criteria, &row.worn_criteria, &row.samples].map(|list| list.as_deref().map(bytes));
    let query = sqlx::query!(
        "INSERT INTO evaluation
             (stream, evaluation, x, refused, value, criteria, worn_criteria, samples, seal, origin)
         VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?) ON CONFLICT DO NOTHING",
        stream,
        evaluation,
        x,
        row.refused,
        row.value,
        criteria,
        worn_criteria,
        samples,
        seal,
        origin,
    );
    if connection.execute(query).await? > 0 {
        return Ok(true);
    }
    let place = (stream, evaluation);
    row::agree(range(connection, place, place).await?.last(), row)?;
    Ok(false)
}

/// Removes the evaluations of a stream from the `first` one on, and returns their number.
pub(crate) async fn remove(
    connection: &mut Connection<'_>,
    stream: StreamId,
    first: u64,
) -> Result<u64, Error> {
    let (stream, first) = (key(stream), first.cast_signed());
    let query = sqlx::query!(
        "DELETE FROM evaluation WHERE stream = ? AND evaluation >= ?",
        stream,
        first
    );
    connection.execute(query).await
}

/// The first evaluation of each stream that stands for a failure.
pub(crate) async fn first_failures(
    connection: &mut Connection<'_>,
    reason: &str,
) -> Result<BTreeMap<StreamId, u64>, Error> {
    let mut failures = BTreeMap::new();
    for row in all(connection).await? {
        if row.is_failure(reason) {
            failures.entry(row.stream).or_insert(row.evaluation);
        }
    }
    Ok(failures)
}

/// The first evaluation of each stream that is of this origin.
pub(crate) async fn first_from(
    connection: &mut Connection<'_>,
    origin: i64,
) -> Result<BTreeMap<StreamId, u64>, Error> {
    let query = sqlx::query!(
        r#"SELECT stream AS "stream!: StreamKey", min(evaluation) AS "first!: u64"
           FROM evaluation WHERE origin = ? GROUP BY stream"#,
        origin
    );
    let rows = connection.all(query).await?;
    Ok(rows
        .into_iter()
        .map(|row| (row.stream.0, row.first))
        .collect())
}

/// The number and the digest of the evaluations of each stream that has any.
pub(crate) async fn digests(
    connection: &mut Connection<'_>,
) -> Result<BTreeMap<StreamId, (u64, String)>, Error> {
    let query = sqlx::query!(
        r#"SELECT stream AS "stream!: StreamKey", count(*) AS "count!: u64",
                  sum(seal & 4294967295) AS "low!: i64",
                  sum((seal >> 32) & 4294967295) AS "high!: i64"
           FROM evaluation GROUP BY stream"#
    );
    let rows = connection.all(query).await?;
    let digests = rows.into_iter().map(|row| {
        let digest = format!("{:x}-{:x}-{:x}", row.count, row.low, row.high);
        (row.stream.0, (row.count, digest))
    });
    Ok(digests.collect())
}
