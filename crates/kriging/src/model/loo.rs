//! Leave-one-out validation in closed form.

mod groups;

use statrs::function::erf::{erf_inv, erfc_inv};

use super::Model;
use crate::data::Points;
use crate::warning::{Outlier, Warning};

/// Validation of each observation's prediction from those at all other points, with the covariance parameters
/// kept and the trend estimated anew. A point is left out with all its observations, and with the
/// points that are nearly the same: their observations would predict its noise, not the function.
///
/// Points are nearly the same if neighbours differ in no coordinate by more than a thousandth of its
/// range, nor by more than a thousandth of the spacing, extent/n^(1/d), of n points on a grid.
#[derive(Debug, Clone, PartialEq)]
pub struct LeaveOneOut {
    /// Numbers of the observations, from 0: the first one of each distinct point, in increasing order.
    pub observations: Vec<usize>,
    /// Number of points that were left out in turn, nearly equal ones counted once.
    pub points: usize,
    /// Observation minus prediction, in units of y, one for each of `observations`.
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

/// Half-width of a two-sided 90 % interval of the standard normal distribution.
pub(crate) const Z_TWO_SIDED_90: f64 = 1.644_853_626_951_472_2;
/// Largest probability that any observation of a right model is called an outlier.
const FALSE_ALARM: f64 = 1e-3;
/// The most outliers that a warning names.
const MOST_NAMED: usize = 10;

/// The limit of [`LeaveOneOut::outliers`]. The limit by the normal distribution is 4.4 for n = 100 and
/// 4.9 for n = 1000.
fn outlier_limit(standardised: &[f64]) -> f64 {
    let n = standardised.len() as f64;
    let normal = std::f64::consts::SQRT_2 * erfc_inv(FALSE_ALARM / n);
    let mut sizes: Vec<f64> = standardised.iter().map(|z| z.abs()).collect();
    sizes.sort_by(f64::total_cmp);
    let usual = sizes[(0.9 * n) as usize];
    let exponential = usual * (n / FALSE_ALARM).ln() / std::f64::consts::LN_10;
    normal.max(exponential)
}

/// A leave-one-out residual.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Residual {
    /// Observation minus prediction, in units of y.
    pub(crate) residual: f64,
    /// Variance of the residual, the noise of the observation included, in units of y².
    pub(crate) variance: f64,
    /// The noise variance of the observation, a nugget included, in units of y².
    pub(crate) noise: f64,
}

impl LeaveOneOut {
    /// The observations (indices of [`LeaveOneOut::residuals`]) whose standardised residuals are
    /// too large: gross errors, or places where the function differs from everywhere else. Look at
    /// them before trusting the model around them.
    ///
    /// The limit is the larger one of two. The first is that of the normal distribution at a
    /// probability of 0.001/n: a right model of n observations has an outlier with a probability of
    /// 0.001 at most (Bonferroni's inequality). The second is that of an exponential tail through
    /// the residuals' own 90 % quantile: smooth functions that are not typical realisations of the
    /// process have such tails, up to 7 for 500 observations without any error. A gross error
    /// raises σ² and makes all other residuals small, so that the first limit applies.
    #[must_use]
    pub fn outliers(&self) -> Vec<usize> {
        let limit = outlier_limit(&self.standardised);
        let residuals = self.standardised.iter().enumerate();
        residuals
            .filter(|(_, z)| z.abs() > limit)
            .map(|(i, _)| i)
            .collect()
    }

    /// The fraction of observations within their prediction interval of this probability, as in 0.95.
    #[must_use]
    pub fn coverage(&self, probability: f64) -> f64 {
        let z = std::f64::consts::SQRT_2 * erf_inv(probability);
        let within = self.standardised.iter().filter(|r| r.abs() <= z).count();
        within as f64 / self.standardised.len() as f64
    }

    /// The validation from the residuals of `points`, in their order. `calibration` multiplies the
    /// variances without the noise.
    pub(crate) fn new(
        points: &Points,
        all: &[Residual],
        distinct: usize,
        calibration: f64,
    ) -> Self {
        let by_first = points.by_first();
        let (residuals, standardised): (Vec<f64>, Vec<f64>) = by_first
            .iter()
            .map(|&i| {
                let Residual {
                    residual,
                    mut variance,
                    noise,
                } = all[i];
                if calibration != 1.0 {
                    variance = calibration * (variance - noise).max(0.0) + noise;
                }
                let sd = variance.sqrt();
                (residual, if residual == 0.0 { 0.0 } else { residual / sd })
            })
            .unzip();

        let observed: Vec<f64> = by_first.iter().map(|&i| points.y[i]).collect();
        let observations = by_first.iter().map(|&i| points.first[i]).collect();
        Self::from_residuals(observations, distinct, &observed, residuals, standardised)
    }

