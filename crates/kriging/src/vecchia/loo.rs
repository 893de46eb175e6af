//! Leave-one-out validation from the nearest neighbours.

use rayon::prelude::*;

use super::Vecchia;
use super::neighbours::nearest;
use crate::Warning;
use crate::likelihood::point;
use crate::model::calibration::{Residual, factor};
use crate::model::loo::LeaveOneOut;

impl Vecchia {
    /// Predicts each point from the nearest other observations, as many as
    /// [`Vecchia::conditioning`] says, like any prediction of the model. The mean μ is kept,
    /// because one observation of thousands does not move it. Costs as much as n predictions.
    #[must_use]
    pub fn leave_one_out(&self) -> LeaveOneOut {
        let (residuals, _) = self.residuals(self.neighbours);
        LeaveOneOut::new(&self.points, &residuals, self.calibration)
    }

    /// The model with its predicted variances multiplied by a factor from the residuals of
    /// [`Vecchia::leave_one_out`], as [`crate::Model::calibrated`] describes it.
    #[must_use]
    pub fn calibrated(mut self) -> Self {
        self.calibration = factor(&self.residuals(self.neighbours).0);
        self
    }

    /// The factor of the predicted variances: 1 unless the model was [`Vecchia::calibrated`].
    #[must_use]
    pub fn calibration(&self) -> f64 {
        self.calibration
    }

    /// The warnings about outliers among the residuals given `neighbours` others, and about the
    /// jitter used.
    pub(super) fn warnings_of_residuals(&self, neighbours: usize) -> Vec<Warning> {
        let (residuals, jitter) = self.residuals(neighbours);
        let mut warnings = Vec::new();
        if jitter > 0.0 {
            warnings.push(Warning::Jitter { relative: jitter });
        }
        warnings.extend(LeaveOneOut::new(&self.points, &residuals, 1.0).warning());
        warnings
    }

    /// The residual of each point given its `neighbours` nearest others, not calibrated, and the
    /// largest jitter that any took.
    fn residuals(&self, neighbours: usize) -> (Vec<Residual>, f64) {
        let n = self.points.len();
        let columns = &self.coordinates.columns;
        let of_point = |i: usize| {
            let at = point(columns, i);
            let mut near = nearest(columns, &at, n, neighbours + 1);
            near.retain(|&j| j as usize != i);
            // Needed only if so many points lie on top of this one that it is not among its own
            // nearest.
            near.truncate(neighbours);
            let given = self.given(&near, &at);
            let noise = self.points.noise[i];
            let residual = Residual {
                residual: self.centred[i] - given.means[0],
                variance: self.parameters.sigma2 * (given.variance + given.jitter) + noise,
                noise,
            };
            (residual, given.jitter)
        };
        let all: Vec<(Residual, f64)> = (0..n)
            .into_par_iter()
            .with_min_len(64)
            .map(of_point)
            .collect();
        let jitter = all.iter().map(|(_, jitter)| *jitter).fold(0.0, f64::max);
        (
            all.into_iter().map(|(residual, _)| residual).collect(),
            jitter,
        )
    }
}
