//! The integrity check: whether the file's pages are as SQLite wrote them, and its rows as they
//! were acknowledged.
//!
//! A small file is checked before it is opened. A large one, for which the check takes seconds, is
//! checked in the background: reads are allowed meanwhile, since every row is compared with its
//! digest when it is read, and writes wait for the result.

use std::path::Path;
use std::sync::Arc;

use sqlx::sqlite::SqliteConnectOptions;
use tokio::sync::watch;

use crate::Error;
use crate::blocks::Streams;
use crate::connection::Connection;
use crate::samples;
use crate::{
    campaign, criteria, derived, designs, evaluations, failures, infill, models, optima, origins,
    responses, rounds, runs,
};

/// The path and options for reading a store's file.
#[derive(Debug, Clone)]
pub(crate) struct ReadOptions {
    pub(crate) path: Arc<Path>,
    pub(crate) sqlite: SqliteConnectOptions,
}

impl ReadOptions {
    pub(crate) async fn connect(&self) -> Result<Connection<'static>, Error> {
        Connection::open(&self.sqlite, &self.path).await
    }

    async fn check(&self) -> Result<(), Error> {
        let mut connection = self.connect().await?;
        let checked = check(&mut connection).await;
        connection.closing(checked).await
    }
}

/// The result of the check, as soon as it is known.
#[derive(Debug, Clone)]
pub(crate) struct Integrity {
    result: watch::Sender<Option<Result<(), Error>>>,
    /// The file to check on demand only.
    unchecked: Option<ReadOptions>,
}

impl Integrity {
    /// The integrity of a file that was checked.
    pub(crate) fn sound() -> Self {
        Self {
            result: watch::Sender::new(Some(Ok(()))),
            unchecked: None,
        }
    }

    /// The integrity of a file that is checked on the first request.
    pub(crate) fn on_demand(file: ReadOptions) -> Self {
        Self {
            result: watch::Sender::new(None),
            unchecked: Some(file),
        }
    }

    /// The integrity of a file that is checked from now on, in the background.
    pub(crate) fn in_background(file: ReadOptions) -> Self {
        let integrity = Self {
            result: watch::Sender::new(None),
            unchecked: None,
        };
        let known = integrity.clone();
        tokio::spawn(async move { known.conclude(file.check().await) });
        integrity
    }

    /// Adds a result. The first error is kept.
    pub(crate) fn conclude(&self, result: Result<(), Error>) {
        self.result.send_if_modified(|known| {
            let is_news = !matches!(known, Some(Err(_)));
            if is_news {
                *known = Some(result);
            }
            is_news
        });
    }

    /// Whether the check has ended without an error.
    pub(crate) fn is_sound(&self) -> bool {
        matches!(*self.result.borrow(), Some(Ok(())))
    }

    /// Waits for the result of the check.
    pub(crate) async fn checked(self) -> Result<(), Error> {
        if let Some(file) = self.unchecked.as_ref().filter(|_| !self.is_sound()) {
            self.conclude(file.check().await);
        }
        let mut result = self.result.subscribe();
        let result = result.wait_for(Option::is_some).await;
        match result.as_deref() {
            Ok(Some(result)) => result.clone(),
            _ => Err(Error::Closed),
        }
    }

    /// Waits for an error, possibly for ever.
    pub(crate) async fn damaged(self) -> Error {
        let mut result = self.result.subscribe();
        match result
            .wait_for(|result| matches!(result, Some(Err(_))))
            .await
            .as_deref()
        {
            Ok(Some(Err(error))) => error.clone(),
            _ => Error::Closed,
        }
    }
}

/// Checks pages and rows.
pub(crate) async fn check(connection: &mut Connection<'_>) -> Result<(), Error> {
    check_pages(connection).await?;
    check_rows(connection).await
}

/// Checks pages, constraints, and that indexes agree with their tables.
pub(crate) async fn check_pages(connection: &mut Connection<'_>) -> Result<(), Error> {
    let findings: Vec<String> = connection.pragma("PRAGMA integrity_check(1)").await?;
    if findings != ["ok"] {
        return Err(connection.damaged(findings.join("; ")));
    }
    Ok(())
}

/// Reads all rows that have digests, which compares them. A bit that flipped within a number leaves its page valid to
/// SQLite.
async fn check_rows(connection: &mut Connection<'_>) -> Result<(), Error> {
    samples::visit(connection, Streams::All, |_| Ok::<(), Error>(())).await?;
    campaign::read(connection).await?;
    designs::all(connection).await?;
    criteria::all(connection).await?;
    responses::all(connection).await?;
    models::named(connection, None).await?;
    runs::all(connection).await?;
    evaluations::all(connection).await?;
    optima::all(connection).await?;
    rounds::all(connection).await?;
    infill::all(connection).await?;
    derived::all(connection).await?;
    origins::all(connection).await?;
    failures::all(connection).await?;
    failures::groups(connection).await?;
    Ok(())
}
