//! Distributions of single random inputs, by the parameters that engineers state, with the quantile function that turns
//! a standard normal score into a value.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use statrs::distribution::{
    Beta, Continuous as _, ContinuousCDF as _, Gumbel, LogNormal, Normal, Triangular, Uniform,
    Weibull,
};
use statrs::function::gamma::gamma;
use statrs::statistics::Distribution as _;

/// Euler's constant, by which the mean of a Gumbel distribution exceeds its mode in units of the scale.
const EULER: f64 = 0.577_215_664_901_532_9;

/// A family of distributions of a random input.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Family {
    /// Normal, with `mean` and `sd`.
    Normal,
    /// Log-normal, with its own `mean` and `sd`, not those of the logarithm.
    Lognormal,
    /// Uniform from `low` to `high`.
    Uniform,
    /// Triangular from `low` to `high`, with its `mode`.
    Triangular,
    /// Weibull, with `shape` and `scale`.
    Weibull,
    /// Gumbel's distribution of greatest values, with `mean` and `sd`.
    Gumbel,
    /// Beta from `low` to `high`, with `alpha` and `beta`.
    Beta,
    /// Normal with `mean` and `sd`, cut at `low` and `high`.
    TruncatedNormal,
    /// One of the measured `values`.
    Table,
}

impl Family {
    /// The names of the parameters, in the order in which [`Marginal::new`] takes them.
    #[must_use]
    pub const fn parameters(self) -> &'static [&'static str] {
        match self {
            Self::Normal | Self::Lognormal | Self::Gumbel => &["mean", "sd"],
            Self::Uniform => &["low", "high"],
            Self::Triangular => &["low", "mode", "high"],
            Self::Weibull => &["shape", "scale"],
            Self::Beta => &["alpha", "beta", "low", "high"],
            Self::TruncatedNormal => &["mean", "sd", "low", "high"],
            Self::Table => &[],
        }
    }

    /// The conditions on the parameters, in words.
    #[must_use]
    pub const fn needs(self) -> &'static str {
        match self {
            Self::Normal | Self::Gumbel => "sd ≥ 0",
            Self::Lognormal => "mean > 0, sd ≥ 0",
            Self::Uniform => "low < high",
            Self::Triangular => "low ≤ mode ≤ high, low < high",
            Self::Weibull => "shape > 0, scale > 0",
            Self::Beta => "alpha > 0, beta > 0, low < high",
            Self::TruncatedNormal => "sd > 0, low < high",
            Self::Table => "two or more values",
        }
    }
}

/// A distribution.
#[derive(Debug, Clone)]
pub struct Marginal<'a>(Distribution<'a>);

#[derive(Debug, Clone)]
enum Distribution<'a> {
    Normal {
        mean: f64,
        sd: f64,
    },
    Lognormal(LogNormal),
    Uniform(Uniform),
    Triangular(Triangular),
    Weibull {
        shape: f64,
        scale: f64,
        of: Weibull,
    },
    Gumbel {
        mean: f64,
        of: Gumbel,
    },
    Beta {
        ends: [f64; 2],
        shapes: [f64; 2],
        of: Beta,
    },
    Truncated {
        mean: f64,
        sd: f64,
        ends: [f64; 2],
    },
    Table(&'a [f64]),
}

impl<'a> Marginal<'a> {
    /// The distribution with these parameters, in the order of [`Family::parameters`], or with these sorted `values`;
    /// `None` unless all are finite and as [`Family::needs`] says. A standard deviation of zero gives a constant.
    #[must_use]
    pub fn new(family: Family, parameters: &[f64], values: &'a [f64]) -> Option<Self> {
        if !parameters.iter().all(|parameter| parameter.is_finite()) {
            return None;
        }
        let distribution = match (family, parameters) {
            (Family::Normal | Family::Lognormal | Family::Gumbel, &[mean, 0.0])
                if family != Family::Lognormal || mean > 0.0 =>
            {
                Distribution::Normal { mean, sd: 0.0 }
            }
            (Family::Normal, &[mean, sd]) if sd > 0.0 => Distribution::Normal { mean, sd },
            (Family::Lognormal, &[mean, sd]) if mean > 0.0 && sd > 0.0 => {
                let variance = (sd / mean).powi(2).ln_1p();
                let location = mean.ln() - 0.5 * variance;
                Distribution::Lognormal(LogNormal::new(location, variance.sqrt()).ok()?)
            }
            (Family::Uniform, &[low, high]) => Distribution::Uniform(Uniform::new(low, high).ok()?),
            (Family::Triangular, &[low, mode, high]) => {
                Distribution::Triangular(Triangular::new(low, high, mode).ok()?)
            }
            (Family::Weibull, &[shape, scale]) => Distribution::Weibull {
                shape,
                scale,
                of: Weibull::new(shape, scale).ok()?,
            },
            (Family::Gumbel, &[mean, sd]) => {
                let scale = sd * 6.0_f64.sqrt() / std::f64::consts::PI;
                let of = Gumbel::new(mean - EULER * scale, scale).ok()?;
                Distribution::Gumbel { mean, of }
            }
            (Family::Beta, &[a, b, low, high]) if low < high => Distribution::Beta {
                ends: [low, high],
                shapes: [a, b],
                of: Beta::new(a, b).ok()?,
            },
            (Family::TruncatedNormal, &[mean, sd, low, high]) if low < high && sd > 0.0 => {
                let ends = [low, high];
                Distribution::Truncated { mean, sd, ends }
            }
            (Family::Table, _) => match values {
                // Numbers that are not finite are at the ends of sorted values.
                [first, .., last] if first.is_finite() && last.is_finite() => {
                    Distribution::Table(values)
                }
                _ => return None,
            },
            _ => return None,
        };
        Some(Self(distribution))
    }

