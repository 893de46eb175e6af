//! Leave-one-out validation from the nearest neighbours.

use rayon::prelude::*;

use super::Vecchia;
use super::likelihood::Conditional;
use super::neighbours::nearest;
use crate::Warning;
use crate::calibration::{Residual, factor};
use crate::loo::LeaveOneOut;

/// Points whose residuals one thread computes together.
const CHUNK: usize = 64;

impl Vecchia {
    /// Predicts each point without its own observation as the model predicts any other: that of
    /// [`crate::Model::leave_one_out`] where the points are few enough for exact predictions,
    /// otherwise from the nearest other observations, as many as [`Vecchia::conditioning`] says. The
    /// mean μ is then kept, which one observation of thousands does not move.
    ///
    /// Costs an inverse, n³ multiplications, or else as much as n predictions.
    #[must_use]
    pub fn leave_one_out(&self) -> LeaveOneOut {
        match &self.exact {
            Some(model) => model.leave_one_out(),
            None => {
                let (residuals, _) = self.residuals(self.neighbours);
                LeaveOneOut::new(&self.points, &residuals, self.calibration)
            }
        }
    }

    /// The model with its predicted variances multiplied by a factor from the residuals of
    /// [`Vecchia::leave_one_out`], as [`crate::Model::calibrated`] describes it.
    #[must_use]
    pub fn calibrated(mut self) -> Self {
        match self.exact.take() {
            Some(model) => self.exact = Some(Box::new(model.calibrated())),
            None => self.calibration = factor(&self.residuals(self.neighbours).0),
        }
        self
    }

    /// The factor of the predicted variances: 1 unless the model was [`Vecchia::calibrated`].
    #[must_use]
    pub fn calibration(&self) -> f64 {
        match &self.exact {
            Some(model) => model.calibration(),
            None => self.calibration,
        }
    }

    /// The warnings that follow from the residuals given `neighbours` others: of outliers and, where
    /// predictions are local, of the jitter they take.
    pub(super) fn warnings_of_residuals(&self, neighbours: usize) -> Vec<Warning> {
        let (residuals, jitter) = self.residuals(neighbours);
        let mut warnings = Vec::new();
        if self.exact.is_none() && jitter > 0.0 {
            warnings.push(Warning::Jitter { relative: jitter });
        }
        warnings.extend(LeaveOneOut::new(&self.points, &residuals, 1.0).warning(&self.points));
        warnings
    }

    /// The residual of each point given its `neighbours` nearest others, not calibrated, and the
    /// largest jitter that any took.
    fn residuals(&self, neighbours: usize) -> (Vec<Residual>, f64) {
        let n = self.points.len();
        let columns = &self.coordinates.columns;
        let of_point = |i: usize| {
            let at: Vec<f64> = columns.iter().map(|c| c[i]).collect();
            let mut near = nearest(columns, &at, n, neighbours + 1);
            near.retain(|&j| j as usize != i);
            // Only where so many points lie on top of this one that it is not among its nearest.
            near.truncate(neighbours);
            let Conditional {
                mean,
                variance,
                jitter,
            } = self.given(&near, &at);
            let noise = self.points.noise[i];
            let residual = Residual {
                residual: self.centred[i] - mean,
                variance: self.parameters.sigma2 * (variance + jitter) + noise,
                noise,
            };
            (residual, jitter)
        };
        let starts: Vec<usize> = (0..n).step_by(CHUNK).collect();
        let all: Vec<(Residual, f64)> = starts
            .into_par_iter()
            .flat_map_iter(|start| {
                let chunk = start..(start + CHUNK).min(n);
                chunk.map(of_point).collect::<Vec<_>>()
            })
            .collect();
        let jitter = all.iter().map(|(_, jitter)| *jitter).fold(0.0, f64::max);
        (
            all.into_iter().map(|(residual, _)| residual).collect(),
            jitter,
        )
    }
}
