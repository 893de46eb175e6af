//! Kinds of designs by their names.

use std::fmt;
use std::str::FromStr;

use rand::Rng as _;
use stats::streams::{Purpose, stream};

use crate::design::check;
use crate::{Design, Error, Options, maximin, random_lhs};

/// The length of the Sobol sequence at hand.
const SOBOL_POINTS: usize = 1 << 16;
/// Half of the spacing of a sequence of single precision: moves its points off 0.
const HALF_SPACING: f64 = 1.0 / (1 << 25) as f64;

/// A kind of design.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum Method {
    /// [`random_lhs`].
    Random,
    /// [`maximin`].
    #[default]
    Maximin,
    /// [`sobol`].
    Sobol,
}

impl Method {
    /// Every method.
    pub const ALL: [Self; 3] = [Self::Random, Self::Maximin, Self::Sobol];

    /// The name [`FromStr`] accepts and [`fmt::Display`] writes.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Random => "random",
            Self::Maximin => "maximin",
            Self::Sobol => "sobol",
        }
    }

    /// A design of `n` points in `d` variables. Only [`Method::Maximin`] uses the effort.
    ///
    /// # Errors
    ///
    /// Those of the method's function.
    pub fn design(self, n: usize, d: usize, options: &Options) -> Result<Design, Error> {
        match self {
            Self::Random => random_lhs(n, d, options.seed),
            Self::Maximin => maximin(n, d, options),
            Self::Sobol => sobol(n, d, options.seed),
        }
    }
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for Method {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self, Error> {
        Self::ALL
            .into_iter()
            .find(|method| method.name() == name)
            .ok_or_else(|| Error::UnknownMethod {
                name: name.to_owned(),
            })
    }
}

/// The first `n` points of an Owen-scrambled Sobol sequence in `d` variables (sobol_burley: Joe and
/// Kuo's directions, Burley's hash-based scrambling), the same for the same `seed`.
///
/// Its discrepancy is lower than a random design's, its smallest distance is not. More points of
/// the same seed continue the sequence, so any longer design contains this one. Where n is a power of
/// two there is one point per stratum ([`Design::is_stratified`]).
///
/// # Errors
///
/// [`Error::Points`], [`Error::Variables`] or [`Error::SobolPoints`] for a size out of range.
pub fn sobol(n: usize, d: usize, seed: u64) -> Result<Design, Error> {
    check(n, d)?;
    if n > SOBOL_POINTS {
        return Err(Error::SobolPoints { n });
    }
    // The scrambling takes 32 bits, which a stream derives from all of the seed.
    let scramble = (stream(seed, Purpose::Doe, 0, 1).next_u64() >> 32) as u32;
    let points = (0..n as u32)
        .flat_map(|i| (0..d as u32).map(move |k| (i, k)))
        .map(|(i, k)| f64::from(sobol_burley::sample(i, k, scramble)) + HALF_SPACING)
        .collect();
    Ok(Design { n, d, points })
}
