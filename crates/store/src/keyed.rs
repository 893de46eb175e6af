//! Tables where the first write wins, written many rows to a statement.
//!
//! Every statement is a hop to SQLite's thread and back, which costs more than a row, so rows go
//! in by up to [`ROWS_PER_STATEMENT`]. Statements come in powers of two, so that few of them are
//! prepared and kept; a chunk is filled up with copies of its last row, which do nothing in a
//! table where the first write wins.

use std::collections::BTreeMap;
use std::path::Path;

use sqlx::error::BoxDynError;
use sqlx::sqlite::{SqliteArguments, SqliteConnection, SqlitePool, SqliteRow};
use sqlx::{Arguments as _, AssertSqlSafe, Error as SqlxError};

use crate::Error;
use crate::rows::Receipt;

/// Enough to make the hop cheap, and with the widest table's 14 columns still below SQLite's
/// 32 766 parameters.
const ROWS_PER_STATEMENT: usize = 1024;

/// A row that can be written many to a statement.
pub(crate) trait Columns: Sized {
    const TABLE: &'static str;
    /// The key's columns first.
    const COLUMNS: &'static [&'static str];

    /// Refuses what SQLite would not give back as it was.
    fn check(&self) -> Result<(), Error>;

    /// The values of all columns, in their order.
    fn bind(&self, arguments: &mut SqliteArguments) -> Result<(), BoxDynError>;
}

/// A row of a table where the first write wins.
pub(crate) trait Keyed: Columns {
    /// How many columns the key has.
    const KEYS: usize;
    /// Whether a second offer of the same row is an everyday event rather than the trace of a
    /// mishap.
    const OFTEN_REPEATED: bool;
    /// What fails when the rows cannot be read: completes "the database could not".
    const READING: &'static str;

    type Key<'a>: Ord
    where
        Self: 'a;

    fn key(&self) -> Self::Key<'_>;

    fn bind_key(&self, arguments: &mut SqliteArguments) -> Result<(), BoxDynError>;

    fn read(row: &SqliteRow) -> Result<Self, SqlxError>;

    /// Refuses a row that differs from the one held.
    fn agree(held: &Self, offered: &Self) -> Result<(), Error>;
}

/// How to find out which rows are new.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Approach {
    /// Suppose that all are, and see from the count whether that was so.
    Trust,
    /// Read what is held first.
    Look,
}

/// Stores rows, each with the index of its owner's receipt, and returns those that were not held.
/// `None` when trust was misplaced: the caller goes back to its savepoint and has to look.
pub(crate) async fn insert<'r, T: Keyed>(
    connection: &mut SqliteConnection,
    path: &Path,
    rows: &[(usize, &'r T)],
    approach: Approach,
    receipts: &mut [Receipt],
) -> Result<Option<Vec<&'r T>>, Error> {
    let mut fresh = Vec::with_capacity(rows.len());
    for chunk in rows.chunks(ROWS_PER_STATEMENT) {
        for (_, row) in chunk {
            row.check()?;
        }
        let before = fresh.len();
        if approach == Approach::Trust && !T::OFTEN_REPEATED {
            for &(owner, row) in chunk {
                receipts[owner].new_rows += 1;
                fresh.push(row);
            }
        } else {
            look(connection, path, chunk, receipts, &mut fresh).await?;
        }
        let offered = &fresh[before..];
        let inserted = write(
            connection,
            path,
            "INSERT INTO",
            "ON CONFLICT DO NOTHING",
            offered,
        )
        .await?;
        if inserted != offered.len() as u64 {
            return Ok(None);
        }
    }
    Ok(Some(fresh))
}

