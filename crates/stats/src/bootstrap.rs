//! The exact bootstrap variance of a weighted sum of order statistics.
//!
//! Resampling n values with replacement makes each of nⁿ new samples equally likely. This module
//! computes the variance of T = Σ cᵣ Y₍ᵣ₎ over all of them, Y₍ᵣ₎ the order statistics of a new
//! sample, without drawing any. Hutson and Ernst write the means and covariances of the Y₍ᵣ₎ as
//! weighted sums of the values, with incomplete beta integrals as weights. Their double sums over
//! all pairs of ranks and of values cost n⁴ steps. The form below gives the same number in fewer
//! steps.
//!
//! Let Nⱼ be the number of drawn values that are at most X₍ⱼ₎, the j-th smallest value, and
//! C(m) = c₁ + … + cₘ. Then T = X₍₁₎ C(n) + Σⱼ (X₍ⱼ₊₁₎ − X₍ⱼ₎) (C(n) − C(Nⱼ)). The Nⱼ are
//! binomial (n, j/n), which is the source of the incomplete beta function in the marginal weights.
//! They are a Markov chain: given Nⱼ = a, Nⱼ₊₁ − a is binomial (n − a, 1/(n − j)). The variance is
//! therefore a sum over j of products of C(Nⱼ) with the expectation of the later terms given Nⱼ,
//! which a recursion computes from the last term to the first. Probabilities below 10⁻²⁰ are left
//! out, so that n values take about n^{3/2} times some hundred steps.
//!
//! Reference: A. D. Hutson, M. D. Ernst, "The exact bootstrap mean and variance of an L-estimator",
//! J. R. Statist. Soc. B 62 (2000) 89–94.

use statrs::function::gamma::ln_gamma;

use crate::Error;
use crate::moments::check_finite;

/// A probability that changes no digit of the sum.
const NEGLIGIBLE: f64 = 1e-20;

/// The variance of Σ `weights[r]` Y₍ᵣ₊₁₎ in the unit of the samples squared, with Y the order
/// statistics of n values drawn with replacement from the n `samples`. It is the limit of a bootstrap
/// with infinitely many replications.
///
/// # Errors
///
/// [`Error::TooFewSamples`] below two samples, [`Error::NonFinite`] for a sample, [`Error::OutOfRange`] unless there is
/// one finite weight per sample, [`Error::Overflow`].
pub fn exact_bootstrap_variance(samples: &[f64], weights: &[f64]) -> Result<f64, Error> {
    let n = samples.len();
    if n < 2 {
        return Err(Error::TooFewSamples {
            statistic: "a bootstrap variance",
            needed: 2,
            got: n,
        });
    }
    check_finite(samples)?;
    if weights.len() != n {
        return Err(Error::OutOfRange {
            name: "number of weights",
            value: weights.len() as f64,
            expected: "that of the samples",
        });
    }
    if let Some(&value) = weights.iter().find(|weight| !weight.is_finite()) {
        return Err(Error::OutOfRange {
            name: "weight",
            value,
            expected: "finite",
        });
    }
    let mut sorted = samples.to_vec();
    sorted.sort_by(f64::total_cmp);
    let variance = variance_of_sorted(&sorted, weights);
    if variance.is_finite() {
        Ok(variance)
    } else {
        Err(Error::Overflow { n })
    }
}

/// [`exact_bootstrap_variance`] of at least two finite values in ascending order.
pub(crate) fn variance_of_sorted(sorted: &[f64], weights: &[f64]) -> f64 {
    let n = sorted.len();
    let mut cumulative = vec![0.0; n + 1];
    for (r, weight) in weights.iter().enumerate() {
        cumulative[r + 1] = cumulative[r] + weight;
    }
    let mut variance = 0.0;
    // E(terms after the j-th | Nⱼ = a), for the counts a from `first` on.
    let mut rest: Vec<f64> = vec![0.0];
    let mut rest_first = n;
    for j in (1..n).rev() {
        let (first, chances) = binomial(n, j as f64 / n as f64);
        let mean: f64 = (first..)
            .zip(&chances)
            .map(|(a, chance)| chance * cumulative[a])
            .sum();
        let gap = sorted[j] - sorted[j - 1];
        let term = |a: usize| gap * (cumulative[a] - mean);
        // E(terms after the j-th | Nⱼ₊₁ = a). A count `a` that was left out is next to impossible,
        // and the nearest kept count stands in for it.
        let rest_at = |a: usize| {
            let place = a.saturating_sub(rest_first).min(rest.len() - 1);
            rest[place]
        };
        let ahead: Vec<f64> = (first..first + chances.len())
            .map(|a| {
                let (from, steps) = binomial(n - a, 1.0 / (n - j) as f64);
                let steps = (a + from..).zip(&steps);
                steps.map(|(b, chance)| chance * rest_at(b)).sum()
            })
            .collect();
        for ((a, chance), ahead) in (first..).zip(&chances).zip(&ahead) {
            variance += chance * term(a) * (term(a) + 2.0 * ahead);
        }
        rest = (first..)
            .zip(&ahead)
            .map(|(a, ahead)| term(a) + ahead)
            .collect();
        rest_first = first;
    }
    // Rounding can take the sum just below zero.
    variance.max(0.0)
}

