//! Derivatives of the prediction with respect to the point.

use super::coordinates::Coordinates;
use super::{Model, Prediction};

/// A prediction and its derivatives.
#[derive(Debug, Clone, PartialEq)]
pub struct Gradient {
    /// The prediction itself.
    pub prediction: Prediction,
    /// ∂ mean/∂ xⱼ, d numbers, in units of y per unit of xⱼ.
    pub mean: Vec<f64>,
    /// ∂ variance/∂ xⱼ, d numbers, in units of y² per unit of xⱼ.
    pub variance: Vec<f64>,
}

impl Model {
    /// The kriging mean at `x` and its derivatives ∂ mean/∂ xⱼ, in units of y per unit of xⱼ. Costs
    /// a few times [`Model::mean`], and no factorisation.
    ///
    /// Where the exponential kernel has a kink, at an observation's coordinate, the mean of the
    /// derivatives on both sides is given.
    ///
    /// # Panics
    ///
    /// If `x` has another length than [`Model::dimensions`].
    #[must_use]
    pub fn mean_gradient(&self, x: &[f64]) -> (f64, Vec<f64>) {
        let (_, factors) = self.correlations_and_factors(x);
        (self.mean(x), self.slopes_of_mean(x, &factors))
    }

    /// Mean and variance at `x` with their derivatives. Costs about twice [`Model::predict`].
    ///
    /// # Panics
    ///
    /// If `x` has another length than [`Model::dimensions`].
    #[must_use]
    pub fn predict_gradient(&self, x: &[f64]) -> Gradient {
        let n = self.points();
        let solved = self.solved();
        let (correlation, factors) = self.correlations_and_factors(x);
        let mut weights = correlation.clone();
        solved.factor.solve(&mut weights);

        // variance/σ² = 1 − rᵀC⁻¹r + uᵀ(FᵀC⁻¹F)⁻¹u with u = f − FᵀC⁻¹r; its derivative is
        // −2 r'ᵀC⁻¹r + 2 u'ᵀ(FᵀC⁻¹F)⁻¹u with u' = f' − FᵀC⁻¹r'.
        let mut shortfall = self.shortfall(x, &correlation);
        solved.gls.solve(&mut shortfall);
        for (coefficient, column) in shortfall.iter().zip(solved.gls.solved().chunks(n)) {
            for (weight, s) in weights.iter_mut().zip(column) {
                *weight += coefficient * s;
            }
        }
        let pull: Vec<f64> = factors
            .iter()
            .zip(&weights)
            .map(|(f, w)| -2.0 * f * w)
            .collect();
        let mut variance = self.slopes_of_sum(x, &pull);
        let slopes = shortfall[1..].iter().zip(&self.coordinates.extents);
        for (&j, (coefficient, extent)) in self.coordinates.active.iter().zip(slopes) {
            variance[j] += 2.0 * coefficient / extent;
        }
        let scale = self.parameters.sigma2 * self.calibration;
        variance.iter_mut().for_each(|v| *v *= scale);
        Gradient {
            prediction: self.predict(x),
            mean: self.slopes_of_mean(x, &factors),
            variance,
        }
    }

    /// The correlations of x with all points, without and with the factor common to a radial
    /// kernel's derivatives.
    fn correlations_and_factors(&self, x: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let at = self.scaled(x);
        let column = |j: usize| &*self.coordinates.columns[j];
        let mut correlation = vec![0.0; self.points()];
        self.kernel.correlations(&at, column, &mut correlation);
        let mut factors = correlation.clone();
        self.kernel
            .multiply_by_radial_factors(&at, column, &mut factors);
        (correlation, factors)
    }

    fn slopes_of_mean(&self, x: &[f64], factors: &[f64]) -> Vec<f64> {
        let pull: Vec<f64> = factors
            .iter()
            .zip(&self.weights)
            .map(|(f, w)| f * w)
            .collect();
        let mut slopes = self.slopes_of_sum(x, &pull);
        for (slope, trend) in slopes.iter_mut().zip(&self.parameters.slopes) {
            *slope += trend;
        }
        slopes
    }

    /// Derivatives of Σᵢ wᵢ r(x, xᵢ) from the products of wᵢ and the correlations' factors.
    fn slopes_of_sum(&self, x: &[f64], pull: &[f64]) -> Vec<f64> {
        let mut slopes = vec![0.0; self.dimensions()];
        let at = self.scaled(x);
        let column = |k: usize| &*self.coordinates.columns[k];
        let Coordinates { active, scale, .. } = &self.coordinates;
        self.kernel.slope_dots(&at, column, pull, |k, dot| {
            slopes[active[k]] = scale[k] * dot;
        });
        slopes
    }
}
