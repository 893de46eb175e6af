//! Correlation functions: products over the coordinates of one-dimensional ones, and functions of
//! one anisotropic distance.
//!
//! With h the distance in one coordinate and θ its range:
//!
//! | kernel | correlation in one coordinate | a |
//! |---|---|---|
//! | Matérn 5/2 | (1 + a + a²/3) e^−a | √5 h/θ |
//! | Matérn 3/2 | (1 + a) e^−a | √3 h/θ |
//! | squared exponential | e^−a² | h/(√2 θ) |
//! | exponential | e^−a | h/θ |
//!
//! The definitions and the meaning of the ranges are those of the R package DiceKriging
//! (Roustant, Ginsbourger, Deville, J. Stat. Softw. 51 (2012), table 1).
//!
//! A radial kernel takes the function of one coordinate at a = √Σ aⱼ²; the squared exponential is
//! its own radial variant.
//!
//! All functions below take coordinates already multiplied by a/h, so that a is a plain difference.
//! Only the product needs an exponential, once per pair of points: the exponents are summed.
//!
//! pulp picks the widest vectors the processor has. That changes the speed, never a bit: every
//! element goes through the same additions and multiplications, and sums have a fixed order.

use std::fmt;
use std::str::FromStr;

use pulp::{Arch, Simd, WithSimd};
use serde::{Deserialize, Serialize};

use crate::Error;
use crate::exponential::multiply_by_exp_of_minus;

/// The correlation function: a product over the coordinates, unless its name says radial.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Kernel {
    /// Matérn with ν = 5/2: twice differentiable sample paths.
    #[default]
    Matern52,
    /// Matérn with ν = 3/2: once differentiable sample paths.
    Matern32,
    /// Squared exponential: infinitely smooth sample paths, badly conditioned without noise.
    SquaredExponential,
    /// Exponential (Matérn with ν = 1/2): continuous sample paths.
    Exponential,
    /// Matérn 5/2 of the distance √Σ (hⱼ/θⱼ)².
    RadialMatern52,
    /// Matérn 3/2 of the distance √Σ (hⱼ/θⱼ)².
    RadialMatern32,
    /// Exponential of the distance √Σ (hⱼ/θⱼ)².
    RadialExponential,
}

/// Number of sums kept side by side so that they can be vectorised in a fixed order.
const LANES: usize = 8;
/// Points whose correlations are computed side by side, all of it in registers.
const WIDE: usize = 16;

impl Kernel {
    /// Every kernel, in the order of the documentation.
    pub const ALL: [Self; 7] = [
        Self::Matern52,
        Self::Matern32,
        Self::SquaredExponential,
        Self::Exponential,
        Self::RadialMatern52,
        Self::RadialMatern32,
        Self::RadialExponential,
    ];

