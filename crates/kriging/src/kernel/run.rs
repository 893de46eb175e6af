//! Correlations and their derivatives between a point and a run of points.

use pulp::{Arch, Simd, WithSimd};

use super::{ByGroups, Kernel, LANES, add_dots, for_each_kernel};
use crate::exponential::multiply_by_exp_of_minus;

impl Kernel {
    /// Writes to `out` the correlations between a point and a run of points.
    ///
    /// `column(j)` gives the coordinate j of the run, of the length of `out`; `at` the point. The
    /// correlation with a NaN is NaN.
    #[inline]
    pub(crate) fn correlations<'a>(
        self,
        at: &[f64],
        column: impl Fn(usize) -> &'a [f64],
        out: &mut [f64],
    ) {
        Arch::new().dispatch(Correlations {
            kernel: self,
            at,
            column,
            out,
        });
    }

    /// Gives `add` for each coordinate j its number and Σᵢ `weights`ᵢ ∂ ln(correlationᵢ)/∂ ln θⱼ;
    /// arguments as in [`Kernel::correlations`].
    pub(crate) fn log_derivative_dots<'a>(
        self,
        at: &[f64],
        column: impl Fn(usize) -> &'a [f64],
        weights: &[f64],
        add: impl FnMut(usize, f64),
    ) {
        Arch::new().dispatch(DerivativeDots {
            kernel: self,
            at,
            column,
            weights,
            add,
        });
    }
}

/// [`Kernel::correlations`] for one instruction set.
struct Correlations<'s, F> {
    kernel: Kernel,
    at: &'s [f64],
    column: F,
    out: &'s mut [f64],
}

impl<'a, F: Fn(usize) -> &'a [f64]> WithSimd for Correlations<'_, F> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        for_each_kernel!(self.run(simd))
    }
}

impl<'a, F: Fn(usize) -> &'a [f64]> Correlations<'_, F> {
    #[inline(always)]
    fn run<S: Simd>(self, kernel: Kernel, simd: S) {
        // Four vectors of points side by side, all of it in registers.
        match S::F64_LANES {
            8 => self.by_runs::<S, 32>(kernel, simd),
            4 => self.by_runs::<S, 16>(kernel, simd),
            _ => self.by_runs::<S, 8>(kernel, simd),
        }
    }

    #[inline(always)]
    fn by_runs<S: Simd, const WIDE: usize>(self, kernel: Kernel, simd: S) {
        let Self {
            at, column, out, ..
        } = self;
        let n = out.len();
        if n < WIDE {
            // Filled up with the point itself.
            let few = side_by_side(kernel, simd, at, |j| {
                let mut points = [at[j]; WIDE];
                points[..n].copy_from_slice(&column(j)[..n]);
                points
            });
            out.copy_from_slice(&few[..n]);
            return;
        }
        let mut start = 0;
        loop {
            let end = start + WIDE;
            let values = side_by_side::<S, WIDE>(kernel, simd, at, |j| {
                let mut points = [0.0; WIDE];
                points.copy_from_slice(&column(j)[start..end]);
                points
            });
            out[start..end].copy_from_slice(&values);
            if end == n {
                return;
            }
            // The last ones overlap with those before.
            start = end.min(n - WIDE);
        }
    }
}

/// The correlations of the points whose coordinates j are `column(j)`.
#[inline(always)]
fn side_by_side<S: Simd, const WIDE: usize>(
    kernel: Kernel,
    simd: S,
    at: &[f64],
    column: impl Fn(usize) -> [f64; WIDE],
) -> [f64; WIDE] {
    let (mut out, mut exponent) = ([1.0; WIDE], [0.0; WIDE]);
    for (j, at) in at.iter().enumerate() {
        let column = column(j);
        let at = simd.splat_f64s(*at);
        let products = S::as_mut_simd_f64s(&mut out).0.iter_mut();
        let exponents = S::as_mut_simd_f64s(&mut exponent).0;
        for ((p, e), c) in products.zip(exponents).zip(S::as_simd_f64s(&column).0) {
            (*p, *e) = kernel.include(simd, simd.sub_f64s(*c, at), (*p, *e));
        }
    }
    kernel.finish_radial(&mut out, &mut exponent);
    multiply_by_exp_of_minus(&exponent, &mut out);
    out
}

