//! Kriging of many points by nearest-neighbour conditioning (Vecchia's approximation).
//!
//! The density of the observations is a product of conditional ones, each observation given all
//! earlier ones. Given only its m nearest earlier neighbours, the cost falls from n³ to n m³, and
//! with the points in max–min order (each as far as possible from those before it) the neighbours
//! come from all distances. Distances are in units of the ranges. The ranges and the process
//! variance start from an exact fit of a random subset and are refined on the leading points of the
//! order, up to a number that the options limit.
//!
//! Up to `dense` points, Newton steps on the exact likelihood bring the parameters next to its
//! optimum, and predictions and likelihood are exact for these parameters: a step and a dense
//! factorisation cost little beside a search. Beyond, a prediction is simple kriging, with the mean
//! of the whole data, from the nearest observations of all. That costs accuracy: with 200 of 2175
//! points of a smooth function of six variables, a root mean square error a quarter above that of
//! all, with 200 of 6000 a half. So `dense` is as large as memory allows, 10 000 by default.
//!
//! Validation leaves out one observation after the other and predicts it from its nearest others.
//!
//! # References
//!
//! - A. V. Vecchia, "Estimation and model identification for continuous spatial processes", J. R.
//!   Statist. Soc. B 50 (1988) 297–312.
//! - J. Guinness, "Permutation and grouping methods for sharpening Gaussian process
//!   approximations", Technometrics 60 (2018) 415–429.
//! - M. Katzfuss, J. Guinness, E. Lawrence, "Scaled Vecchia approximation for fast computer-model
//!   emulation", SIAM/ASA J. Uncertainty Quantification 10 (2022) 537–554.

mod likelihood;
mod loo;
mod neighbours;

use std::borrow::Cow;

use rand::seq::SliceRandom as _;
use rayon::prelude::*;
use stats::streams::{Purpose, stream};

use crate::bfgs::{Limits, Step, minimise, one_step};
use crate::contradiction;
use crate::coordinates::{Coordinates, rows};
use crate::covariance::{JITTERS, noise_ratio};
use crate::data::{Data, Points, merge};
use crate::fit::report::{Bounds, few_points, no_structure};
use crate::fit::{Start, constant_sigma2, in_units_of_data, start_from_subset};
use crate::gls::Trend;
use crate::kernel::Kernel;
use crate::likelihood::{Form, Likelihood, Order};
use crate::model::{Model, Parameters, Prediction};
use crate::panels::Lower;
use crate::scaled::Scaled;
use crate::{Error, FitOptions, Warning};

use likelihood::{Conditional, Conditionals, Local};
use neighbours::{max_min_order, nearest, nearest_earlier};

/// Random vectors that stand for the inverse in a Newton step's gradient: an eighth of the standard
/// errors is added to the parameters' own.
const PROBES: usize = 64;

/// How to fit by nearest-neighbour conditioning.
#[derive(Debug, Clone, PartialEq)]
pub struct VecchiaOptions {
    /// The correlation function.
    pub kernel: Kernel,
    /// Seed of the subset, of its fit's starts and of the order's first point.
    pub seed: u64,
    /// Neighbours m that each observation is conditioned on in the likelihood.
    pub neighbours: usize,
    /// Observations that a prediction is made from, beyond `dense` points.
    pub prediction_neighbours: usize,
    /// Up to this many points the predictions are exact: 4 n² bytes, n³/3 multiplications. The fit
    /// takes 8 n² bytes in passing, 0.8 GB at the default of 10 000. Just beyond, the error of a
    /// smooth function is half as large again, and a mean takes some twenty times as long.
    pub dense: usize,
    /// Points of the subset whose exact fit starts the search; two fifths of them suffice where Newton
    /// steps follow.
    pub subset: usize,
    /// Whether up to `dense` points, if that is more than the subset, a Newton step on the exact
    /// likelihood of the subset and one on that of all points improve the parameters, in whose gradient
    /// random vectors stand for the inverse: 2/3 n³ multiplications and additions.
    pub newton_step: bool,
    /// Leading points of the order on which the parameters are refined.
    pub refinement: usize,
    /// The most quasi-Newton iterations of the refinement by Vecchia's likelihood. None by default:
    /// for smooth functions with little noise thirty neighbours bias it by more than the exact
    /// likelihood of a thousand points errs.
    pub max_iterations: usize,
}

