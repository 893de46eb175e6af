//! Errors of the crates as one exception of Python.

use pyo3::create_exception;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

create_exception!(
    pitchline,
    PitchlineError,
    PyValueError,
    "What was wrong, where, and what would be right: the sentence that the programs print."
);

/// The Python exception of an error, with its causes.
pub(crate) fn raised(error: impl Into<anyhow::Error>) -> PyErr {
    PitchlineError::new_err(format!("{:#}", error.into()))
}
