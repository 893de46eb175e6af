//! Correlations of one point with a run of points, and their derivatives.
//!
//! `column(j)` gives coordinate j of the run's points, `at` the coordinates of the one point, both
//! in the units of [`Kernel::length_factor`].

use super::Kernel;
use super::exponential::multiply_by_exp_of_minus;
use crate::linalg::{sum_of, vectorised};

/// Number of points whose intermediate results stay in the processor's fastest memory.
const RUN: usize = 64;

impl Kernel {
    /// Writes the correlations to `out`; a NaN among the coordinates gives NaN.
    pub(crate) fn correlations<'a>(
        self,
        at: &[f64],
        column: impl Fn(usize) -> &'a [f64],
        out: &mut [f64],
    ) {
        vectorised(
            #[inline(always)]
            || {
                for (start, out) in (0..).step_by(RUN).zip(out.chunks_mut(RUN)) {
                    let end = start + out.len();
                    self.correlations_of_run(at, |j| &column(j)[start..end], out);
                }
            },
        );
    }

    #[inline(always)]
    fn correlations_of_run<'a>(
        self,
        at: &[f64],
        column: impl Fn(usize) -> &'a [f64],
        out: &mut [f64],
    ) {
        let mut exponents = [0.0; RUN];
        let exponents = &mut exponents[..out.len()];
        out.fill(1.0);
        let run = (at, column, &mut *out, &mut *exponents);
        match self {
            Self::Matern52 => accumulate(run, |a, p, e| {
                *p *= 1.0 + a * (1.0 + a * (1.0 / 3.0));
                *e += a;
            }),
            Self::Matern32 => accumulate(run, |a, p, e| {
                *p *= 1.0 + a;
                *e += a;
            }),
            Self::Exponential => accumulate(run, |a, _, e| *e += a),
            Self::SquaredExponential
            | Self::RadialMatern52
            | Self::RadialMatern32
            | Self::RadialExponential => accumulate(run, |a, _, e| *e += a * a),
        }
        let both = out.iter_mut().zip(&mut *exponents);
        match self {
            Self::RadialMatern52 => both.for_each(|(p, e)| {
                *e = e.sqrt();
                *p = 1.0 + *e * (1.0 + *e * (1.0 / 3.0));
            }),
            Self::RadialMatern32 => both.for_each(|(p, e)| {
                *e = e.sqrt();
                *p = 1.0 + *e;
            }),
            Self::RadialExponential => both.for_each(|(_, e)| *e = e.sqrt()),
            _ => {}
        }
        multiply_by_exp_of_minus(exponents, out);
    }

    /// Calls `add` for each coordinate j with j and Σᵢ `weights`ᵢ ∂ ln(correlationᵢ)/∂ ln θⱼ. For a
    /// radial kernel the weights must have gone through [`Kernel::multiply_by_radial_factors`].
    pub(crate) fn log_derivative_dots<'a>(
        self,
        at: &[f64],
        column: impl Fn(usize) -> &'a [f64],
        weights: &[f64],
        mut add: impl FnMut(usize, f64),
    ) {
        vectorised(
            #[inline(always)]
            || {
                for (j, at) in at.iter().enumerate() {
                    let run = (*at, column(j), weights);
                    let dot = match self {
                        Self::Matern52 => weigh(run, |a| a * a * (1.0 + a) / (3.0 + a * (3.0 + a))),
                        Self::Matern32 => weigh(run, |a| a * a / (1.0 + a)),
                        Self::SquaredExponential => weigh(run, |a| 2.0 * a * a),
                        Self::Exponential => weigh(run, |a| a),
                        _ => weigh(run, |a| a * a),
                    };
                    add(j, dot);
                }
            },
        );
    }

    /// Multiplies the weights of a radial kernel's derivatives by the factor that all coordinates
    /// have in common, −(d ln(correlation)/da)/a. Leaves the weights of a product unchanged.
    pub(crate) fn multiply_by_radial_factors<'a>(
        self,
        at: &[f64],
        column: impl Fn(usize) -> &'a [f64],
        weights: &mut [f64],
    ) {
        if !self.is_radial() {
            return;
        }
        let mut squares = vec![0.0; weights.len()];
        for (j, at) in at.iter().enumerate() {
            for (s, c) in squares.iter_mut().zip(column(j)) {
                *s += (c - at) * (c - at);
            }
        }
        for (weight, square) in weights.iter_mut().zip(squares) {
            let a = square.sqrt();
            *weight *= match self {
                Self::RadialMatern52 => (1.0 + a) / (3.0 + a * (3.0 + a)),
                Self::RadialMatern32 => 1.0 / (1.0 + a),
                // Not differentiable at a = 0, where the mean of both sides is taken.
                _ if a == 0.0 => 0.0,
                _ => 1.0 / a,
            };
        }
    }
}

