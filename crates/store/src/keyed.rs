//! Generic tables: rows are written many per statement, and read with their seals.
//!
//! A row of a *sealed* table carries a digest of its columns, which is written with it and compared
//! at every read. A value that was changed on the disk or by another program is refused with the
//! name of its table and row before it is used.
//!
//! Every statement takes a round trip to SQLite's thread, which costs more than a row, so up to
//! [`ROWS_PER_STATEMENT`] rows go into one statement. The number of rows is a power of two, so that
//! few different statements are prepared and cached. A chunk is filled up with copies of its last
//! row: they have no effect in a table where the first write wins, and replace that row by itself
//! in the others.

use std::collections::BTreeMap;
use std::path::Path;

use ledger::StreamId;
use sha2::{Digest as _, Sha256};
use sqlx::sqlite::{SqliteArguments, SqliteRow};
use sqlx::{Arguments as _, AssertSqlSafe, Error as SqlxError, Row as _};
use tokio_stream::StreamExt as _;

use crate::Error;
use crate::connection::Connection;
use crate::rows::Receipt;
use crate::tables::number;

/// Maximum number of rows per statement: enough to make the round trip cheap and, with the 15
/// columns of the widest table, below SQLite's limit of 32 766 parameters.
const ROWS_PER_STATEMENT: usize = 1024;

/// A column's value in one row.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Value<'v> {
    Null,
    /// An index or a count, which SQLite's signed integers must be able to hold.
    Count(u64),
    /// 64 bits, stored as a two's complement integer.
    Bits(u64),
    Stream(StreamId),
    Number(f64),
    Text(&'v str),
    /// A list of numbers, stored as little-endian bytes.
    Numbers(&'v [f64]),
}

/// A type that is stored in one column.
pub(crate) trait Column: Sized {
    fn value(&self) -> Value<'_>;

    fn read(row: &SqliteRow, place: usize) -> Result<Self, SqlxError>;
}

impl Column for u64 {
    fn value(&self) -> Value<'_> {
        Value::Count(*self)
    }

    fn read(row: &SqliteRow, place: usize) -> Result<Self, SqlxError> {
        row.try_get::<i64, _>(place).map(i64::cast_unsigned)
    }
}

impl Column for StreamId {
    fn value(&self) -> Value<'_> {
        Value::Stream(*self)
    }

    fn read(row: &SqliteRow, place: usize) -> Result<Self, SqlxError> {
        let key: i64 = row.try_get(place)?;
        let stream = Self::from_key(key.cast_unsigned());
        stream.ok_or_else(|| SqlxError::Decode(format!("{key} is no stream").into()))
    }
}

impl Column for bool {
    fn value(&self) -> Value<'_> {
        Value::Count(u64::from(*self))
    }

    fn read(row: &SqliteRow, place: usize) -> Result<Self, SqlxError> {
        row.try_get(place)
    }
}

impl Column for f64 {
    fn value(&self) -> Value<'_> {
        Value::Number(number(*self))
    }

    fn read(row: &SqliteRow, place: usize) -> Result<Self, SqlxError> {
        row.try_get(place)
    }
}

impl Column for Option<f64> {
    fn value(&self) -> Value<'_> {
        self.as_ref().map_or(Value::Null, f64::value)
    }

    fn read(row: &SqliteRow, place: usize) -> Result<Self, SqlxError> {
        row.try_get(place)
    }
}

impl Column for String {
    fn value(&self) -> Value<'_> {
        Value::Text(self)
    }

    fn read(row: &SqliteRow, place: usize) -> Result<Self, SqlxError> {
        row.try_get(place)
    }
}

impl Column for Vec<f64> {
    fn value(&self) -> Value<'_> {
        Value::Numbers(self)
    }

    fn read(row: &SqliteRow, place: usize) -> Result<Self, SqlxError> {
        numbers(row.try_get(place)?)
    }
}

impl Column for Option<Vec<f64>> {
    fn value(&self) -> Value<'_> {
        self.as_deref().map_or(Value::Null, Value::Numbers)
    }

    fn read(row: &SqliteRow, place: usize) -> Result<Self, SqlxError> {
        let bytes: Option<&[u8]> = row.try_get(place)?;
        bytes.map(numbers).transpose()
    }
}

/// The columns in which an infinite number stands for a failed sample, or for a percentile of too many of
/// them. SQLite returns it unchanged, but not NaN.
const INFINITE: [&str; 3] = [
    "sample_block.samples",
    "response.percentile",
    "evaluation.samples",
];

