//! Correlations and their derivatives for a panel of a matrix: [`ROWS`] points by a run of points.

use pulp::{Arch, Simd, WithSimd};

use super::{ByGroups, Kernel, LANES, add_dots, for_each_kernel, weighted_derivatives};
use crate::exponential::multiply_by_exp_of_minus;
use crate::panels::{Column, ROWS, add_multiple, dot};

impl Kernel {
    /// Writes to `out` the correlations of the points whose coordinates j are `rows[j]` with those whose
    /// coordinates j are `columns[j]`, one of them a column: what [`Kernel::correlations`] gives.
    pub(crate) fn correlations_of_panel(
        self,
        rows: &[[f64; ROWS]],
        columns: &[&[f64]],
        out: &mut [Column],
    ) {
        Arch::new().dispatch(Correlations {
            kernel: self,
            rows,
            columns,
            out,
        });
    }

    /// Adds to `sums[j]`, in parts, Σ `weights`ᵢₖ ∂ ln(correlationᵢₖ)/∂ ln θⱼ; points as above.
    pub(crate) fn log_derivative_dots_of_panel(
        self,
        rows: &[[f64; ROWS]],
        columns: &[&[f64]],
        weights: &[Column],
        sums: &mut [[f64; LANES]],
    ) {
        Arch::new().dispatch(DerivativeDots {
            kernel: self,
            rows,
            columns,
            weights,
            sums,
        });
    }

    /// With D the `correlations`ᵢₖ times ∂ ln(correlationᵢₖ)/∂ ln θⱼ, both as above: adds D `across` to
    /// `down[j]` and gives `add` j, k and element k of Dᵀ `along`.
    pub(crate) fn derivatives_of_panel_times(
        self,
        rows: &[[f64; ROWS]],
        columns: &[&[f64]],
        correlations: &[Column],
        (along, across): (&Column, &[f64]),
        down: &mut [Column],
        add: impl FnMut(usize, usize, f64),
    ) {
        Arch::new().dispatch(DerivativesTimes {
            kernel: self,
            rows,
            columns,
            correlations,
            along,
            across,
            down,
            add,
        });
    }
}

/// [`Kernel::correlations_of_panel`] for one instruction set.
struct Correlations<'s> {
    kernel: Kernel,
    rows: &'s [[f64; ROWS]],
    columns: &'s [&'s [f64]],
    out: &'s mut [Column],
}

impl WithSimd for Correlations<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        for_each_kernel!(self.run(simd))
    }
}

/// Vectors whose factors are computed side by side: a multiplication's result takes some cycles.
const VECTORS: usize = 6;
/// Columns whose exponentials are computed side by side.
const PAIR: usize = 2;

impl Correlations<'_> {
    #[inline(always)]
    fn run<S: Simd>(self, kernel: Kernel, simd: S) {
        let (pairs, last) = self.out.as_chunks_mut::<PAIR>();
        for (k, out) in pairs.iter_mut().enumerate() {
            let at = |j: usize, h: usize| self.columns[j][PAIR * k + h];
            *out = side_by_side(kernel, simd, self.rows, at);
        }
        if let [out] = last {
            let at = |j: usize, _| self.columns[j][PAIR * pairs.len()];
            [*out, _] = side_by_side(kernel, simd, self.rows, at);
        }
    }
}

/// The correlations with the points whose coordinates j are `at(j, 0)` and `at(j, 1)`.
#[inline(always)]
fn side_by_side<S: Simd>(
    kernel: Kernel,
    simd: S,
    rows: &[[f64; ROWS]],
    at: impl Fn(usize, usize) -> f64,
) -> [Column; PAIR] {
    let (mut out, mut exponent) = ([[1.0; ROWS]; PAIR], [[0.0; ROWS]; PAIR]);
    {
        let (polynomials, exponents) = (
            S::as_mut_simd_f64s(out.as_flattened_mut()).0,
            S::as_mut_simd_f64s(exponent.as_flattened_mut()).0,
        );
        let of_column = ROWS / S::F64_LANES;
        for first in (0..PAIR * of_column).step_by(VECTORS) {
            let (mut polynomial, mut sum) = (
                [simd.splat_f64s(1.0); VECTORS],
                [simd.splat_f64s(0.0); VECTORS],
            );
            for (j, rows) in rows.iter().enumerate() {
                let rows = S::as_simd_f64s(rows).0;
                for i in 0..VECTORS {
                    let (h, v) = ((first + i) / of_column, (first + i) % of_column);
                    let difference = simd.sub_f64s(rows[v], simd.splat_f64s(at(j, h)));
                    (polynomial[i], sum[i]) =
                        kernel.include(simd, difference, (polynomial[i], sum[i]));
                }
            }
            polynomials[first..first + VECTORS].copy_from_slice(&polynomial);
            exponents[first..first + VECTORS].copy_from_slice(&sum);
        }
    }
    let (polynomials, exponents) = (out.as_flattened_mut(), exponent.as_flattened_mut());
    kernel.finish_radial(polynomials, exponents);
    multiply_by_exp_of_minus(exponents, polynomials);
    out.map(Column)
}