/// Updates each point's polynomial and exponent by `include`, given its distance in one coordinate
/// after the other.
#[inline(always)]
fn accumulate<'a>(
    (at, column, polynomials, exponents): (
        &[f64],
        impl Fn(usize) -> &'a [f64],
        &mut [f64],
        &mut [f64],
    ),
    include: impl Fn(f64, &mut f64, &mut f64),
) {
    for (j, at) in at.iter().enumerate() {
        let points = column(j).iter().zip(&mut *polynomials);
        for ((c, p), e) in points.zip(&mut *exponents) {
            include((c - at).abs(), p, e);
        }
    }
}

/// Σᵢ wᵢ `derivative`(|cᵢ − at|).
#[inline(always)]
fn weigh((at, column, weights): (f64, &[f64], &[f64]), derivative: impl Fn(f64) -> f64) -> f64 {
    sum_of(column, weights, |c, w| w * derivative((c - at).abs()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn correlation(kernel: Kernel, h: f64, theta: f64) -> f64 {
        let column = [kernel.length_factor() * h / theta];
        let mut out = [0.0];
        kernel.correlations(&[0.0], |_| &column, &mut out);
        out[0]
    }

    #[test]
    fn values_are_those_of_the_textbook() {
        // Rasmussen and Williams, "Gaussian Processes for Machine Learning" (2006), equations
        // (4.9), (4.14), (4.17), evaluated to 40 digits at h/θ = 1 and rounded to 10.
        // In one coordinate the radial kernels are the others.
        let [m52, m32, se, exponential] = [0.5239941088, 0.4833577246, 0.6065306597, 0.3678794412];
        let expected = [m52, m32, se, exponential, m52, m32, exponential];
        for (kernel, value) in Kernel::ALL.into_iter().zip(expected) {
            assert!(
                (correlation(kernel, 0.7, 0.7) - value).abs() < 5e-11,
                "{kernel}"
            );
            assert_eq!(correlation(kernel, 0.0, 0.7), 1.0);
            assert_eq!(correlation(kernel, 1e200, 1e-200), 0.0);
        }
    }

    #[test]
    fn derivatives_agree_with_differences() {
        for kernel in Kernel::ALL {
            for h in [0.01, 0.3, 1.0, 5.0] {
                let step = 1e-5_f64;
                let up = correlation(kernel, h, step.exp()).ln();
                let down = correlation(kernel, h, (-step).exp()).ln();
                let column = [kernel.length_factor() * h];
                let mut weight = [1.0];
                kernel.multiply_by_radial_factors(&[0.0], |_| &column, &mut weight);
                let mut exact = 0.0;
                kernel.log_derivative_dots(&[0.0], |_| &column, &weight, |_, dot| exact = dot);
                // Central differences: step² of truncation, 1e-16/step of rounding.
                let error = (up - down) / (2.0 * step) - exact;
                assert!(
                    error.abs() < 1e-9 * (1.0 + exact.abs()) + 2e-11,
                    "{kernel} {h}: {error}"
                );
            }
        }
    }

    #[test]
    fn radial_kernels_depend_on_one_distance() {
        for kernel in Kernel::ALL {
            let at = |columns: [[f64; 1]; 2]| {
                let mut out = [0.0];
                kernel.correlations(&[0.0, 0.0], |j| &columns[j], &mut out);
                out[0]
            };
            // 3, 4, 5: the same distance along an axis and across.
            let (across, along) = (at([[0.3], [0.4]]), at([[0.5], [0.0]]));
            let isotropic = kernel.is_radial() || kernel == Kernel::SquaredExponential;
            assert_eq!((across - along).abs() < 1e-14, isotropic, "{kernel}");
        }
    }

    #[test]
    fn a_run_of_any_length_is_that_of_its_points() {
        for kernel in Kernel::ALL {
            let column: Vec<f64> = (0..RUN * 2 + 3).map(|i| 0.05 * i as f64).collect();
            for count in [1, 7, RUN - 1, RUN, RUN + 1, 2 * RUN + 3] {
                let mut out = vec![0.0; count];
                kernel.correlations(&[0.4], |_| &column[..count], &mut out);
                for (i, value) in out.iter().enumerate() {
                    let mut one = [0.0];
                    kernel.correlations(&[0.4], |_| &column[i..=i], &mut one);
                    assert_eq!(one[0], *value, "{kernel} {count} {i}");
                }
            }
        }
    }
}
