//! Arrays of numpy as slices, and back.

use std::borrow::Cow;

use numpy::{AllowTypeChange, PyArrayLike1, PyArrayLike2, PyUntypedArrayMethods as _};

/// A vector with one number per observation, from anything that numpy converts to an array.
pub(crate) type Vector<'py> = PyArrayLike1<'py, f64, AllowTypeChange>;
/// A matrix with one row per point.
pub(crate) type Matrix<'py> = PyArrayLike2<'py, f64, AllowTypeChange>;

/// The numbers of a vector, copied only if they do not lie one after another.
pub(crate) fn numbers<'a>(vector: &'a Vector<'_>) -> Cow<'a, [f64]> {
    match vector.as_slice() {
        Ok(slice) => Cow::Borrowed(slice),
        Err(_) => Cow::Owned(vector.as_array().iter().copied().collect()),
    }
}

/// The numbers of a matrix row by row, copied only if they are not stored in this order.
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
