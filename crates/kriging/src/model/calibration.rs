//! Predicted variances that fit the leave-one-out residuals.

use statrs::distribution::{Binomial, DiscreteCDF as _};

use super::Model;
use super::loo::{Residual, Z_TWO_SIDED_90};

/// The fewest points whose residuals can calibrate a 90 % interval.
const FEWEST: usize = 10;
/// Bounds of the factor: beyond these the model, not its variance, is wrong.
const BOUNDS: (f64, f64) = (1e-2, 1e2);
/// Confidence, required of a factor below 1, that it is not due to chance.
const CONFIDENCE: f64 = 0.99;

/// The factor of the predicted variances that [`Model::calibrated`] describes; 1 for too few
/// residuals.
pub(crate) fn factor(residuals: &[Residual]) -> f64 {
    let n = residuals.len();
    if n < FEWEST {
        return 1.0;
    }
    let mut needed: Vec<f64> = residuals
        .iter()
        .map(|r| {
            let of_model = r.variance - r.noise;
            let excess = (r.residual / Z_TWO_SIDED_90).powi(2) - r.noise;
            if of_model > 0.0 {
                excess / of_model
            } else if excess > 0.0 {
                f64::INFINITY
            } else {
                0.0
            }
        })
        .collect();
    needed.sort_by(f64::total_cmp);
    // As for the coverage of a new observation in conformal prediction: ⌈0.9 (n + 1)⌉ of n.
    let rank = (9 * (n + 1)).div_ceil(10).min(n);
    let factor = needed[rank - 1].clamp(BOUNDS.0, BOUNDS.1);
    let upper = upper_rank(n).map_or(f64::INFINITY, |rank| needed[rank - 1]);
    if factor < 1.0 && upper >= 1.0 {
        1.0
    } else {
        factor
    }
}

/// The rank, from 1, of the order statistic of n values that is above their distribution's 90 %
/// quantile with [`CONFIDENCE`]; `None` for few values. The number of values below the quantile is
/// binomial, whatever the distribution (H. David, H. Nagaraja, "Order Statistics" (2003), section
/// 7.1).
fn upper_rank(n: usize) -> Option<usize> {
    let below = Binomial::new(0.9, n as u64).expect("0.9 is a probability");
    let rank = below.inverse_cdf(CONFIDENCE) as usize + 1;
    (rank <= n).then_some(rank)
}

impl Model {
    /// The model with its predicted variances multiplied by one factor c, such that 90 % of the
    /// leave-one-out residuals lie within their 90 % intervals: cᵢ = ((rᵢ/1.645)² − vᵢ)/(pᵢ − vᵢ) is
    /// the factor that observation i needs, r its residual, p its residual's variance and v its
    /// noise; c is the 90 % quantile of all cᵢ, kept within 0.01 to 100. Means do not change.
    ///
    /// A function that is rougher in some places than in others violates the assumption of a
    /// stationary process, and then the variance of maximum likelihood is too small in more than a
    /// tenth of the places. Intervals that are too wide by chance do less harm than intervals that
    /// are too narrow. So a factor below 1 is taken only if the 99 % upper confidence limit of the
    /// quantile, an order statistic whose rank follows from the binomial distribution, is below 1,
    /// too: never for fewer than 44 points, and seldom when the residuals are mostly noise. For a
    /// right model, a factor below 1 has a probability of one in a hundred.
    ///
    /// Models of fewer than 10 points are returned as they are. Costs the inverse of
    /// a factor, n³/6 multiplications.
    #[must_use]
    pub fn calibrated(mut self) -> Self {
        self.calibration = factor(&self.residuals_of_points().0);
        self
    }

    /// The factor of the predicted variances: 1 unless the model was [`Model::calibrated`].
    #[must_use]
    pub fn calibration(&self) -> f64 {
        self.calibration
    }
}

#[cfg(test)]
mod tests {
    use rand::RngExt as _;
    use stats::streams::{Purpose, StreamRng, stream};

    use super::*;

    fn normal(rng: &mut StreamRng) -> f64 {
        let radius = (-2.0 * (1.0 - rng.random::<f64>()).ln()).sqrt();
        radius * (std::f64::consts::TAU * rng.random::<f64>()).cos()
    }

    /// Factors of samples of n residuals whose true variance is `truth` times that of the model,
    /// to which as much noise is added as the model's own variance times `noise`.
    fn factors(n: usize, truth: f64, noise: f64) -> Vec<f64> {
        (0..400)
            .map(|sample| {
                let mut rng = stream(sample, Purpose::Test, n as u64, 7);
                let residuals: Vec<Residual> = (0..n)
                    .map(|_| Residual {
                        residual: (truth + noise).sqrt() * normal(&mut rng),
                        variance: 1.0 + noise,
                        noise,
                    })
                    .collect();
                factor(&residuals)
            })
            .collect()
    }

    #[test]
    fn ranks_are_those_of_the_binomial_distribution() {
        // 0.9⁴³ = 0.0108 and 0.9⁴⁴ = 0.0097: the largest of 44 values is the first limit there is.
        assert_eq!(upper_rank(43), None);
        assert_eq!(upper_rank(44), Some(44));
        // P(B ≥ 97) = 0.0078 and P(B ≥ 96) = 0.0237 for B ~ Bin(100, 0.9), from the sums by hand.
        assert_eq!(upper_rank(100), Some(97));
        // The normal approximation, 9000 + 2.326 · 30 + ½, to its own error.
        let rank = upper_rank(10_000).unwrap();
        assert!((9068..=9073).contains(&rank), "{rank}");
    }

    #[test]
    fn a_right_models_intervals_are_not_narrowed_by_chance() {
        for n in [10, 20, 43, 60, 300] {
            for noise in [0.0, 3.0] {
                let narrowed = factors(n, 1.0, noise).iter().filter(|c| **c < 1.0).count();
                // One in a hundred of 400 are 4, with a standard deviation of 2.
                assert!(narrowed <= 12, "{n} {noise}: {narrowed}");
            }
        }
        assert!(factors(43, 0.2, 0.0).iter().all(|c| *c >= 1.0));
    }

    #[test]
    fn intervals_that_are_truly_too_wide_or_narrow_are_mended() {
        let near = |truth: f64| {
            let good = |c: &&f64| (**c / truth - 1.0).abs() < 0.35;
            factors(300, truth, 0.0).iter().filter(good).count()
        };
        // The quantile of 300 squares has a relative standard deviation of 12 %.
        assert!(near(0.3) > 380, "{}", near(0.3));
        assert!(near(2.5) > 380, "{}", near(2.5));
    }
}