/// [`Kernel::log_derivative_dots_of_panel`] for one instruction set.
struct DerivativeDots<'s> {
    kernel: Kernel,
    rows: &'s [[f64; ROWS]],
    columns: &'s [&'s [f64]],
    weights: &'s [Column],
    sums: &'s mut [[f64; LANES]],
}

impl WithSimd for DerivativeDots<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        for_each_kernel!(self.run(simd))
    }
}

impl ByGroups for DerivativeDots<'_> {
    fn coordinates(&self) -> usize {
        self.rows.len()
    }

    #[inline(always)]
    fn group<S: Simd, const N: usize>(&mut self, kernel: Kernel, simd: S, first: usize) {
        let rows: [_; N] = std::array::from_fn(|g| self.rows[first + g].as_chunks::<LANES>().0);
        let columns: [_; N] =
            std::array::from_fn(|g| &self.columns[first + g][..self.weights.len()]);
        let mut sums = [[0.0; LANES]; N];
        for (k, weights) in self.weights.iter().enumerate() {
            let at = columns.map(|column| column[k]);
            for (i, weights) in weights.0.as_chunks::<LANES>().0.iter().enumerate() {
                add_dots(
                    kernel,
                    simd,
                    at,
                    rows.map(|rows| &rows[i]),
                    weights,
                    &mut sums,
                );
            }
        }
        for (total, sums) in self.sums[first..].iter_mut().zip(sums) {
            total
                .iter_mut()
                .zip(sums)
                .for_each(|(total, sum)| *total += sum);
        }
    }
}

/// [`Kernel::derivatives_of_panel_times`] for one instruction set.
struct DerivativesTimes<'s, F> {
    kernel: Kernel,
    rows: &'s [[f64; ROWS]],
    columns: &'s [&'s [f64]],
    correlations: &'s [Column],
    along: &'s Column,
    across: &'s [f64],
    down: &'s mut [Column],
    add: F,
}

impl<F: FnMut(usize, usize, f64)> WithSimd for DerivativesTimes<'_, F> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        for_each_kernel!(self.run(simd))
    }
}

impl<F: FnMut(usize, usize, f64)> ByGroups for DerivativesTimes<'_, F> {
    fn coordinates(&self) -> usize {
        self.rows.len()
    }

    #[inline(always)]
    fn group<S: Simd, const N: usize>(&mut self, kernel: Kernel, simd: S, first: usize) {
        let rows: [_; N] = std::array::from_fn(|g| S::as_simd_f64s(&self.rows[first + g]).0);
        let mut down = [Column([0.0; ROWS]); N];
        for (k, (correlations, across)) in self.correlations.iter().zip(self.across).enumerate() {
            let at: [f64; N] = std::array::from_fn(|g| self.columns[first + g][k]);
            let mut derivatives = [Column([0.0; ROWS]); N];
            for (v, weight) in S::as_simd_f64s(&correlations.0).0.iter().enumerate() {
                let rows = rows.map(|rows| rows[v]);
                let terms = weighted_derivatives(kernel, simd, at, rows, *weight);
                for (column, term) in derivatives.iter_mut().zip(terms) {
                    S::as_mut_simd_f64s(&mut column.0).0[v] = term;
                }
            }
            for (g, (column, down)) in derivatives.iter().zip(&mut down).enumerate() {
                add_multiple(simd, column, *across, down);
                (self.add)(first + g, k, dot(simd, column, self.along));
            }
        }
        for (total, down) in self.down[first..].iter_mut().zip(down) {
            total
                .0
                .iter_mut()
                .zip(down.0)
                .for_each(|(total, sum)| *total += sum);
        }
    }
}

