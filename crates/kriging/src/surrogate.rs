//! A model by any method, of the response or of its logarithm.

mod stored;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use statrs::function::erf::erfc_inv;

use crate::data::Data;
use crate::fit::fit;
use crate::fit::options::FitOptions;
use crate::fit::report::check_structure;
use crate::kernel::Kernel;
use crate::model::predict::Prediction;
use crate::model::{Model, Parameters};
use crate::vecchia::{Vecchia, VecchiaOptions, fit_vecchia};
use crate::{Error, LeaveOneOut, Noise, Trend, Warning};

/// Number of observations above which [`Method::Auto`] approximates: the exact fit would take
/// 24 n² bytes, 2.4 GB here, and minutes.
const MANY: usize = 10_000;

/// The observations that a prediction uses.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// `"exact"` up to 10 000 observations, `"vecchia"` above.
    #[default]
    Auto,
    /// All observations.
    Exact,
    /// The nearest observations, by Vecchia's approximation.
    Vecchia,
}

/// The quantity that is modelled.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Response {
    /// The response y.
    #[default]
    Plain,
    /// ln y, for positive responses that vary by factors. Its noise variance is v/y², to first order.
    Log,
}

/// Settings of a fit of a [`Surrogate`].
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Settings {
    /// The search for the parameters.
    pub fit: FitOptions,
    /// The method of prediction.
    pub method: Method,
    /// The quantity that is modelled.
    pub response: Response,
    /// The source of the noise variances that the caller passes: [`Noise::variances`].
    pub noise: Noise,
}

/// A kriging model by either method, of the response or of its logarithm.
///
/// A model of ln y predicts the median of y, exp(mean of ln y), and the variance of y to first order,
/// exp(2 mean) times that of ln y.
#[derive(Debug, Clone)]
pub struct Surrogate {
    pub(crate) model: AnyModel,
    pub(crate) response: Response,
}

/// A model by either method, on the modelled scale.
#[derive(Debug, Clone)]
pub(crate) enum AnyModel {
    Exact(Model),
    Vecchia(Vecchia),
}

impl From<Model> for Surrogate {
    fn from(model: Model) -> Self {
        Self {
            model: AnyModel::Exact(model),
            response: Response::Plain,
        }
    }
}

impl From<Vecchia> for Surrogate {
    fn from(model: Vecchia) -> Self {
        Self {
            model: AnyModel::Vecchia(model),
            response: Response::Plain,
        }
    }
}

/// Calls a method that both kinds of model have.
macro_rules! of_model {
    ($surrogate:expr, $model:ident => $call:expr) => {
        match &$surrogate.model {
            AnyModel::Exact($model) => $call,
            AnyModel::Vecchia($model) => $call,
        }
    };
}

impl Surrogate {
    /// Fits by the method of `settings`.
    ///
    /// # Errors
    ///
    /// The errors of [`fit()`] and [`fit_vecchia`]; [`Error::ExactOnly`] for a linear trend with the
    /// approximate method; [`Error::Logarithm`] for the logarithm of an observation that is not positive.
    pub fn fit(data: &Data<'_>, settings: &Settings) -> Result<Self, Error> {
        let response = settings.response;
        let logarithms = match response {
            Response::Plain => None,
            Response::Log => Some(logarithms(data)?),
        };
        let data = match &logarithms {
            None => *data,
            Some((y, noise_variance)) => Data {
                y,
                noise_variance,
                ..*data
            },
        };
        let is_exact = match settings.method {
            Method::Auto => data.y.len() <= MANY,
            Method::Exact => true,
            Method::Vecchia => false,
        };
        let model = if is_exact {
            AnyModel::Exact(fit(&data, &settings.fit)?)
        } else {
            AnyModel::Vecchia(approximate(&data, &settings.fit)?)
        };
        Ok(Self { model, response })
    }