impl Default for VecchiaOptions {
    fn default() -> Self {
        Self {
            kernel: Kernel::default(),
            seed: 0,
            neighbours: 30,
            prediction_neighbours: 200,
            dense: 10_000,
            subset: 1000,
            newton_step: true,
            refinement: 10_000,
            max_iterations: 0,
        }
    }
}

/// An approximate kriging model for many points: see [`fit_vecchia`].
#[derive(Debug, Clone)]
pub struct Vecchia {
    pub(crate) kernel: Kernel,
    pub(crate) points: Points,
    pub(crate) parameters: Parameters,
    pub(crate) nll: f64,
    pub(crate) neighbours: usize,
    pub(crate) coordinates: Coordinates,
    /// Noise over process variance.
    noise_ratio: Vec<f64>,
    /// Observations less the mean.
    centred: Vec<f64>,
    /// The factor of the predicted variances; that of `exact` where there is one.
    pub(crate) calibration: f64,
    /// All of it, where the points are few enough.
    pub(crate) exact: Option<Box<Model>>,
}

/// Fits ordinary kriging to many points, up to 100 000 and more, in O(n) memory.
///
/// The result depends on the data and the options only. Time: n²d for the neighbours and
/// n m³ for each evaluation of the likelihood.
///
/// # Errors
///
/// Those of [`crate::fit`] for unusable data (a nugget is not on offer here), and [`Error::OutOfRange`]
/// for options of zero.
pub fn fit_vecchia(data: &Data<'_>, options: &VecchiaOptions) -> Result<Vecchia, Error> {
    let counts = [
        ("neighbours", options.neighbours),
        ("prediction neighbours", options.prediction_neighbours),
        ("refinement points", options.refinement),
    ];
    if let Some(&(what, _)) = counts.iter().find(|(_, count)| *count == 0) {
        return Err(Error::OutOfRange { what, value: 0.0 });
    }
    let mut points = merge(data)?;
    let n = points.len();
    if n < 2 {
        return Err(Error::TooFewPoints { distinct: n });
    }
    let scaled = Scaled::new(&points)?;
    contradiction::check(&points, &scaled)?;
    for coordinate in (0..data.d).filter(|j| !scaled.active.contains(j)) {
        points
            .warnings
            .push(Warning::IgnoredCoordinate { coordinate });
    }
    let mut order: Vec<usize> = (0..n).collect();
    order.shuffle(&mut stream(options.seed, Purpose::Fit, 2, 0));
    if scaled.y.iter().all(|y| *y == scaled.y[0]) {
        points.warnings.push(Warning::ConstantResponse);
        let at = vec![0.5_f64.ln(); scaled.active.len()];
        return finish(
            options,
            points,
            &scaled,
            &at,
            constant_sigma2(&scaled),
            None,
        );
    }

    let exact = FitOptions {
        kernel: options.kernel,
        seed: options.seed,
        ..FitOptions::default()
    };
    let stepping = options.newton_step && options.subset < n && n <= options.dense;
    let size = if stepping {
        2 * options.subset / 5
    } else {
        options.subset
    };
    let subset = scaled.subset(&order[..size.clamp(2, n)]);
    let Start {
        mut at,
        lower,
        upper,
        ranges,
        warnings,
    } = start_from_subset(&subset, n, &exact)?;
    // The ranges, σ² and μ.
    points.warnings.extend(few_points(n, ranges + 2));
    let mut model = None;
    if stepping {
        let limits = Limits {
            lower: &lower,
            upper: &upper,
            max_iterations: 1,
            renewed: 0,
            tolerance: 0.0,
        };
        let larger = scaled.subset(&order[..options.subset]);
        let value = |function: &mut Likelihood<'_>, at: &[f64]| {
            Some(function.evaluate(at, Order::Value)?.value)
        };
        let step = newton_step(options.kernel, &larger, &at, &limits, 1.0, value);
        at = step.at;
        // The model of all points at the end of the step has their likelihood, too. What was the best
        // length for a part of the points is close to that for all.
        let value = |function: &mut Likelihood<'_>, at: &[f64]| {
            let room = function.take_matrix();
            let trial = exact_model(options, &points, &scaled, at, room).ok()?;
            let own = trial.nll - n as f64 * scaled.y_scale.ln() - points.within;
            model = Some((at.to_vec(), trial));
            Some(own)
        };
        at = newton_step(options.kernel, &scaled, &at, &limits, step.share, value).at;
    }

    if options.max_iterations > 0 {
        let leading = max_min_order(
            &metric(&scaled, options.kernel, &at),
            order,
            options.refinement,
        );
        let leading = scaled.subset(&leading);
        let earlier = nearest_earlier(&metric(&leading, options.kernel, &at), options.neighbours);
        let conditionals = Conditionals::new(options.kernel, &leading, &earlier);
        let limits = Limits {
            lower: &lower,
            upper: &upper,
            max_iterations: options.max_iterations,
            renewed: 0,
            // Relative to the likelihood of n points this is nothing.
            tolerance: 0.05,
        };
        if let Some(outcome) = minimise(|p, _| conditionals.evaluate(p), &at, &limits) {
            at = outcome.at;
        }
    }
    let (ln_sigma2, ln_ranges) = at.split_last().ok_or(Error::TooFewPoints { distinct: n })?;
    let model = model.filter(|(of, _)| *of == at).map(|(_, model)| model);
    let within = points.within;
    let mut fitted = finish(options, points, &scaled, ln_ranges, ln_sigma2.exp(), model)?;
    let value = fitted.nll - n as f64 * scaled.y_scale.ln() - within;
    let bounds = Bounds {
        lower: &lower,
        upper: &upper,
    };
    let mut of_fit = Vec::from_iter(no_structure(&scaled, value, ranges));
    of_fit.extend(bounds.warnings(&at, &scaled.active, false));
    of_fit.extend(warnings);
    of_fit.extend(fitted.warnings_of_residuals(options.neighbours));
    fitted.warn(of_fit);
    Ok(fitted)
}

