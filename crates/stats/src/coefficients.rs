//! Standard normal coefficients that cover their space more evenly than independent ones, and the
//! percentile of responses to them.
//!
//! A Karhunen–Loève series turns d independent standard normal coefficients into one random field.
//! The coefficients may be drawn in groups that are independent of each other, each coefficient by
//! itself standard normal. Means over such samples are unbiased, and their variance is estimated
//! from the groups:
//!
//! - antithetic: pairs (ξ, −ξ), which cancel all odd parts of the response;
//! - quasi-random: a group is a Sobol sequence, scrambled anew for each group (Owen), through the
//!   inverse of the normal distribution function.
//!
//! Let m be the mean of N responses in R groups. V = Σ(m_r − m)²/(R(R − 1)) is an unbiased estimate
//! of its variance. The sample variance is biased, because the samples of a group are not
//! independent: E Σ(y − m)²/N = σ² − Var(m). So σ̂² = Σ(y − m)²/N + V is unbiased for every
//! grouping. The percentile m + z σ̂ has the usual small bias of a square root, −z Var(σ̂²)/(8σ³).
//! Its variance is estimated by the jackknife over the groups, which holds for normal and other
//! responses alike but is too large by about 1/R.
//!
//! # References
//!
//! - J. M. Hammersley, K. W. Morton, "A new Monte Carlo technique: antithetic variates", Proc.
//!   Cambridge Phil. Soc. 52 (1956) 449–475.
//! - A. B. Owen, "Scrambled net variance for integrals of smooth functions", Ann. Statist. 25 (1997)
//!   1541–1562.
//! - B. Efron, C. Stein, "The jackknife estimate of variance", Ann. Statist. 9 (1981) 586–596.

use rand::Rng as _;
use statrs::distribution::{ContinuousCDF as _, Normal};

use crate::moments::check_finite;
use crate::sobol::{SOBOL_DIMENSIONS, SOBOL_POINTS, sobol_coordinate};
use crate::streams::{Purpose, StreamRng, stream};
use crate::{Error, Percentile};

/// The bit of a stream's sample number that marks groups.
const GROUPS: u64 = 1 << 63;

/// The dependence between the coefficients of a design's samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Sampling {
    /// The coefficients of all samples are independent.
    #[default]
    Independent,
    /// Samples come in pairs with coefficients of opposite signs.
    Antithetic,
    /// Groups of samples are scrambled Sobol sequences; a power of two as length gives the best
    /// balance.
    Quasi {
        /// Samples per group, from 2 to 65 536.
        group: usize,
    },
}

impl Sampling {
    /// Number of samples per group. Samples of different groups are independent.
    #[must_use]
    pub fn group(self) -> usize {
        match self {
            Self::Independent => 1,
            Self::Antithetic => 2,
            Self::Quasi { group } => group,
        }
    }
}

/// The next `count` standard normal numbers of a stream.
pub fn normal_scores(rng: &mut StreamRng, count: usize) -> Vec<f64> {
    let normal = Normal::standard();
    (0..count)
        .map(|_| normal.inverse_cdf(uniform(rng)))
        .collect()
}

/// The `count` standard normal coefficients of one sample, from streams named by (`seed`,
/// `purpose`, `design`). They depend neither on who draws them nor on the order of drawing.
///
/// # Errors
///
/// [`Error::OutOfRange`] for a group, or a number of coefficients, that the sequence cannot serve.
pub fn normal_coefficients(
    sampling: Sampling,
    seed: u64,
    purpose: Purpose,
    design: u64,
    sample: u64,
    count: usize,
) -> Result<Vec<f64>, Error> {
    let normal = Normal::standard();
    let independent =
        |sample: u64| normal_scores(&mut stream(seed, purpose, design, sample), count);
    match sampling {
        Sampling::Independent => Ok(independent(sample)),
        Sampling::Antithetic => {
            let mut coefficients = independent(sample / 2);
            if sample % 2 == 1 {
                coefficients.iter_mut().for_each(|c| *c = -*c);
            }
            Ok(coefficients)
        }
        Sampling::Quasi { group } => {
            if !(2..=SOBOL_POINTS).contains(&group) {
                return Err(Error::OutOfRange {
                    name: "group",
                    value: group as f64,
                    expected: "from 2 to 65536",
                });
            }
            if count > SOBOL_DIMENSIONS {
                return Err(Error::OutOfRange {
                    name: "number of coefficients",
                    value: count as f64,
                    expected: "at most 256",
                });
            }
            let (which, place) = (sample / group as u64, (sample % group as u64) as u32);
            let scramble = (stream(seed, purpose, design, GROUPS | which).next_u64() >> 32) as u32;
            Ok((0..count as u32)
                .map(|k| normal.inverse_cdf(sobol_coordinate(place, k, scramble)))
                .collect())
        }
    }
}