    /// [`Model::mean`] or [`Vecchia::mean`]; for a model of ln y, the exponential of it.
    ///
    /// # Panics
    ///
    /// If `x` has another length than [`Surrogate::dimensions`].
    #[must_use]
    pub fn mean(&self, x: &[f64]) -> f64 {
        self.in_units_of_y(of_model!(self, model => model.mean(x)))
    }

    /// The gradient of [`Surrogate::mean`] at `x`; `None` for the approximate method, whose mean is not continuous.
    ///
    /// # Panics
    ///
    /// As [`Surrogate::mean`].
    #[must_use]
    pub fn gradient(&self, x: &[f64]) -> Option<Vec<f64>> {
        let model = self.exact()?;
        let factor = match self.response {
            Response::Plain => 1.0,
            Response::Log => self.mean(x),
        };
        Some(model.gradient(x).into_iter().map(|g| factor * g).collect())
    }

    /// [`Surrogate::mean`] at many points: row-major, any number of rows.
    ///
    /// # Errors
    ///
    /// [`Error::Shape`] if `x` is not a whole number of rows.
    pub fn means(&self, x: &[f64]) -> Result<Vec<f64>, Error> {
        let means = of_model!(self, model => model.means(x))?;
        Ok(means.into_iter().map(|m| self.in_units_of_y(m)).collect())
    }

    /// [`Model::predict_many`] or [`Vecchia::predict_many`]; for a model of ln y, in units of y.
    ///
    /// # Errors
    ///
    /// [`Error::Shape`] if `x` is not a whole number of rows.
    pub fn predict_many(&self, x: &[f64]) -> Result<Vec<Prediction>, Error> {
        let predictions = of_model!(self, model => model.predict_many(x))?;
        let in_units = |Prediction { mean, variance }| {
            let mean = self.in_units_of_y(mean);
            let variance = match self.response {
                Response::Plain => variance,
                Response::Log => mean * mean * variance,
            };
            Prediction { mean, variance }
        };
        Ok(predictions.into_iter().map(in_units).collect())
    }

    /// The `level` quantile (0 < level < 1), in units of y, of the distribution that a prediction of this
    /// model gives the noise-free function: normal, or log-normal where ln y is modelled.
    #[must_use]
    pub fn quantile(&self, prediction: Prediction, level: f64) -> f64 {
        let z = -std::f64::consts::SQRT_2 * erfc_inv(2.0 * level);
        let Prediction { mean, variance } = prediction;
        match self.response {
            Response::Plain => mean + z * variance.sqrt(),
            Response::Log => mean * (z * variance.sqrt() / mean).exp(),
        }
    }

    /// A value on the modelled scale in units of y.
    fn in_units_of_y(&self, modelled: f64) -> f64 {
        match self.response {
            Response::Plain => modelled,
            Response::Log => modelled.exp(),
        }
    }

    /// [`Model::leave_one_out`] or [`Vecchia::leave_one_out`]. For a model of ln y, residuals and their
    /// root mean square are in units of y, and the standardised residuals are those of ln y.
    #[must_use]
    pub fn leave_one_out(&self) -> LeaveOneOut {
        let modelled = of_model!(self, model => model.leave_one_out());
        match self.response {
            Response::Plain => modelled,
            Response::Log => modelled.exponentiated(&self.observations()),
        }
    }

    /// The observations on the modelled scale in the order of [`LeaveOneOut::residuals`].
    fn observations(&self) -> Vec<f64> {
        let points = of_model!(self, model => &model.points);
        points.by_first().into_iter().map(|i| points.y[i]).collect()
    }

    /// −ln L of the observations, or Vecchia's approximation of it. It is that of y also if ln y is
    /// modelled, so that the two can be compared.
    #[must_use]
    pub fn negative_log_likelihood(&self) -> f64 {
        let jacobian = match self.response {
            Response::Plain => 0.0,
            Response::Log => self.observations().iter().sum(),
        };
        self.modelled_likelihood() + jacobian
    }

    /// −ln L of the modelled quantity.
    pub(crate) fn modelled_likelihood(&self) -> f64 {
        of_model!(self, model => model.negative_log_likelihood())
    }

