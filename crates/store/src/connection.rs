//! A connection that knows the path of its file.

use std::path::Path;
use std::pin::pin;
use std::sync::Arc;
use std::time::Duration;

use sqlx::pool::PoolConnection;
use sqlx::query::{Map, Query};
use sqlx::query_builder::{QueryBuilder, Separated};
use sqlx::sqlite::{
    Sqlite, SqliteArguments, SqliteConnectOptions, SqliteConnection, SqlitePool, SqliteRow,
};
use sqlx::{
    Connection as _, Decode, Error as SqlxError, Executor as _, Row as _, Transaction, Type,
};
use tokio::sync::{Mutex, OwnedMutexGuard};
use tokio_stream::{Stream, StreamExt as _};

use crate::Error;
use crate::error::BUSY_TIMEOUT;
use crate::row::{self, Row};

/// The most rows of one statement, whose parameters SQLite limits to 32 766.
const ROWS_PER_STATEMENT: usize = 1000;

/// The values of one row in a statement that inserts many.
pub(crate) type Values<'a> = Separated<'a, Sqlite, &'static str>;

/// A connection to a store's file. It runs statements and converts SQLite's errors to [`Error`]s
/// that name the file.
#[derive(Debug)]
pub(crate) struct Connection<'c> {
    sql: Handle<'c>,
    path: Arc<Path>,
}

#[derive(Debug)]
enum Handle<'c> {
    Own(SqliteConnection),
    Pooled(PoolConnection<Sqlite>),
    Shared(OwnedMutexGuard<Transaction<'static, Sqlite>>),
    Within(Transaction<'c, Sqlite>),
}

/// Time after which a wait for a lock is worth a message.
const PATIENCE: Duration = Duration::from_secs(3);

/// Awaits a statement that does nothing but wait for a lock of another program, and says so when it takes long.
pub(crate) async fn waiting<T>(path: &Path, statement: impl Future<Output = T>) -> T {
    let mut statement = pin!(statement);
    if let Ok(done) = tokio::time::timeout(PATIENCE, &mut statement).await {
        return done;
    }
    tracing::warn!(
        store = %path.display(),
        "waiting up to {} s for another program that has locked the store, such as an SQLite shell or a database browser",
        BUSY_TIMEOUT.as_secs()
    );
    statement.await
}

/// The connections that a store reads with.
#[derive(Debug, Clone)]
pub(crate) enum Readers {
    /// Each read sees what is stored when it begins.
    Pool(SqlitePool),
    /// All reads see what was stored at the first of them. One waits for another.
    Snapshot(Arc<Mutex<Transaction<'static, Sqlite>>>),
}

impl Readers {
    pub(crate) async fn acquire(&self, path: &Arc<Path>) -> Result<Connection<'static>, Error> {
        let sql = match self {
            Self::Pool(pool) => Handle::Pooled(pool.acquire().await.map_err(|e| opening(path, e))?),
            Self::Snapshot(moment) => Handle::Shared(Arc::clone(moment).lock_owned().await),
        };
        let path = Arc::clone(path);
        Ok(Connection { sql, path })
    }

    /// Readers that all see the same state of the store.
    pub(crate) async fn snapshot(&self, path: &Path) -> Result<Self, Error> {
        Ok(match self {
            Self::Pool(pool) => {
                let moment = pool.begin().await.map_err(|e| opening(path, e))?;
                Self::Snapshot(Arc::new(Mutex::new(moment)))
            }
            Self::Snapshot(_) => self.clone(),
        })
    }

    /// Closes the connections, once they are no longer in use.
    pub(crate) async fn close(&self) {
        if let Self::Pool(pool) = self {
            pool.close().await;
        }
    }
}

fn opening(path: &Path, source: SqlxError) -> Error {
    Error::sqlite(path, source)
}

type MappedQuery<'q, F> = Map<'q, Sqlite, F, SqliteArguments>;

impl Connection<'static> {
    pub(crate) async fn open(
        options: &SqliteConnectOptions,
        path: &Arc<Path>,
    ) -> Result<Self, Error> {
        let opened = waiting(path, SqliteConnection::connect_with(options)).await;
        Ok(Self {
            sql: Handle::Own(opened.map_err(|e| Error::sqlite(path, e))?),
            path: Arc::clone(path),
        })
    }

    pub(crate) async fn close(self) -> Result<(), Error> {
        let closed = match self.sql {
            Handle::Own(sql) => sql.close().await,
            Handle::Pooled(sql) => sql.close().await,
            Handle::Shared(_) => Ok(()),
            Handle::Within(transaction) => transaction.rollback().await,
        };
        closed.map_err(|e| Error::sqlite(&self.path, e))
    }

    /// Returns `result` once the connection is closed. After a refusal the caller may replace the file, and a connection
    /// that is only dropped still holds the log for a moment.
    pub(crate) async fn closing<T>(self, result: Result<T, Error>) -> Result<T, Error> {
        let closed = self.close().await;
        let value = result?;
        closed?;
        Ok(value)
    }
}

