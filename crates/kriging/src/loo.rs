//! Leave-one-out validation in closed form.

use crate::calibration::Z_TWO_SIDED_90;
use crate::inverse::invert;
use crate::model::Model;

/// How well each observation is predicted from all others, with the covariance parameters kept and
/// the trend estimated anew.
#[derive(Debug, Clone, PartialEq)]
pub struct LeaveOneOut {
    /// Observation minus prediction, in units of y: one for each distinct point, in the order of
    /// their first observations.
    pub residuals: Vec<f64>,
    /// Residuals over their standard deviations, the noise of the left-out observation included.
    /// Standard normal if the model is right. Zero where residual and deviation both vanish.
    pub standardised: Vec<f64>,
    /// 1 − Σ residual²/Σ (y − ȳ)²: 1 for perfect predictions, 0 for those of the mean. Zero for a
    /// constant response.
    pub q2: f64,
    /// Root mean square of the residuals, in units of y.
    pub rmse: f64,
    /// The fraction of observations within their 90 % prediction interval.
    pub coverage90: f64,
}

/// A standardised residual beyond this is not the model's: of a million normal ones, 0.6 are.
const OUTLYING: f64 = 5.0;

impl LeaveOneOut {
    /// The observations (indices of [`LeaveOneOut::residuals`]) whose standardised residuals exceed
    /// 5 in size: gross errors, or places where the function is unlike everywhere else. Look at them
    /// before trusting the model around them.
    #[must_use]
    pub fn outliers(&self) -> Vec<usize> {
        let residuals = self.standardised.iter().enumerate();
        residuals
            .filter(|(_, z)| z.abs() > OUTLYING)
            .map(|(i, _)| i)
            .collect()
    }
}

impl Model {
    /// Leaves out each point in turn.
    ///
    /// With P = C⁻¹ − C⁻¹F(FᵀC⁻¹F)⁻¹FᵀC⁻¹ and C as in (20) including the noise, the residual of
    /// observation i is (Py)ᵢ/Pᵢᵢ and its variance σ²/Pᵢᵢ (Dubrule, "Cross validation of kriging in
    /// a unique neighborhood", Math. Geol. 15 (1983) 687–699). Costs an inverse, n³ multiplications.
    #[must_use]
    pub fn leave_one_out(&self) -> LeaveOneOut {
        let n = self.points.len();
        let all = self.residuals();
        let mut by_first: Vec<usize> = (0..n).collect();
        by_first.sort_by_key(|&i| self.points.first[i]);
        let (residuals, standardised): (Vec<f64>, Vec<f64>) = by_first
            .iter()
            .map(|&i| {
                let (residual, mut variance) = all[i];
                if self.calibration != 1.0 {
                    let noise = self.points.noise[i] + self.parameters.nugget;
                    variance = self.calibration * (variance - noise).max(0.0) + noise;
                }
                let sd = variance.sqrt();
                (residual, if residual == 0.0 { 0.0 } else { residual / sd })
            })
            .unzip();

        let count = n as f64;
        let centre = self.points.y.iter().sum::<f64>() / count;
        let total: f64 = self.points.y.iter().map(|y| (y - centre).powi(2)).sum();
        let left: f64 = residuals.iter().map(|r| r * r).sum();
        let covered = standardised
            .iter()
            .filter(|z| z.abs() <= Z_TWO_SIDED_90)
            .count();
        LeaveOneOut {
            q2: if total > 0.0 { 1.0 - left / total } else { 0.0 },
            rmse: (left / count).sqrt(),
            coverage90: covered as f64 / count,
            residuals,
            standardised,
        }
    }

    /// The leave-one-out residual of each point and its variance, the noise of the point included,
    /// not calibrated.
    pub(crate) fn residuals(&self) -> Vec<(f64, f64)> {
        let n = self.points.len();
        let solved = self.solved();
        let mut inverse = vec![0.0; n * n];
        invert(&solved.factor, n, &mut inverse);
        let mut row = vec![0.0; solved.gls.coefficients()];
        (0..n)
            .map(|i| {
                for (r, column) in row.iter_mut().zip(solved.gls.solved().chunks(n)) {
                    *r = column[i];
                }
                let p = inverse[i * n + i] - solved.gls.quadratic(&mut row);
                (self.weights[i] / p, self.parameters.sigma2 / p)
            })
            .collect()
    }
}
