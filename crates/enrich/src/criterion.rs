//! The infill criteria: what a further observation is worth, in µm.

use statrs::distribution::{Continuous as _, ContinuousCDF as _, Normal};

/// A normal belief about the modelled quantity, and whether that is the logarithm of the response.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Belief {
    pub(crate) mean: f64,
    pub(crate) sd: f64,
    pub(crate) logarithm: bool,
}

fn cdf(u: f64) -> f64 {
    Normal::standard().cdf(u)
}

fn pdf(u: f64) -> f64 {
    Normal::standard().pdf(u)
}

impl Belief {
    /// E(T − Y)⁺ in µm for a threshold T given on the modelled scale: the expected improvement
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
        // Two nearly equal terms may leave a negative rest.
        value.max(0.0)
    }

    /// Expected quantile improvement: `lowest` is the lowest quantile among the designs, `noise` the
    /// variance of the observation to come, z the quantile's deviate. The quantile after the
    /// observation is normal with mean m + z √(τ²s²/(τ² + s²)) and variance s⁴/(τ² + s²).
    pub(crate) fn quantile_improvement(&self, lowest: f64, noise: f64, z: f64) -> f64 {
        let variance = self.sd * self.sd;
        let total = variance + noise;
        if total <= 0.0 || total.is_nan() {
            return 0.0;
        }
        Self {
            mean: self.mean + z * (noise * variance / total).sqrt(),
            sd: variance / total.sqrt(),
            ..*self
        }
        .expected_below(lowest)
    }

    /// The quantile with deviate z, in µm.
    pub(crate) fn quantile_um(&self, z: f64) -> f64 {
        let quantile = self.mean + z * self.sd;
        if self.logarithm {
            quantile.exp()
        } else {
            quantile
        }
    }
}

/// The knowledge gradient min(a) − E min(a + bZ) ≥ 0 with Z standard normal: means `a` of the
/// candidates and their changes `b` by one standard deviation of the observation.
///
/// The minimum over the lines aᵢ + bᵢ z is concave and piecewise linear; between neighbouring lines
/// of its lower envelope, at z = c, the slope changes by Δb, and each such corner adds
/// |Δb| (φ(c) − |c| Φ(−|c|)) (Frazier et al., section 3).
pub(crate) fn knowledge_gradient(lines: &[(f64, f64)]) -> f64 {
    let mut lines = lines.to_vec();
    // By falling slope, as the lower envelope meets them from left to right; of equal slopes the
    // lowest.
    lines.sort_by(|p, q| q.1.total_cmp(&p.1).then(p.0.total_cmp(&q.0)));
    lines.dedup_by(|later, earlier| later.1 == earlier.1);
    let crossing = |p: (f64, f64), q: (f64, f64)| (q.0 - p.0) / (p.1 - q.1);
    let mut envelope: Vec<(f64, f64)> = Vec::new();
    let mut corners: Vec<f64> = Vec::new();
    for line in lines {
        while let Some(&last) = envelope.last() {
            let corner = crossing(last, line);
            if corners.last().is_some_and(|&before| corner <= before) {
                envelope.pop();
                corners.pop();
            } else {
                corners.push(corner);
                break;
            }
        }
        envelope.push(line);
    }
    corners
        .iter()
        .zip(envelope.windows(2))
        .map(|(corner, pair)| {
            let c = corner.abs();
            (pair[0].1 - pair[1].1) * (pdf(c) - c * cdf(-c)).max(0.0)
        })
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn belief(mean: f64, sd: f64, logarithm: bool) -> Belief {
        Belief {
            mean,
            sd,
            logarithm,
        }
    }

    /// Midpoint rule over ±9 standard deviations.
    fn expectation(f: impl Fn(f64) -> f64) -> f64 {
        let steps = 200_000;
        let width = 18.0 / f64::from(steps);
        (0..steps)
            .map(|i| {
                let z = -9.0 + (f64::from(i) + 0.5) * width;
                f(z) * pdf(z) * width
            })
            .sum()
    }

    #[test]
    fn expected_improvements_are_their_integrals() {
        for (mean, sd, threshold) in [(0.3, 0.5, 0.2), (1.0, 0.1, 0.7), (-0.2, 1.0, 0.5)] {
            for logarithm in [false, true] {
                let scale = |v: f64| if logarithm { v.exp() } else { v };
                let integral = expectation(|z| (scale(threshold) - scale(mean + sd * z)).max(0.0));
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
        assert_eq!(
            belief(1.0, 0.0, false).quantile_improvement(1.5, 0.0, 1.0),
            0.0
        );
    }

    /// Without noise the quantile after the observation is the observation itself.
    #[test]
    fn quantile_improvement_without_noise_is_expected_improvement() {
        let b = belief(0.4, 0.3, false);
        assert!((b.quantile_improvement(0.5, 0.0, 1.28) - b.expected_below(0.5)).abs() < 1e-15);
        // And with noise beyond all bounds nothing is learned.
        assert!(b.quantile_improvement(0.3, 1e12, 1.28) < 1e-6);
    }

    #[test]
    fn the_knowledge_gradient_is_its_integral() {
        for lines in [
            vec![(0.0, 0.0), (0.1, 0.5)],
            vec![(0.0, 0.2), (0.1, 0.5), (0.05, -0.3), (2.0, 0.1), (0.3, 0.5)],
            vec![(0.2, 0.4), (0.2, 0.4)],
        ] {
            let least = lines.iter().map(|l| l.0).fold(f64::INFINITY, f64::min);
            let integral = least
                - expectation(|z| {
                    let after = lines.iter().map(|(a, b)| a + b * z);
                    after.fold(f64::INFINITY, f64::min)
                });
            let formula = knowledge_gradient(&lines);
            assert!(formula >= 0.0);
            assert!((formula - integral).abs() < 1e-8, "{formula} {integral}");
        }
    }
}
