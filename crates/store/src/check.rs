//! The integrity check: whether the pages of the file are what SQLite wrote, and the samples in them
//! what was acknowledged.
//!
//! A small file is checked before it is opened. A large one, which takes seconds, is checked while
//! reads go on; nothing is written to it until the verdict on its pages is there. Its samples are
//! compared with their digest after that, beside everything else: a bit that flipped on the disk
//! does no harm to what is written meanwhile, and the campaign ends with an error before it is done.

use std::path::{Path, PathBuf};

use sqlx::Connection as _;
use sqlx::sqlite::SqliteConnection;
use tokio::sync::watch;

use crate::{Error, open, query, tally};

type Found = watch::Receiver<Option<Result<(), Error>>>;

/// What the checks found, or will find.
#[derive(Debug, Clone)]
pub(crate) struct Verdict {
    pages: Found,
    samples: Found,
}

/// What is still to be checked.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Pending {
    Nothing,
    Samples,
    PagesAndSamples,
}

impl Verdict {
    /// Nothing is left to be found.
    pub(crate) fn sound() -> Self {
        let sound = || watch::channel(Some(Ok(()))).1;
        Self {
            pages: sound(),
            samples: sound(),
        }
    }

    /// Starts what is still to be checked, on a connection of its own.
    pub(crate) fn of(path: PathBuf, pending: Pending) -> Self {
        let mut verdict = Self::sound();
        if pending == Pending::Nothing {
            return verdict;
        }
        let (samples, found) = watch::channel(None);
        verdict.samples = found;
        let pages = (pending == Pending::PagesAndSamples).then(|| {
            let (pages, found) = watch::channel(None);
            verdict.pages = found;
            pages
        });
        tokio::spawn(async move {
            let mut result = Ok(());
            if let Some(pages) = pages {
                result = check(&path, Part::Pages).await;
                // Nobody may be left to hear of it.
                let _ = pages.send(Some(result.clone()));
            }
            if result.is_ok() {
                result = check(&path, Part::Samples).await;
            }
            let _ = samples.send(Some(result));
        });
        verdict
    }

    /// Waits until the pages are known to be sound.
    pub(crate) async fn on_pages(self) -> Result<(), Error> {
        reached(self.pages).await
    }

    /// Waits until everything is known to be sound.
    pub(crate) async fn on_everything(self) -> Result<(), Error> {
        reached(self.pages).await?;
        reached(self.samples).await
    }
}

async fn reached(mut found: Found) -> Result<(), Error> {
    let found = found.wait_for(Option::is_some).await;
    match found.as_deref() {
        Ok(Some(result)) => result.clone(),
        // The runtime is shutting down.
        _ => Err(Error::Closed),
    }
}

enum Part {
    Pages,
    Samples,
}

async fn check(path: &Path, part: Part) -> Result<(), Error> {
    let mut connection = open::connect(&open::reading(path), path).await?;
    match part {
        Part::Pages => quick_check(&mut connection, path).await?,
        Part::Samples => samples(&mut connection, path).await?,
    }
    connection
        .close()
        .await
        .map_err(|e| Error::sqlite("close its file", path, e))
}

/// Whether the samples have the digest that was carried on when they were stored. A bit that flipped
/// within a number leaves its page as sound as before.
pub(crate) async fn samples(connection: &mut SqliteConnection, path: &Path) -> Result<(), Error> {
    // One transaction, so that both are of the same moment.
    let mut moment = connection
        .begin()
        .await
        .map_err(|e| Error::sqlite("begin to read", path, e))?;
    let held = query::tally(&mut *moment, path).await?;
    let computed = tally::recompute(&mut *moment, path).await?;
    moment
        .rollback()
        .await
        .map_err(|e| Error::sqlite("end reading", path, e))?;
    if held == computed {
        return Ok(());
    }
    Err(Error::Damaged {
        path: path.to_owned(),
        detail: format!(
            "its samples have the digest {}, those that were acknowledged had {}: a number has \
             changed on the disk",
            computed.to_hex(),
            held.to_hex()
        ),
    })
}

pub(crate) async fn quick_check(
    connection: &mut SqliteConnection,
    path: &Path,
) -> Result<(), Error> {
    let findings: Vec<String> = sqlx::query_scalar("PRAGMA quick_check(1)")
        .fetch_all(connection)
        .await
        .map_err(|e| Error::sqlite("check its file", path, e))?;
    if findings != ["ok"] {
        return Err(Error::Damaged {
            path: path.to_owned(),
            detail: findings.join("; "),
        });
    }
    Ok(())
}
