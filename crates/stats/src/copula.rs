//! A Gaussian copula: correlated standard normal scores from independent ones.
//!
//! The scores are L z, with L the Cholesky factor of their correlation matrix. With the quantiles of
//! [`Marginal`](crate::Marginal) they are Nataf's model with the correlations of the scores in place of those of the
//! inputs.
//!
//! Reference: P.-L. Liu, A. Der Kiureghian, "Multivariate distribution models with prescribed marginals and
//! covariances", Prob. Eng. Mech. 1 (1986) 105–112.

/// The Cholesky factor of a correlation matrix, row by row.
#[derive(Debug, Clone, PartialEq)]
pub struct Copula(Vec<Vec<f64>>);

impl Copula {
    /// The copula of `count` scores whose correlations are `correlation(i, j)`, j < i; `None` unless their matrix is
    /// positive definite.
    pub fn new(count: usize, correlation: impl Fn(usize, usize) -> f64) -> Option<Self> {
        let mut factor: Vec<Vec<f64>> = Vec::with_capacity(count);
        for i in 0..count {
            let mut row: Vec<f64> = Vec::with_capacity(i + 1);
            for (j, other) in factor.iter().enumerate() {
                let known: f64 = row.iter().zip(other).map(|(a, b)| a * b).sum();
                row.push((correlation(i, j) - known) / other[j]);
            }
            let rest = 1.0 - row.iter().map(|a| a * a).sum::<f64>();
            // Rounding decides the sign of a smaller remainder.
            if rest.is_nan() || rest <= 1e-12 {
                return None;
            }
            row.push(rest.sqrt());
            factor.push(row);
        }
        Some(Self(factor))
    }

    /// Returns the correlated scores L z of the independent scores z.
    #[must_use]
    pub fn correlated(&self, independent: &[f64]) -> Vec<f64> {
        let dot = |row: &Vec<f64>| row.iter().zip(independent).map(|(a, z)| a * z).sum();
        self.0.iter().map(dot).collect()
    }
}
