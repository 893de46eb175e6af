//! Arrays of numpy as slices, and back.

use std::borrow::Cow;

use numpy::{AllowTypeChange, PyArrayLike1, PyArrayLike2, PyUntypedArrayMethods as _};

/// One number an observation; anything that numpy makes an array of.
pub(crate) type Vector<'py> = PyArrayLike1<'py, f64, AllowTypeChange>;
/// One row a point.
pub(crate) type Matrix<'py> = PyArrayLike2<'py, f64, AllowTypeChange>;

/// The numbers of a vector, copied only if they do not lie one after another.
pub(crate) fn numbers<'a>(vector: &'a Vector<'_>) -> Cow<'a, [f64]> {
    match vector.as_slice() {
        Ok(slice) => Cow::Borrowed(slice),
        Err(_) => Cow::Owned(vector.as_array().iter().copied().collect()),
    }
}

/// The numbers of a matrix row by row, copied only if they do not lie so.
pub(crate) fn rows<'a>(matrix: &'a Matrix<'_>) -> Cow<'a, [f64]> {
    match matrix.as_slice() {
        Ok(slice) if matrix.is_c_contiguous() => Cow::Borrowed(slice),
        _ => Cow::Owned(matrix.as_array().iter().copied().collect()),
    }
}

/// The number of rows and of columns.
pub(crate) fn shape(matrix: &Matrix<'_>) -> [usize; 2] {
    let shape = matrix.shape();
    [shape[0], shape[1]]
}
