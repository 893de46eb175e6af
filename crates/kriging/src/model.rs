//! The fitted model and its predictions.

pub(crate) mod calibration;
pub(crate) mod coordinates;
mod gradient;
pub(crate) mod loo;
pub(crate) mod predict;
mod update;

use std::sync::OnceLock;

use crate::data::Points;
use crate::kernel::Kernel;
use crate::likelihood::gls::{Gls, Trend};
use crate::likelihood::{covariance, noise_ratio};
use crate::linalg::{JITTERS, NotPositiveDefinite, Spd, dot};
use crate::{Error, Warning};
use coordinates::Coordinates;

/// The parameters of the process.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameters {
    /// The mean μ, in units of y; for a linear trend, the trend at the centre of the box that the
    /// points span.
    pub mu: f64,
    /// The process variance σ², in units of y².
    pub sigma2: f64,
    /// The d ranges θ, in units of x; infinite where the model ignores a coordinate.
    pub ranges: Vec<f64>,
    /// The d slopes of a linear trend, in units of y per unit of x, zero where the model ignores a
    /// coordinate; empty for a constant trend.
    pub slopes: Vec<f64>,
    /// The estimated nugget, a noise variance on top of the known ones, in units of y²; zero if
    /// none was estimated.
    pub nugget: f64,
}

/// A kriging model: see [`crate::fit`].
#[derive(Debug, Clone)]
pub struct Model {
    pub(crate) kernel: Kernel,
    pub(crate) trend: Trend,
    pub(crate) points: Points,
    pub(crate) parameters: Parameters,
    pub(crate) warnings: Vec<Warning>,
    pub(crate) jitter: f64,
    /// The factor by which predicted variances are multiplied.
    pub(crate) calibration: f64,
    /// C⁻¹(y − Fμ), see [`crate::likelihood`].
    pub(crate) weights: Vec<f64>,
    /// Negative log likelihood of the observations.
    pub(crate) nll: f64,
    pub(crate) coordinates: Coordinates,
    /// Computed at the first call that needs a variance.
    factorisation: OnceLock<Factorisation>,
}

/// The Cholesky factor of C, and the trend's normal equations.
#[derive(Debug, Clone)]
pub(crate) struct Factorisation {
    pub(crate) factor: Spd,
    /// C⁻¹F and FᵀC⁻¹F.
    pub(crate) gls: Gls,
    /// The diagonal of C⁻¹, computed when it is needed first.
    inverse_diagonal: OnceLock<Vec<f64>>,
}

impl Factorisation {
    pub(crate) const fn new(factor: Spd, gls: Gls) -> Self {
        Self {
            factor,
            gls,
            inverse_diagonal: OnceLock::new(),
        }
    }

    /// The diagonal of C⁻¹: n³/6 multiplications at the first call.
    pub(crate) fn inverse_diagonal(&self) -> &[f64] {
        let diagonal = || self.factor.inverse_diagonal();
        self.inverse_diagonal.get_or_init(diagonal)
    }
}

impl Model {
    /// Computes the trend and the weights for given σ², nugget and ranges; `parameters.mu` and
    /// `slopes` are replaced. The jitter grows until C can be factorised.
    pub(crate) fn new(
        kernel: Kernel,
        trend: Trend,
        points: Points,
        parameters: Parameters,
        jitter: f64,
    ) -> Result<Self, Error> {
        Self::assemble(kernel, trend, points, parameters, jitter).factorised()
    }

    /// Factorises C, with more jitter if needed, and estimates the trend and the weights.
    pub(crate) fn factorised(mut self) -> Result<Self, Error> {
        let (factorisation, used) = self.try_factorise()?;
        self.jitter = used;
        self.estimate_trend(factorisation);
        self.checked()
    }