/// A step with the average information on the likelihood of `data`, from `at`; `value` gives the value
/// at `share` of it. Where the matrix needs jitter, no step is taken.
fn newton_step<'a>(
    kernel: Kernel,
    data: &'a Scaled,
    at: &[f64],
    limits: &Limits<'_>,
    share: f64,
    value: impl FnOnce(&mut Likelihood<'a>, &[f64]) -> Option<f64>,
) -> Step {
    let form = Form {
        kernel,
        ..Form::default()
    };
    let mut function = Likelihood::new(form, Cow::Borrowed(data), 0.0);
    function.probes = PROBES;
    match function.evaluate(at, Order::Curvature) {
        Some(evaluation) => {
            let value = |p: &[f64]| value(&mut function, p);
            one_step(&evaluation, value, at, limits, share)
        }
        None => Step {
            at: at.to_vec(),
            share,
        },
    }
}

/// The exact model at (ln θ₁ … ln θ_d, ln σ²) of the scaled data, in the place of `room`.
fn exact_model(
    options: &VecchiaOptions,
    points: &Points,
    scaled: &Scaled,
    at: &[f64],
    room: Lower,
) -> Result<Model, Error> {
    let sigma2 = at[at.len() - 1].exp();
    let parameters = in_units_of_data(points, scaled, |k| at[k].exp(), sigma2);
    Model::new_in(
        options.kernel,
        Trend::Constant,
        points.clone(),
        parameters,
        0.0,
        room,
    )
}

