//! The integrity check: whether the pages of the file are what SQLite wrote, and the samples in them
//! what was acknowledged.
//!
//! A small file is checked before it is opened. A large one, which takes seconds, is checked while
//! reads go on; nothing is written to it until the verdict on its pages is there. Its samples are
//! compared with their digest after that, beside everything else: a bit that flipped on the disk
//! does no harm to what is written meanwhile, and the campaign ends with an error before it is done.

use std::path::Path;
use std::sync::Arc;

use sqlx::sqlite::SqliteConnectOptions;
use tokio::sync::watch;

use crate::connection::Connection;
use crate::keyed::{self, Table};
use crate::rounds::{InfillRow, RoundRow};
use crate::rows::{
    CampaignRow, CriteriaRow, DesignRow, EvaluationRow, ModelRow, OptimiserRunRow, OptimumRow,
    ResponseRow,
};
use crate::{Error, samples, tally};

type Found = watch::Sender<Option<Result<(), Error>>>;

/// What the checks found, or will find.
#[derive(Debug, Clone)]
pub(crate) struct Verdict {
    pages: Found,
    /// The verdict on everything, the pages included.
    all: Found,
    /// What is checked only when somebody asks.
    unasked: Option<Reading>,
}

/// How a store's file is read.
#[derive(Debug, Clone)]
pub(crate) struct Reading {
    pub(crate) path: Arc<Path>,
    pub(crate) options: SqliteConnectOptions,
}

/// What is still to be checked.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Pending {
    Nothing,
    Rows,
    PagesAndRows,
}

impl Verdict {
    /// Nothing is left to be found.
    pub(crate) fn sound() -> Self {
        Self {
            pages: Found::new(Some(Ok(()))),
            all: Found::new(Some(Ok(()))),
            unasked: None,
        }
    }

    /// Nothing is looked for until somebody wants to know.
    pub(crate) fn on_demand(reading: Reading) -> Self {
        Self {
            pages: Found::new(None),
            all: Found::new(None),
            unasked: Some(reading),
        }
    }

    /// Starts what is still to be checked, on a connection of its own.
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

    /// Adds a finding. The first error stays.
    pub(crate) fn conclude(&self, result: Result<(), Error>) {
        self.all.send_if_modified(|found| {
            let is_news = !matches!(found, Some(Err(_)));
            if is_news {
                *found = Some(result);
            }
            is_news
        });
    }

    /// Whether everything is known to be sound.
    pub(crate) fn is_sound(&self) -> bool {
        matches!(*self.all.borrow(), Some(Ok(())))
    }

    /// Waits until the pages are known to be sound.
    pub(crate) async fn on_pages(self) -> Result<(), Error> {
        reached(&self.pages).await
    }

    /// Waits until everything is known to be sound.
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

    /// Waits for an error, however long everything is sound.
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

/// Whether all rows are what was stored, by their seals and by the counts and digests that were carried
/// on when samples were stored. A bit that flipped within a number leaves its page as sound as
/// before.
pub(crate) async fn rows(connection: &mut Connection<'_>) -> Result<(), Error> {
    samples(connection).await?;
    lasting_rows(connection).await?;
    sealed::<DesignRow>(connection).await?;
    sealed::<CriteriaRow>(connection).await?;
    sealed::<InfillRow>(connection).await
}

/// As [`rows`], for the evaluations of optimiser runs.
pub(crate) async fn evaluations(connection: &mut Connection<'_>) -> Result<(), Error> {
    sealed::<EvaluationRow>(connection).await
}

/// Compares the samples of the DoE with their digests.
pub(crate) async fn samples(connection: &mut Connection<'_>) -> Result<(), Error> {
    samples::visit(connection, |_| Ok::<(), Error>(())).await
}

/// As [`rows`], for the tables whose columns are the same since they have seals.
pub(crate) async fn lasting_rows(connection: &mut Connection<'_>) -> Result<(), Error> {
    tally::check_verify_samples(connection).await?;
    sealed::<CampaignRow>(connection).await?;
    sealed::<OptimiserRunRow>(connection).await?;
    sealed::<ResponseRow>(connection).await?;
    sealed::<ModelRow>(connection).await?;
    sealed::<OptimumRow>(connection).await?;
    sealed::<RoundRow>(connection).await
}

async fn sealed<T: Table>(connection: &mut Connection<'_>) -> Result<(), Error> {
    keyed::all::<T>(connection).await.map(drop)
}

/// Seals all rows, for the migration that brought the seals.
pub(crate) async fn seal(connection: &mut Connection<'_>) -> Result<(), Error> {
    keyed::seal::<CampaignRow>(connection).await?;
    keyed::seal::<OptimiserRunRow>(connection).await?;
    keyed::seal::<ResponseRow>(connection).await?;
    keyed::seal::<ModelRow>(connection).await?;
    keyed::seal::<OptimumRow>(connection).await?;
    keyed::seal::<RoundRow>(connection).await?;
    tally::fill_points(connection).await
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
