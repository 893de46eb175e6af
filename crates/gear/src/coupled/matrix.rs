//! Small symmetric matrices and vectors, padded so that loops over them use the vector units.

use crate::vectors::with_vectors;

/// A block of numbers that fills one or two vector registers.
pub(super) type Lanes = [f64; 8];

/// The number of [`Lanes`] that hold `n` numbers.
pub(super) const fn lanes(n: usize) -> usize {
    n.div_ceil(8)
}

/// Adds `factor` times `row`.
#[inline(always)]
pub(super) fn add_multiple(to: &mut [Lanes], factor: f64, row: &[Lanes]) {
    // Not lane by lane: that becomes a loop that gathers whole rows, ten times slower from eight lanes on.
    for (to, value) in to.as_flattened_mut().iter_mut().zip(row.as_flattened()) {
        *to += factor * value;
    }
}

/// The sum of all numbers, lane by lane.
#[inline(always)]
pub(super) fn sum(values: &[Lanes]) -> f64 {
    let mut sums = [0.0; 8];
    for values in values {
        for (sum, value) in sums.iter_mut().zip(values) {
            *sum += value;
        }
    }
    sums.iter().sum()
}

/// The greatest magnitude.
#[inline(always)]
pub(super) fn greatest(values: &[f64]) -> f64 {
    let (whole, rest) = values.as_chunks::<8>();
    let mut most = [0.0_f64; 8];
    for values in whole {
        for (most, value) in most.iter_mut().zip(values) {
            *most = most.max(value.abs());
        }
    }
    let all = most.iter().chain(rest);
    all.fold(0.0, |most, value| most.max(value.abs()))
}

/// A symmetric n×n matrix, row by row; rows are padded with zeros.
#[derive(Debug, Clone, Default)]
pub(super) struct Matrix {
    pub(super) n: usize,
    values: Vec<Lanes>,
}

impl Matrix {
    pub(super) fn zero(n: usize) -> Self {
        let values = vec![[0.0; 8]; n * lanes(n)];
        Self { n, values }
    }

    #[inline(always)]
    pub(super) fn lanes_of(&self, i: usize) -> &[Lanes] {
        let width = lanes(self.n);
        &self.values[i * width..(i + 1) * width]
    }

    #[inline(always)]
    pub(super) fn row(&self, i: usize) -> &[f64] {
        &self.lanes_of(i).as_flattened()[..self.n]
    }

    #[inline(always)]
    pub(super) fn row_mut(&mut self, i: usize) -> &mut [f64] {
        let width = lanes(self.n);
        &mut self.values[i * width..(i + 1) * width].as_flattened_mut()[..self.n]
    }

    /// The product with a vector, padded with zeros.
    #[inline(always)]
    pub(super) fn multiply(&self, by: &[f64], product: &mut Vec<Lanes>) {
        product.clear();
        product.resize(lanes(self.n), [0.0; 8]);
        for (k, part) in product.chunks_mut(4).enumerate() {
            match part.len() {
                4 => self.multiply_lanes::<4>(by, 4 * k, part),
                3 => self.multiply_lanes::<3>(by, 4 * k, part),
                2 => self.multiply_lanes::<2>(by, 4 * k, part),
                _ => self.multiply_lanes::<1>(by, 4 * k, part),
            }
        }
    }

    /// The `N` lanes of the product from `first` on. Their number is fixed, so that the sums stay in registers.
    #[inline(always)]
    fn multiply_lanes<const N: usize>(&self, by: &[f64], first: usize, product: &mut [Lanes]) {
        let mut sums = [[0.0; 8]; N];
        for (&factor, row) in by.iter().zip(self.values.chunks_exact(lanes(self.n))) {
            for (sum, values) in sums.iter_mut().zip(&row[first..first + N]) {
                for (sum, value) in sum.iter_mut().zip(values) {
                    *sum += factor * value;
                }
            }
        }
        product.copy_from_slice(&sums);
    }

    /// Copies the lower triangle to the upper one.
    pub(super) fn mirror(&mut self) {
        for i in 0..self.n {
            for j in 0..i {
                let value = self.row(i)[j];
                self.row_mut(j)[i] = value;
            }
        }
    }

    /// Replaces a positive definite matrix by its inverse; returns false if it is not positive definite.
    ///
    /// Gauss–Jordan elimination without a search for pivots, which a positive definite matrix does not
    /// need. Every step is a multiple of one row added to another, so that it gives the same bits on any
    /// vector unit.
    pub(super) fn invert(&mut self) -> bool {
        with_vectors(
            #[inline(always)]
            || self.invert_here(),
        )
    }

    #[inline(always)]
    fn invert_here(&mut self) -> bool {
        let (n, width) = (self.n, lanes(self.n));
        let mut pivots = vec![[0.0; 8]; width];
        for k in 0..n {
            pivots.copy_from_slice(self.lanes_of(k));
            let pivot = pivots.as_flattened()[k];
            // The comparison also catches a pivot that is not a number.
            let is_positive = pivot > 0.0;
            if !is_positive {
                return false;
            }
            for (i, row) in self.values.chunks_exact_mut(width).enumerate() {
                // The matrix stays symmetric: its row is its column, too.
                let factor = pivots.as_flattened()[i] / pivot;
                if i != k {
                    add_multiple(row, -factor, &pivots);
                    row.as_flattened_mut()[k] = factor;
                }
            }
            for value in self.row_mut(k) {
                *value /= pivot;
            }
            self.row_mut(k)[k] = -1.0 / pivot;
        }
        for value in self.values.as_flattened_mut() {
            *value = -*value;
        }
        true
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// The matrix with these rows.
    pub(in super::super) fn matrix(n: usize, value: impl Fn(usize, usize) -> f64) -> Matrix {
        let mut matrix = Matrix::zero(n);
        for i in 0..n {
            for (j, to) in matrix.row_mut(i).iter_mut().enumerate() {
                *to = value(i, j);
            }
        }
        matrix
    }

    /// Hilbert's matrix has an inverse of whole numbers.
    #[test]
    fn hilberts_matrix_is_inverted() {
        let mut hilbert = matrix(5, |i, j| 1.0 / (i + j + 1) as f64);
        assert!(hilbert.invert());
        for (i, j, expected) in [
            (0, 0, 25.0),
            (0, 1, -300.0),
            (1, 1, 4800.0),
            (4, 4, 44_100.0),
            (4, 3, -88_200.0),
        ] {
            let found = hilbert.row(i)[j];
            assert!((found / expected - 1.0).abs() < 1e-9, "{i}, {j}: {found}");
        }
    }

    #[test]
    fn an_indefinite_matrix_is_refused() {
        for values in [[1.0, 2.0, 2.0, 1.0], [f64::NAN; 4], [0.0; 4]] {
            assert!(!matrix(2, |i, j| values[2 * i + j]).invert());
        }
    }
}