/// The coordinates in units of the ranges, for distances.
fn metric(scaled: &Scaled, kernel: Kernel, at: &[f64]) -> Vec<Vec<f64>> {
    let factors = at
        .iter()
        .map(|ln_range| kernel.length_factor() * (-ln_range).exp());
    let columns = scaled.columns.iter().zip(factors);
    columns
        .map(|(column, factor)| column.iter().map(|x| x * factor).collect())
        .collect()
}

/// The model with given parameters, its mean and likelihood from all points; `model` if it is known.
fn finish(
    options: &VecchiaOptions,
    mut points: Points,
    scaled: &Scaled,
    ln_ranges: &[f64],
    sigma2: f64,
    model: Option<Model>,
) -> Result<Vecchia, Error> {
    let n = points.len();
    let mut parameters = in_units_of_data(&points, scaled, |k| ln_ranges[k].exp(), sigma2);
    let (nll, exact) = if n <= options.dense {
        let model = match model {
            Some(model) => model,
            None => Model::new(options.kernel, Trend::Constant, points, parameters, 0.0)?,
        };
        parameters = model.parameters.clone();
        points = model.points.clone();
        (model.nll, Some(Box::new(model)))
    } else {
        let (value, mu) = approximate(options, scaled, ln_ranges, sigma2)?;
        // y = centre + y_scale · scaled y, with one centre for all points.
        let pairs = points.y.iter().zip(&scaled.y);
        let centres = pairs.map(|(y, s)| y - s * scaled.y_scale);
        parameters.mu = centres.sum::<f64>() / n as f64 + mu * scaled.y_scale;
        if !parameters.mu.is_finite() {
            return Err(Error::Extent { what: "y" });
        }
        (value + n as f64 * scaled.y_scale.ln() + points.within, None)
    };
    let neighbours = options.prediction_neighbours.min(n);
    Ok(Vecchia::assemble(
        options.kernel,
        points,
        parameters,
        nll,
        neighbours,
        exact,
    ))
}

/// Vecchia's likelihood of all points in units of the scaled data, and the mean in those.
fn approximate(
    options: &VecchiaOptions,
    scaled: &Scaled,
    ln_ranges: &[f64],
    sigma2: f64,
) -> Result<(f64, f64), Error> {
    let n = scaled.len();
    let mut random: Vec<usize> = (0..n).collect();
    random.shuffle(&mut stream(options.seed, Purpose::Fit, 2, 0));
    let order = max_min_order(&metric(scaled, options.kernel, ln_ranges), random, n);
    let ordered = scaled.subset(&order);
    let earlier = nearest_earlier(
        &metric(&ordered, options.kernel, ln_ranges),
        options.neighbours,
    );
    let at = [ln_ranges, &[sigma2.ln()]].concat();
    Conditionals::new(options.kernel, &ordered, &earlier)
        .value(&at)
        .ok_or(Error::NotPositiveDefinite {
            jitter: JITTERS[JITTERS.len() - 1],
        })
}

impl Vecchia {
    /// Puts a model together from what its predictions need.
    pub(crate) fn assemble(
        kernel: Kernel,
        points: Points,
        parameters: Parameters,
        nll: f64,
        neighbours: usize,
        exact: Option<Box<Model>>,
    ) -> Self {
        let ratio = |v: &f64| noise_ratio(*v, parameters.sigma2);
        Self {
            kernel,
            coordinates: Coordinates::new(kernel, &points, &parameters.ranges),
            noise_ratio: points.noise.iter().map(ratio).collect(),
            centred: points.y.iter().map(|y| y - parameters.mu).collect(),
            points,
            parameters,
            nll,
            neighbours,
            calibration: 1.0,
            exact,
        }
    }

    /// Adds to the warnings, those of a stored model, too.
    fn warn(&mut self, warnings: Vec<Warning>) {
        if let Some(model) = &mut self.exact {
            model.points.warnings.extend(warnings.iter().cloned());
        }
        self.points.warnings.extend(warnings);
    }

