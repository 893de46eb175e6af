//! A model of either method, exact or approximate.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::data::Data;
use crate::fit::{FitOptions, fit};
use crate::kernel::Kernel;
use crate::model::predict::Prediction;
use crate::model::{Model, Parameters};
use crate::vecchia::{Vecchia, VecchiaOptions, fit_vecchia};
use crate::{Error, LeaveOneOut, Trend, Warning};

/// From more distinct points than this, [`Method::Auto`] approximates: an exact fit takes 24 n² bytes, 2.4 GB
/// here, and minutes.
const MANY: usize = 10_000;

/// How to fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// [`fit()`] up to 10 000 observations, [`fit_vecchia`] beyond.
    #[default]
    Auto,
    /// [`fit()`].
    Exact,
    /// [`fit_vecchia`].
    Vecchia,
}

impl Method {
    /// Every method.
    pub const ALL: [Self; 3] = [Self::Auto, Self::Exact, Self::Vecchia];

    /// The name in files and on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::Exact => "exact",
            Self::Vecchia => "vecchia",
        }
    }
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for Method {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self, Error> {
        let found = Self::ALL.into_iter().find(|method| method.name() == name);
        found.ok_or_else(|| Error::UnknownMethod {
            name: name.to_owned(),
        })
    }
}

/// Fits by `method`.
///
/// # Errors
///
/// Those of [`fit()`] and [`fit_vecchia`]; [`Error::ExactOnly`] where the method is the
/// approximate one and the options ask for what only the exact one offers: a linear trend, a nugget.
pub fn fit_by(data: &Data<'_>, options: &FitOptions, method: Method) -> Result<Surrogate, Error> {
    let is_exact = match method {
        Method::Auto => data.y.len() <= MANY,
        Method::Exact => true,
        Method::Vecchia => false,
    };
    if is_exact {
        return fit(data, options).map(Surrogate::Exact);
    }
    let exact_only = [
        ("a linear trend", options.trend != Trend::Constant),
        ("a nugget", options.nugget),
    ];
    if let Some((what, _)) = exact_only.into_iter().find(|(_, asked)| *asked) {
        return Err(Error::ExactOnly { what });
    }
    let approximate = VecchiaOptions {
        kernel: options.kernel,
        seed: options.seed,
        ..VecchiaOptions::default()
    };
    let model = fit_vecchia(data, &approximate)?;
    let no_structure = model.warnings().iter().find_map(|warning| match warning {
        Warning::NoStructure { gain, needed } => Some((*gain, *needed)),
        _ => None,
    });
    if options.refuse_no_structure
        && let Some((gain, needed)) = no_structure
    {
        return Err(Error::NoStructure { gain, needed });
    }
    Ok(Surrogate::Vecchia(if options.calibrate {
        model.calibrated()
    } else {
        model
    }))
}

/// A model of either method.
#[derive(Debug, Clone)]
pub enum Surrogate {
    /// Of [`crate::fit()`].
    Exact(Model),
    /// Of [`crate::fit_vecchia`].
    Vecchia(Vecchia),
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
