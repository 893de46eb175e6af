//! Kinds of designs by their names.

use std::fmt;

use rand::Rng as _;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use stats::streams::{Purpose, stream};
use stats::{SOBOL_POINTS, SOBOL_SPACING, sobol_coordinate};

use crate::design::check;
use crate::{Design, Error, Options, check_enlarge, enlarge, maximin, random_lhs};

/// Largest accepted difference of a coordinate from the sequence's: less than the spacing, and more
/// than the rounding of a conversion to other units and back.
const SAME: f64 = 0.25 * SOBOL_SPACING;

/// A kind of design.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Method {
    /// Any Latin hypercube.
    Random,
    /// A Latin hypercube whose points lie far apart.
    #[default]
    Maximin,
    /// A scrambled Sobol sequence of at most 65 536 points.
    Sobol,
}

impl Method {
    /// Every method.
    pub const ALL: [Self; 3] = [Self::Random, Self::Maximin, Self::Sobol];

    /// A design of `n` points in `d` variables. Only [`Method::Maximin`] uses the effort.
    ///
    /// # Errors
    ///
    /// The errors of the method's function.
    pub fn design(self, n: usize, d: usize, options: &Options) -> Result<Design, Error> {
        match self {
            Self::Random => random_lhs(n, d, options.seed),
            Self::Maximin => maximin(n, d, options),
            Self::Sobol => sobol(n, d, options.seed),
        }
    }

    /// A design of `n` points that begins with those of `existing`, unchanged. It can be enlarged
    /// again.
    ///
    /// - [`Method::Maximin`] searches for good places of the new points: [`enlarge`];
    /// - [`Method::Random`] adds them to the free strata at random: [`enlarge`] without a search;
    /// - [`Method::Sobol`] continues its sequence, so that growth in steps gives the same
    ///   as growth at once.
    ///
    /// # Errors
    ///
    /// The errors of [`Method::check_enlarge`] and [`Error::Effort`].
    pub fn enlarge(self, existing: &Design, n: usize, options: &Options) -> Result<Design, Error> {
        match self {
            Self::Maximin => enlarge(existing, n, options),
            Self::Random => {
                let effort = 0.0;
                enlarge(existing, n, &Options { effort, ..*options })
            }
            Self::Sobol => {
                self.check_enlarge(existing, n, options.seed)?;
                let mut design = sobol(n, existing.d, options.seed)?;
                design.points[..existing.points.len()].copy_from_slice(&existing.points);
                Ok(design)
            }
        }
    }

    /// Whether [`Method::enlarge`] can make `n` points of `existing` with this `seed`, without the
    /// search.
    ///
    /// # Errors
    ///
    /// The errors of [`check_enlarge`]; for [`Method::Sobol`] also [`Error::SobolPoints`], and
    /// [`Error::OtherSequence`] for points that are not the beginning of the seed's sequence.
    pub fn check_enlarge(self, existing: &Design, n: usize, seed: u64) -> Result<(), Error> {
        check_enlarge(existing, n)?;
        if self != Self::Sobol || existing.n == 0 {
            return Ok(());
        }
        let d = existing.d;
        let sequence = sobol(n, d, seed)?;
        let mut pairs = existing.points.iter().zip(&sequence.points);
        match pairs.position(|(held, expected)| (held - expected).abs() > SAME) {
            Some(index) => Err(Error::OtherSequence { point: index / d }),
            None => Ok(()),
        }
    }
}

/// The name in files.
impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.serialize(f)
    }
}

/// The first `n` points of an Owen-scrambled Sobol sequence in `d` variables (sobol_burley: Joe and
/// Kuo's directions, Burley's hash-based scrambling), the same for the same `seed`.
///
/// The sequence's discrepancy is lower than a random design's, its smallest distance is not. More
/// points of the same seed continue the sequence, so any longer design contains this one. Where n
/// is a power of two there is one point per stratum ([`Design::is_stratified`]). The sequence ends
/// after [`SOBOL_POINTS`], the length that sobol_burley supports.
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
        .map(|(i, k)| sobol_coordinate(i, k, scramble))
        .collect();
    Ok(Design { n, d, points })
}
