//! Predicted means and variances.

use rayon::prelude::*;

use super::Model;
use super::coordinates::rows;
use crate::Error;
use crate::linalg::dot;

/// Points whose correlations are computed together: their intermediate results stay in the cache.
const BLOCK: usize = 128;
/// Points predicted together by [`Model::predict_many`]: many enough for the triangular solves to
/// run at the speed of matrix products.
const BATCH: usize = 256;

/// Prediction of the noise-free function at one point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Prediction {
    /// m_OK, equation (19), in units of y.
    pub mean: f64,
    /// s²_OK, equation (20), in units of y². The noise of a new observation is not part of it, nor
    /// is an estimated nugget.
    pub variance: f64,
}

/// The noise-free function at one point, given the observations; [`Model::covariance`] relates two of them.
#[derive(Debug, Clone)]
pub struct Conditional {
    /// The result of [`Model::predict`] at the point.
    pub prediction: Prediction,
    /// The point in the kernel's coordinates.
    at: Vec<f64>,
    /// L⁻¹r of its correlations r with the observations, C = LLᵀ.
    half: Vec<f64>,
    /// The trend's part: R⁻¹(f − FᵀC⁻¹r), FᵀC⁻¹F = RRᵀ.
    trend: Vec<f64>,
}

impl Model {
    /// The kriging mean m_OK at `x` (d coordinates), equation (19), in units of y.
    ///
    /// # Panics
    ///
    /// If `x` has another length than [`Model::dimensions`].
    #[must_use]
    pub fn mean(&self, x: &[f64]) -> f64 {
        let at = self.coordinates.scaled(x);
        let n = self.points.len();
        let mut correlation = [0.0; BLOCK];
        let mut sum = 0.0;
        for start in (0..n).step_by(BLOCK) {
            let end = (start + BLOCK).min(n);
            let block = &mut correlation[..end - start];
            self.kernel
                .correlations(&at, |j| &self.coordinates.columns[j][start..end], block);
            sum += dot(block, &self.weights[start..end]);
        }
        self.trend_at(x) + sum
    }

    /// [`Model::mean`] at many points: row-major, any number of rows of d coordinates. Bit for bit the
    /// same numbers; rayon's threads share the rows.
    ///
    /// # Errors
    ///
    /// [`Error::Shape`] if `x` is not a whole number of rows.
    pub fn means(&self, x: &[f64]) -> Result<Vec<f64>, Error> {
        let rows = rows(x, self.points.d)?;
        Ok(rows.into_par_iter().map(|x| self.mean(x)).collect())
    }

    /// Mean and variance at `x` (d coordinates), equations (19) and (20). The first call after
    /// reading a stored model factorises the covariance matrix; every call costs about n²/2
    /// multiplications.
    ///
    /// # Panics
    ///
    /// If `x` has another length than [`Model::dimensions`].
    #[must_use]
    pub fn predict(&self, x: &[f64]) -> Prediction {
        self.predict_batch(&[x])[0]
    }

    /// [`Model::predict`] at many points: row-major, any number of rows of d coordinates. Costs less
    /// per point than single predictions, and its variances may differ from theirs by rounding.
    /// rayon's threads share the batches. Where no variance is needed, [`Model::means`] costs less.
    ///
    /// # Errors
    ///
    /// [`Error::Shape`] if `x` is not a whole number of rows.
    pub fn predict_many(&self, x: &[f64]) -> Result<Vec<Prediction>, Error> {
        let rows = rows(x, self.points.d)?;
        // One thread computes a batch, so the result does not depend on the number of threads.
        Ok(rows
            .par_chunks(BATCH)
            .flat_map_iter(|batch| self.predict_batch(batch))
            .collect())
    }

    /// The predictions at some points, with one triangular solve for all.
    fn predict_batch(&self, rows: &[&[f64]]) -> Vec<Prediction> {
        let n = self.points.len();
        let factorisation = self.factorisation();
        let mut correlations = vec![0.0; n * rows.len()];
        let mut trend_errors = Vec::with_capacity(rows.len());
        let mut means = Vec::with_capacity(rows.len());
        for (x, r) in rows.iter().zip(correlations.chunks_exact_mut(n)) {
            let at = self.coordinates.scaled(x);
            self.kernel
                .correlations(&at, |j| &self.coordinates.columns[j], r);
            trend_errors.push(self.trend_error(x, r));
            means.push(self.mean_from(x, r));
        }
        factorisation.factor.half_solve(&mut correlations);
        means
            .into_iter()
            .zip(correlations.chunks_exact(n).zip(trend_errors))
            .map(|(mean, (half, mut trend_error))| {
                let unit = 1.0 - dot(half, half) + factorisation.gls.quadratic(&mut trend_error);
                // At a noise-free observation the terms cancel up to rounding. A NaN remains one.
                let unit = if unit < 0.0 { 0.0 } else { unit };
                let variance = self.parameters.sigma2 * unit * self.calibration;
                Prediction { mean, variance }
            })
            .collect()
    }

    /// The function at `x` (d coordinates) for [`Model::covariance`]. Costs as much as [`Model::predict`].
    ///
    /// # Panics
    ///
    /// If `x` has another length than [`Model::dimensions`].
    #[must_use]
    pub fn conditional(&self, x: &[f64]) -> Conditional {
        let at = self.coordinates.scaled(x);
        let mut half = vec![0.0; self.points.len()];
        self.kernel
            .correlations(&at, |j| &self.coordinates.columns[j], &mut half);
        let mean = self.mean_from(x, &half);
        let factorisation = self.factorisation();
        let mut trend = self.trend_error(x, &half);
        let of_trend = factorisation.gls.quadratic(&mut trend);
        factorisation.factor.half_solve(&mut half);
        let unit = (1.0 - dot(&half, &half) + of_trend).max(0.0);
        let variance = self.parameters.sigma2 * unit * self.calibration;
        Conditional {
            prediction: Prediction { mean, variance },
            at,
            half,
            trend,
        }
    }

    /// The covariance of the noise-free function at two points, given the observations, in units of y²: equation (20)
    /// with two points in the place of one. Costs n multiplications.
    #[must_use]
    pub fn covariance(&self, a: &Conditional, b: &Conditional) -> f64 {
        let mut correlation = [0.0];
        self.kernel
            .correlations(&a.at, |j| &b.at[j..=j], &mut correlation);
        let unit = correlation[0] - dot(&a.half, &b.half) + dot(&a.trend, &b.trend);
        self.parameters.sigma2 * unit * self.calibration
    }

    /// The mean at `x` from its correlations with all points: summed as [`Model::mean`] does.
    fn mean_from(&self, x: &[f64], correlations: &[f64]) -> f64 {
        let blocks = correlations.chunks(BLOCK).zip(self.weights.chunks(BLOCK));
        let mut sum = 0.0;
        for (r, w) in blocks {
            sum += dot(r, w);
        }
        self.trend_at(x) + sum
    }

    /// f(x) − FᵀC⁻¹r: the trend's basis functions at `x` minus their interpolation.
    pub(crate) fn trend_error(&self, x: &[f64], correlations: &[f64]) -> Vec<f64> {
        let n = self.points.len();
        let columns = self.factorisation().gls.c_inv_f().chunks(n);
        columns
            .enumerate()
            .map(|(k, s)| {
                let f = if k == 0 { 1.0 } else { self.basis_at(x, k - 1) };
                f - dot(correlations, s)
            })
            .collect()
    }
}
