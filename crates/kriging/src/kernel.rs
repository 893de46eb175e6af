//! Correlation functions: products over the coordinates of one-dimensional ones.
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
//! All functions below take coordinates already multiplied by a/h, so that a is a plain difference.
//! Only the product needs an exponential, once per pair of points: the exponents are summed.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::Error;
use crate::exponential::multiply_by_exp_of_minus;

/// The correlation function, a product over the coordinates.
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
}

/// Number of sums kept side by side so that they can be vectorised in a fixed order.
const LANES: usize = 8;

impl Kernel {
    /// Every kernel, in the order of the documentation.
    pub const ALL: [Self; 4] = [
        Self::Matern52,
        Self::Matern32,
        Self::SquaredExponential,
        Self::Exponential,
    ];

    /// The name [`FromStr`] accepts and [`fmt::Display`] writes.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Matern52 => "matern-5-2",
            Self::Matern32 => "matern-3-2",
            Self::SquaredExponential => "squared-exponential",
            Self::Exponential => "exponential",
        }
    }

    /// a θ/h of the table above.
    pub(crate) fn length_factor(self) -> f64 {
        match self {
            Self::Matern52 => 5.0_f64.sqrt(),
            Self::Matern32 => 3.0_f64.sqrt(),
            Self::SquaredExponential => 0.5_f64.sqrt(),
            Self::Exponential => 1.0,
        }
    }

    /// Multiplies `polynomial` and adds to `exponent` the factors of one coordinate, between the
    /// point at `at` and those at `column`. All three slices have one length.
    #[inline]
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
            Self::SquaredExponential => both.for_each(|((_, e), c)| {
                let a = c - at;
                *e += a * a;
            }),
            Self::Exponential => both.for_each(|((_, e), c)| *e += (c - at).abs()),
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
        exponent: &mut [f64],
        out: &mut [f64],
    ) {
        exponent.fill(0.0);
        out.fill(1.0);
        for (j, at) in at.iter().enumerate() {
            self.accumulate(*at, column(j), out, exponent);
        }
        multiply_by_exp_of_minus(exponent, out);
    }

    /// ∂ ln(correlation)/∂ ln θ of one coordinate as a function of a.
    #[inline]
    fn log_derivative(self, a: f64) -> f64 {
        match self {
            Self::Matern52 => a * a * (1.0 + a) / (3.0 + a * (3.0 + a)),
            Self::Matern32 => a * a / (1.0 + a),
            Self::SquaredExponential => 2.0 * a * a,
            Self::Exponential => a,
        }
    }

    /// Σᵢ `weights`ᵢ ∂ ln(correlationᵢ)/∂ ln θ for one coordinate.
    pub(crate) fn log_derivative_dot(self, at: f64, column: &[f64], weights: &[f64]) -> f64 {
        // The match stays outside of the loop, so that each loop is vectorised on its own.
        match self {
            Self::Matern52 => dot(at, column, weights, |a| Self::Matern52.log_derivative(a)),
            Self::Matern32 => dot(at, column, weights, |a| Self::Matern32.log_derivative(a)),
            Self::SquaredExponential => dot(at, column, weights, |a| {
                Self::SquaredExponential.log_derivative(a)
            }),
            Self::Exponential => dot(at, column, weights, |a| Self::Exponential.log_derivative(a)),
        }
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
}

/// Σ wᵢ f(|cᵢ − at|) with a fixed order of summation that does not hinder vectorisation.
#[inline]
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
        kernel.correlations(&[0.0], |_| &column, &mut [0.0], &mut out);
        out[0]
    }

    #[test]
    fn values_are_those_of_the_textbook() {
        // Rasmussen and Williams, "Gaussian Processes for Machine Learning" (2006), equations
        // (4.9), (4.14), (4.17), evaluated to 40 digits at h/θ = 1 and rounded to 10.
        let expected = [0.5239941088, 0.4833577246, 0.6065306597, 0.3678794412];
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
                let exact = kernel.log_derivative(kernel.length_factor() * h);
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
    fn names_round_trip() {
        for kernel in Kernel::ALL {
            assert_eq!(kernel.to_string().parse::<Kernel>().unwrap(), kernel);
        }
        assert!("matern".parse::<Kernel>().is_err());
    }
}
