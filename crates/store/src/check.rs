//! The integrity check: whether the file's pages are as SQLite wrote them, and its rows as they
//! were acknowledged.
//!
//! A small file is checked before it is opened. A large one, for which the check takes seconds, is
//! checked in the background: reads are allowed meanwhile, and writes wait for the verdict on the
//! pages. Its samples are compared with their digest afterwards, in parallel with normal work. A
//! bit that flipped on the disk does not harm rows written meanwhile, and the campaign still ends
//! with an error.

use std::path::Path;
use std::sync::Arc;

use sqlx::sqlite::SqliteConnectOptions;
use tokio::sync::watch;

use crate::Error;
use crate::connection::Connection;
use crate::derived::Derivation;
use crate::keyed::{self, Table};
use crate::rounds::{InfillRow, RoundRow};
use crate::rows::{
    CampaignRow, CriteriaRow, DesignRow, EvaluationRow, ModelRow, OptimiserRunRow, OptimumRow,
    ResponseRow,
};
use crate::samples::{self, Of};

type Found = watch::Sender<Option<Result<(), Error>>>;

/// The results of the checks, as they become known.
#[derive(Debug, Clone)]
pub(crate) struct Verdict {
    pages: Found,
    /// The verdict on everything, the pages included.
    all: Found,
    /// The file to check on demand only.
    unasked: Option<Reading>,
}

/// The path and options for reading a store's file.
#[derive(Debug, Clone)]
pub(crate) struct Reading {
    pub(crate) path: Arc<Path>,
    pub(crate) options: SqliteConnectOptions,
}

/// The checks still to be made.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Pending {
    Nothing,
    Rows,
    PagesAndRows,
}

impl Verdict {
    /// A verdict of no errors, with no check left to make.
    pub(crate) fn sound() -> Self {
        Self {
            pages: Found::new(Some(Ok(()))),
            all: Found::new(Some(Ok(()))),
            unasked: None,
        }
    }

    /// A verdict whose check starts only on the first request.
    pub(crate) fn on_demand(reading: Reading) -> Self {
        Self {
            pages: Found::new(None),
            all: Found::new(None),
            unasked: Some(reading),
        }
    }

    /// Starts the pending checks on a connection of their own.
    pub(crate) fn of(reading: Reading, pending: Pending) -> Self {
        if pending == Pending::Nothing {
            return Self::sound();
        }
        let pages = (pending == Pending::Rows).then_some(Ok(()));
        let verdict = Self {
            pages: Found::new(pages.clone()),
            all: Found::new(None),
            unasked: None,
        };
        let found = verdict.clone();
        tokio::spawn(async move {
            let mut result = Ok(());
            if pages.is_none() {
                result = check(&reading, Part::Pages).await;
                found.pages.send_replace(Some(result.clone()));
            }
            if result.is_ok() {
                result = check(&reading, Part::Rows).await;
            }
            found.conclude(result);
        });
        verdict
    }

    /// Adds a result. The first error is kept.
    pub(crate) fn conclude(&self, result: Result<(), Error>) {
        self.all.send_if_modified(|found| {
            let is_news = !matches!(found, Some(Err(_)));
            if is_news {
                *found = Some(result);
            }
            is_news
        });
    }

    /// Whether all checks have ended without an error.
    pub(crate) fn is_sound(&self) -> bool {
        matches!(*self.all.borrow(), Some(Ok(())))
    }

    /// Waits for the check of the pages.
    pub(crate) async fn on_pages(self) -> Result<(), Error> {
        reached(&self.pages).await
    }

    /// Waits for all checks.
    pub(crate) async fn on_everything(self) -> Result<(), Error> {
        if let Some(reading) = self.unasked.as_ref().filter(|_| !self.is_sound()) {
            let mut result = check(reading, Part::Pages).await;
            if result.is_ok() {
                result = check(reading, Part::Rows).await;
            }
            self.conclude(result);
        }
        reached(&self.all).await
    }

    /// Waits for an error, possibly for ever.
    pub(crate) async fn on_damage(self) -> Error {
        let mut found = self.all.subscribe();
        loop {
            if let Some(Err(error)) = &*found.borrow_and_update() {
                return error.clone();
            }
            if found.changed().await.is_err() {
                return Error::Closed;
            }
        }
    }
}

async fn reached(found: &Found) -> Result<(), Error> {
    let mut found = found.subscribe();
    let found = found.wait_for(Option::is_some).await;
    match found.as_deref() {
        Ok(Some(result)) => result.clone(),
        _ => Err(Error::Closed),
    }
}

enum Part {
    Pages,
    Rows,
}

async fn check(reading: &Reading, part: Part) -> Result<(), Error> {
    let mut connection = Connection::open(&reading.options, &reading.path).await?;
    match part {
        Part::Pages => quick_check(&mut connection).await?,
        Part::Rows => rows(&mut connection).await?,
    }
    connection.close().await
}

/// Checks all rows against their seals, and against the counts and digests updated when samples
/// were stored. A bit that flipped within a number leaves its page valid to SQLite.
pub(crate) async fn rows(connection: &mut Connection<'_>) -> Result<(), Error> {
    samples::visit(connection, Of::All, |_| Ok::<(), Error>(())).await?;
    sealed::<CampaignRow>(connection).await?;
    sealed::<DesignRow>(connection).await?;
    sealed::<CriteriaRow>(connection).await?;
    sealed::<ResponseRow>(connection).await?;
    sealed::<ModelRow>(connection).await?;
    sealed::<OptimiserRunRow>(connection).await?;
    sealed::<EvaluationRow>(connection).await?;
    sealed::<OptimumRow>(connection).await?;
    sealed::<RoundRow>(connection).await?;
    sealed::<InfillRow>(connection).await?;
    sealed::<Derivation>(connection).await
}

async fn sealed<T: Table>(connection: &mut Connection<'_>) -> Result<(), Error> {
    keyed::all::<T>(connection).await.map(drop)
}

pub(crate) async fn quick_check(connection: &mut Connection<'_>) -> Result<(), Error> {
    let findings: Vec<String> = connection
        .pragma("check its file", "PRAGMA quick_check(1)")
        .await?;
    if findings != ["ok"] {
        return Err(connection.damaged(findings.join("; ")));
    }
    Ok(())
}
