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

use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

mod exponential;
mod pairs;

/// The correlation function: a product over the coordinates, unless its name says radial.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Kernel {
    /// Matérn with ν = 5/2: twice differentiable sample paths.
    #[default]
    #[serde(rename = "matern-5-2")]
    Matern52,
    /// Matérn with ν = 3/2: once differentiable sample paths.
    #[serde(rename = "matern-3-2")]
    Matern32,
    /// Squared exponential: infinitely smooth sample paths, badly conditioned without noise.
    SquaredExponential,
    /// Exponential (Matérn with ν = 1/2): continuous sample paths.
    Exponential,
    /// Matérn 5/2 of the distance √Σ (hⱼ/θⱼ)².
    #[serde(rename = "radial-matern-5-2")]
    RadialMatern52,
    /// Matérn 3/2 of the distance √Σ (hⱼ/θⱼ)².
    #[serde(rename = "radial-matern-3-2")]
    RadialMatern32,
    /// Exponential of the distance √Σ (hⱼ/θⱼ)².
    RadialExponential,
}

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

    /// The correlation of two points whose distance in coordinate j is `distances[j]` times its range.
    #[must_use]
    pub fn correlation(self, distances: &[f64]) -> f64 {
        let factor = self.length_factor();
        let columns: Vec<[f64; 1]> = distances.iter().map(|h| [h * factor]).collect();
        let mut correlation = [0.0];
        self.correlations(
            &vec![0.0; distances.len()],
            |j| &columns[j],
            &mut correlation,
        );
        correlation[0]
    }

    /// a θ/h of the module's table: a is this factor times the distance in ranges.
    pub(crate) fn length_factor(self) -> f64 {
        match self {
            Self::Matern52 | Self::RadialMatern52 => 5.0_f64.sqrt(),
            Self::Matern32 | Self::RadialMatern32 => 3.0_f64.sqrt(),
            Self::SquaredExponential => 0.5_f64.sqrt(),
            Self::Exponential | Self::RadialExponential => 1.0,
        }
    }

    pub(crate) fn is_radial(self) -> bool {
        matches!(
            self,
            Self::RadialMatern52 | Self::RadialMatern32 | Self::RadialExponential
        )
    }
}

/// The name in files.
impl fmt::Display for Kernel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.serialize(f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn correlations_are_those_of_the_table() {
        let root_5 = 5.0_f64.sqrt() * 0.5;
        let matern = (1.0 + root_5 + root_5 * root_5 / 3.0) * (-root_5).exp();
        for (kernel, expected) in [
            (Kernel::Matern52, matern),
            (Kernel::SquaredExponential, (-0.125_f64).exp()),
            (Kernel::Exponential, (-0.5_f64).exp()),
        ] {
            assert!((kernel.correlation(&[0.5]) - expected).abs() < 1e-15);
            // A product over the coordinates.
            let both = kernel.correlation(&[0.5, 0.5]);
            assert!((both - expected * expected).abs() < 1e-15);
        }
        let radial = Kernel::RadialExponential.correlation(&[0.3, 0.4]);
        assert!((radial - (-0.5_f64).exp()).abs() < 1e-15);
    }

    #[test]
    fn names_are_those_of_files() {
        assert_eq!(Kernel::RadialMatern32.to_string(), "radial-matern-3-2");
        for kernel in Kernel::ALL {
            let name = serde_json::to_value(kernel).unwrap();
            assert_eq!(name, kernel.to_string());
        }
    }
}
