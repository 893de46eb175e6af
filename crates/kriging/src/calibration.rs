//! Predicted variances that fit the leave-one-out residuals.

use crate::model::Model;

/// Half-width of a two-sided 90 % interval of the standard normal distribution.
pub(crate) const Z_TWO_SIDED_90: f64 = 1.644_853_626_951_472_2;
/// The fewest points whose residuals say anything of a 90 % interval.
const FEWEST: usize = 10;
/// Bounds of the factor: beyond these the model, not its variance, is wrong.
const BOUNDS: (f64, f64) = (1e-2, 1e2);

impl Model {
    /// The model with its predicted variances multiplied by one factor c, such that 90 % of the
    /// leave-one-out residuals lie within their 90 % intervals: cᵢ = ((rᵢ/1.645)² − vᵢ)/(pᵢ − vᵢ) is
    /// the factor that observation i needs, r its residual, p its residual's variance and v its
    /// noise; c is the 90 % quantile of all cᵢ, kept within 0.01 to 100. Means do not change.
    ///
    /// A function that is rougher in some places than in others breaks the process's assumption,
    /// and then the variance of maximum likelihood is too small in more than a tenth of the places.
    /// Models of fewer than 10 points are returned as they are. Costs an inverse, n³
    /// multiplications.
    #[must_use]
    pub fn calibrated(mut self) -> Self {
        self.calibration = 1.0;
        let n = self.points();
        if n < FEWEST {
            return self;
        }
        let mut needed: Vec<f64> = self
            .residuals()
            .iter()
            .enumerate()
            .map(|(i, &(residual, variance))| {
                let noise = self.points.noise[i] + self.parameters.nugget;
                let of_model = variance - noise;
                let excess = (residual / Z_TWO_SIDED_90).powi(2) - noise;
                if of_model > 0.0 {
                    excess / of_model
                } else if excess > 0.0 {
                    f64::INFINITY
                } else {
                    0.0
                }
            })
            .collect();
        needed.sort_by(f64::total_cmp);
        // As for the coverage of a fresh observation in conformal prediction: ⌈0.9 (n + 1)⌉ of n.
        let rank = (9 * (n + 1)).div_ceil(10).min(n);
        self.calibration = needed[rank - 1].clamp(BOUNDS.0, BOUNDS.1);
        self
    }

    /// The factor of the predicted variances: 1 unless the model was [`Model::calibrated`].
    #[must_use]
    pub fn calibration(&self) -> f64 {
        self.calibration
    }
}
