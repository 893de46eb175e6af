//! The digest that rows carry in their column `seal`.
//!
//! It is written with the row and compared at every read, so that a value that was changed on the
//! disk or by another program is refused with the name of its table and row before it is used.

use std::fmt::Debug;
use std::path::Path;

use ledger::StreamId;
use sha2::{Digest as _, Sha256};

use crate::Error;
use crate::values::number;

/// A row with a digest.
pub(crate) trait Row {
    const TABLE: &'static str;

    /// The row's key for messages, such as "design 17".
    fn key(&self) -> String;

    /// Adds the values of all columns to a digest.
    fn add_to(&self, columns: &mut Columns);
}

/// The digest of a row, and its first value that SQLite would not return unchanged.
pub(crate) struct Columns {
    hash: Sha256,
    refusal: Option<Refusal>,
}

enum Refusal {
    NotFinite(&'static str, f64),
    TooLarge(&'static str, u64),
}

impl Columns {
    fn of(row: &impl Row) -> Self {
        let mut columns = Self::named(row);
        row.add_to(&mut columns);
        columns
    }

    fn named<R: Row>(_: &R) -> Self {
        Self {
            hash: Sha256::new_with_prefix(R::TABLE),
            refusal: None,
        }
    }

    /// The first 64 bits of the SHA-256 of the table's name and of all columns.
    ///
    /// A checksum against accidents: anybody who edits a row on purpose can adapt it.
    fn seal(self) -> i64 {
        let hash = self.hash.finalize();
        let first = hash.first_chunk().copied().unwrap_or_default();
        i64::from_le_bytes(first)
    }

    fn add(&mut self, kind: u8, bytes: &[u8]) -> &mut Self {
        self.hash.update([kind]);
        self.hash.update(bytes);
        self
    }

    fn refuse(&mut self, refusal: Refusal) {
        self.refusal.get_or_insert(refusal);
    }

    /// Adds an index or a count.
    pub(crate) fn count(&mut self, column: &'static str, value: u64) -> &mut Self {
        if i64::try_from(value).is_err() {
            self.refuse(Refusal::TooLarge(column, value));
        }
        self.bits(value)
    }

    /// Adds 64 bits, which are stored as a two's complement integer.
    pub(crate) fn bits(&mut self, value: u64) -> &mut Self {
        self.add(1, &value.to_le_bytes())
    }

    pub(crate) fn stream(&mut self, stream: StreamId) -> &mut Self {
        self.bits(stream.key())
    }

    pub(crate) fn number(&mut self, column: &'static str, value: f64) -> &mut Self {
        if !value.is_finite() {
            self.refuse(Refusal::NotFinite(column, value));
        }
        self.outcome(column, value)
    }

    /// Adds a number that is infinite if a sample failed, or too many of them. SQLite returns it unchanged, but not
    /// NaN.
    pub(crate) fn outcome(&mut self, column: &'static str, value: f64) -> &mut Self {
        if value.is_nan() {
            self.refuse(Refusal::NotFinite(column, value));
        }
        self.add(2, &number(value).to_bits().to_le_bytes())
    }

    pub(crate) fn text(&mut self, value: &str) -> &mut Self {
        self.add(3, &(value.len() as u64).to_le_bytes());
        self.hash.update(value);
        self
    }

    pub(crate) fn numbers(&mut self, column: &'static str, values: &[f64]) -> &mut Self {
        if let Some(value) = values.iter().find(|value| !value.is_finite()) {
            self.refuse(Refusal::NotFinite(column, *value));
        }
        self.outcomes(column, values)
    }

    /// Adds numbers that may be infinite.
    pub(crate) fn outcomes(&mut self, column: &'static str, values: &[f64]) -> &mut Self {
        if let Some(value) = values.iter().find(|value| value.is_nan()) {
            self.refuse(Refusal::NotFinite(column, *value));
        }
        self.add(4, &(values.len() as u64).to_le_bytes());
        for value in values {
            self.hash.update(value.to_bits().to_le_bytes());
        }
        self
    }

    /// Adds a value that may be missing.
    pub(crate) fn option<T>(
        &mut self,
        value: Option<T>,
        add: impl FnOnce(&mut Self, T) -> &mut Self,
    ) -> &mut Self {
        match value {
            None => self.add(0, &[]),
            Some(value) => add(self, value),
        }
    }
}

/// The digest to store with a row. Refuses values that SQLite would not return unchanged.
pub(crate) fn seal<R: Row>(row: &R) -> Result<i64, Error> {
    let columns = Columns::of(row);
    let named = |column| format!("{}.{column}", R::TABLE);
    match columns.refusal {
        None => Ok(columns.seal()),
        Some(Refusal::NotFinite(column, value)) => Err(Error::NotFinite {
            column: named(column),
            key: row.key(),
            value,
        }),
        Some(Refusal::TooLarge(column, value)) => Err(Error::TooLarge {
            column: named(column),
            value,
        }),
    }
}

/// Returns the row if it has the digest that it was stored with.
pub(crate) fn check<R: Row>(row: R, seal: i64, path: &Path) -> Result<R, Error> {
    if Columns::of(&row).seal() == seal {
        return Ok(row);
    }
    let detail = "its values do not match the digest that it was stored with: something other than this program has \
                  changed it";
    Err(Error::damaged_rows(path, R::TABLE, row.key(), detail))
}

/// Refuses a row that differs from the stored one.
pub(crate) fn agree<R: Row + Debug + PartialEq>(
    stored: Option<&R>,
    offered: &R,
) -> Result<(), Error> {
    match stored {
        Some(stored) if stored != offered => {
            Err(Error::conflict(R::TABLE, offered.key(), [stored, offered]))
        }
        _ => Ok(()),
    }
}
