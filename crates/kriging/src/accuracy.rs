//! The method by the accuracy that is asked for.
//!
//! The rule follows a chart of the approximation's error, `examples/vecchia_error.rs`: what the root mean
//! square error of the six-dimensional Hartmann function with noise exceeds the exact fit's by, in
//! per cent, when a prediction is made from its m nearest observations.
//!
//! | n | m = 25 | 50 | 100 | 200 | 400 | 800 | all |
//! |---|---|---|---|---|---|---|---|
//! | 500 | 37 | 19 | 10 | 2 | 0.5 | | 0 |
//! | 1000 | 67 | 40 | 24 | 10 | 3 | 0.3 | 0 |
//!
//! So m has to be a good part of n where the function is smooth, and all observations are used for
//! as long as memory allows; the parameters may come from a subset and one Newton step.
//!
//! | accuracy | up to 1000 points | up to 10 000 | beyond: m |
//! |---|---|---|---|
//! | exact | exact | exact | exact |
//! | fine | exact | Vecchia, all | 400 |
//! | standard | Vecchia, all | Vecchia, all | 200 |
//! | coarse | Vecchia, all | 100 | 100 |
//!
//! Multiplications for n points: exact some 10 n³ in all, Vecchia with all observations 2 n³, and else
//! n²d for the neighbours and m³/3 for each prediction. All observations take 8 n² bytes, 0.8 GB for
//! 10 000.

use std::fmt;
use std::str::FromStr;

use crate::data::Data;
use crate::fit::{FitOptions, fit};
use crate::kernel::Kernel;
use crate::model::{Model, Parameters, Prediction};
use crate::vecchia::{Vecchia, VecchiaOptions, fit_vecchia};
use crate::{Error, LeaveOneOut, Trend, Warning};

/// Up to so many points an exact fit is a matter of a second.
const SMALL: usize = 1000;

/// How near to the exact fit a model has to be.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum Accuracy {
    /// The exact fit, whatever it costs.
    #[default]
    Exact,
    /// Within a few per cent of the exact fit's error up to 10 000 points, from 400 observations
    /// beyond.
    Fine,
    /// Within a few per cent of it up to 10 000 points, from 200 observations beyond.
    Standard,
    /// The soonest.
    Coarse,
}

/// What an [`Accuracy`] comes to for a number of points.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Plan {
    /// [`crate::fit()`].
    Exact,
    /// [`crate::fit_vecchia`] with these options; kernel and seed are those of the fit.
    Vecchia(VecchiaOptions),
}

impl Accuracy {
    /// Every accuracy, the finest first.
    pub const ALL: [Self; 4] = [Self::Exact, Self::Fine, Self::Standard, Self::Coarse];

    /// The name [`FromStr`] accepts and [`fmt::Display`] writes.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Exact => "exact",
            Self::Fine => "fine",
            Self::Standard => "standard",
            Self::Coarse => "coarse",
        }
    }

    /// The method for `n` points, by the table above.
    #[must_use]
    pub fn plan(self, n: usize) -> Plan {
        let vecchia = |dense: usize, prediction_neighbours: usize| {
            Plan::Vecchia(VecchiaOptions {
                dense,
                prediction_neighbours,
                ..VecchiaOptions::default()
            })
        };
        let dense = VecchiaOptions::default().dense;
        match self {
            Self::Exact => Plan::Exact,
            Self::Fine if n <= SMALL => Plan::Exact,
            Self::Fine => vecchia(dense, 400),
            Self::Standard => vecchia(dense, 200),
            Self::Coarse => vecchia(SMALL, 100),
        }
    }
}

impl fmt::Display for Accuracy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for Accuracy {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self, Error> {
        Self::ALL
            .into_iter()
            .find(|accuracy| accuracy.name() == name)
            .ok_or_else(|| Error::UnknownAccuracy {
                name: name.to_owned(),
            })
    }
}

/// A model of either method.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub enum Surrogate {
    /// Of [`crate::fit()`].
    Exact(Model),
    /// Of [`crate::fit_vecchia`].
    Vecchia(Vecchia),
}