fn is_allowed(value: f64, column: &str) -> bool {
    value.is_finite() || value.is_infinite() && INFINITE.contains(&column)
}

/// Decodes a column's bytes to numbers.
pub(crate) fn numbers(bytes: &[u8]) -> Result<Vec<f64>, SqlxError> {
    let (numbers, rest) = bytes.as_chunks();
    if !rest.is_empty() {
        let found = format!("{} bytes, which are no list of numbers", bytes.len());
        return Err(SqlxError::Decode(found.into()));
    }
    Ok(numbers.iter().copied().map(f64::from_le_bytes).collect())
}

impl Column for Option<String> {
    fn value(&self) -> Value<'_> {
        self.as_deref().map_or(Value::Null, Value::Text)
    }

    fn read(row: &SqliteRow, place: usize) -> Result<Self, SqlxError> {
        row.try_get(place)
    }
}

/// A table, implemented by the type of its rows.
pub(crate) trait Table: Sized + Send + Sync + Unpin {
    const NAME: &'static str;
    /// The column names, those of the key first.
    const COLUMNS: &'static [&'static str];
    /// The number of key columns.
    const KEYS: usize;
    /// Whether each row carries a seal, in the column `seal`.
    const SEALED: bool;
    /// The operation of reading the rows; completes "the database could not".
    const READING: &'static str;

    /// Passes the values of all columns to `visit`, in order.
    fn each(&self, visit: impl FnMut(Value<'_>));

    fn read(row: &SqliteRow) -> Result<Self, SqlxError>;

    /// The row's key for messages, such as "sample 3 of design 17".
    fn name(&self) -> String {
        let mut parts = Vec::new();
        self.each(|value| {
            if let Some(column) = Self::COLUMNS.get(parts.len()) {
                parts.push(match value {
                    Value::Null | Value::Numbers(_) => (*column).to_owned(),
                    Value::Count(value) | Value::Bits(value) => format!("{column} {value}"),
                    Value::Stream(stream) => stream.to_string(),
                    Value::Number(value) => format!("{column} {value}"),
                    Value::Text(value) => format!("{column} {value:?}"),
                });
            }
        });
        parts.truncate(Self::KEYS);
        parts.reverse();
        parts.join(" of ")
    }

    /// Refuses values that SQLite would not return unchanged.
    fn check(&self) -> Result<(), Error> {
        let mut columns = Self::COLUMNS.iter();
        let mut result = Ok(());
        self.each(|value| {
            let column = columns.next().copied().unwrap_or_default();
            let column = || format!("{}.{column}", Self::NAME);
            match value {
                Value::Count(value) if i64::try_from(value).is_err() => {
                    let column = column();
                    result = Err(Error::TooLarge { column, value });
                }
                Value::Number(value) if !is_allowed(value, &column()) => {
                    result = Err(self.not_finite(column(), value));
                }
                Value::Numbers(values) => {
                    let column = column();
                    if let Some(value) = values.iter().find(|value| !is_allowed(**value, &column)) {
                        result = Err(self.not_finite(column, *value));
                    }
                }
                _ => {}
            }
        });
        result
    }

    /// The error for a number that SQLite would not return.
    fn not_finite(&self, column: String, value: f64) -> Error {
        Error::NotFinite {
            column,
            key: self.name(),
            value,
        }
    }

    /// The first 64 bits of the SHA-256 of the table's name and of all columns.
    ///
    /// A checksum against accidents: anybody who edits a row on purpose can adapt it.
    fn seal(&self) -> i64 {
        let mut hash = Sha256::new_with_prefix(Self::NAME);
        self.each(|value| match value {
            Value::Null => hash.update([0]),
            Value::Count(value) | Value::Bits(value) => {
                hash.update([1]);
                hash.update(value.to_le_bytes());
            }
            Value::Stream(stream) => {
                hash.update([1]);
                hash.update(stream.key().to_le_bytes());
            }
            Value::Number(value) => {
                hash.update([2]);
                hash.update(value.to_bits().to_le_bytes());
            }
            Value::Text(value) => {
                hash.update([3]);
                hash.update((value.len() as u64).to_le_bytes());
                hash.update(value);
            }
            Value::Numbers(values) => {
                hash.update([5]);
                hash.update((values.len() as u64).to_le_bytes());
                let each = values.iter().map(|value| value.to_bits().to_le_bytes());
                each.for_each(|bytes| hash.update(bytes));
            }
        });
        let hash = hash.finalize();
        let first = hash.first_chunk().copied().unwrap_or_default();
        i64::from_le_bytes(first)
    }
}

/// A row of a table where the first write wins.
pub(crate) trait Keyed: Table {
    type Key<'a>: Ord
    where
        Self: 'a;

    fn key(&self) -> Self::Key<'_>;

    /// Refuses a row that differs from the one held.
    fn agree(held: &Self, offered: &Self) -> Result<(), Error>;
}

/// Stores rows, each given with the index of its batch's receipt, and returns the new ones.
pub(crate) async fn insert<'r, T: Keyed>(
    connection: &mut Connection<'_>,
    rows: &[(usize, &'r T)],
    receipts: &mut [Receipt],
) -> Result<Vec<&'r T>, Error> {
    let mut fresh = Vec::with_capacity(rows.len());
    for chunk in rows.chunks(ROWS_PER_STATEMENT) {
        for (_, row) in chunk {
            row.check()?;
        }
        let before = fresh.len();
        look(connection, chunk, receipts, &mut fresh).await?;
        let offered = &fresh[before..];
        let inserted = write(connection, "INSERT INTO", "ON CONFLICT DO NOTHING", offered).await?;
        if inserted != offered.len() as u64 {
            // There is only one writer, so rows that were missing a moment ago can be inserted.
            return Err(connection.damaged("rows that it does not hold cannot be inserted"));
        }
    }
    Ok(fresh)
}

/// Compares rows with the stored ones and with each other.
async fn look<'r, T: Keyed>(
    connection: &mut Connection<'_>,
    rows: &[(usize, &'r T)],
    receipts: &mut [Receipt],
    fresh: &mut Vec<&'r T>,
) -> Result<(), Error> {
    let held = held(connection, rows).await?;
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
    connection: &mut Connection<'_>,
    rows: &[(usize, &T)],
) -> Result<Vec<T>, Error> {
    let Some(last) = rows.last() else {
        return Ok(Vec::new());
    };
    let count = rows.len().next_power_of_two();
    let mut arguments = SqliteArguments::default();
    arguments.reserve(count * T::KEYS, 0);
    let filling = std::iter::repeat_n(last, count - rows.len());
    for (_, row) in rows.iter().chain(filling) {
        bind(*row, T::KEYS, &mut arguments).map_err(|e| connection.failed(T::READING, e))?;
    }
    let filter = format!(
        "WHERE ({}) IN (VALUES {})",
        keys::<T>(),
        places(count, T::KEYS)
    );
    collect(connection, &filter, arguments).await
}

/// All rows, ordered by key.
pub(crate) async fn all<T: Table>(connection: &mut Connection<'_>) -> Result<Vec<T>, Error> {
    collect(connection, "", SqliteArguments::default()).await
}

/// The rows that match a filter, ordered by key.
pub(crate) async fn all_where<T: Table>(
    connection: &mut Connection<'_>,
    filter: &str,
    parameters: &[Value<'_>],
) -> Result<Vec<T>, Error> {
    let arguments = arguments(connection, parameters)?;
    collect(connection, filter, arguments).await
}

pub(crate) fn arguments(
    connection: &Connection<'_>,
    values: &[Value<'_>],
) -> Result<SqliteArguments, Error> {
    let mut arguments = SqliteArguments::default();
    for value in values {
        add(*value, &mut arguments).map_err(|e| connection.failed("bind values", e))?;
    }
    Ok(arguments)
}

async fn collect<T: Table>(
    connection: &mut Connection<'_>,
    filter: &str,
    arguments: SqliteArguments,
) -> Result<Vec<T>, Error> {
    let mut rows = Vec::new();
    visit(connection, filter, arguments, |row| {
        rows.push(row);
        Ok::<(), Error>(())
    })
    .await?;
    Ok(rows)
}

/// Passes the rows that match a filter to `visit`, one by one, ordered by key.
pub(crate) async fn visit<T: Table, E: From<Error>>(
    connection: &mut Connection<'_>,
    filter: &str,
    arguments: SqliteArguments,
    mut visit: impl FnMut(T) -> Result<(), E>,
) -> Result<(), E> {
    let path = connection.shared_path();
    let (columns, table, keys) = (columns::<T>(), T::NAME, keys::<T>());
    let sql = format!("SELECT {columns} FROM {table} {filter} ORDER BY {keys}");
    let query = sqlx::query_with(AssertSqlSafe(sql), arguments);
    let mut rows = connection.stream(T::READING, query.try_map(Ok));
    while let Some(row) = rows.next().await {
        let row = row?;
        let read = decode::<T>(&path, &row)?;
        if T::SEALED {
            let held: Option<i64> = row.try_get(T::COLUMNS.len()).ok();
            if held != Some(read.seal()) {
                let detail = "its values are not those that it was sealed with: something else than this program \
                              has changed it";
                return Err(Error::damaged_rows(&path, T::NAME, read.name(), detail).into());
            }
        }
        visit(read)?;
    }
    Ok(())
}

fn decode<T: Table>(path: &Path, row: &SqliteRow) -> Result<T, Error> {
    T::read(row).map_err(|e| {
        let row = "one that cannot be read".to_owned();
        Error::damaged_rows(path, T::NAME, row, &e.to_string())
    })
}

/// Stores rows, replacing those with the same keys.
pub(crate) async fn replace<T: Table>(
    connection: &mut Connection<'_>,
    rows: &[T],
) -> Result<(), Error> {
    rows.iter().try_for_each(T::check)?;
    let rows: Vec<&T> = rows.iter().collect();
    write(connection, "INSERT OR REPLACE INTO", "", &rows)
        .await
        .map(drop)
}

fn columns<T: Table>() -> String {
    let mut columns = T::COLUMNS.join(", ");
    if T::SEALED {
        columns += ", seal";
    }
    columns
}

fn keys<T: Table>() -> String {
    T::COLUMNS[..T::KEYS].join(", ")
}

/// Writes rows with one statement per chunk and returns the number of changed rows.
pub(crate) async fn write<T: Table>(
    connection: &mut Connection<'_>,
    verb: &str,
    otherwise: &str,
    rows: &[&T],
) -> Result<u64, Error> {
    let width = T::COLUMNS.len() + usize::from(T::SEALED);
    let mut changed = 0;
    for chunk in rows.chunks(ROWS_PER_STATEMENT) {
        let Some(last) = chunk.last() else {
            continue;
        };
        let count = chunk.len().next_power_of_two();
        let mut arguments = SqliteArguments::default();
        arguments.reserve(count * width, 0);
        let filling = std::iter::repeat_n(last, count - chunk.len());
        for row in chunk.iter().chain(filling) {
            bind(*row, width, &mut arguments).map_err(|e| connection.failed("bind rows", e))?;
        }
        let sql = format!(
            "{verb} {} ({}) VALUES {} {otherwise}",
            T::NAME,
            columns::<T>(),
            places(count, width),
        );
        // The text consists of names and question marks only.
        let query = sqlx::query_with(AssertSqlSafe(sql), arguments);
        changed += connection.insert(T::NAME, query).await?.rows_affected();
    }
    Ok(changed)
}

/// Binds the first `count` values of a row, of which the last is the seal if the table has seals.
fn bind<T: Table>(row: &T, count: usize, arguments: &mut SqliteArguments) -> Result<(), SqlxError> {
    let mut left = count;
    let mut result = Ok(());
    row.each(|value| {
        if left == 0 || result.is_err() {
            return;
        }
        left -= 1;
        result = add(value, arguments);
    });
    if left > 0 && result.is_ok() {
        result = add(Value::Bits(row.seal().cast_unsigned()), arguments);
    }
    result
}

fn add(value: Value<'_>, arguments: &mut SqliteArguments) -> Result<(), SqlxError> {
    match value {
        Value::Null => arguments.add(None::<i64>),
        Value::Count(value) | Value::Bits(value) => arguments.add(value.cast_signed()),
        Value::Stream(stream) => arguments.add(stream.key().cast_signed()),
        Value::Number(value) => arguments.add(value),
        Value::Text(value) => arguments.add(value),
        Value::Numbers(values) => {
            let bytes = values.iter().flat_map(|value| value.to_le_bytes());
            arguments.add(bytes.collect::<Vec<u8>>())
        }
    }
    .map_err(SqlxError::Encode)
}

/// Placeholders such as `(?,?),(?,?)`, for `rows` rows of `columns` columns.
fn places(rows: usize, columns: usize) -> String {
    let row = format!("({})", vec!["?"; columns].join(","));
    vec![row.as_str(); rows].join(",")
}
