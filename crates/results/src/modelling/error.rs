use std::fmt;

/// Why a table cannot be used, a model cannot be fitted, or a model file cannot be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// Something in a file is wrong.
    #[error(transparent)]
    Input(#[from] InputError),
    /// The settings contradict each other.
    #[error("{0}")]
    Settings(String),
    /// The model cannot be fitted to the table.
    #[error("no model can be fitted to {file}: {reason}")]
    Fit {
        /// The table's file, as the user named it.
        file: String,
        /// The error, and what would help.
        reason: String,
    },
    /// The model cannot be written or evaluated.
    #[error(transparent)]
    Kriging(#[from] kriging::Error),
}

/// An error in a file, and its place.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub struct InputError {
    /// The file, as the user named it.
    pub file: String,
    /// The line, from 1, if one is concerned.
    pub line: Option<u64>,
    /// The column's name, if one is concerned.
    pub column: Option<String>,
    /// The value found, and what would be right.
    pub message: String,
}

impl InputError {
    /// An error that concerns a whole file.
    #[must_use]
    pub fn in_file(file: &str, message: impl Into<String>) -> Self {
        Self {
            file: file.to_owned(),
            line: None,
            column: None,
            message: message.into(),
        }
    }

    /// The error with a line, from 1.
    #[must_use]
    pub fn at_line(self, line: u64) -> Self {
        Self {
            line: Some(line),
            ..self
        }
    }

    /// The error with a column.
    #[must_use]
    pub fn in_column(self, column: &str) -> Self {
        Self {
            column: Some(column.to_owned()),
            ..self
        }
    }
}

impl fmt::Display for InputError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.file)?;
        if let Some(line) = self.line {
            write!(f, ", line {line}")?;
        }
        if let Some(column) = &self.column {
            write!(f, ", column {column:?}")?;
        }
        write!(f, ": {}", self.message)
    }
}