    /// The exact model, on the modelled scale.
    #[must_use]
    pub fn exact(&self) -> Option<&Model> {
        match &self.model {
            AnyModel::Exact(model) => Some(model),
            AnyModel::Vecchia(_) => None,
        }
    }

    /// The approximate model, on the modelled scale.
    #[must_use]
    pub fn vecchia(&self) -> Option<&Vecchia> {
        match &self.model {
            AnyModel::Exact(_) => None,
            AnyModel::Vecchia(model) => Some(model),
        }
    }

    /// The quantity that is modelled.
    #[must_use]
    pub fn response(&self) -> Response {
        self.response
    }

    /// The parameters of the process, on the modelled scale.
    #[must_use]
    pub fn parameters(&self) -> &Parameters {
        of_model!(self, model => model.parameters())
    }

    /// The correlation function.
    #[must_use]
    pub fn kernel(&self) -> Kernel {
        of_model!(self, model => model.kernel())
    }

    /// Number of coordinates d of a point.
    #[must_use]
    pub fn dimensions(&self) -> usize {
        of_model!(self, model => model.dimensions())
    }

    /// Number of distinct points.
    #[must_use]
    pub fn points(&self) -> usize {
        of_model!(self, model => model.points())
    }

    /// The box that the points span: lowest and highest value of each of the d coordinates.
    #[must_use]
    pub fn bounds(&self) -> Vec<[f64; 2]> {
        let points = of_model!(self, model => &model.points);
        (0..points.d).map(|j| points.interval(j)).collect()
    }

    /// The factor of the predicted variances: 1 unless they were calibrated.
    #[must_use]
    pub fn calibration(&self) -> f64 {
        of_model!(self, model => model.calibration())
    }

    /// The variance of an observation's noise, on the modelled scale: the nugget and the mean of the known noise
    /// variances. Observations of one point that were merged count as one, with the variance of their
    /// mean.
    #[must_use]
    pub fn noise_variance(&self) -> f64 {
        let noise = of_model!(self, model => &model.points.noise);
        self.parameters().nugget + noise.iter().sum::<f64>() / noise.len() as f64
    }

    /// The prediction of a new observation whose noise has this variance on the modelled scale: the same
    /// mean, and the variance of the noise on top.
    #[must_use]
    pub fn observed(&self, prediction: Prediction, noise_variance: f64) -> Prediction {
        let Prediction { mean, variance } = prediction;
        let noise = match self.response {
            Response::Plain => noise_variance,
            Response::Log => mean * mean * noise_variance,
        };
        Prediction {
            mean,
            variance: variance + noise,
        }
    }

    /// The warnings about the data and the fit.
    #[must_use]
    pub fn warnings(&self) -> &[Warning] {
        of_model!(self, model => model.warnings())
    }
}

/// ln y and its noise variances.
fn logarithms(data: &Data<'_>) -> Result<(Vec<f64>, Vec<f64>), Error> {
    if let Some(index) = data.y.iter().position(|y| *y <= 0.0) {
        let value = data.y[index];
        return Err(Error::Logarithm { index, value });
    }
    let pairs = data.y.iter().zip(data.noise_variance);
    Ok(pairs.map(|(y, v)| (y.ln(), v / (y * y))).unzip())
}

/// Fits by nearest-neighbour conditioning; refuses options that only the exact fit has.
fn approximate(data: &Data<'_>, options: &FitOptions) -> Result<Vecchia, Error> {
    if options.trend != Trend::Constant {
        return Err(Error::ExactOnly {
            what: "a linear trend",
        });
    }
    let model = fit_vecchia(
        data,
        &VecchiaOptions {
            kernel: options.kernel,
            estimator: options.estimator,
            seed: options.seed,
            nugget: options.nugget,
            ..VecchiaOptions::default()
        },
    )?;
    if options.refuse_no_structure {
        check_structure(model.warnings())?;
    }
    Ok(if options.calibrate {
        model.calibrated()
    } else {
        model
    })
}
