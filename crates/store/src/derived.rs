//! Derived results: their inputs and their removal.

use ledger::StreamId;

use crate::Error;
use crate::blocks::Streams;
use crate::connection::Connection;
use crate::models::ModelRow;
use crate::receipt::Receipt;
use crate::row::{self, Columns, Row};
use crate::samples;
use crate::{criteria, evaluations, generations, models, optima, responses, rounds, runs};

/// A result that is computed from others.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub enum DerivedResult {
    /// Criteria and samples of the whole DoE, which depend on the variables that all designs share.
    Samples,
    /// The responses of all designs.
    Responses,
    /// The model of the DoE's responses.
    Model,
    /// The run of an optimiser.
    Run(StreamId),
    /// A round of infill, with the model of the enrichment's end.
    Round(u64),
    /// The optimum that is verified at this point.
    Optimum(StreamId),
    /// The samples of an optimum.
    Verification(StreamId),
}

impl DerivedResult {
    /// The result's name in the table of derivations.
    #[must_use]
    pub fn name(&self) -> String {
        match self {
            Self::Samples => "samples".to_owned(),
            Self::Responses => "responses".to_owned(),
            Self::Model => "model".to_owned(),
            Self::Run(stream) => stream.to_string(),
            Self::Round(round) => format!("round {round}"),
            Self::Optimum(stream) => format!("optimum {stream}"),
            Self::Verification(stream) => format!("verification {stream}"),
        }
    }
}

/// The inputs and the outcome of a derived result.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Derivation {
    /// [`DerivedResult::name`] of the result.
    pub name: String,
    /// The digest of everything that the result depends on.
    pub inputs: String,
    /// The digest of the result; `None` where no other result is computed from it.
    pub output: Option<String>,
    /// Why there is no result, for a fit that failed; for responses, which samples are not plausible, as JSON.
    pub failure: Option<String>,
}

impl Derivation {
    /// The derivation of a result from which no other is computed.
    #[must_use]
    pub fn new(of: &DerivedResult, inputs: impl Into<String>) -> Self {
        Self {
            name: of.name(),
            inputs: inputs.into(),
            output: None,
            failure: None,
        }
    }
}

impl Row for Derivation {
    const TABLE: &'static str = "derivation";

    fn key(&self) -> String {
        format!("name {:?}", self.name)
    }

    fn add_to(&self, columns: &mut Columns) {
        columns
            .text(&self.name)
            .text(&self.inputs)
            .option(self.output.as_deref(), Columns::text)
            .option(self.failure.as_deref(), Columns::text);
    }
}

pub(crate) async fn all(connection: &mut Connection<'_>) -> Result<Vec<Derivation>, Error> {
    let query =
        sqlx::query!("SELECT name, inputs, output, failure, seal FROM derivation ORDER BY name");
    let rows = connection.all(query).await?;
    rows.into_iter()
        .map(|row| {
            let derivation = Derivation {
                name: row.name,
                inputs: row.inputs,
                output: row.output,
                failure: row.failure,
            };
            connection.check(derivation, row.seal)
        })
        .collect()
}

/// Stores the derivation, replacing that of the same result.
pub(crate) async fn replace(
    connection: &mut Connection<'_>,
    row: &Derivation,
) -> Result<(), Error> {
    let seal = row::seal(row)?;
    let query = sqlx::query!(
        "INSERT OR REPLACE INTO derivation (name, inputs, output, failure, seal)
         VALUES (?, ?, ?, ?, ?)",
        row.name,
        row.inputs,
        row.output,
        row.failure,
        seal,
    );
    connection.execute(query).await.map(drop)
}

pub(crate) async fn remove_named(
    connection: &mut Connection<'_>,
    result: &DerivedResult,
) -> Result<u64, Error> {
    let name = result.name();
    let query = sqlx::query!("DELETE FROM derivation WHERE name = ?", name);
    connection.execute(query).await
}

/// Removes derived results with their derivations. The workers' results for them are removed, too, and late results are
/// refused.
pub(crate) async fn remove(
    connection: &mut Connection<'_>,
    results: &[DerivedResult],
) -> Result<Receipt, Error> {
    for result in results {
        match result {
            DerivedResult::Samples => {
                samples::remove(connection, Streams::Designs).await?;
                criteria::remove(connection).await?;
            }
            DerivedResult::Responses => responses::remove(connection).await?,
            DerivedResult::Model => models::remove(connection, ModelRow::DOE).await?,
            DerivedResult::Run(stream) => {
                runs::remove(connection, *stream).await?;
                generations::forget(connection, *stream).await?;
            }
            DerivedResult::Round(round) => rounds::remove(connection, *round).await?,
            DerivedResult::Optimum(stream) => optima::remove(connection, *stream).await?,
            DerivedResult::Verification(stream) => {
                samples::remove(connection, Streams::One(*stream)).await?;
                generations::forget(connection, *stream).await?;
            }
        }
        remove_named(connection, result).await?;
    }
    Ok(Receipt::default())
}

/// Removes what [`Store::remove_failures`](crate::Store::remove_failures) says. The receipt counts the removed rows.
pub(crate) async fn remove_failures(
    connection: &mut Connection<'_>,
    reason: &str,
) -> Result<Receipt, Error> {
    let mut removed = samples::remove_failed(connection).await?;
    for (stream, first) in evaluations::first_failures(connection, reason).await? {
        removed += evaluations::remove(connection, stream, first).await?;
        removed += runs::remove(connection, stream).await?;
        removed += remove_named(connection, &DerivedResult::Run(stream)).await?;
    }
    removed += criteria::remove_failed(connection, reason).await?;
    Ok(Receipt::new(removed))
}