/// Compares rows with those held, and with each other.
async fn look<'r, T: Keyed>(
    connection: &mut SqliteConnection,
    path: &Path,
    rows: &[(usize, &'r T)],
    receipts: &mut [Receipt],
    fresh: &mut Vec<&'r T>,
) -> Result<(), Error> {
    let held = held(connection, path, rows).await?;
    let mut known: BTreeMap<T::Key<'_>, &T> = held.iter().map(|row| (row.key(), row)).collect();
    for &(owner, row) in rows {
        match known.get(&row.key()) {
            Some(held) => {
                T::agree(held, row)?;
                receipts[owner].duplicate_rows += 1;
            }
            None => {
                known.insert(row.key(), row);
                receipts[owner].new_rows += 1;
                fresh.push(row);
            }
        }
    }
    Ok(())
}

async fn held<T: Keyed>(
    connection: &mut SqliteConnection,
    path: &Path,
    rows: &[(usize, &T)],
) -> Result<Vec<T>, Error> {
    let Some((_, last)) = rows.last() else {
        return Ok(Vec::new());
    };
    let count = rows.len().next_power_of_two();
    let mut arguments = SqliteArguments::default();
    arguments.reserve(count * T::KEYS, 0);
    let filling = std::iter::repeat_n(last, count - rows.len());
    for row in rows.iter().map(|(_, row)| row).chain(filling) {
        row.bind_key(&mut arguments)
            .map_err(|e| Error::sqlite(T::READING, path, SqlxError::Encode(e)))?;
    }
    let sql = format!(
        "{} WHERE ({}) IN (VALUES {})",
        select::<T>(),
        keys::<T>(),
        places(count, T::KEYS),
    );
    let query = sqlx::query_with(AssertSqlSafe(sql), arguments);
    read(path, query.fetch_all(connection).await)
}

/// All rows, by key.
pub(crate) async fn all<T: Keyed>(pool: &SqlitePool, path: &Path) -> Result<Vec<T>, Error> {
    let sql = format!("{} ORDER BY {}", select::<T>(), keys::<T>());
    let rows = sqlx::query(AssertSqlSafe(sql)).fetch_all(pool).await;
    read(path, rows)
}

/// The rows whose key begins with `first`, by key.
pub(crate) async fn all_of<T: Keyed>(
    pool: &SqlitePool,
    path: &Path,
    first: &str,
) -> Result<Vec<T>, Error> {
    let sql = format!(
        "{} WHERE {} = ? ORDER BY {}",
        select::<T>(),
        T::COLUMNS[0],
        keys::<T>()
    );
    let query = sqlx::query(AssertSqlSafe(sql)).bind(first);
    read(path, query.fetch_all(pool).await)
}

fn select<T: Keyed>() -> String {
    format!("SELECT {} FROM {}", T::COLUMNS.join(", "), T::TABLE)
}

fn keys<T: Keyed>() -> String {
    T::COLUMNS[..T::KEYS].join(", ")
}

fn read<T: Keyed>(path: &Path, rows: Result<Vec<SqliteRow>, SqlxError>) -> Result<Vec<T>, Error> {
    rows.and_then(|rows| rows.iter().map(T::read).collect())
        .map_err(|e| Error::sqlite(T::READING, path, e))
}

/// One statement per chunk; returns how many rows it changed.
pub(crate) async fn write<T: Columns>(
    connection: &mut SqliteConnection,
    path: &Path,
    verb: &str,
    otherwise: &str,
    rows: &[&T],
) -> Result<u64, Error> {
    let mut changed = 0;
    for chunk in rows.chunks(ROWS_PER_STATEMENT) {
        let Some(last) = chunk.last() else {
            continue;
        };
        let count = chunk.len().next_power_of_two();
        let mut arguments = SqliteArguments::default();
        arguments.reserve(count * T::COLUMNS.len(), 0);
        let filling = std::iter::repeat_n(last, count - chunk.len());
        for row in chunk.iter().chain(filling) {
            row.bind(&mut arguments)
                .map_err(|e| Error::insertion(T::TABLE, path, SqlxError::Encode(e)))?;
        }
        let sql = format!(
            "{verb} {} ({}) VALUES {} {otherwise}",
            T::TABLE,
            T::COLUMNS.join(", "),
            places(count, T::COLUMNS.len()),
        );
        // Nothing but names and question marks is in the text.
        changed += sqlx::query_with(AssertSqlSafe(sql), arguments)
            .execute(&mut *connection)
            .await
            .map_err(|e| Error::insertion(T::TABLE, path, e))?
            .rows_affected();
    }
    Ok(changed)
}

/// `(?,?),(?,?)`: `rows` of them with `columns` places each.
fn places(rows: usize, columns: usize) -> String {
    let row = format!("({})", vec!["?"; columns].join(","));
    vec![row.as_str(); rows].join(",")
}
