//! The mapping of values to SQLite's columns.

use ledger::StreamId;
use sqlx::error::BoxDynError;
use sqlx::sqlite::{SqliteTypeInfo, SqliteValueRef};
use sqlx::{Decode, Sqlite, Type};

/// A list of numbers: a column of little-endian bytes.
#[derive(Debug)]
pub(crate) struct Numbers(pub(crate) Vec<f64>);

impl Type<Sqlite> for Numbers {
    fn type_info() -> SqliteTypeInfo {
        <Vec<u8> as Type<Sqlite>>::type_info()
    }
}

impl<'r> Decode<'r, Sqlite> for Numbers {
    fn decode(value: SqliteValueRef<'r>) -> Result<Self, BoxDynError> {
        let bytes = <&[u8] as Decode<Sqlite>>::decode(value)?;
        let (numbers, rest) = bytes.as_chunks();
        let numbers = numbers.iter().copied().map(f64::from_le_bytes);
        // Bytes that end within a number get a NaN, so that the row's digest differs: NaN is never stored.
        let rest = (!rest.is_empty()).then_some(f64::NAN);
        Ok(Self(numbers.chain(rest).collect()))
    }
}

/// The bytes of a list of numbers.
pub(crate) fn bytes(numbers: &[f64]) -> Vec<u8> {
    numbers.iter().flat_map(|n| n.to_le_bytes()).collect()
}

/// A stream, stored as its key.
#[derive(Debug)]
pub(crate) struct StreamKey(pub(crate) StreamId);

impl Type<Sqlite> for StreamKey {
    fn type_info() -> SqliteTypeInfo {
        <i64 as Type<Sqlite>>::type_info()
    }
}

impl<'r> Decode<'r, Sqlite> for StreamKey {
    fn decode(value: SqliteValueRef<'r>) -> Result<Self, BoxDynError> {
        let key = <i64 as Decode<Sqlite>>::decode(value)?;
        let stream = StreamId::from_key(key.cast_unsigned());
        let stream = stream.ok_or_else(|| format!("no stream has the key {key}"))?;
        Ok(Self(stream))
    }
}

/// The stream's key as SQLite's signed integer.
pub(crate) fn key(stream: StreamId) -> i64 {
    stream.key().cast_signed()
}

/// Integers for `IN (SELECT value FROM json_each(?))`: one statement for many rows.
pub(crate) fn list(numbers: impl IntoIterator<Item = i64>) -> String {
    let numbers: Vec<String> = numbers.into_iter().map(|n| n.to_string()).collect();
    format!("[{}]", numbers.join(","))
}

/// The value as SQLite returns it: -0.0 becomes 0.0.
pub(crate) fn number(value: f64) -> f64 {
    value + 0.0
}