    /// The name [`FromStr`] accepts and [`fmt::Display`] writes.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Matern52 => "matern-5-2",
            Self::Matern32 => "matern-3-2",
            Self::SquaredExponential => "squared-exponential",
            Self::Exponential => "exponential",
            Self::RadialMatern52 => "radial-matern-5-2",
            Self::RadialMatern32 => "radial-matern-3-2",
            Self::RadialExponential => "radial-exponential",
        }
    }

    /// a θ/h of the table above.
    pub(crate) fn length_factor(self) -> f64 {
        match self {
            Self::Matern52 | Self::RadialMatern52 => 5.0_f64.sqrt(),
            Self::Matern32 | Self::RadialMatern32 => 3.0_f64.sqrt(),
            Self::SquaredExponential => 0.5_f64.sqrt(),
            Self::Exponential | Self::RadialExponential => 1.0,
        }
    }

    /// Multiplies `polynomial` and adds to `exponent` the factors of one coordinate, between the
    /// point at `at` and those at `column`. All three slices have one length.
    #[inline(always)]
    fn accumulate(self, at: f64, column: &[f64], polynomial: &mut [f64], exponent: &mut [f64]) {
        let both = polynomial.iter_mut().zip(exponent).zip(column);
        match self {
            Self::Matern52 => both.for_each(|((p, e), c)| {
                let a = (c - at).abs();
                *p *= 1.0 + a * (1.0 + a * (1.0 / 3.0));
                *e += a;
            }),
            Self::Matern32 => both.for_each(|((p, e), c)| {
                let a = (c - at).abs();
                *p *= 1.0 + a;
                *e += a;
            }),
            Self::SquaredExponential
            | Self::RadialMatern52
            | Self::RadialMatern32
            | Self::RadialExponential => both.for_each(|((_, e), c)| {
                let a = c - at;
                *e += a * a;
            }),
            Self::Exponential => both.for_each(|((_, e), c)| *e += (c - at).abs()),
        }
    }

    /// Turns the sums of squares of a radial kernel into distances, and writes the polynomials of
    /// those.
    #[inline(always)]
    fn finish_radial(self, polynomial: &mut [f64], exponent: &mut [f64]) {
        let both = polynomial.iter_mut().zip(exponent);
        match self {
            Self::RadialMatern52 => both.for_each(|(p, e)| {
                let a = e.sqrt();
                *p = 1.0 + a * (1.0 + a * (1.0 / 3.0));
                *e = a;
            }),
            Self::RadialMatern32 => both.for_each(|(p, e)| {
                let a = e.sqrt();
                *p = 1.0 + a;
                *e = a;
            }),
            Self::RadialExponential => both.for_each(|(_, e)| *e = e.sqrt()),
            _ => {}
        }
    }

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

    /// ∂ ln(correlation)/∂ ln θ of one coordinate as a function of a; for a radial kernel, of that
    /// coordinate's a and up to [`Kernel::multiply_by_radial_factors`].
    #[inline(always)]
    fn log_derivative(self, a: f64) -> f64 {
        match self {
            Self::Matern52 => a * a * (1.0 + a) / (3.0 + a * (3.0 + a)),
            Self::Matern32 => a * a / (1.0 + a),
            Self::SquaredExponential => 2.0 * a * a,
            Self::Exponential => a,
            Self::RadialMatern52 | Self::RadialMatern32 | Self::RadialExponential => a * a,
        }
    }

    /// Multiplies `values` by what a radial kernel's derivatives have in common in all coordinates,
    /// −(d ln(correlation)/da)/a. Leaves them alone for products.
    pub(crate) fn multiply_by_radial_factors<'a>(
        self,
        at: &[f64],
        column: impl Fn(usize) -> &'a [f64],
        squares: &mut [f64],
        values: &mut [f64],
    ) {
        if !self.is_radial() {
            return;
        }
        squares.fill(0.0);
        for (j, at) in at.iter().enumerate() {
            for (s, c) in squares.iter_mut().zip(column(j)) {
                *s += (c - at) * (c - at);
            }
        }
        for (value, square) in values.iter_mut().zip(squares) {
            let a = square.sqrt();
            *value *= match self {
                Self::RadialMatern52 => (1.0 + a) / (3.0 + a * (3.0 + a)),
                Self::RadialMatern32 => 1.0 / (1.0 + a),
                // Not differentiable at a = 0, where the mean of both sides is taken.
                _ if a == 0.0 => 0.0,
                _ => 1.0 / a,
            };
        }
    }

    fn is_radial(self) -> bool {
        matches!(
            self,
            Self::RadialMatern52 | Self::RadialMatern32 | Self::RadialExponential
        )
    }

    /// Σᵢ `weights`ᵢ ∂ ln(correlationᵢ)/∂ ln θ for one coordinate.
    pub(crate) fn log_derivative_dot(self, at: f64, column: &[f64], weights: &[f64]) -> f64 {
        Arch::new().dispatch(DerivativeDot {
            kernel: self,
            at,
            column,
            weights,
        })
    }

    /// Writes to `out` the derivatives ∂ correlationᵢ/∂ ln θ of one coordinate.
    pub(crate) fn derivatives(
        self,
        at: f64,
        column: &[f64],
        correlations: &[f64],
        out: &mut [f64],
    ) {
        for ((o, c), r) in out.iter_mut().zip(column).zip(correlations) {
            *o = r * self.log_derivative((c - at).abs());
        }
    }

    /// Σᵢ `weights`ᵢ ∂ ln(correlationᵢ)/∂ at for one scaled coordinate. Where a kernel has a kink,
    /// at the point itself, the mean of both sides is taken.
    pub(crate) fn slope_dot(self, at: f64, column: &[f64], weights: &[f64]) -> f64 {
        // a = |c − at|, so that d/d at = −sign(c − at) d/da = log_derivative(a)/(c − at).
        let slope = |c: f64| {
            let difference = c - at;
            if difference == 0.0 {
                0.0
            } else {
                self.log_derivative(difference.abs()) / difference
            }
        };
        column.iter().zip(weights).map(|(c, w)| w * slope(*c)).sum()
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
    fn with_simd<S: Simd>(self, _: S) {
        // A kernel that is known where its loops are compiled leaves no choice inside of them.
        match self.kernel {
            Kernel::Matern52 => self.run(Kernel::Matern52),
            Kernel::Matern32 => self.run(Kernel::Matern32),
            Kernel::SquaredExponential => self.run(Kernel::SquaredExponential),
            Kernel::Exponential => self.run(Kernel::Exponential),
            Kernel::RadialMatern52 => self.run(Kernel::RadialMatern52),
            Kernel::RadialMatern32 => self.run(Kernel::RadialMatern32),
            Kernel::RadialExponential => self.run(Kernel::RadialExponential),
        }
    }
}

