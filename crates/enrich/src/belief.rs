//! A normal belief about the response at one design, before and after a further observation.

use statrs::distribution::{Continuous as _, ContinuousCDF as _, Normal};

/// Distribution function of the standard normal distribution.
pub(crate) fn cdf(u: f64) -> f64 {
    Normal::standard().cdf(u)
}

/// Density of the standard normal distribution.
pub(crate) fn pdf(u: f64) -> f64 {
    Normal::standard().pdf(u)
}

/// A normal distribution of the modelled quantity, which is the response in µm or its logarithm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Belief {
    pub(crate) mean: f64,
    pub(crate) sd: f64,
    pub(crate) logarithm: bool,
}

impl Belief {
    /// E(T − Y)⁺ in µm for a threshold T on the modelled scale: the expected improvement
    /// (t − m) Φ(u) + s φ(u) with u = (t − m)/s, and for a logarithm
    /// eᵗ Φ(u) − e^(m + s²/2) Φ(u − s).
    pub(crate) fn expected_below(&self, threshold: f64) -> f64 {
        let Self {
            mean,
            sd,
            logarithm,
        } = *self;
        if sd <= 0.0 || sd.is_nan() {
            let (t, m) = if logarithm {
                (threshold.exp(), mean.exp())
            } else {
                (threshold, mean)
            };
            return (t - m).max(0.0);
        }
        let u = (threshold - mean) / sd;
        let value = if logarithm {
            threshold.exp() * cdf(u) - (mean + 0.5 * sd * sd).exp() * cdf(u - sd)
        } else {
            (threshold - mean) * cdf(u) + sd * pdf(u)
        };
        // The difference of two nearly equal terms may be slightly negative.
        value.max(0.0)
    }

    /// The distribution of the mean after an observation with the variance `noise`: normal around
    /// the current mean with the standard deviation s²/√(s² + τ²). `None` if s² + τ² is not
    /// positive.
    pub(crate) fn next_mean(&self, noise: f64) -> Option<Self> {
        let variance = self.sd * self.sd;
        let total = variance + noise;
        (total > 0.0).then(|| Self {
            sd: variance / total.sqrt(),
            ..*self
        })
    }

    /// The quantile with deviate `z` on the modelled scale.
    pub(crate) fn quantile(&self, z: f64) -> f64 {
        self.mean + z * self.sd
    }

    /// The quantile with deviate `z`, in the unit of the response.
    pub(crate) fn response_quantile(&self, z: f64) -> f64 {
        let quantile = self.quantile(z);
        if self.logarithm {
            quantile.exp()
        } else {
            quantile
        }
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// E f(Z) for a standard normal Z, by the midpoint rule over ±9 standard deviations.
    pub(crate) fn expectation(steps: u32, f: impl Fn(f64) -> f64) -> f64 {
        let width = 18.0 / f64::from(steps);
        (0..steps)
            .map(|i| {
                let z = -9.0 + (f64::from(i) + 0.5) * width;
                f(z) * pdf(z) * width
            })
            .sum()
    }

    fn belief(mean: f64, sd: f64, logarithm: bool) -> Belief {
        Belief {
            mean,
            sd,
            logarithm,
        }
    }

    #[test]
    fn expected_improvements_are_their_integrals() {
        for (mean, sd, threshold) in [(0.3, 0.5, 0.2), (1.0, 0.1, 0.7), (-0.2, 1.0, 0.5)] {
            for logarithm in [false, true] {
                let scale = |v: f64| if logarithm { v.exp() } else { v };
                let integral = expectation(200_000, |z| {
                    (scale(threshold) - scale(mean + sd * z)).max(0.0)
                });
                let formula = belief(mean, sd, logarithm).expected_below(threshold);
                // The midpoint rule's error at the kink.
                assert!((formula - integral).abs() < 1e-8, "{formula} {integral}");
            }
        }
    }

    #[test]
    fn a_certain_belief_improves_by_its_distance() {
        assert_eq!(belief(1.0, 0.0, false).expected_below(1.5), 0.5);
        assert_eq!(belief(2.0, 0.0, false).expected_below(1.5), 0.0);
        assert_eq!(belief(1.0, 0.0, false).next_mean(0.0), None);
    }
}