#[cfg(test)]
mod tests {
    use rand::RngExt as _;
    use stats::streams::{Purpose, stream};

    use super::*;

    const D: usize = 4;

    /// Coordinates of a panel's points and of `count` others, one of which is one of the panel's.
    fn points(count: usize) -> (Vec<[f64; ROWS]>, Vec<Vec<f64>>) {
        let mut rng = stream(12, Purpose::Test, count as u64, 0);
        let rows: Vec<[f64; ROWS]> = (0..D)
            .map(|_| std::array::from_fn(|_| 3.0 * rng.random::<f64>()))
            .collect();
        let others = |rows: &[f64; ROWS]| {
            let mut column: Vec<f64> = (1..count).map(|_| 3.0 * rng.random::<f64>()).collect();
            column.push(rows[7]);
            column
        };
        let columns = rows.iter().map(others).collect();
        (rows, columns)
    }

    fn slices(columns: &[Vec<f64>]) -> Vec<&[f64]> {
        columns.iter().map(Vec::as_slice).collect()
    }

    /// A prediction at an observation must find the same correlations as the factor was made of.
    #[test]
    fn a_panel_has_the_bits_of_single_correlations() {
        for kernel in Kernel::ALL {
            for count in [1, 2, 9] {
                let (rows, columns) = points(count);
                let mut panel = vec![Column([f64::NAN; ROWS]); count];
                kernel.correlations_of_panel(&rows, &slices(&columns), &mut panel);
                for (k, column) in panel.iter().enumerate() {
                    let at: Vec<f64> = columns.iter().map(|c| c[k]).collect();
                    let mut single = [0.0; ROWS];
                    kernel.correlations(&at, |j| &rows[j], &mut single);
                    assert_eq!(column.0, single, "{kernel} {count} {k}");
                }
                assert_eq!(panel[count - 1].0[7], 1.0);
            }
        }
    }

    #[test]
    fn derivatives_are_those_of_single_columns() {
        for kernel in Kernel::ALL {
            let count = 9;
            let (rows, columns) = points(count);
            let mut rng = stream(13, Purpose::Test, 0, 0);
            let mut column = || Column(std::array::from_fn(|_| rng.random::<f64>() - 0.5));
            let weights: Vec<Column> = (0..count).map(|_| column()).collect();
            let along = column();
            let across = &column().0[..count];

            let mut sums = vec![[0.0; LANES]; D];
            kernel.log_derivative_dots_of_panel(&rows, &slices(&columns), &weights, &mut sums);
            let mut down = vec![Column([0.0; ROWS]); D];
            let mut right = vec![vec![0.0; count]; D];
            kernel.derivatives_of_panel_times(
                &rows,
                &slices(&columns),
                &weights,
                (&along, across),
                &mut down,
                |j, k, sum| right[j][k] += sum,
            );
            for j in 0..D {
                let derivative =
                    |r: usize, k: usize| kernel.log_derivative((rows[j][r] - columns[j][k]).abs());
                let of = |r: usize, k: usize| weights[k].0[r] * derivative(r, k);
                let all = (0..count).flat_map(|k| (0..ROWS).map(move |r| (r, k)));
                let total: f64 = all.map(|(r, k)| of(r, k)).sum();
                assert!(
                    (total - sums[j].iter().sum::<f64>()).abs() < 1e-12,
                    "{kernel} {j}"
                );
                for r in 0..ROWS {
                    let sum: f64 = (0..count).map(|k| of(r, k) * across[k]).sum();
                    assert!((sum - down[j].0[r]).abs() < 1e-13, "{kernel} {j} {r}");
                }
                for (k, right) in right[j].iter().enumerate() {
                    let sum: f64 = (0..ROWS).map(|r| of(r, k) * along.0[r]).sum();
                    assert!((sum - right).abs() < 1e-13, "{kernel} {j} {k}");
                }
            }
        }
    }
}