impl<'a, F: Fn(usize) -> &'a [f64]> Correlations<'_, F> {
    #[inline(always)]
    fn run(self, kernel: Kernel) {
        let Self {
            at, column, out, ..
        } = self;
        let (whole, rest) = out.as_chunks_mut::<WIDE>();
        let mut start = 0;
        for out in whole {
            *out = side_by_side(kernel, at, |j| {
                let mut points = [0.0; WIDE];
                points.copy_from_slice(&column(j)[start..start + WIDE]);
                points
            });
            start += WIDE;
        }
        if !rest.is_empty() {
            // Filled up with the point itself.
            let last = side_by_side(kernel, at, |j| {
                let mut points = [at[j]; WIDE];
                points[..rest.len()].copy_from_slice(&column(j)[start..start + rest.len()]);
                points
            });
            rest.copy_from_slice(&last[..rest.len()]);
        }
    }
}

/// The correlations of [`WIDE`] points.
#[inline(always)]
fn side_by_side(kernel: Kernel, at: &[f64], column: impl Fn(usize) -> [f64; WIDE]) -> [f64; WIDE] {
    let (mut out, mut exponent) = ([1.0; WIDE], [0.0; WIDE]);
    for (j, at) in at.iter().enumerate() {
        kernel.accumulate(*at, &column(j), &mut out, &mut exponent);
    }
    kernel.finish_radial(&mut out, &mut exponent);
    multiply_by_exp_of_minus(&exponent, &mut out);
    out
}

/// [`Kernel::log_derivative_dot`] for one instruction set.
struct DerivativeDot<'s> {
    kernel: Kernel,
    at: f64,
    column: &'s [f64],
    weights: &'s [f64],
}

impl WithSimd for DerivativeDot<'_> {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> f64 {
        let Self {
            kernel,
            at,
            column,
            weights,
        } = self;
        // The match stays outside of the loop, so that each loop is vectorised on its own.
        match kernel {
            Kernel::Matern52 => dot(at, column, weights, |a| Kernel::Matern52.log_derivative(a)),
            Kernel::Matern32 => dot(at, column, weights, |a| Kernel::Matern32.log_derivative(a)),
            Kernel::SquaredExponential => dot(at, column, weights, |a| {
                Kernel::SquaredExponential.log_derivative(a)
            }),
            Kernel::Exponential => dot(at, column, weights, |a| {
                Kernel::Exponential.log_derivative(a)
            }),
            Kernel::RadialMatern52 | Kernel::RadialMatern32 | Kernel::RadialExponential => {
                dot(at, column, weights, |a| {
                    Kernel::RadialMatern52.log_derivative(a)
                })
            }
        }
    }
}

/// Σ wᵢ f(|cᵢ − at|) with a fixed order of summation that does not hinder vectorisation.
#[inline(always)]
fn dot(at: f64, column: &[f64], weights: &[f64], f: impl Fn(f64) -> f64) -> f64 {
    let mut sums = [0.0; LANES];
    let (columns, column_rest) = column.as_chunks::<LANES>();
    let (weight_chunks, weight_rest) = weights.as_chunks::<LANES>();
    for (c, w) in columns.iter().zip(weight_chunks) {
        for lane in 0..LANES {
            sums[lane] += w[lane] * f((c[lane] - at).abs());
        }
    }
    for (lane, (c, w)) in column_rest.iter().zip(weight_rest).enumerate() {
        sums[lane] += w * f((c - at).abs());
    }
    sums.iter().sum()
}

impl fmt::Display for Kernel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for Kernel {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self, Error> {
        Self::ALL
            .into_iter()
            .find(|kernel| kernel.name() == name)
            .ok_or_else(|| Error::UnknownKernel {
                name: name.to_owned(),
            })
    }
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
                let a = kernel.length_factor() * h;
                let mut factor = [1.0];
                let column = [a];
                kernel.multiply_by_radial_factors(&[0.0], |_| &column, &mut [0.0], &mut factor);
                let exact = factor[0] * kernel.log_derivative(a);
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
            assert_eq!((across - along).abs() < 1e-15, isotropic, "{kernel}");
        }
    }

    #[test]
    fn names_round_trip() {
        for kernel in Kernel::ALL {
            assert_eq!(kernel.to_string().parse::<Kernel>().unwrap(), kernel);
        }
        assert!("matern".parse::<Kernel>().is_err());
    }
}