impl Connection<'_> {
    pub(crate) fn shared_path(&self) -> Arc<Path> {
        Arc::clone(&self.path)
    }

    /// Converts an SQLite error.
    pub(crate) fn failed(&self, source: SqlxError) -> Error {
        Error::sqlite(&self.path, source)
    }

    pub(crate) fn damaged(&self, detail: impl Into<String>) -> Error {
        Error::Damaged {
            path: self.path.to_path_buf(),
            detail: detail.into(),
        }
    }

    pub(crate) fn damaged_rows(&self, table: &'static str, row: String, detail: &str) -> Error {
        Error::damaged_rows(&self.path, table, row, detail)
    }

    pub(crate) fn sql(&mut self) -> &mut SqliteConnection {
        match &mut self.sql {
            Handle::Own(sql) => sql,
            Handle::Pooled(sql) => sql,
            Handle::Shared(sql) => sql,
            Handle::Within(transaction) => transaction,
        }
    }

    /// Begins a transaction, which is rolled back when it is dropped.
    pub(crate) async fn begin(&mut self, statement: &'static str) -> Result<Connection<'_>, Error> {
        let path = Arc::clone(&self.path);
        let begun = waiting(&path, self.sql().begin_with(statement)).await;
        Ok(Connection {
            sql: Handle::Within(begun.map_err(|e| Error::sqlite(&path, e))?),
            path,
        })
    }

    /// Begins a transaction whose reads all see the same state. Within another transaction, they see the state of that
    /// one.
    pub(crate) async fn moment(&mut self) -> Result<Connection<'_>, Error> {
        let path = Arc::clone(&self.path);
        let begun = self.sql().begin().await;
        Ok(Connection {
            sql: Handle::Within(begun.map_err(|e| Error::sqlite(&path, e))?),
            path,
        })
    }

    pub(crate) async fn commit(self) -> Result<(), Error> {
        match self.sql {
            Handle::Within(transaction) => transaction
                .commit()
                .await
                .map_err(|e| Error::sqlite(&self.path, e)),
            Handle::Own(_) | Handle::Pooled(_) | Handle::Shared(_) => Ok(()),
        }
    }

    /// Runs statements without parameters.
    pub(crate) async fn run(&mut self, statement: &'static str) -> Result<(), Error> {
        let done = self.sql().execute(statement).await;
        done.map(drop).map_err(|e| self.failed(e))
    }

    /// Runs a statement without parameters and returns one value per row.
    pub(crate) async fn pragma<O>(&mut self, statement: &'static str) -> Result<Vec<O>, Error>
    where
        O: for<'r> Decode<'r, Sqlite> + Type<Sqlite> + Send + Unpin,
    {
        let query = sqlx::query(statement).try_map(|row: SqliteRow| row.try_get(0));
        self.all(query).await
    }

    /// Inserts, changes or removes rows, and returns their number.
    pub(crate) async fn execute(
        &mut self,
        query: Query<'_, Sqlite, SqliteArguments>,
    ) -> Result<u64, Error> {
        let done = query.execute(self.sql()).await;
        Ok(done.map_err(|e| self.failed(e))?.rows_affected())
    }

    /// Inserts many rows with one statement: a statement takes a round trip to SQLite's thread, which costs more than a
    /// row. `statement` holds the text before and after the values of the rows, which `bind` adds.
    pub(crate) async fn insert_many<T>(
        &mut self,
        statement: [&'static str; 2],
        rows: &[T],
        bind: impl Fn(&mut Values<'_>, &T),
    ) -> Result<(), Error> {
        let [before, after] = statement;
        for rows in rows.chunks(ROWS_PER_STATEMENT) {
            let mut builder = QueryBuilder::new(before);
            builder.push_values(rows, |mut values, row| bind(&mut values, row));
            // Not cached: statements differ by their number of rows.
            let query = builder.push(after).build().persistent(false);
            self.execute(query).await?;
        }
        Ok(())
    }

    /// Returns a row that was read if it has the digest that it was stored with.
    pub(crate) fn check<R: Row>(&self, row: R, seal: i64) -> Result<R, Error> {
        row::check(row, seal, &self.path)
    }

    pub(crate) async fn all<F, O>(&mut self, query: MappedQuery<'_, F>) -> Result<Vec<O>, Error>
    where
        F: FnMut(SqliteRow) -> Result<O, SqlxError> + Send,
        O: Send + Unpin,
    {
        let rows = query.fetch_all(self.sql()).await;
        rows.map_err(|e| self.failed(e))
    }

    pub(crate) async fn one<F, O>(&mut self, query: MappedQuery<'_, F>) -> Result<O, Error>
    where
        F: FnMut(SqliteRow) -> Result<O, SqlxError> + Send,
        O: Send + Unpin,
    {
        let row = query.fetch_one(self.sql()).await;
        row.map_err(|e| self.failed(e))
    }

    pub(crate) async fn optional<F, O>(
        &mut self,
        query: MappedQuery<'_, F>,
    ) -> Result<Option<O>, Error>
    where
        F: FnMut(SqliteRow) -> Result<O, SqlxError> + Send,
        O: Send + Unpin,
    {
        let row = query.fetch_optional(self.sql()).await;
        row.map_err(|e| self.failed(e))
    }

    /// Streams rows, for tables that are too large to hold in memory.
    pub(crate) fn stream<'s, F, O>(
        &'s mut self,
        query: MappedQuery<'s, F>,
    ) -> impl Stream<Item = Result<O, Error>> + Send + Unpin + 's
    where
        F: FnMut(SqliteRow) -> Result<O, SqlxError> + Send + 's,
        O: Send + Unpin + 's,
    {
        let path = Arc::clone(&self.path);
        query
            .fetch(self.sql())
            .map(move |row| row.map_err(|e| Error::sqlite(&path, e)))
    }
}
