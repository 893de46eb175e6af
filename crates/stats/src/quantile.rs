//! A percentile of a sample that is not normal, from its order statistics.
//!
//! With X₍₁₎ ≤ … ≤ X₍ₙ₎ the sorted sample and p the level, such as 0.9:
//!
//! - [`harrell_davis_p90`] is the bootstrap mean of X₍(n+1) p₎: a weighted sum of all order
//!   statistics, X₍ⱼ₎ with the weight Iⱼ⸝ₙ − I₍ⱼ₋₁₎⸝ₙ, I the regularised incomplete beta function with
//!   the parameters p (n + 1) and (1 − p)(n + 1). Its variance is the jackknife's
//!   (F. E. Harrell, C. E. Davis, "A new distribution-free quantile estimator", Biometrika 69
//!   (1982) 635–640), or by [`HarrellDavisVariance`] the exact bootstrap variance.

use statrs::function::beta::beta_reg;

use crate::moments::check_finite;
use crate::{Error, bootstrap};

/// The fewest samples for a percentile at `level`: 10 for 90 %, since with fewer the percentile
/// lies beyond the largest sample.
#[must_use]
pub fn harrell_davis_min_samples(level: f64) -> usize {
    let tail = level.max(1.0 - level);
    // 1/(1 − 0.9) is just above 10.
    ((1.0 / (1.0 - tail) - 1e-9).ceil() as usize).max(3)
}

/// The estimator of a measure.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Method {
    /// Assumes a normal response: [`Measure::of_normal`](crate::Measure::of_normal).
    Normal,
    /// Assumes no distribution: [`Measure::distribution_free`](crate::Measure::distribution_free) weights all order
    /// statistics for a percentile, and averages the scores of any other measure.
    DistributionFree,
}

/// An estimate of a measure and its variance, by either estimator.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// The estimator.
    pub method: Method,
    /// Number of samples.
    pub n: usize,
    /// The measure; all but a probability in the unit of the samples.
    pub value: f64,
    /// Estimated variance of `value`, in its unit squared.
    pub variance: f64,
}

/// The formula for the variance of Harrell and Davis's estimator.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum HarrellDavisVariance {
    /// The jackknife variance, from the estimates that leave one sample out, as Harrell and Davis
    /// propose.
    #[default]
    Jackknife,
    /// The exact bootstrap variance: [`crate::exact_bootstrap_variance`].
    Bootstrap,
}

/// Harrell and Davis's estimator of the 90th percentile with its jackknife variance.
///
/// # Errors
///
/// [`Error::TooFewSamples`] below [`harrell_davis_min_samples`], [`Error::NonFinite`],
/// [`Error::Overflow`].
pub fn harrell_davis_p90(samples: &[f64]) -> Result<Estimate, Error> {
    harrell_davis(samples, 0.9, HarrellDavisVariance::Jackknife)
}

/// Harrell and Davis's estimator of the percentile at `level`, with the named variance.
///
/// # Errors
///
/// As [`harrell_davis_p90`].
pub fn harrell_davis(
    samples: &[f64],
    level: f64,
    variance: HarrellDavisVariance,
) -> Result<Estimate, Error> {
    let sorted = sorted(samples, level, "the Harrell–Davis percentile")?;
    let n = sorted.len();
    let weights = harrell_davis_weights(n, level);
    let base = sorted[0];
    let value = base + weighted_sum(&weights, sorted.iter(), base);
    let variance = match variance {
        HarrellDavisVariance::Jackknife => jackknife(&sorted, level),
        HarrellDavisVariance::Bootstrap => bootstrap::variance_of_sorted(&sorted, &weights),
    };
    finite(Estimate {
        method: Method::DistributionFree,
        n,
        value,
        variance,
    })
}

/// The jackknife variance of Harrell and Davis's estimator.
fn jackknife(sorted: &[f64], level: f64) -> f64 {
    let n = sorted.len();
    let fewer = harrell_davis_weights(n - 1, level);
    let above_base = |i: usize| sorted[i] - sorted[0];
    // Without the i-th sample, those before it keep their ranks and those after it lose one.
    let mut left_out = vec![0.0; n];
    let (mut before, mut after) = (0.0, 0.0);
    for i in 1..n {
        before += fewer[i - 1] * above_base(i - 1);
        left_out[i] += before;
        let from_end = n - 1 - i;
        after += fewer[from_end] * above_base(from_end + 1);
        left_out[from_end] += after;
    }
    let mean = left_out.iter().sum::<f64>() / n as f64;
    let squares: f64 = left_out.iter().map(|v| (v - mean).powi(2)).sum();
    (n - 1) as f64 / n as f64 * squares
}

fn weighted_sum<'a>(weights: &[f64], values: impl Iterator<Item = &'a f64>, base: f64) -> f64 {
    let terms = weights.iter().zip(values);
    terms.map(|(w, x)| w * (x - base)).sum()
}

fn harrell_davis_weights(n: usize, level: f64) -> Vec<f64> {
    let next = (n + 1) as f64;
    beta_weights(n, level * next, (1.0 - level) * next)
}

/// Iⱼ⸝ₙ(a, b) − I₍ⱼ₋₁₎⸝ₙ(a, b) for j = 1 … n.
fn beta_weights(n: usize, a: f64, b: f64) -> Vec<f64> {
    let cumulative: Vec<f64> = (0..=n)
        .map(|j| beta_reg(a, b, j as f64 / n as f64))
        .collect();
    cumulative
        .windows(2)
        .map(|pair| pair[1] - pair[0])
        .collect()
}

fn sorted(samples: &[f64], level: f64, statistic: &'static str) -> Result<Vec<f64>, Error> {
    let needed = harrell_davis_min_samples(level);
    if samples.len() < needed {
        return Err(Error::TooFewSamples {
            statistic,
            needed,
            got: samples.len(),
        });
    }
    check_finite(samples)?;
    let mut sorted = samples.to_vec();
    sorted.sort_by(f64::total_cmp);
    Ok(sorted)
}

fn finite(estimate: Estimate) -> Result<Estimate, Error> {
    if estimate.value.is_finite() && estimate.variance.is_finite() {
        Ok(estimate)
    } else {
        Err(Error::Overflow { n: estimate.n })
    }
}
