//! The outcome of a committed batch.

/// The outcome of a committed batch. Times are not counted: they are measured and never compared.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Receipt {
    /// Rows that were not stored before.
    pub new_rows: u64,
    /// Rows that were stored before with the same value.
    pub duplicate_rows: u64,
    /// Whether nothing was stored because the batch is out of date.
    pub is_stale: bool,
}

impl Receipt {
    /// The receipt of new rows.
    pub(crate) fn new(rows: u64) -> Self {
        Self {
            new_rows: rows,
            ..Self::default()
        }
    }

    /// Counts a row.
    pub(crate) fn count(&mut self, is_new: bool) {
        if is_new {
            self.new_rows += 1;
        } else {
            self.duplicate_rows += 1;
        }
    }
}
