//! Designs of experiments.

use ::doe::{Design, Method, Options};
use numpy::{IntoPyArray as _, PyArray2, PyArrayMethods as _};
use pyo3::prelude::*;

use crate::arrays::{Matrix, rows, shape};
use crate::error::raised;
use crate::interrupt::interruptible;

fn method(name: &str) -> PyResult<Method> {
    serde_json::from_value(name.into()).map_err(raised)
}

fn points(py: Python<'_>, design: Design) -> PyResult<Bound<'_, PyArray2<f64>>> {
    let shape = [design.n, design.d];
    design.points.into_pyarray(py).reshape(shape)
}

fn given(x: &Matrix<'_>) -> Design {
    let [n, d] = shape(x);
    Design {
        n,
        d,
        points: rows(x).into_owned(),
    }
}

/// `n` points in the open unit box of `d` variables, shape (n, d).
#[pyfunction]
pub(crate) fn design<'py>(
    py: Python<'py>,
    kind: &str,
    n: usize,
    d: usize,
    seed: u64,
    effort: f64,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let method = method(kind)?;
    let options = Options { seed, effort };
    let found = interruptible(py, move |_| method.design(n, d, &options))?;
    points(py, found.map_err(raised)?)
}

/// A design of `n` points that begins with those of `existing`.
#[pyfunction]
pub(crate) fn enlarge<'py>(
    py: Python<'py>,
    kind: &str,
    existing: Matrix<'py>,
    n: usize,
    seed: u64,
    effort: f64,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let method = method(kind)?;
    let existing = given(&existing);
    let options = Options { seed, effort };
    let found = interruptible(py, move |_| method.enlarge(&existing, n, &options))?;
    points(py, found.map_err(raised)?)
}

/// The smallest Euclidean distance between two points.
#[pyfunction]
pub(crate) fn distance(x: Matrix<'_>) -> f64 {
    given(&x).min_distance()
}

/// The centred L2 discrepancy.
#[pyfunction]
pub(crate) fn discrepancy(x: Matrix<'_>) -> f64 {
    given(&x).centred_discrepancy()
}
