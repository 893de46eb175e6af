//! Changes that the writer makes in a transaction.

use std::sync::{Arc, OnceLock};

use ledger::StreamId;

use crate::batch::{self, Batch};
use crate::campaign::{self, CampaignRow};
use crate::connection::Connection;
use crate::derived::{self, Derivation, DerivedResult};
use crate::designs::{self, DesignRow};
use crate::discard::{self, Discard, RemovedRows};
use crate::models::{self, ModelRow};
use crate::optima::{self, OptimumRow};
use crate::receipt::Receipt;
use crate::responses::{self, ResponseRow};
use crate::rounds::{self, NewRound};
use crate::times::{self, StageTimeRow};
use crate::{Error, evaluations, generations};

/// A change that is made as a whole or not at all.
#[derive(Debug)]
pub(crate) enum Change {
    Batch(Batch),
    Designs(Vec<DesignRow>),
    /// Replaces all responses.
    Responses(Vec<ResponseRow>, Derivation),
    /// Replaces the model of the DoE, or removes it if the fit has failed.
    Models(Vec<ModelRow>, Derivation),
    Optimum(Box<OptimumRow>, Derivation),
    Stage(String),
    StageTime(StageTimeRow),
    Round(NewRound, Derivation),
    Derivation(Derivation),
    ModelDigest(String),
    Extension(CampaignRow),
    Removal(Vec<DerivedResult>),
    Generations(Vec<(StreamId, u64)>),
    /// Removes the evaluations of a run.
    NoEvaluations(StreamId),
    /// Removes results, or only counts them if the flag is set, and puts their numbers into the cell.
    Discard(Discard, bool, Arc<OnceLock<RemovedRows>>),
    /// Removes results that stand for failures whose reason begins with this text.
    NoFailures(String),
}

impl Change {
    fn batch(&self) -> Option<&Batch> {
        match self {
            Self::Batch(batch) => Some(batch),
            _ => None,
        }
    }

    /// Whether other changes may be made in the same step.
    pub(crate) fn is_batch(&self) -> bool {
        self.batch().is_some()
    }

    /// The number of rows.
    pub(crate) fn len(&self) -> usize {
        match self {
            Self::Batch(batch) => batch.len(),
            Self::Designs(rows) => rows.len(),
            Self::Responses(rows, _) => rows.len(),
            Self::Generations(rows) => rows.len(),
            _ => 1,
        }
    }
}

/// Makes one change, or some batches together. The outer error means that the transaction failed. An inner error means
/// that these rows were refused and left no trace.
pub(crate) async fn make(
    connection: &mut Connection<'_>,
    changes: &[Change],
) -> Result<Result<Vec<Receipt>, Error>, Error> {
    connection.run("SAVEPOINT change").await?;
    let made = match changes {
        [change] if !change.is_batch() => one(connection, change).await.map(|made| vec![made]),
        _ => {
            let batches: Vec<&Batch> = changes.iter().filter_map(Change::batch).collect();
            batch::insert(connection, &batches).await
        }
    };
    match &made {
        Ok(_) => {}
        Err(error) if error.is_refusal() => {
            connection.run("ROLLBACK TO change").await?;
        }
        Err(error) => return Err(error.clone()),
    }
    connection.run("RELEASE change").await?;
    Ok(made)
}

async fn one(connection: &mut Connection<'_>, change: &Change) -> Result<Receipt, Error> {
    match change {
        Change::Batch(batch) => {
            let receipts = batch::insert(connection, &[batch]).await?;
            Ok(receipts.first().copied().unwrap_or_default())
        }
        Change::Designs(rows) => designs::insert(connection, rows).await,
        Change::Responses(rows, derivation) => {
            responses::replace(connection, rows).await?;
            derived::replace(connection, derivation).await?;
            Ok(Receipt::new(rows.len() as u64))
        }
        Change::Models(rows, derivation) => {
            models::remove(connection, ModelRow::DOE).await?;
            for row in rows {
                models::replace(connection, row).await?;
            }
            derived::replace(connection, derivation).await?;
            Ok(Receipt::new(rows.len() as u64))
        }
        Change::Optimum(row, derivation) => {
            optima::replace(connection, row).await?;
            derived::replace(connection, derivation).await?;
            Ok(Receipt::new(1))
        }
        Change::Stage(stage) => times::replace_current(connection, stage).await,
        Change::StageTime(row) => times::replace_stage(connection, row).await,
        Change::Round(new, derivation) => {
            let receipt = rounds::insert(connection, new).await?;
            derived::replace(connection, derivation).await?;
            Ok(receipt)
        }
        Change::Derivation(row) => {
            derived::replace(connection, row).await?;
            Ok(Receipt::new(1))
        }
        Change::ModelDigest(digest) => campaign::pin_model_digest(connection, digest).await,
        Change::Extension(campaign) => campaign::extend(connection, campaign).await,
        Change::Removal(results) => derived::remove(connection, results).await,
        Change::Generations(rows) => generations::put(connection, rows).await,
        Change::NoEvaluations(stream) => {
            evaluations::remove(connection, *stream, 0).await?;
            Ok(Receipt::default())
        }
        Change::Discard(what, is_trial, told) => {
            let removed = discard::discard(connection, what, *is_trial).await?;
            // The cell is empty, because a change is made once.
            let _ = told.set(removed);
            Ok(Receipt::default())
        }
        Change::NoFailures(reason) => derived::remove_failures(connection, reason).await,
    }
}
