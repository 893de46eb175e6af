//! Generalised least squares: the trend's coefficients under a covariance C.
//!
//! With F the n × p matrix of basis functions (ones; for a linear trend the coordinates too) the
//! coefficients are (FᵀC⁻¹F)⁻¹FᵀC⁻¹y, equation (18) for p = 1.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::linalg::{LowerTriangle, Spd, dot};

/// The deterministic part of the model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Trend {
    /// A constant μ: ordinary kriging.
    #[default]
    Constant,
    /// A constant and a slope for each coordinate, in which it is linear: universal kriging.
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

/// The smallest pivot of FᵀC⁻¹F, relative to its diagonal, at which the coefficients still count as
/// determined.
const INDEPENDENT: f64 = 1e-12;

/// C⁻¹F and the normal equations' matrix FᵀC⁻¹F.
#[derive(Debug, Clone)]
pub(crate) struct Gls {
    /// C⁻¹F, column by column.
    c_inv_f: Vec<f64>,
    normal: Spd,
}

impl Gls {
    /// From F and C⁻¹F, both n × p and column by column; `None` if the columns of F depend on each
    /// other.
    pub(crate) fn new(basis: &[f64], c_inv_f: Vec<f64>, n: usize) -> Option<Self> {
        let matrix = LowerTriangle::from_columns(basis.len() / n, |k, column| {
            for (f, value) in basis.chunks_exact(n).skip(k).zip(column) {
                *value = dot(f, &c_inv_f[k * n..(k + 1) * n]);
            }
        });
        let diagonal: Vec<f64> = matrix.diagonal().collect();
        let normal = Spd::factor(matrix).ok()?;
        let is_lost = |(pivot, whole): (f64, &f64)| pivot * pivot <= INDEPENDENT * whole;
        let dependent = diagonal.len() > 1 && normal.pivots().zip(&diagonal).any(is_lost);
        (!dependent).then_some(Self { c_inv_f, normal })
    }

    pub(crate) fn coefficients(&self) -> usize {
        self.normal.len()
    }

    /// C⁻¹F, column by column.
    pub(crate) fn c_inv_f(&self) -> &[f64] {
        &self.c_inv_f
    }

    /// Replaces b by (FᵀC⁻¹F)⁻¹b.
    pub(crate) fn solve(&self, b: &mut [f64]) {
        self.normal.solve(b);
    }

    /// uᵀ(FᵀC⁻¹F)⁻¹u; `u` is overwritten.
    pub(crate) fn quadratic(&self, u: &mut [f64]) -> f64 {
        self.normal.half_solve(u);
        dot(u, u)
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