/// Returns the first value kept of a binomial distribution of `n` trials, and the probabilities
/// from that value on. The tails with probabilities below [`NEGLIGIBLE`] are left out.
fn binomial(n: usize, p: f64) -> (usize, Vec<f64>) {
    if n == 0 {
        return (0, vec![1.0]);
    }
    if p >= 1.0 {
        return (n, vec![1.0]);
    }
    let odds = p / (1.0 - p);
    let mode = (((n + 1) as f64 * p) as usize).min(n);
    let (count, at) = (n as f64, mode as f64);
    let ln_peak = ln_gamma(count + 1.0) - ln_gamma(at + 1.0) - ln_gamma(count - at + 1.0)
        + at * p.ln()
        + (count - at) * (-p).ln_1p();
    let peak = ln_peak.exp();
    let mut below = Vec::new();
    let (mut value, mut chance) = (mode, peak);
    while value > 0 && chance > NEGLIGIBLE {
        chance *= value as f64 / ((n - value + 1) as f64 * odds);
        value -= 1;
        below.push(chance);
    }
    let mut chances: Vec<f64> = below.iter().rev().copied().collect();
    chances.push(peak);
    let (mut above, mut chance) = (mode, peak);
    while above < n && chance > NEGLIGIBLE {
        chance *= (n - above) as f64 * odds / (above + 1) as f64;
        above += 1;
        chances.push(chance);
    }
    // The logarithms leave a common relative error of some 10⁻¹⁴, which dividing by the sum
    // removes.
    let sum: f64 = chances.iter().sum();
    chances.iter_mut().for_each(|chance| *chance /= sum);
    (value, chances)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The variance by enumeration of all nⁿ resamples.
    fn enumerated(samples: &[f64], weights: &[f64]) -> f64 {
        let n = samples.len();
        let all = n.pow(n as u32);
        let (mut sum, mut squares) = (0.0, 0.0);
        for which in 0..all {
            let mut rest = which;
            let mut drawn: Vec<f64> = (0..n)
                .map(|_| {
                    let value = samples[rest % n];
                    rest /= n;
                    value
                })
                .collect();
            drawn.sort_by(f64::total_cmp);
            let value: f64 = drawn.iter().zip(weights).map(|(x, w)| x * w).sum();
            sum += value;
            squares += value * value;
        }
        let mean = sum / all as f64;
        squares / all as f64 - mean * mean
    }

    #[test]
    fn the_variance_is_that_over_all_resamples() {
        let samples = [0.3, -1.2, 4.0, 0.9, 0.3, 2.2];
        for weights in [
            [1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            [0.0, 0.0, 0.0, 0.0, 1.0, 0.0],
            [0.1, 0.1, 0.2, 0.2, 0.3, 0.1],
            [2.0, -1.0, 0.0, 0.5, 0.0, -3.0],
        ] {
            let expected = enumerated(&samples, &weights);
            let found = exact_bootstrap_variance(&samples, &weights).unwrap();
            // The plain sums over 46 656 resamples leave some 1e-12 of rounding.
            assert!(
                (found - expected).abs() < 1e-10 * expected,
                "{weights:?}: {found} against {expected}"
            );
        }
        for n in 2..6 {
            let weights = vec![1.0 / n as f64; n];
            let found = exact_bootstrap_variance(&samples[..n], &weights).unwrap();
            assert!((found - enumerated(&samples[..n], &weights)).abs() < 1e-13);
        }
    }

    /// The bootstrap variance of a mean is Σ(x − m)²/n² for every n.
    #[test]
    fn the_mean_has_its_known_variance() {
        for n in [50, 300, 3000] {
            let samples: Vec<f64> = (0..n).map(|i| (f64::from(i) * 0.7).sin() + 1e3).collect();
            let count = f64::from(n);
            let weights = vec![1.0 / count; n as usize];
            let mean = samples.iter().sum::<f64>() / count;
            let squares: f64 = samples.iter().map(|x| (x - mean).powi(2)).sum();
            let expected = squares / count / count;
            let found = exact_bootstrap_variance(&samples, &weights).unwrap();
            assert!(
                (found / expected - 1.0).abs() < 1e-10,
                "{n}: {found} against {expected}"
            );
        }
    }

    #[test]
    fn what_cannot_be_resampled_is_refused() {
        let refused = |samples: &[f64], weights: &[f64]| {
            exact_bootstrap_variance(samples, weights)
                .unwrap_err()
                .to_string()
        };
        assert!(refused(&[1.0], &[1.0]).contains("bootstrap"));
        assert!(refused(&[1.0, f64::NAN], &[0.5, 0.5]).contains("NaN"));
        assert!(refused(&[1.0, 2.0], &[1.0]).contains("number of weights"));
        assert!(refused(&[1.0, 2.0], &[1.0, f64::INFINITY]).contains("weight"));
        assert_eq!(exact_bootstrap_variance(&[7.0; 40], &[0.1; 40]), Ok(0.0));
    }
}