/// Fits by the method that `accuracy` asks for at this number of observations, and `options`.
///
/// # Errors
///
/// Those of [`crate::fit()`] and [`crate::fit_vecchia`]; [`Error::ExactOnly`] where the method is an
/// approximate one and the options ask for what only the exact one offers: a linear trend, a nugget,
/// the refusal of models without structure.
pub fn fit_with_accuracy(
    data: &Data<'_>,
    options: &FitOptions,
    accuracy: Accuracy,
) -> Result<Surrogate, Error> {
    let plan = match accuracy.plan(data.y.len()) {
        Plan::Exact => return fit(data, options).map(Surrogate::Exact),
        Plan::Vecchia(plan) => plan,
    };
    let exact_only = [
        ("a linear trend", options.trend != Trend::Constant),
        ("a nugget", options.nugget),
        (
            "refusing models without structure",
            options.refuse_no_structure,
        ),
    ];
    if let Some((what, _)) = exact_only.into_iter().find(|(_, asked)| *asked) {
        return Err(Error::ExactOnly { what });
    }
    let plan = VecchiaOptions {
        kernel: options.kernel,
        seed: options.seed,
        ..plan
    };
    let model = fit_vecchia(data, &plan)?;
    Ok(Surrogate::Vecchia(if options.calibrate {
        model.calibrated()
    } else {
        model
    }))
}

/// Calls a method that both models have.
macro_rules! either {
    ($surrogate:expr, $model:ident => $call:expr) => {
        match $surrogate {
            Surrogate::Exact($model) => $call,
            Surrogate::Vecchia($model) => $call,
        }
    };
}

impl Surrogate {
    /// [`Model::mean`] or [`Vecchia::mean`].
    ///
    /// # Panics
    ///
    /// If `x` has another length than [`Surrogate::dimensions`].
    #[must_use]
    pub fn mean(&self, x: &[f64]) -> f64 {
        either!(self, model => model.mean(x))
    }

    /// [`Model::means`] or [`Vecchia::means`].
    ///
    /// # Errors
    ///
    /// [`Error::Shape`] if `x` is not a whole number of rows.
    pub fn means(&self, x: &[f64]) -> Result<Vec<f64>, Error> {
        either!(self, model => model.means(x))
    }

    /// [`Model::predict`] or [`Vecchia::predict`].
    ///
    /// # Panics
    ///
    /// If `x` has another length than [`Surrogate::dimensions`].
    #[must_use]
    pub fn predict(&self, x: &[f64]) -> Prediction {
        either!(self, model => model.predict(x))
    }

    /// [`Model::predict_many`] or [`Vecchia::predict_many`].
    ///
    /// # Errors
    ///
    /// [`Error::Shape`] if `x` is not a whole number of rows.
    pub fn predict_many(&self, x: &[f64]) -> Result<Vec<Prediction>, Error> {
        either!(self, model => model.predict_many(x))
    }

    /// The parameters of the process.
    #[must_use]
    pub fn parameters(&self) -> &Parameters {
        either!(self, model => model.parameters())
    }

    /// The correlation function.
    #[must_use]
    pub fn kernel(&self) -> Kernel {
        either!(self, model => model.kernel())
    }

    /// Number of coordinates d of a point.
    #[must_use]
    pub fn dimensions(&self) -> usize {
        either!(self, model => model.dimensions())
    }

    /// Number of distinct points.
    #[must_use]
    pub fn points(&self) -> usize {
        either!(self, model => model.points())
    }

    /// −ln L of the observations, or Vecchia's approximation of it.
    #[must_use]
    pub fn negative_log_likelihood(&self) -> f64 {
        either!(self, model => model.negative_log_likelihood())
    }

    /// [`Model::leave_one_out`] or [`Vecchia::leave_one_out`].
    #[must_use]
    pub fn leave_one_out(&self) -> LeaveOneOut {
        either!(self, model => model.leave_one_out())
    }

    /// The factor of the predicted variances: 1 unless they were calibrated.
    #[must_use]
    pub fn calibration(&self) -> f64 {
        either!(self, model => model.calibration())
    }

    /// What a user of the model should know about the data and the fit.
    #[must_use]
    pub fn warnings(&self) -> &[Warning] {
        either!(self, model => model.warnings())
    }
}