    /// Mean and variance at `x` (d coordinates), those of [`Model::predict`] where the points are few
    /// enough. Otherwise from its nearest observations: equations (19) and (20) for those, with the
    /// mean μ of the whole data taken as known. Noise is not part of the
    /// variance. Where even that small covariance matrix cannot be factorised, a jitter of up to
    /// 1e-4 of the process variance is added.
    ///
    /// # Panics
    ///
    /// If `x` has another length than [`Vecchia::dimensions`].
    #[must_use]
    pub fn predict(&self, x: &[f64]) -> Prediction {
        assert_eq!(
            x.len(),
            self.points.d,
            "a point must have the model's number of coordinates"
        );
        if let Some(model) = &self.exact {
            return model.predict(x);
        }
        let at = self.coordinates.scaled(x);
        let columns = &self.coordinates.columns;
        let near = nearest(columns, &at, self.points.len(), self.neighbours);
        let Conditional { mean, variance, .. } = self.given(&near, &at);
        Prediction {
            mean: self.parameters.mu + mean,
            variance: self.parameters.sigma2 * variance * self.calibration,
        }
    }

    /// The process at the scaled coordinates `at` from the observations `near`.
    fn given(&self, near: &[u32], at: &[f64]) -> Conditional {
        let columns = &self.coordinates.columns;
        let mut local = Local::new(self.kernel, columns.len(), near.len() + 1);
        local.gather(columns, near, at);
        let noise: Vec<f64> = near.iter().map(|&i| self.noise_ratio[i as usize]).collect();
        let observed: Vec<f64> = near.iter().map(|&i| self.centred[i as usize]).collect();
        local.predict(&noise, &observed)
    }

    /// The mean at `x` alone.
    ///
    /// # Panics
    ///
    /// If `x` has another length than [`Vecchia::dimensions`].
    #[must_use]
    pub fn mean(&self, x: &[f64]) -> f64 {
        match &self.exact {
            Some(model) => model.mean(x),
            None => self.predict(x).mean,
        }
    }

    /// [`Vecchia::predict`] at many points: row-major, any number of rows of d coordinates; the same
    /// but for rounding. rayon's threads share the rows.
    ///
    /// # Errors
    ///
    /// [`Error::Shape`] if `x` is not a whole number of rows.
    pub fn predict_many(&self, x: &[f64]) -> Result<Vec<Prediction>, Error> {
        let rows = rows(x, self.points.d)?;
        if let Some(model) = &self.exact {
            return model.predict_many(x);
        }
        Ok(rows.into_par_iter().map(|x| self.predict(x)).collect())
    }

    /// [`Vecchia::mean`] at many points: row-major, any number of rows of d coordinates; the same numbers.
    /// rayon's threads share the rows.
    ///
    /// # Errors
    ///
    /// [`Error::Shape`] if `x` is not a whole number of rows.
    pub fn means(&self, x: &[f64]) -> Result<Vec<f64>, Error> {
        let rows = rows(x, self.points.d)?;
        Ok(rows.into_par_iter().map(|x| self.mean(x)).collect())
    }

    /// Number of observations a prediction is made from: all of them where the points are few enough.
    #[must_use]
    pub fn conditioning(&self) -> usize {
        if self.exact.is_some() {
            self.points.len()
        } else {
            self.neighbours
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

    /// Number of coordinates d of a point.
    #[must_use]
    pub fn dimensions(&self) -> usize {
        self.points.d
    }

    /// Number of distinct points.
    #[must_use]
    pub fn points(&self) -> usize {
        self.points.len()
    }

    /// −ln L of all observations, with its n/2 ln 2π: Vecchia's approximation of it, beyond the number
    /// of points whose predictions are exact.
    #[must_use]
    pub fn negative_log_likelihood(&self) -> f64 {
        self.nll
    }

    /// What a user of the model should know about the data and the fit. Ranges that the data do not
    /// determine, and a search that did not converge, are those of the subset that the search starts
    /// from; outliers are judged from the nearest neighbours that the likelihood takes.
    #[must_use]
    pub fn warnings(&self) -> &[Warning] {
        &self.points.warnings
    }
}
