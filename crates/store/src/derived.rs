//! Derived results, what they were computed from, and their removal.

use std::collections::BTreeMap;

use ledger::StreamId;

use crate::Error;
use crate::connection::Connection;
use crate::keyed::{self, Table};
use crate::rounds;
use crate::rows::{EvaluationRow, ModelRow, OptimumRow, Receipt, ResponseRow};
use crate::samples::{self, Of};

/// Completes "the database could not".
pub(crate) const REMOVING: &str = "remove derived rows";

/// A result that is computed from others.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub enum Derived {
    /// Criteria and samples of the whole DoE, which depend on the variables that all designs share.
    Samples,
    /// The responses of all designs.
    Responses,
    /// The model of the DoE's responses.
    Model,
    /// The run of an optimiser.
    Run(StreamId),
    /// A round of infill, and the model of the enrichment's end.
    Round(u64),
    /// The optimum of an approach.
    Optimum(String),
    /// The samples of an optimum.
    Verification(StreamId),
}

impl Derived {
    /// The result's name in the table of derivations.
    #[must_use]
    pub fn name(&self) -> String {
        match self {
            Self::Samples => "samples".to_owned(),
            Self::Responses => "responses".to_owned(),
            Self::Model => "model".to_owned(),
            Self::Run(stream) => stream.to_string(),
            Self::Round(round) => format!("round {round}"),
            Self::Optimum(approach) => format!("optimum {approach}"),
            Self::Verification(stream) => format!("verification {stream}"),
        }
    }
}

/// What a derived result was computed from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Derivation {
    /// [`Derived::name`] of the result.
    pub name: String,
    /// The digest of everything that the result depends on.
    pub inputs: String,
    /// The digest of the result; `None` where no other result is computed from it.
    pub output: Option<String>,
    /// Why there is no result: of a fit that failed.
    pub failure: Option<String>,
}

impl Derivation {
    /// The derivation of a result from which no other is computed.
    #[must_use]
    pub fn new(of: &Derived, inputs: impl Into<String>) -> Self {
        Self {
            name: of.name(),
            inputs: inputs.into(),
            output: None,
            failure: None,
        }
    }
}

/// Replaces all responses.
pub(crate) async fn responses(
    connection: &mut Connection<'_>,
    rows: &[ResponseRow],
    derivation: &Derivation,
) -> Result<Receipt, Error> {
    connection.run(REMOVING, "DELETE FROM response").await?;
    put(connection, rows, derivation).await
}

/// Replaces the model of the DoE, or removes it if the fit has failed.
pub(crate) async fn model(
    connection: &mut Connection<'_>,
    row: Option<&ModelRow>,
    derivation: &Derivation,
) -> Result<Receipt, Error> {
    remove_model(connection, ModelRow::DOE).await?;
    put(
        connection,
        row.map_or(&[], std::slice::from_ref),
        derivation,
    )
    .await
}

/// Replaces the optimum of an approach.
pub(crate) async fn optimum(
    connection: &mut Connection<'_>,
    row: &OptimumRow,
    derivation: &Derivation,
) -> Result<Receipt, Error> {
    put(connection, std::slice::from_ref(row), derivation).await
}

async fn put<T: Table>(
    connection: &mut Connection<'_>,
    rows: &[T],
    derivation: &Derivation,
) -> Result<Receipt, Error> {
    keyed::replace(connection, rows).await?;
    derivations(connection, std::slice::from_ref(derivation)).await?;
    Ok(Receipt {
        new_rows: rows.len() as u64,
        ..Receipt::default()
    })
}

/// Stores derivations, replacing those of the same results.
pub(crate) async fn derivations(
    connection: &mut Connection<'_>,
    rows: &[Derivation],
) -> Result<(), Error> {
    keyed::replace(connection, rows).await
}

