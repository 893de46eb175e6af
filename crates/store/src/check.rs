//! The integrity check: whether the pages of the file are what SQLite wrote.
//!
//! A small file is checked before it is opened. A large one, which takes seconds, is checked while
//! reads go on; nothing is written to it until the verdict is there.

use std::path::{Path, PathBuf};

use sqlx::Connection as _;
use sqlx::sqlite::SqliteConnection;
use tokio::sync::watch;

use crate::{Error, open};

/// What the check found, or will find.
#[derive(Debug, Clone)]
pub(crate) struct Verdict {
    found: watch::Receiver<Option<Result<(), Error>>>,
}

impl Verdict {
    /// Nothing is left to be found.
    pub(crate) fn sound() -> Self {
        Self {
            found: watch::channel(Some(Ok(()))).1,
        }
    }

    /// Starts the check on a connection of its own.
    pub(crate) fn pending(path: PathBuf) -> Self {
        let (verdict, found) = watch::channel(None);
        tokio::spawn(async move {
            let result = check(&path).await;
            // Nobody may be left to hear of it.
            let _ = verdict.send(Some(result));
        });
        Self { found }
    }

    /// Waits for it.
    pub(crate) async fn reached(mut self) -> Result<(), Error> {
        let found = self.found.wait_for(Option::is_some).await;
        match found.as_deref() {
            Ok(Some(result)) => result.clone(),
            // The runtime is shutting down.
            _ => Err(Error::Closed),
        }
    }
}

async fn check(path: &Path) -> Result<(), Error> {
    let mut connection = open::connect(&open::reading(path), path).await?;
    quick_check(&mut connection, path).await?;
    connection
        .close()
        .await
        .map_err(|e| Error::sqlite("close its file", path, e))
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
