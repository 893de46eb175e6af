//! Generalised least squares: the trend's coefficients under a covariance C.
//!
//! With F the n × p matrix of basis functions (ones; for a linear trend the coordinates too) the
//! coefficients are (FᵀC⁻¹F)⁻¹FᵀC⁻¹y, equation (18) for p = 1. The small matrix is factorised as
//! LDLᵀ, which for p = 1 is the plain division by 1ᵀC⁻¹1.

use serde::{Deserialize, Serialize};

/// The deterministic part of the model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Trend {
    /// A constant μ: ordinary kriging.
    #[default]
    Constant,
    /// A constant and a slope for each coordinate: universal kriging. Its slopes are linear in x.
    Linear,
}

impl Trend {
    /// Number of coefficients p where `dimensions` coordinates vary.
    pub(crate) fn coefficients(self, dimensions: usize) -> usize {
        match self {
            Self::Constant => 1,
            Self::Linear => 1 + dimensions,
        }
    }

    pub(crate) fn is_constant(&self) -> bool {
        *self == Self::Constant
    }

    /// The n × p basis, column by column, at points whose coordinates run over intervals of
    /// length one: ones, then the coordinates less `centre`.
    pub(crate) fn basis(self, columns: &[Vec<f64>], n: usize, centre: f64) -> Vec<f64> {
        let mut basis = vec![1.0; n];
        if self == Self::Linear {
            basis.extend(columns.iter().flatten().map(|c| c - centre));
        }
        basis
    }
}

/// The smallest pivot of FᵀC⁻¹F, relative to its diagonal, at which the coefficients are still told
/// apart.
const INDEPENDENT: f64 = 1e-12;

/// C⁻¹F, and FᵀC⁻¹F as LDLᵀ.
#[derive(Debug, Clone)]
pub(crate) struct Gls {
    p: usize,
    /// C⁻¹F, column by column.
    solved: Vec<f64>,
    /// Unit lower triangle, row by row.
    lower: Vec<f64>,
    pivots: Vec<f64>,
}

impl Gls {
    /// From F and C⁻¹F, both n × p and column by column; `None` if the columns of F depend on each
    /// other.
    pub(crate) fn new(basis: &[f64], solved: Vec<f64>, n: usize) -> Option<Self> {
        let p = basis.len() / n;
        let (mut lower, mut pivots) = (vec![0.0; p * p], vec![0.0; p]);
        for k in 0..p {
            for i in k..p {
                let inner: f64 = basis[i * n..(i + 1) * n]
                    .iter()
                    .zip(&solved[k * n..(k + 1) * n])
                    .map(|(f, s)| f * s)
                    .sum();
                let mut value = inner;
                for m in 0..k {
                    value -= lower[i * p + m] * lower[k * p + m] * pivots[m];
                }
                if i > k {
                    lower[i * p + k] = value / pivots[k];
                    continue;
                }
                if p > 1 && (value.is_nan() || value <= INDEPENDENT * inner) {
                    return None;
                }
                pivots[k] = value;
            }
        }
        Some(Self {
            p,
            solved,
            lower,
            pivots,
        })
    }

    pub(crate) fn coefficients(&self) -> usize {
        self.p
    }

    /// C⁻¹F, column by column.
    pub(crate) fn solved(&self) -> &[f64] {
        &self.solved
    }

    /// Replaces b by (FᵀC⁻¹F)⁻¹b.
    pub(crate) fn solve(&self, b: &mut [f64]) {
        self.half_solve(b);
        for (b, pivot) in b.iter_mut().zip(&self.pivots) {
            *b /= pivot;
        }
        for k in (0..self.p).rev() {
            for i in k + 1..self.p {
                b[k] -= self.lower[i * self.p + k] * b[i];
            }
        }
    }

    /// uᵀ(FᵀC⁻¹F)⁻¹u; `u` is overwritten.
    pub(crate) fn quadratic(&self, u: &mut [f64]) -> f64 {
        self.half_solve(u);
        let squares = u.iter().zip(&self.pivots);
        squares.map(|(u, pivot)| *u * *u / pivot).sum()
    }

    fn half_solve(&self, b: &mut [f64]) {
        for k in 0..self.p {
            for i in k + 1..self.p {
                b[i] -= self.lower[i * self.p + k] * b[k];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_through_four_points() {
        // Ordinary least squares (C = I) of 1, 3, 2, 5 at 0, 1, 2, 3: 1.1 + 1.1 t, by hand.
        let basis = [1.0, 1.0, 1.0, 1.0, 0.0, 1.0, 2.0, 3.0];
        let gls = Gls::new(&basis, basis.to_vec(), 4).unwrap();
        let mut b = [11.0, 22.0];
        gls.solve(&mut b);
        assert!((b[0] - 1.1).abs() < 1e-14 && (b[1] - 1.1).abs() < 1e-14);
        // The variance of the line at t = 0, (Σt²)/(nΣt² − (Σt)²) = 14/20.
        assert!((gls.quadratic(&mut [1.0, 0.0]) - 0.7).abs() < 1e-14);
        let twice = [1.0, 1.0, 1.0, 1.0, 2.0, 2.0, 2.0, 2.0];
        assert!(Gls::new(&twice, twice.to_vec(), 4).is_none());
    }
}
