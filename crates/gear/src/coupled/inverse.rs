//! The inverse of a small symmetric matrix.

/// Replaces a symmetric positive definite n×n matrix, row by row in `matrix`, by its inverse; returns
/// false if it is not positive definite. Only the lower triangle is read.
///
/// Gauss–Jordan elimination without a search for pivots, which a positive definite matrix does not
/// need. Every step is a multiple of one row added to another, so that it uses the vector units and
/// gives the same bits on each of them. `column` is working memory.
#[inline(always)]
pub(super) fn invert(matrix: &mut [f64], n: usize, column: &mut Vec<f64>) -> bool {
    for k in 0..n {
        let pivot = matrix[k * n + k];
        // The comparison also catches a pivot that is not a number.
        let is_positive = pivot > 0.0;
        if !is_positive {
            return false;
        }
        column.clear();
        column.extend_from_slice(&matrix[k * n..k * n + k]);
        column.extend((k..n).map(|i| matrix[i * n + k]));
        for (i, c) in column.iter().enumerate() {
            let factor = -c / pivot;
            let row = &mut matrix[i * n..i * n + i + 1];
            for (value, c) in row.iter_mut().zip(&*column) {
                *value += factor * c;
            }
        }
        for (i, c) in column.iter().enumerate() {
            let at = if i < k { k * n + i } else { i * n + k };
            matrix[at] = c / pivot;
        }
        matrix[k * n + k] = -1.0 / pivot;
    }
    for i in 0..n {
        for j in 0..=i {
            let value = -matrix[i * n + j];
            matrix[i * n + j] = value;
            matrix[j * n + i] = value;
        }
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Hilbert's matrix has an inverse of whole numbers.
    #[test]
    fn hilberts_matrix_is_inverted() {
        let n = 5;
        let mut matrix: Vec<f64> = (0..n * n)
            .map(|at| 1.0 / (at / n + at % n + 1) as f64)
            .collect();
        assert!(invert(&mut matrix, n, &mut Vec::new()));
        for (at, expected) in [
            (0, 25.0),
            (1, -300.0),
            (6, 4800.0),
            (24, 44_100.0),
            (23, -88_200.0),
        ] {
            assert!(
                (matrix[at] / expected - 1.0).abs() < 1e-9,
                "{at}: {}",
                matrix[at]
            );
        }
    }

    #[test]
    fn an_indefinite_matrix_is_refused() {
        for matrix in [[1.0, 2.0, 2.0, 1.0], [f64::NAN; 4], [0.0; 4]] {
            assert!(!invert(&mut matrix.to_vec(), 2, &mut Vec::new()));
        }
    }
}
