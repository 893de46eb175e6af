//! More observations for a fitted model, with its covariance parameters kept.

use super::{Factorisation, Model};
use crate::data::scaled::ScaledData;
use crate::data::{self, Points, contradiction, merge_repeated};
use crate::error::check_length;
use crate::likelihood::{noise_ratio, point};
use crate::linalg::{LowerTriangle, Spd};
use crate::{Data, Error, Warning};

impl Model {
    /// The model with further observations, its kernel, ranges, process variance, nugget and
    /// calibration as they are; the trend is estimated anew.
    ///
    /// The new rows are appended to the Cholesky factor, which costs n²m multiplications for m new
    /// points instead of a fit's hundreds of n³. The matrix is factorised anew (n³/6) only if a new
    /// observation repeats a point of the model or the longer matrix is nearly singular. The
    /// numbers of the new observations follow those of the model's, in the order given. Coordinates
    /// that the model ignores stay ignored.
    ///
    /// More observations never raise the variance at a point. A coordinate's scale is that of the
    /// old points: call [`crate::fit`] when the data have changed much.
    ///
    /// # Errors
    ///
    /// The errors of [`crate::fit`] for unusable data; [`Error::Shape`] if `data` has another
    /// number of coordinates than the model.
    pub fn with_points(&self, data: &Data<'_>) -> Result<Self, Error> {
        let d = self.points.d;
        check_length("every point", d, data.d)?;
        // The nugget belongs to every observation, so they are not merged.
        let apart = self.has_nugget();
        let (mut new, warnings) = data::points(data, apart)?;
        let repeated = |i: usize| (0..self.points()).any(|k| self.points.row(k) == new.row(i));
        if !apart && (0..new.len()).any(repeated) {
            return self.refactorised(data);
        }

        let mut points = self.points.clone();
        points.within = self.within();
        points.x.append(&mut new.x);
        points.y.append(&mut new.y);
        points.noise.append(&mut new.noise);
        points
            .first
            .extend(new.first.iter().map(|i| self.points.observations + i));
        points.within += new.within;
        points.observations += new.observations;

        let mut model = self.on_points(points, warnings)?;
        // Coordinates are relative to their smallest value, which the new points may have changed.
        // The old factor remains right, since correlations depend on differences only.
        let extended = self.extended_factor(&model);
        let factorisation = extended.and_then(|factor| {
            let gls = model.solve_trend(&factor)?;
            Some(Factorisation::new(factor, gls))
        });
        match factorisation {
            Some(factorisation) => {
                model.estimate_trend(factorisation);
                model.warnings.extend(model.jitter_warning());
                model.checked()
            }
            None => model.factorised_anew(),
        }
    }

    /// The factor of `longer`'s matrix, whose first points are those of this model. `None` if the matrix
    /// needs more jitter, which the full factorisation finds.
    fn extended_factor(&self, longer: &Self) -> Option<Spd> {
        let (old, n) = (self.points(), longer.points());
        let columns = &longer.coordinates.columns;
        let correlations = |k: usize, from: usize, to: &mut [f64]| {
            let run = from..from + to.len();
            let at = point(columns, k);
            longer
                .kernel
                .correlations(&at, |j| &columns[j][run.clone()], to);
        };
        let mut cross = vec![0.0; old * (n - old)];
        for (k, column) in (old..).zip(cross.chunks_exact_mut(old)) {
            correlations(k, 0, column);
        }
        let corner = LowerTriangle::from_columns(n - old, |k, column| {
            correlations(old + k, old + k, column);
            let noise = longer.points.noise[old + k] + longer.parameters.nugget;
            column[0] += longer.jitter + noise_ratio(noise, longer.parameters.sigma2);
        });
        self.factorisation().factor.append_rows(cross, &corner)
    }

    fn has_nugget(&self) -> bool {
        self.parameters.nugget > 0.0
    }

    /// The model of the old points, each with its merged observation, and the new ones.
    fn refactorised(&self, data: &Data<'_>) -> Result<Self, Error> {
        let old = &self.points;
        let join = |a: &[f64], b: &[f64]| [a, b].concat();
        let (x, y) = (join(&old.x, data.x), join(&old.y, data.y));
        let noise_variance = join(&old.noise, data.noise_variance);
        let (mut points, warnings) = merge_repeated(&Data {
            x: &x,
            d: old.d,
            y: &y,
            noise_variance: &noise_variance,
        })?;
        points.within += self.within();
        for first in &mut points.first {
            *first = match old.first.get(*first) {
                Some(first) => *first,
                None => old.observations + *first - old.len(),
            };
        }
        points.observations = old.observations + data.y.len();
        self.on_points(points, warnings)?.factorised_anew()
    }

    /// A model of other points with this model's parameters and the `warnings` of the new data, not
    /// factorised yet.
    fn on_points(&self, points: Points, warnings: Vec<Warning>) -> Result<Self, Error> {
        if !self.has_nugget() {
            contradiction::check(&points, &ScaledData::new(&points)?)?;
        }
        let warnings = joined_warnings(&self.warnings, &points, warnings);
        let parameters = self.parameters.clone();
        let mut model = Self::assemble(self.kernel, self.trend, points, parameters, self.jitter);
        model.calibration = self.calibration;
        model.warnings = warnings;
        model.coordinates.check()?;
        Ok(model)
    }

    /// Factorises the whole matrix.
    fn factorised_anew(self) -> Result<Self, Error> {
        let mut model = self.factorised()?;
        model.warnings.extend(model.jitter_warning());
        Ok(model)
    }

    /// The model that interpolates its own means at its points: the same parameters, and
    /// observations without noise. Its variances do not include the uncertainty of those means.
    ///
    /// # Errors
    ///
    /// [`Error::NotPositiveDefinite`] where the matrix cannot be factorised without the noise.
    pub fn reinterpolated(&self) -> Result<Self, Error> {
        let mut points = self.points.clone();
        points.y = (0..points.len())
            .map(|i| self.mean(points.row(i)))
            .collect();
        points.noise.fill(0.0);
        self.on_points(points, Vec::new())?.factorised_anew()
    }

    /// The merged observations' part of the likelihood: a stored model holds only the total.
    fn within(&self) -> f64 {
        self.nll - self.likelihood_of_points()
    }
}

/// The warnings of a model whose points are now `points`, and those of its further data.
fn joined_warnings(old: &[Warning], points: &Points, new: Vec<Warning>) -> Vec<Warning> {
    let mut warnings: Vec<Warning> = points.merged_duplicates().into_iter().collect();
    for warning in old.iter().cloned().chain(new) {
        let is_renewed = matches!(
            warning,
            Warning::MergedDuplicates { .. } | Warning::Jitter { .. }
        );
        if !is_renewed && !warnings.contains(&warning) {
            warnings.push(warning);
        }
    }
    warnings
}