/// [`Kernel::log_derivative_dots`] for one instruction set.
struct DerivativeDots<'s, F, G> {
    kernel: Kernel,
    at: &'s [f64],
    column: F,
    weights: &'s [f64],
    add: G,
}

impl<'a, F: Fn(usize) -> &'a [f64], G: FnMut(usize, f64)> WithSimd for DerivativeDots<'_, F, G> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        for_each_kernel!(self.run(simd))
    }
}

impl<'a, F: Fn(usize) -> &'a [f64], G: FnMut(usize, f64)> ByGroups for DerivativeDots<'_, F, G> {
    fn coordinates(&self) -> usize {
        self.at.len()
    }

    #[inline(always)]
    fn group<S: Simd, const N: usize>(&mut self, kernel: Kernel, simd: S, first: usize) {
        let at: [f64; N] = std::array::from_fn(|g| self.at[first + g]);
        let columns: [_; N] =
            std::array::from_fn(|g| (self.column)(first + g).as_chunks::<LANES>());
        let (whole, rest) = self.weights.as_chunks::<LANES>();
        let mut sums = [[0.0; LANES]; N];
        for (i, weights) in whole.iter().enumerate() {
            let columns = columns.map(|(whole, _)| &whole[i]);
            add_dots(kernel, simd, at, columns, weights, &mut sums);
        }
        if !rest.is_empty() {
            // Filled up with points of no weight.
            let fill = |values: &[f64]| {
                let mut filled = [0.0; LANES];
                filled[..rest.len()].copy_from_slice(&values[..rest.len()]);
                filled
            };
            let last = columns.map(|(_, rest)| fill(rest));
            add_dots(kernel, simd, at, last.each_ref(), &fill(rest), &mut sums);
        }
        for (g, sums) in sums.iter().enumerate() {
            (self.add)(first + g, sums.iter().sum());
        }
    }
}

#[cfg(test)]
mod tests {
    use pulp::Scalar;
    use rand::RngExt as _;
    use stats::streams::{Purpose, stream};

    use super::*;

    /// A model gives the same mean on every machine.
    #[test]
    fn vectors_of_the_processor_change_no_bit() {
        let mut rng = stream(14, Purpose::Test, 0, 0);
        for kernel in Kernel::ALL {
            for count in [1, 8, 31, 100] {
                let mut numbers =
                    |n: usize| -> Vec<f64> { (0..n).map(|_| 3.0 * rng.random::<f64>()).collect() };
                let columns: Vec<Vec<f64>> = (0..5).map(|_| numbers(count)).collect();
                let (at, weights) = (numbers(5), numbers(count));
                let with = |dispatch: &dyn Fn(Both<'_>)| {
                    let (mut out, mut sums) = (vec![0.0; count], vec![0.0; 5]);
                    dispatch(Both {
                        kernel,
                        at: &at,
                        columns: &columns,
                        weights: &weights,
                        out: &mut out,
                        sums: &mut sums,
                    });
                    (out, sums)
                };
                let without = with(&|both| both.with_simd(Scalar::new()));
                assert_eq!(with(&|both| Arch::new().dispatch(both)), without);
                // What a processor with wider vectors does not use.
                #[cfg(target_arch = "x86_64")]
                if let Some(simd) = pulp::x86::V3::try_new() {
                    assert_eq!(with(&|both| Simd::vectorize(simd, both)), without);
                }
            }
        }
    }

    struct Both<'s> {
        kernel: Kernel,
        at: &'s [f64],
        columns: &'s [Vec<f64>],
        weights: &'s [f64],
        out: &'s mut [f64],
        sums: &'s mut [f64],
    }

    impl WithSimd for Both<'_> {
        type Output = ();

        #[inline(always)]
        fn with_simd<S: Simd>(self, simd: S) {
            let (kernel, at) = (self.kernel, self.at);
            let correlations = Correlations {
                kernel,
                at,
                column: |j: usize| &*self.columns[j],
                out: self.out,
            };
            correlations.with_simd(simd);
            let dots = DerivativeDots {
                kernel,
                at,
                column: |j: usize| &*self.columns[j],
                weights: self.weights,
                add: |j: usize, dot| self.sums[j] = dot,
            };
            dots.with_simd(simd);
        }
    }
}
