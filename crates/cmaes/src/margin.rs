//! The margin of discrete variables: a lower bound on the probability that a candidate has another value than the mean.
//!
//! The caller rounds a discrete variable with k values: its unit interval has k equal cells. When the distribution
//! becomes narrower than a cell, all candidates are rounded to one value, and the search can learn nothing more about
//! the variable. The margin moves the mean, and stretches the distribution along the variable, so that each
//! neighbouring cell keeps at least the probability α/2, or α for the only neighbour of a cell at an end. α = 1/(λ d).
//!
//! Reference: R. Hamano, S. Saito, M. Nomura, S. Shirakawa, "CMA-ES with margin: lower-bounding marginal probability
//! for mixed-integer black-box optimization", GECCO 2022, 639–647, sections 4.2 and 4.3.

use nalgebra::DVector;
use statrs::distribution::{ContinuousCDF as _, Normal};

/// Corrects the `mean` and the `stretch` of the distribution along its axes after an update. `cells` has the number of
/// cells of each variable, 0 for a continuous one; `deviations` are the standard deviations without the stretch.
pub(crate) fn keep(
    cells: &[usize],
    population: usize,
    deviations: impl Fn(usize) -> f64,
    mean: &mut DVector<f64>,
    stretch: &mut DVector<f64>,
) {
    let alpha = 1.0 / (population * mean.len()) as f64;
    for (i, &count) in cells.iter().enumerate() {
        let plain = deviations(i);
        // The covariance is degenerate, which ends the search.
        if count < 2 || !(plain > 0.0 && plain.is_finite()) {
            continue;
        }
        let (m, sd) = (mean[i], plain * stretch[i]);
        let cell = ((m * count as f64) as usize).min(count - 1);
        let edge = |number: usize| number as f64 / count as f64;
        let (low, high) = (edge(cell), edge(cell + 1));
        if cell == 0 {
            mean[i] = m.max(high - reach(alpha) * sd);
        } else if cell + 1 == count {
            mean[i] = m.min(low + reach(alpha) * sd);
        } else {
            let (moved, deviation) = between(alpha, [low, high], m, sd);
            mean[i] = moved;
            stretch[i] = deviation / plain;
        }
        mean[i] = mean[i].clamp(0.0, 1.0);
    }
}

/// The distance, in standard deviations, beyond which the probability is `tail`.
fn reach(tail: f64) -> f64 {
    -Normal::standard().inverse_cdf(tail)
}

/// Mean and standard deviation with which both neighbours of a cell have at least the probability `alpha`/2.
fn between(alpha: f64, [low, high]: [f64; 2], m: f64, sd: f64) -> (f64, f64) {
    let standard = Normal::standard();
    let (below, above) = (standard.cdf((low - m) / sd), standard.cdf((m - high) / sd));
    let inside = 1.0 - below - above;
    let least = 0.5 * alpha;
    if below >= least && above >= least {
        return (m, sd);
    }
    let (raised_below, raised_above) = (below.max(least), above.max(least));
    // All three probabilities are reduced in proportion to their excess over the least, until they sum to 1.
    let sum = raised_below + raised_above + inside;
    let excess = (1.0 - sum) / (sum - 3.0 * least);
    let settled = |raised: f64| raised + excess * (raised - least);
    let (to_low, to_high) = (reach(settled(raised_below)), reach(settled(raised_above)));
    let width = to_low + to_high;
    (
        (low * to_high + high * to_low) / width,
        (high - low) / width,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbouring_values_keep_their_probability() {
        let standard = Normal::standard();
        let (population, n) = (10, 3);
        let alpha = 1.0 / (population * n) as f64;
        // In the middle of a cell, near its edge, and at both ends; 20 values, 5, 2.
        for (count, at) in [
            (20, 0.525),
            (20, 0.549),
            (5, 0.41),
            (5, 0.05),
            (5, 0.99),
            (2, 0.3),
        ] {
            let mut mean = DVector::from_vec(vec![0.5, at, 0.5]);
            let mut stretch = DVector::from_element(n, 1.0);
            let sd = 1e-6;
            keep(&[0, count, 0], population, |_| sd, &mut mean, &mut stretch);
            assert_eq!((mean[0], stretch[0]), (0.5, 1.0));
            let (m, wide) = (mean[1], sd * stretch[1]);
            let cell = (at * count as f64) as usize;
            assert_eq!((m * count as f64) as usize, cell, "{at} moved to {m}");
            let edge = |number: usize| number as f64 / count as f64;
            let below = standard.cdf((edge(cell) - m) / wide);
            let above = standard.cdf((m - edge(cell + 1)) / wide);
            let least = 0.5 * alpha * (1.0 - 1e-6);
            match (cell, cell + 1 == count) {
                (0, _) => assert!(above >= 2.0 * least, "{count} {at}: {above}"),
                (_, true) => assert!(below >= 2.0 * least, "{count} {at}: {below}"),
                _ => assert!(
                    below >= least && above >= least,
                    "{count} {at}: {below} {above}"
                ),
            }
        }
        // A wide distribution is not changed.
        let mut mean = DVector::from_vec(vec![0.41]);
        let mut stretch = DVector::from_element(1, 1.0);
        keep(&[5], 10, |_| 0.3, &mut mean, &mut stretch);
        assert_eq!((mean[0], stretch[0]), (0.41, 1.0));
    }
}