    /// The model; [`Error::Extent`] unless all numbers that predictions use are finite.
    pub(crate) fn checked(self) -> Result<Self, Error> {
        let Parameters {
            mu, sigma2, slopes, ..
        } = &self.parameters;
        let numbers = [mu, sigma2, &self.nll].into_iter().chain(slopes);
        if numbers.chain(&self.weights).all(|v| v.is_finite()) {
            Ok(self)
        } else {
            Err(Error::Extent { what: "y" })
        }
    }

    /// Estimates the trend, the weights and the likelihood from the factor of C.
    pub(crate) fn estimate_trend(&mut self, factorisation: Factorisation) {
        let n = self.points.len();
        let centre = self.points.y.iter().sum::<f64>() / n as f64;
        let mut weights: Vec<f64> = self.points.y.iter().map(|y| y - centre).collect();
        let columns = factorisation.gls.c_inv_f().chunks(n);
        let mut coefficients: Vec<f64> = columns.map(|s| dot(&weights, s)).collect();
        factorisation.gls.solve(&mut coefficients);
        for (coefficient, column) in coefficients.iter().zip(self.basis().chunks(n)) {
            for (weight, f) in weights.iter_mut().zip(column) {
                *weight -= coefficient * f;
            }
        }
        let z = weights.clone();
        factorisation.factor.solve(&mut weights);
        let quadratic = dot(&z, &weights);
        self.nll = self.likelihood(&factorisation, quadratic) + self.points.within;
        self.parameters.mu = centre + coefficients[0];
        self.parameters.slopes = match self.trend {
            Trend::Constant => Vec::new(),
            Trend::Linear => {
                let mut slopes = vec![0.0; self.points.d];
                let found = coefficients[1..].iter().zip(&self.coordinates.extents);
                for (&j, (coefficient, extent)) in self.coordinates.active.iter().zip(found) {
                    slopes[j] = coefficient / extent;
                }
                slopes
            }
        };
        self.weights = weights;
        self.factorisation = OnceLock::from(factorisation);
    }

    /// −ln L of the points, given (y − Fμ)ᵀC⁻¹(y − Fμ).
    fn likelihood(&self, factorisation: &Factorisation, quadratic: f64) -> f64 {
        let n = self.points.len();
        let sigma2 = self.parameters.sigma2;
        0.5 * (n as f64 * (std::f64::consts::TAU.ln() + sigma2.ln())
            + factorisation.factor.log_det()
            + quadratic / sigma2)
    }

    /// −ln L of the points, without the contribution of merged observations ([`Points::within`]).
    pub(crate) fn likelihood_of_points(&self) -> f64 {
        let n = self.points.len();
        let z: Vec<f64> = (0..n)
            .map(|i| self.points.y[i] - self.trend_at(self.points.row(i)))
            .collect();
        self.likelihood(self.factorisation(), dot(&z, &self.weights))
    }

    /// The trend's basis at the points, column by column.
    pub(crate) fn basis(&self) -> Vec<f64> {
        let n = self.points.len();
        let column = |k: usize| -> Vec<f64> {
            let rows = (0..n).map(|i| self.points.row(i));
            rows.map(|x| self.basis_at(x, k)).collect()
        };
        let in_extents: Vec<Vec<f64>> = (0..self.coordinates.active.len()).map(column).collect();
        self.trend.basis(&in_extents, n, 0.0)
    }

    /// Whether the points determine the trend's coefficients.
    pub(crate) fn determines_trend(&self) -> bool {
        let basis = self.basis();
        Gls::new(&basis, basis.clone(), self.points.len()).is_some()
    }

    /// The linear basis function of active coordinate k.
    fn basis_at(&self, x: &[f64], k: usize) -> f64 {
        let Coordinates {
            active, extents, ..
        } = &self.coordinates;
        (x[active[k]] - self.coordinates.centre(k)) / extents[k]
    }

    /// The trend at `x`.
    pub(crate) fn trend_at(&self, x: &[f64]) -> f64 {
        let mut sum = self.parameters.mu;
        if self.trend == Trend::Linear {
            for (k, &j) in self.coordinates.active.iter().enumerate() {
                sum += self.parameters.slopes[j] * (x[j] - self.coordinates.centre(k));
            }
        }
        sum
    }

