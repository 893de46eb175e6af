//! A percentile and its confidence interval from order statistics, for any continuous distribution.
//!
//! With X₍₁₎ ≤ … ≤ X₍ₙ₎ the sorted samples and p the level, such as 0.9:
//!
//! - The percentile is definition 8 of Hyndman and Fan: X at the rank (n + 1/3) p + 1/3, interpolated
//!   linearly. Its median is nearly the true percentile for every distribution.
//! - A limit of the interval lies between two order statistics. The number of samples below the true percentile is
//!   binomial (n, p), so X₍ᵣ₎ exceeds it with the probability P(B ≤ r − 1), exactly. The limit is interpolated between
//!   X₍ᵣ₎ and X₍ᵣ₊₁₎ by Nyblom's method, so that each tail has half of the probability of a miss, not less. There is no
//!   interval if no order statistic lies far enough out.
//! - Two percentiles of samples that share their random numbers are compared by the method of variance
//!   estimates recovery (MOVER) of Zou and Donner, which combines the two intervals. The correlation of the
//!   two estimates comes from the samples that lie below both percentiles.
//!
//! Samples may be infinite: only their order counts.
//!
//! References: R. J. Hyndman, Y. Fan, "Sample quantiles in statistical packages", Amer. Statist. 50 (1996)
//! 361–365; J. Nyblom, "Note on interpolated order statistics", Statist. Probab. Lett. 14 (1992) 129–131;
//! G. Y. Zou, A. Donner, "Construction of confidence limits about effect measures: a general approach",
//! Statist. Med. 27 (2008) 1693–1702.

use statrs::distribution::{Binomial, DiscreteCDF as _};

use crate::Error;

/// A measure of samples, with an interval that assumes no distribution.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct IntervalEstimate {
    /// Number of samples.
    pub n: usize,
    /// The measure; all but a probability in the unit of the samples.
    pub value: f64,
    /// The confidence interval (low, high); `None` with too few samples for one.
    pub interval: Option<(f64, f64)>,
}

/// The percentile of `samples` at `level` and its two-sided interval at `confidence`, both between 0 and 1.
///
/// # Errors
///
/// [`Error::TooFewSamples`] without samples, [`Error::NonFinite`] for a sample that is not a number,
/// [`Error::OutOfRange`] unless `level` and `confidence` lie strictly between 0 and 1.
pub fn order_statistic(
    samples: &[f64],
    level: f64,
    confidence: f64,
) -> Result<IntervalEstimate, Error> {
    check(level, "level")?;
    check_samples(samples, confidence)?;
    let mut sorted = samples.to_vec();
    sorted.sort_by(f64::total_cmp);
    let tail = 0.5 * (1.0 - confidence);
    let limit = |chance| limit(&sorted, level, chance);
    Ok(IntervalEstimate {
        n: sorted.len(),
        value: at_rank(
            &sorted,
            (sorted.len() as f64 + 1.0 / 3.0) * level + 1.0 / 3.0,
        ),
        interval: limit(tail).zip(limit(1.0 - tail)),
    })
}

/// The fewest samples with which [`order_statistic`] has an interval: the probability that no sample lies below the
/// percentile, and that none lies above it, must each be at most (1 − `confidence`)/2. 36 for 90 % at a confidence of
/// 95 %.
#[must_use]
pub fn order_interval_min_samples(level: f64, confidence: f64) -> usize {
    let outer = level.max(1.0 - level);
    let needed = (0.5 * (1.0 - confidence)).ln() / outer.ln();
    (needed - 1e-9).ceil() as usize
}

