//! The strategy parameters: weights and learning rates (the tutorial's table 1).

use crate::Options;

/// Constants of a search, derived from d, λ, µ and [`Options::active`].
#[derive(Debug, Clone)]
pub(crate) struct Parameters {
    /// One weight per rank, best first; the first µ are positive and sum to one.
    pub(crate) weights: Vec<f64>,
    /// The variance-effective selection mass µ_eff = 1/Σwᵢ² of the positive weights.
    pub(crate) mu_eff: f64,
    /// Learning rate of the step-size path.
    pub(crate) c_sigma: f64,
    /// Damping of the step size.
    pub(crate) d_sigma: f64,
    /// Learning rate of the covariance path.
    pub(crate) c_c: f64,
    /// Learning rate of the rank-one update.
    pub(crate) c_1: f64,
    /// Learning rate of the rank-µ update.
    pub(crate) c_mu: f64,
    /// E‖N(0, I)‖.
    pub(crate) chi: f64,
    /// Generations between two eigen-decompositions: 1/(d (c_1 + c_µ)), ten times as many as in
    /// section B.2. On no test function does this change the evaluations needed by more than 1 %.
    pub(crate) decompose_every: usize,
}

impl Parameters {
    pub(crate) fn new(options: &Options) -> Self {
        let n = options.bounds.dimension() as f64;
        let mu = options.parents;

        // Logarithmic weights, eq. (49), with µ + ½ in place of the tutorial's (λ + 1)/2: the same
        // for µ = λ/2, and a zero crossing after the µ-th rank for any other µ.
        let raw: Vec<f64> = (1..=options.population)
            .map(|rank| (mu as f64 + 0.5).ln() - (rank as f64).ln())
            .collect();
        let (positive, negative) = raw.split_at(mu);
        let mass = |w: &[f64]| {
            let sum: f64 = w.iter().sum();
            sum * sum / w.iter().map(|v| v * v).sum::<f64>()
        };
        let mu_eff = mass(positive);

        // (55) has n + µ_eff + 5; the authors' own implementation (pycma) has 3, which is a little
        // faster on all test functions.
        let c_sigma = (mu_eff + 2.0) / (n + mu_eff + 3.0);
        let d_sigma = 1.0 + 2.0 * (((mu_eff - 1.0) / (n + 1.0)).sqrt() - 1.0).max(0.0) + c_sigma;
        let c_c = (4.0 + mu_eff / n) / (n + 4.0 + 2.0 * mu_eff / n); // (56)
        let c_1 = 2.0 / ((n + 1.3) * (n + 1.3) + mu_eff); // (57)
        let rank_mu = 2.0 * (0.25 + mu_eff + 1.0 / mu_eff - 2.0) / ((n + 2.0) * (n + 2.0) + mu_eff);
        let c_mu = rank_mu.min(1.0 - c_1); // (58)

        let positive_sum: f64 = positive.iter().sum();
        let mut weights: Vec<f64> = positive.iter().map(|w| w / positive_sum).collect();
        // The negative weights act through the rank-µ update only.
        if options.active && !negative.is_empty() && c_mu > 0.0 {
            let keep_sum = 1.0 + c_1 / c_mu; // (50)
            let by_mass = 1.0 + 2.0 * mass(negative) / (mu_eff + 2.0); // (51)
            let keep_definite = (1.0 - c_1 - c_mu) / (n * c_mu); // (52)
            let scale = keep_sum.min(by_mass).min(keep_definite).max(0.0)
                / negative.iter().map(|w| w.abs()).sum::<f64>();
            weights.extend(negative.iter().map(|w| w * scale)); // (53)
        } else {
            weights.resize(options.population, 0.0);
        }

        let every = (1.0 / (n * (c_1 + c_mu))).floor().max(1.0);
        Self {
            weights,
            mu_eff,
            c_sigma,
            d_sigma,
            c_c,
            c_1,
            c_mu,
            chi: n.sqrt() * (1.0 - 1.0 / (4.0 * n) + 1.0 / (21.0 * n * n)),
            // c_1 ≥ 2/((n + 1.3)² + µ_eff), so the quotient stays far below usize::MAX.
            decompose_every: every as usize,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Bounds;

    fn parameters(dimension: usize, population: usize, parents: usize) -> Parameters {
        let bounds = Bounds::unit(dimension).unwrap();
        Parameters::new(&Options {
            population,
            parents,
            ..Options::new(bounds)
        })
    }

    /// The (5, 10) weights written out: ln 5.5 − ln i over their sum.
    #[test]
    fn weights_are_the_logarithmic_ones() {
        let p = parameters(6, 10, 5);
        let expected = [0.45627, 0.27075, 0.16223, 0.08523, 0.02551];
        for (w, e) in p.weights.iter().zip(expected) {
            assert!((w - e).abs() < 5e-6, "{w} is not {e}"); // figures are rounded to 5 digits
        }
        assert!(p.weights[5..].iter().all(|w| *w < 0.0));
        assert!((p.mu_eff - 3.1673).abs() < 1e-4, "{}", p.mu_eff);
    }

    #[test]
    fn learning_rates_leave_the_covariance_definite() {
        for dimension in [1, 2, 6, 11, 20, 100] {
            for (population, parents) in [(2, 1), (4, 2), (10, 5), (10, 10), (50, 7), (400, 200)] {
                let p = parameters(dimension, population, parents);
                let positive: f64 = p.weights[..parents].iter().sum();
                let negative: f64 = p.weights[parents..].iter().sum();
                assert!((positive - 1.0).abs() < 1e-12);
                assert!(p.c_1 > 0.0 && p.c_mu >= 0.0 && p.c_1 + p.c_mu <= 1.0);
                // The rest of C after decay and the largest effect of negative weights, section
                // B.1.
                let left = 1.0 - p.c_1 - p.c_mu + dimension as f64 * p.c_mu * negative;
                assert!(left >= -1e-12, "{dimension} {population} {parents}: {left}");
                assert!(p.decompose_every >= 1);
            }
        }
    }
}
