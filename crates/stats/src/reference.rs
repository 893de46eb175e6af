//! Responses with known percentiles, on which estimators and intervals are judged.

use rand::{Rng, RngExt as _};
use rand_distr::{Distribution as _, Exp1, StandardNormal};
use statrs::distribution::{ContinuousCDF as _, Normal};

use crate::normal_quantile;

/// The distribution of a response.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reference {
    /// Normal, mean 0 and standard deviation 1.
    Normal,
    /// Exponential, mean 1.
    Exponential,
    /// Lognormal: the exponential of a standard normal number.
    Lognormal,
    /// Two narrow modes: 80 % around 0 and 20 % around 1, each with a standard deviation of 0.1.
    Bimodal,
    /// A rare jump: standard normal, with 20 added in 6 % of the samples.
    RareJump,
}

impl Reference {
    /// All distributions.
    pub const ALL: [Self; 5] = [
        Self::Normal,
        Self::Exponential,
        Self::Lognormal,
        Self::Bimodal,
        Self::RareJump,
    ];

    /// Name of the distribution, for tables.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Normal => "normal",
            Self::Exponential => "exponential",
            Self::Lognormal => "lognormal",
            Self::Bimodal => "bimodal",
            Self::RareJump => "rare jump",
        }
    }

    /// Draws one sample.
    pub fn draw(self, rng: &mut impl Rng) -> f64 {
        let normal: f64 = StandardNormal.sample(rng);
        match self {
            Self::Normal => normal,
            Self::Exponential => Exp1.sample(rng),
            Self::Lognormal => normal.exp(),
            Self::Bimodal => 0.1 * normal + f64::from(u8::from(rng.random::<f64>() < 0.2)),
            Self::RareJump => normal + 20.0 * f64::from(u8::from(rng.random::<f64>() < 0.06)),
        }
    }

    /// The true percentile at a `level` strictly between 0 and 1.
    #[must_use]
    pub fn quantile(self, level: f64) -> f64 {
        match self {
            Self::Normal => normal_quantile(level),
            Self::Exponential => -(-level).ln_1p(),
            Self::Lognormal => normal_quantile(level).exp(),
            Self::Bimodal => mixture_quantile(level, 0.2, 1.0, 0.1),
            Self::RareJump => mixture_quantile(level, 0.06, 20.0, 1.0),
        }
    }
}

/// The percentile of two normal modes of standard deviation `sd`: one around 0, and one around `place` with
/// the given share of the samples.
fn mixture_quantile(level: f64, share: f64, place: f64, sd: f64) -> f64 {
    let normal = Normal::standard();
    let below = |x: f64| (1.0 - share) * normal.cdf(x / sd) + share * normal.cdf((x - place) / sd);
    let (mut low, mut high) = (-40.0 * sd, place + 40.0 * sd);
    // Each step halves the interval: 100 steps reach the last bit.
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if below(middle) < level {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}
