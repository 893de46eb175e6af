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

use pulp::{Scalar, Simd};
use serde::{Deserialize, Serialize};

use crate::Error;

mod panel;
mod run;

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
pub(crate) const LANES: usize = 8;
/// The most coordinates that share one division, see [`weighted_derivatives`].
const SHARED: usize = 3;

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

    /// The polynomial and the exponent of a product over some coordinates, given those without the one
    /// in which the points have this difference.
    #[inline(always)]
    fn include<S: Simd>(
        self,
        simd: S,
        difference: S::f64s,
        (polynomial, exponent): (S::f64s, S::f64s),
    ) -> (S::f64s, S::f64s) {
        let one = simd.splat_f64s(1.0);
        let a = simd.abs_f64s(difference);
        let (polynomial, term) = match self {
            Self::Matern52 => {
                let third = simd.mul_f64s(a, simd.splat_f64s(1.0 / 3.0));
                let inner = simd.mul_f64s(a, simd.add_f64s(one, third));
                (simd.mul_f64s(polynomial, simd.add_f64s(one, inner)), a)
            }
            Self::Matern32 => (simd.mul_f64s(polynomial, simd.add_f64s(one, a)), a),
            Self::Exponential => (polynomial, a),
            Self::SquaredExponential
            | Self::RadialMatern52
            | Self::RadialMatern32
            | Self::RadialExponential => (polynomial, simd.mul_f64s(a, a)),
        };
        (polynomial, simd.add_f64s(exponent, term))
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

    /// ∂ ln(correlation)/∂ ln θ of one coordinate as a function of a; for a radial kernel, of that
    /// coordinate's a and up to [`Kernel::multiply_by_radial_factors`].
    #[inline(always)]
    fn log_derivative(self, a: f64) -> f64 {
        let (above, below) = self.log_derivative_fraction(Scalar::new(), a);
        above / below
    }

    /// Numerator and denominator of [`Kernel::log_derivative`].
    #[inline(always)]
    fn log_derivative_fraction<S: Simd>(self, simd: S, a: S::f64s) -> (S::f64s, S::f64s) {
        let number = |value| simd.splat_f64s(value);
        let (one, square) = (number(1.0), simd.mul_f64s(a, a));
        match self {
            Self::Matern52 => {
                let below = simd.mul_f64s(a, simd.add_f64s(number(3.0), a));
                (
                    simd.mul_f64s(square, simd.add_f64s(one, a)),
                    simd.add_f64s(number(3.0), below),
                )
            }
            Self::Matern32 => (square, simd.add_f64s(one, a)),
            Self::SquaredExponential => (simd.mul_f64s(number(2.0), square), one),
            Self::Exponential => (a, one),
            Self::RadialMatern52 | Self::RadialMatern32 | Self::RadialExponential => (square, one),
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

    pub(crate) fn is_radial(self) -> bool {
        matches!(
            self,
            Self::RadialMatern52 | Self::RadialMatern32 | Self::RadialExponential
        )
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

/// Calls a method with the kernel as a constant, so that its loops are compiled for each kernel and
/// leave no choice inside of them.
macro_rules! for_each_kernel {
    ($self:ident.$method:ident($($argument:expr),*)) => {
        match $self.kernel {
            Kernel::Matern52 => $self.$method(Kernel::Matern52 $(, $argument)*),
            Kernel::Matern32 => $self.$method(Kernel::Matern32 $(, $argument)*),
            Kernel::SquaredExponential => $self.$method(Kernel::SquaredExponential $(, $argument)*),
            Kernel::Exponential => $self.$method(Kernel::Exponential $(, $argument)*),
            Kernel::RadialMatern52 => $self.$method(Kernel::RadialMatern52 $(, $argument)*),
            Kernel::RadialMatern32 => $self.$method(Kernel::RadialMatern32 $(, $argument)*),
            Kernel::RadialExponential => $self.$method(Kernel::RadialExponential $(, $argument)*),
        }
    };
}

use for_each_kernel;

/// A computation for each coordinate, where up to [`SHARED`] at a time share divisions.
trait ByGroups: Sized {
    fn coordinates(&self) -> usize;

    /// Computes for N coordinates from the `first` on.
    fn group<S: Simd, const N: usize>(&mut self, kernel: Kernel, simd: S, first: usize);

    #[inline(always)]
    fn run<S: Simd>(mut self, kernel: Kernel, simd: S) {
        for first in (0..self.coordinates()).step_by(SHARED) {
            match self.coordinates() - first {
                1 => self.group::<S, 1>(kernel, simd, first),
                2 => self.group::<S, 2>(kernel, simd, first),
                _ => self.group::<S, SHARED>(kernel, simd, first),
            }
        }
    }
}

/// Adds the terms of [`LANES`] points to the sums of N coordinates.
#[inline(always)]
fn add_dots<S: Simd, const N: usize>(
    kernel: Kernel,
    simd: S,
    at: [f64; N],
    columns: [&[f64; LANES]; N],
    weights: &[f64; LANES],
    sums: &mut [[f64; LANES]; N],
) {
    for (v, weight) in S::as_simd_f64s(weights).0.iter().enumerate() {
        let columns = columns.map(|column| S::as_simd_f64s(column).0[v]);
        let terms = weighted_derivatives(kernel, simd, at, columns, *weight);
        for (sums, term) in sums.iter_mut().zip(terms) {
            let sum = &mut S::as_mut_simd_f64s(sums).0[v];
            *sum = simd.add_f64s(*sum, term);
        }
    }
}

/// A weight times ∂ ln(correlation)/∂ ln θ of N coordinates. Divisions are slow, and one does for all:
/// w/q₁ is w/(q₁q₂q₃) times q₂q₃.
#[inline(always)]
fn weighted_derivatives<S: Simd, const N: usize>(
    kernel: Kernel,
    simd: S,
    at: [f64; N],
    columns: [S::f64s; N],
    weight: S::f64s,
) -> [S::f64s; N] {
    let one = simd.splat_f64s(1.0);
    let (mut above, mut below) = ([one; N], [one; N]);
    // The product of the denominators before each.
    let mut before = [one; N];
    let mut all = one;
    for g in 0..N {
        let a = simd.abs_f64s(simd.sub_f64s(columns[g], simd.splat_f64s(at[g])));
        (above[g], below[g]) = kernel.log_derivative_fraction(simd, a);
        before[g] = all;
        all = simd.mul_f64s(all, below[g]);
    }
    // The weight over the product of the denominators up to each.
    let mut share = simd.div_f64s(weight, all);
    let mut terms = above;
    for g in (0..N).rev() {
        terms[g] = simd.mul_f64s(above[g], simd.mul_f64s(before[g], share));
        share = simd.mul_f64s(share, below[g]);
    }
    terms
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