/// A uniform number in the open unit interval, of 53 bits.
fn uniform(rng: &mut StreamRng) -> f64 {
    const BITS: f64 = 1.0 / (1_u64 << 53) as f64;
    ((rng.next_u64() >> 11) as f64 + 0.5) * BITS
}

/// Estimates m + z σ̂ from groups: runs of `group` successive samples, independent of each other. The
/// variance is that of the jackknife over the groups. With groups of one, only the
/// variance differs from [`crate::normal_p90`]. An incomplete last group is refused, because its
/// variance would differ.
///
/// # Errors
///
/// [`Error::OutOfRange`] for a `group` of zero, samples that are not whole groups, or a `z` that is not
/// finite; [`Error::TooFewSamples`] for fewer than 4 groups; [`Error::NonFinite`],
/// [`Error::Overflow`].
pub fn grouped_p90(samples: &[f64], group: usize, z: f64) -> Result<Percentile, Error> {
    let n = samples.len();
    if group == 0 || !n.is_multiple_of(group) {
        return Err(Error::OutOfRange {
            name: "number of samples",
            value: n as f64,
            expected: "a multiple of the group's",
        });
    }
    if !z.is_finite() {
        return Err(Error::OutOfRange {
            name: "z",
            value: z,
            expected: "finite",
        });
    }
    let groups = n / group;
    if groups < GROUPED_MIN_GROUPS {
        return Err(Error::TooFewSamples {
            statistic: "a percentile of grouped samples",
            needed: GROUPED_MIN_GROUPS * group,
            got: n,
        });
    }
    check_finite(samples)?;
    // Relative to a common value, so that sums of squares keep their digits.
    let base = samples.iter().sum::<f64>() / n as f64;
    let sums: Vec<[f64; 2]> = samples
        .chunks_exact(group)
        .map(|run| {
            let deviations = run.iter().map(|y| y - base);
            deviations.fold([0.0, 0.0], |[a, b], y| [a + y, b + y * y])
        })
        .collect();
    let moments = |without: Option<usize>| -> (f64, f64) {
        let kept = || {
            let all = sums.iter().enumerate();
            all.filter(move |(r, _)| Some(*r) != without)
                .map(|(_, s)| s)
        };
        let groups = (groups - usize::from(without.is_some())) as f64;
        let size = group as f64;
        let mean = kept().map(|s| s[0]).sum::<f64>() / (groups * size);
        let between: f64 = kept().map(|s| (s[0] / size - mean).powi(2)).sum();
        let square = kept().map(|s| s[1]).sum::<f64>() / (groups * size) - mean * mean;
        let variance = square + between / (groups * (groups - 1.0));
        (mean, variance.max(0.0).sqrt())
    };
    let (mean, sd) = moments(None);
    let left_out: Vec<f64> = (0..groups)
        .map(|r| {
            let (mean, sd) = moments(Some(r));
            mean + z * sd
        })
        .collect();
    let centre = left_out.iter().sum::<f64>() / groups as f64;
    let squares: f64 = left_out.iter().map(|p| (p - centre).powi(2)).sum();
    let variance = (groups - 1) as f64 / groups as f64 * squares;
    let p90 = base + mean + z * sd;
    if !(p90.is_finite() && variance.is_finite()) {
        return Err(Error::Overflow { n });
    }
    Ok(Percentile {
        n,
        mean: base + mean,
        sd,
        p90,
        variance,
    })
}

/// The fewest groups of [`grouped_p90`]: with fewer the jackknife has next to nothing to compare.
pub const GROUPED_MIN_GROUPS: usize = 4;