    /// Assembles a model from the numbers that predictions need; the rest is computed on demand.
    /// The same input gives the same bits of every prediction.
    pub(crate) fn assemble(
        kernel: Kernel,
        trend: Trend,
        points: Points,
        parameters: Parameters,
        jitter: f64,
    ) -> Self {
        let coordinates = Coordinates::new(kernel, &points, &parameters.ranges);
        Self {
            kernel,
            trend,
            points,
            parameters,
            warnings: Vec::new(),
            jitter,
            calibration: 1.0,
            weights: Vec::new(),
            nll: 0.0,
            coordinates,
            factorisation: OnceLock::new(),
        }
    }

    /// The parameters of the process.
    #[must_use]
    pub fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    /// The correlation function.
    #[must_use]
    pub fn kernel(&self) -> Kernel {
        self.kernel
    }

    /// The trend.
    #[must_use]
    pub fn trend(&self) -> Trend {
        self.trend
    }

    /// Number of coordinates d of a point.
    #[must_use]
    pub fn dimensions(&self) -> usize {
        self.points.d
    }

    /// Number of distinct points the model was fitted to; with an estimated nugget, repeated
    /// observations count one by one.
    #[must_use]
    pub fn points(&self) -> usize {
        self.points.len()
    }

    /// −ln L of the observations, with its n/2 ln 2π. Repeated observations count one by one, but
    /// noise-free ones of the same point as one.
    #[must_use]
    pub fn negative_log_likelihood(&self) -> f64 {
        self.nll
    }

    /// [`Warning::Jitter`] if the model needed jitter.
    pub(crate) fn jitter_warning(&self) -> Option<Warning> {
        let relative = self.jitter;
        (relative > 0.0).then_some(Warning::Jitter { relative })
    }

    /// The warnings about the data and the fit.
    #[must_use]
    pub fn warnings(&self) -> &[Warning] {
        &self.warnings
    }

    /// The factorisation of C, computed at the first call.
    pub(crate) fn factorisation(&self) -> &Factorisation {
        self.factorisation.get_or_init(|| {
            // The matrix could be factorised when the model was made. A factor to which rows were
            // appended differs from this one in the last bits; a little more jitter absorbs the
            // difference.
            let (factorisation, _) = self
                .try_factorise()
                .expect("a correlation matrix with 1e-4 on its diagonal is positive definite");
            factorisation
        })
    }

    /// Factorises C with the model's jitter or the next larger one that suffices.
    fn try_factorise(&self) -> Result<(Factorisation, f64), Error> {
        let n = self.points.len();
        let Parameters { sigma2, nugget, .. } = self.parameters;
        let levels = JITTERS.into_iter().filter(|j| *j > self.jitter);
        let mut observation = None;
        for jitter in std::iter::once(self.jitter).chain(levels) {
            let columns = &self.coordinates.columns;
            let ratio = |i: usize| noise_ratio(self.points.noise[i] + nugget, sigma2);
            let matrix = covariance(self.kernel, columns, n, jitter, ratio, Vec::new());
            match Spd::factor(matrix) {
                Ok(factor) => {
                    if let Some(gls) = self.solve_trend(&factor) {
                        return Ok((Factorisation::new(factor, gls), jitter));
                    }
                }
                Err(NotPositiveDefinite { pivot }) => observation = Some(self.points.first[pivot]),
            }
        }
        Err(Error::not_positive_definite(observation))
    }

    /// The trend's normal equations; `None` if they are singular.
    pub(crate) fn solve_trend(&self, factor: &Spd) -> Option<Gls> {
        let n = self.points.len();
        let basis = self.basis();
        let mut c_inv_f = basis.clone();
        factor.solve(&mut c_inv_f);
        Gls::new(&basis, c_inv_f, n)
    }
}