    /// The value whose distribution function is Φ(z). Scores beyond ±8, where Φ(z) has no digits left, count as ±8.
    #[must_use]
    pub fn quantile(&self, z: f64) -> f64 {
        let standard = Normal::standard();
        let z = z.clamp(-8.0, 8.0);
        let u = standard.cdf(z);
        match &self.0 {
            Distribution::Normal { mean, sd } => mean + sd * z,
            Distribution::Lognormal(of) => of.inverse_cdf(u),
            Distribution::Uniform(of) => of.inverse_cdf(u),
            Distribution::Triangular(of) => of.inverse_cdf(u),
            Distribution::Weibull { of, .. } => of.inverse_cdf(u),
            Distribution::Gumbel { of, .. } => of.inverse_cdf(u),
            Distribution::Beta {
                ends: [low, high],
                of,
                ..
            } => low + (high - low) * of.inverse_cdf(u),
            Distribution::Truncated { mean, sd, ends } => {
                let standardised = ends.map(|end| (end - mean) / sd);
                (mean + sd * truncated_quantile(standardised, z)).clamp(ends[0], ends[1])
            }
            Distribution::Table(values) => {
                let place = (u * values.len() as f64) as usize;
                values[place.min(values.len() - 1)]
            }
        }
    }

    /// The mean.
    #[must_use]
    pub fn mean(&self) -> f64 {
        match &self.0 {
            Distribution::Normal { mean, .. } | Distribution::Gumbel { mean, .. } => *mean,
            Distribution::Lognormal(of) => of.mean().unwrap_or(f64::NAN),
            Distribution::Uniform(of) => of.mean().unwrap_or(f64::NAN),
            Distribution::Triangular(of) => of.mean().unwrap_or(f64::NAN),
            Distribution::Weibull { shape, scale, .. } => scale * gamma(1.0 + 1.0 / shape),
            Distribution::Beta {
                ends: [low, high],
                shapes: [a, b],
                ..
            } => low + (high - low) * a / (a + b),
            Distribution::Truncated { mean, sd, ends } => {
                mean + sd * truncated_mean(ends.map(|end| (end - mean) / sd))
            }
            Distribution::Table(values) => values.iter().sum::<f64>() / values.len() as f64,
        }
    }
}

/// Distance from the mean, in standard deviations, beyond which a tail of the normal distribution is replaced by an
/// exponential one. Their distances from the near end differ by about 2/30² of themselves.
const TAIL: f64 = 30.0;

/// The value at the score `z` of a standard normal variable that lies between the `ends`.
fn truncated_quantile([low, high]: [f64; 2], z: f64) -> f64 {
    if low > 0.0 {
        // Only the lower tail has digits left far from the mean.
        return -truncated_quantile([-high, -low], -z);
    }
    let standard = Normal::standard();
    if high < -TAIL {
        let covered = -f64::exp_m1(high * (high - low));
        return high - f64::ln_1p(-standard.cdf(-z) * covered) / high;
    }
    let [low, high] = [low, high].map(|end| standard.cdf(end));
    standard.inverse_cdf(low + (high - low) * standard.cdf(z))
}

/// The mean of a standard normal variable that lies between the `ends`.
fn truncated_mean([low, high]: [f64; 2]) -> f64 {
    if low > 0.0 {
        return -truncated_mean([-high, -low]);
    }
    if high < -TAIL {
        let decay = high * (high - low);
        return high + 1.0 / high - (high - low) * f64::exp(decay) / f64::exp_m1(decay);
    }
    let standard = Normal::standard();
    let share = standard.cdf(high) - standard.cdf(low);
    if share > 0.0 {
        ((standard.pdf(low) - standard.pdf(high)) / share).clamp(low, high)
    } else {
        // The ends are next to each other.
        0.5 * (low + high)
    }
}