/// The difference between the percentiles of `first` and `second` with its confidence interval. Samples of one
/// index must have the same random numbers; those beyond the shorter list are left out. `None` if one of the
/// percentiles has no interval.
///
/// # Errors
///
/// As [`order_statistic`].
pub fn paired_difference(
    first: &[f64],
    second: &[f64],
    level: f64,
    confidence: f64,
) -> Result<Option<IntervalEstimate>, Error> {
    let n = first.len().min(second.len());
    let (first, second) = (&first[..n], &second[..n]);
    let a = order_statistic(first, level, confidence)?;
    let b = order_statistic(second, level, confidence)?;
    let (Some(of_a), Some(of_b)) = (a.interval, b.interval) else {
        return Ok(None);
    };
    let value = a.value - b.value;
    if first.iter().zip(second).all(|(a, b)| a - b == value) {
        // One is the other plus a constant, and so are the percentiles.
        let interval = Some((value, value));
        return Ok(Some(IntervalEstimate { n, value, interval }));
    }
    let below = |samples: &[f64], value: f64| -> Vec<bool> {
        samples.iter().map(|sample| *sample <= value).collect()
    };
    let (below_a, below_b) = (below(first, a.value), below(second, b.value));
    let share = |count: usize| count as f64 / n as f64;
    let count = |below: &[bool]| share(below.iter().filter(|below| **below).count());
    let (of_first, of_second) = (count(&below_a), count(&below_b));
    let both = share(
        below_a
            .iter()
            .zip(&below_b)
            .filter(|(a, b)| **a && **b)
            .count(),
    );
    let spread = |share: f64| share * (1.0 - share);
    let product = (spread(of_first) * spread(of_second)).sqrt();
    let correlation = if product > 0.0 {
        ((both - of_first * of_second) / product).clamp(-1.0, 1.0)
    } else {
        0.0
    };
    if !value.is_finite() {
        // Apart from their order, infinite percentiles cannot be compared.
        let are_apart = of_a.0 > of_b.1 || of_b.0 > of_a.1;
        let interval = are_apart.then_some((value, value));
        return Ok(interval.map(|interval| IntervalEstimate {
            n,
            value,
            interval: Some(interval),
        }));
    }
    let half = |a: f64, b: f64| {
        if a.is_finite() && b.is_finite() {
            (a * a + b * b - 2.0 * correlation * a * b).max(0.0).sqrt()
        } else {
            f64::INFINITY
        }
    };
    let low = value - half(a.value - of_a.0, of_b.1 - b.value);
    let high = value + half(of_a.1 - a.value, b.value - of_b.0);
    Ok(Some(IntervalEstimate {
        n,
        value,
        interval: Some((low, high)),
    }))
}

/// The value that exceeds the true percentile at `level` with the probability `chance`; `None` if it lies
/// beyond all samples.
fn limit(sorted: &[f64], level: f64, chance: f64) -> Option<f64> {
    let n = sorted.len();
    let binomial = Binomial::new(level, n as u64).expect("the level was checked");
    // P(X₍ᵣ₎ > ξ) = P(B ≤ r − 1), which grows with r; `r` is the last rank with at most `chance`.
    let above = |r: usize| binomial.cdf(r as u64 - 1);
    let (mut r, mut beyond) = (0, n + 1);
    while beyond - r > 1 {
        let middle = r + (beyond - r) / 2;
        if above(middle) <= chance {
            r = middle;
        } else {
            beyond = middle;
        }
    }
    if r == 0 {
        return None;
    }
    if r == n {
        return (above(n) == chance).then(|| sorted[n - 1]);
    }
    let (at, next) = (above(r), above(r + 1));
    let odds =
        r as f64 * (1.0 - level) * (next - chance) / ((n - r) as f64 * level * (chance - at));
    Some(interpolate(sorted[r - 1], sorted[r], 1.0 / (1.0 + odds)))
}

/// The value at a rank from 1 on, interpolated linearly.
fn at_rank(sorted: &[f64], rank: f64) -> f64 {
    let rank = rank.clamp(1.0, sorted.len() as f64);
    let below = rank.floor() as usize;
    let above = (below + 1).min(sorted.len());
    interpolate(sorted[below - 1], sorted[above - 1], rank - rank.floor())
}

/// a + share (b − a); an infinite end between the two.
fn interpolate(a: f64, b: f64, share: f64) -> f64 {
    if share <= 0.0 || a == b || a.is_infinite() {
        return a;
    }
    if share >= 1.0 {
        return b;
    }
    a + share * (b - a)
}

/// The checks of samples that may be infinite, and of the confidence of their interval.
pub(crate) fn check_samples(samples: &[f64], confidence: f64) -> Result<(), Error> {
    check(confidence, "confidence")?;
    if samples.is_empty() {
        return Err(Error::TooFewSamples {
            statistic: "a measure",
            needed: 1,
            got: 0,
        });
    }
    if let Some(index) = samples.iter().position(|sample| sample.is_nan()) {
        return Err(Error::NonFinite {
            index,
            value: samples[index],
        });
    }
    Ok(())
}

pub(crate) fn check(value: f64, name: &'static str) -> Result<(), Error> {
    if value > 0.0 && value < 1.0 {
        return Ok(());
    }
    Err(Error::OutOfRange {
        name,
        value,
        expected: "strictly between 0 and 1",
    })
}
