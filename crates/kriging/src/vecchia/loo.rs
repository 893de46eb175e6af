//! Leave-one-out validation from the nearest neighbours.

use rayon::prelude::*;

use super::Vecchia;
use super::neighbours::nearest;
use crate::Warning;
use crate::likelihood::point;
use crate::model::calibration::factor;
use crate::model::loo::{LeaveOneOut, Residual};

/// Points that are left out together.
#[derive(Debug, Clone, Copy)]
struct Group {
    /// Index of one of the points, which identifies the group.
    first: usize,
    /// Number of points.
    size: usize,
}

impl Vecchia {
    /// Predicts each point from the [`Vecchia::prediction_neighbours`] nearest observations of other
    /// points, like any prediction of the model. Points that are nearly the same count as one, see
    /// [`LeaveOneOut`]. The mean μ is kept, because one observation of thousands does not move it. Costs
    /// as much as n predictions.
    #[must_use]
    pub fn leave_one_out(&self) -> LeaveOneOut {
        let (groups, distinct) = self.groups();
        let (residuals, _) = self.residuals(self.neighbours, &groups);
        LeaveOneOut::new(&self.points, &residuals, distinct, self.calibration)
    }

    /// The model with its predicted variances multiplied by a factor from the residuals of
    /// [`Vecchia::leave_one_out`], as [`crate::Model::calibrated`] describes it.
    #[must_use]
    pub fn calibrated(mut self) -> Self {
        let (groups, _) = self.groups();
        self.calibration = factor(&self.residuals(self.neighbours, &groups).0);
        self
    }

    /// The group of nearly equal points that each point belongs to, and the number of groups. Most groups
    /// have one point.
    fn groups(&self) -> (Vec<Group>, usize) {
        let n = self.points.len();
        let mut groups: Vec<Group> = (0..n).map(|first| Group { first, size: 1 }).collect();
        let mut distinct = n;
        for group in self.coordinates.near_groups(self.kernel) {
            distinct -= group.len() - 1;
            let (first, size) = (group[0], group.len());
            for i in group {
                groups[i] = Group { first, size };
            }
        }
        (groups, distinct)
    }

    /// The factor of the predicted variances: 1 unless the model was [`Vecchia::calibrated`].
    #[must_use]
    pub fn calibration(&self) -> f64 {
        self.calibration
    }

    /// The warnings about outliers among the residuals given `neighbours` others, and about the
    /// jitter used.
    pub(super) fn warnings_of_residuals(&self, neighbours: usize) -> Vec<Warning> {
        let n = self.points.len();
        // Outliers differ from the other observations at their points, too.
        let alone: Vec<Group> = (0..n).map(|first| Group { first, size: 1 }).collect();
        let (residuals, jitter) = self.residuals(neighbours, &alone);
        let mut warnings = Vec::new();
        if jitter > 0.0 {
            warnings.push(Warning::Jitter { relative: jitter });
        }
        warnings.extend(LeaveOneOut::new(&self.points, &residuals, n, 1.0).warning());
        warnings
    }

    /// The residual of each point given its `neighbours` nearest of other `groups`, not calibrated, and
    /// the largest jitter that any took.
    fn residuals(&self, neighbours: usize, groups: &[Group]) -> (Vec<Residual>, f64) {
        let n = self.points.len();
        let columns = &self.coordinates.columns;
        let of_point = |i: usize| {
            let at = point(columns, i);
            let Group { first, size } = groups[i];
            let count = (neighbours + size).min(n);
            let mut near = nearest(columns, &at, n, count);
            near.retain(|&j| groups[j as usize].first != first);
            // Shortens the list only where the point is not among its own nearest, because others
            // coincide with it.
            near.truncate(neighbours);
            let given = self.conditional(&near, &at);
            let noise = self.points.noise[i] + self.parameters.nugget;
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