    /// The validation and its summary statistics.
    fn from_residuals(
        observations: Vec<usize>,
        points: usize,
        observed: &[f64],
        residuals: Vec<f64>,
        standardised: Vec<f64>,
    ) -> Self {
        let count = observed.len() as f64;
        let centre = observed.iter().sum::<f64>() / count;
        let total: f64 = observed.iter().map(|y| (y - centre).powi(2)).sum();
        let left: f64 = residuals.iter().map(|r| r * r).sum();
        let covered = standardised
            .iter()
            .filter(|z| z.abs() <= Z_TWO_SIDED_90)
            .count();
        Self {
            q2: if total > 0.0 { 1.0 - left / total } else { 0.0 },
            rmse: (left / count).sqrt(),
            coverage90: covered as f64 / count,
            observations,
            points,
            residuals,
            standardised,
        }
    }

    /// Converts the residuals of ln y to units of y. `logarithms` are the observations of ln y.
    pub(crate) fn exponentiated(self, logarithms: &[f64]) -> Self {
        let pairs = logarithms.iter().zip(&self.residuals);
        let residuals = pairs.map(|(y, r)| y.exp() - (y - r).exp()).collect();
        let observed: Vec<f64> = logarithms.iter().map(|y| y.exp()).collect();
        Self::from_residuals(
            self.observations,
            self.points,
            &observed,
            residuals,
            self.standardised,
        )
    }

    /// The warning of the outliers, if there are any.
    pub(crate) fn warning(&self) -> Option<Warning> {
        let outliers = self.outliers();
        let count = outliers.len();
        let mut worst: Vec<Outlier> = outliers
            .into_iter()
            .map(|i| Outlier {
                observation: self.observations[i],
                // JSON has no infinity.
                standardised: self.standardised[i].clamp(-f64::MAX, f64::MAX),
            })
            .collect();
        worst.sort_by(|a, b| {
            let sizes = b.standardised.abs().total_cmp(&a.standardised.abs());
            sizes.then(a.observation.cmp(&b.observation))
        });
        worst.truncate(MOST_NAMED);
        (count > 0).then_some(Warning::Outliers { count, worst })
    }
}

impl Model {
    /// Leaves out each point in turn, with those nearly the same.
    ///
    /// With P = C⁻¹ − C⁻¹F(FᵀC⁻¹F)⁻¹FᵀC⁻¹ and C as in (20) including the noise, the residual of
    /// observation i is (Py)ᵢ/Pᵢᵢ and its variance σ²/Pᵢᵢ (Dubrule, "Cross validation of kriging in
    /// a unique neighborhood", Math. Geol. 15 (1983) 687–699). For a group G of points they are
    /// P_GG⁻¹(Py)_G and the diagonal of σ²P_GG⁻¹. Costs the inverse of a factor, n³/6 multiplications.
    #[must_use]
    pub fn leave_one_out(&self) -> LeaveOneOut {
        let (residuals, distinct) = self.residuals_of_points();
        LeaveOneOut::new(&self.points, &residuals, distinct, self.calibration)
    }

    /// The warning of outliers among the residuals of single observations, given all others: an outlier may
    /// differ from other observations at its own point.
    pub(crate) fn warning_of_residuals(&self) -> Option<Warning> {
        let n = self.points.len();
        LeaveOneOut::new(&self.points, &self.residuals(), n, self.calibration).warning()
    }

    /// The residuals of single observations, not calibrated.
    pub(super) fn residuals(&self) -> Vec<Residual> {
        let n = self.points.len();
        let factorisation = self.factorisation();
        let diagonal = factorisation.inverse_diagonal();
        let mut row = vec![0.0; factorisation.gls.coefficients()];
        (0..n)
            .map(|i| {
                for (r, column) in row.iter_mut().zip(factorisation.gls.c_inv_f().chunks(n)) {
                    *r = column[i];
                }
                let p = diagonal[i] - factorisation.gls.quadratic(&mut row);
                Residual {
                    residual: self.weights[i] / p,
                    variance: self.parameters.sigma2 / p,
                    noise: self.points.noise[i] + self.parameters.nugget,
                }
            })
            .collect()
    }
}