/// Removes derived results with their derivations. What workers computed for them goes with them, and results
/// that come late are refused.
pub(crate) async fn remove(
    connection: &mut Connection<'_>,
    results: &[Derived],
) -> Result<Receipt, Error> {
    for result in results {
        match result {
            Derived::Samples => {
                samples::remove(connection, Of::Designs).await?;
                connection.run(REMOVING, "DELETE FROM criteria").await?;
            }
            Derived::Responses => connection.run(REMOVING, "DELETE FROM response").await?,
            Derived::Model => remove_model(connection, ModelRow::DOE).await?,
            Derived::Run(stream) => {
                let key = stream.key().cast_signed();
                let query = sqlx::query!("DELETE FROM optimiser_run WHERE stream = ?", key);
                connection.execute(REMOVING, query).await?;
                forget_stream(connection, *stream).await?;
            }
            Derived::Round(round) => rounds::remove(connection, *round).await?,
            Derived::Optimum(approach) => {
                let query = sqlx::query!("DELETE FROM optimum WHERE approach = ?", approach);
                connection.execute(REMOVING, query).await?;
            }
            Derived::Verification(stream) => {
                samples::remove(connection, Of::One(*stream)).await?;
                forget_stream(connection, *stream).await?;
            }
        }
        let name = result.name();
        let query = sqlx::query!("DELETE FROM derivation WHERE name = ?", name);
        connection.execute(REMOVING, query).await?;
    }
    Ok(Receipt::default())
}

/// Removes what stands for failures: infinite samples, and criteria and evaluations that have one or whose reason
/// begins with `reason`. A run goes on from its first evaluation that is removed. The receipt counts the rows removed.
pub(crate) async fn remove_failures(
    connection: &mut Connection<'_>,
    reason: &str,
) -> Result<Receipt, Error> {
    let mut removed = samples::remove_failed(connection).await?;
    let mut failed: BTreeMap<StreamId, u64> = BTreeMap::new();
    let evaluations: Vec<EvaluationRow> = keyed::all(connection).await?;
    for row in evaluations {
        let is_failure = row.refused.is_some_and(|why| why.starts_with(reason));
        let mut samples = row.samples.iter().flatten();
        if is_failure || samples.any(|sample| sample.is_infinite()) {
            failed.entry(row.stream).or_insert(row.evaluation);
        }
    }
    for (stream, first) in failed {
        let (key, first) = (stream.key().cast_signed(), first.cast_signed());
        let name = Derived::Run(stream).name();
        for query in [
            sqlx::query("DELETE FROM evaluation WHERE stream = ? AND evaluation >= ?")
                .bind(key)
                .bind(first),
            sqlx::query("DELETE FROM optimiser_run WHERE stream = ?").bind(key),
            sqlx::query("DELETE FROM derivation WHERE name = ?").bind(name),
        ] {
            removed += connection.execute(REMOVING, query).await?.rows_affected();
        }
    }
    let query = sqlx::query("DELETE FROM criteria WHERE substr(reason, 1, length(?1)) = ?1");
    let done = connection.execute(REMOVING, query.bind(reason)).await?;
    removed += done.rows_affected();
    Ok(Receipt {
        new_rows: removed,
        ..Receipt::default()
    })
}

pub(crate) async fn remove_model(connection: &mut Connection<'_>, name: &str) -> Result<(), Error> {
    let query = sqlx::query("DELETE FROM model WHERE name = ?").bind(name);
    connection.execute(REMOVING, query).await.map(drop)
}

/// Removes the evaluations and the wanted generation of a stream.
pub(crate) async fn forget_stream(
    connection: &mut Connection<'_>,
    stream: StreamId,
) -> Result<(), Error> {
    for statement in [
        "DELETE FROM evaluation WHERE stream = ?",
        "DELETE FROM stream_generation WHERE stream = ?",
    ] {
        let query = sqlx::query(statement).bind(stream.key().cast_signed());
        connection.execute(REMOVING, query).await?;
    }
    Ok(())
}
