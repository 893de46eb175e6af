//! Models as JSON.

use std::mem::take;

use serde::{Deserialize, Serialize};

use crate::data::Points;
use crate::error::{check_finite, check_length, check_noise};
use crate::kernel::Kernel;
use crate::likelihood::gls::Trend;
use crate::model::{Model, Parameters};
use crate::surrogate::{AnyModel, Response, Surrogate};
use crate::{Error, Vecchia, Warning};

/// Version of the format, raised when a change would make older programs misread it.
const VERSION: u32 = 1;

/// An exact model in a file, or the common part of an approximate one.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct StoredModel {
    version: u32,
    kernel: Kernel,
    response: Response,
    dimensions: usize,
    mu: f64,
    sigma2: f64,
    /// `null` where a coordinate is ignored: JSON has no infinity.
    ranges: Vec<Option<f64>>,
    jitter: f64,
    negative_log_likelihood: f64,
    warnings: Vec<Warning>,
    /// Row-major.
    x: Vec<f64>,
    y: Vec<f64>,
    noise_variance: Vec<f64>,
    weights: Vec<f64>,
    first_observation: Vec<usize>,
    trend: Trend,
    slopes: Vec<f64>,
    nugget: f64,
    calibration: f64,
}

/// The fields that are read first. The version and the method determine the other fields.
#[derive(Deserialize)]
struct Header {
    version: u32,
    #[serde(default)]
    method: Option<serde::de::IgnoredAny>,
}

/// A model of nearest neighbours. In a file, its field `method` distinguishes it from an exact one.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct StoredVecchia {
    version: u32,
    method: ApproximateMethod,
    /// Observations per prediction.
    neighbours: usize,
    model: StoredModel,
}

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum ApproximateMethod {
    Vecchia,
}

impl Surrogate {
    /// The model as one JSON object. Numbers are written so that they are read back exactly.
    ///
    /// # Errors
    ///
    /// [`Error::Json`] if the writer fails.
    pub fn to_json(&self) -> Result<String, Error> {
        let response = self.response;
        match &self.model {
            AnyModel::Exact(model) => serde_json::to_string(&StoredModel {
                response,
                jitter: model.jitter,
                weights: model.weights.clone(),
                trend: model.trend,
                ..StoredModel::new(self, &model.points)
            }),
            AnyModel::Vecchia(model) => serde_json::to_string(&StoredVecchia {
                version: VERSION,
                method: ApproximateMethod::Vecchia,
                neighbours: model.neighbours,
                model: StoredModel {
                    response,
                    ..StoredModel::new(self, &model.points)
                },
            }),
        }
        .map_err(Error::Json)
    }

    /// Reads the text of [`Surrogate::to_json`]. The means of the model read are bit for bit those of the
    /// model written. The covariance matrix is factorised at the first prediction of a variance.
    ///
    /// # Errors
    ///
    /// [`Error::Json`] and [`Error::Version`] for text that is not a stored model, [`Error::Shape`],
    /// [`Error::NonFinite`], [`Error::NegativeNoise`] and [`Error::OutOfRange`] for one whose numbers do
    /// not fit together.
    pub fn from_json(text: &str) -> Result<Self, Error> {
        let Header { version, method } = serde_json::from_str(text).map_err(Error::Json)?;
        if version != VERSION {
            return Err(Error::Version {
                found: version,
                supported: VERSION,
            });
        }
        if method.is_none() {
            let stored: StoredModel = serde_json::from_str(text).map_err(Error::Json)?;
            let response = stored.response;
            let model = AnyModel::Exact(stored.into_model()?);
            return Ok(Self { model, response });
        }
        let stored: StoredVecchia = serde_json::from_str(text).map_err(Error::Json)?;
        let response = stored.model.response;
        let model = AnyModel::Vecchia(stored.into_model()?);
        Ok(Self { model, response })
    }
}

impl StoredVecchia {
    fn into_model(self) -> Result<Vecchia, Error> {
        let (mut stored, neighbours) = (self.model, self.neighbours);
        if neighbours == 0 || neighbours > stored.y.len() {
            return Err(Error::OutOfRange {
                what: "neighbours",
                value: neighbours as f64,
            });
        }
        stored.check(0)?;
        let (points, parameters) = stored.take_parts();
        let nll = stored.negative_log_likelihood;
        let mut model = Vecchia::assemble(stored.kernel, points, parameters, nll, neighbours);
        model.calibration = stored.calibration;
        model.warnings = stored.warnings;
        model.coordinates.check()?;
        Ok(model)
    }
}

impl StoredModel {
    /// The fields that both kinds of model have: all but weights, jitter and trend.
    fn new(model: &Surrogate, points: &Points) -> Self {
        let parameters = model.parameters();
        let ranges = parameters.ranges.iter();
        Self {
            version: VERSION,
            kernel: model.kernel(),
            response: Response::Plain,
            dimensions: points.d,
            mu: parameters.mu,
            sigma2: parameters.sigma2,
            ranges: ranges.map(|r| r.is_finite().then_some(*r)).collect(),
            jitter: 0.0,
            negative_log_likelihood: model.modelled_likelihood(),
            warnings: model.warnings().to_vec(),
            x: points.x.clone(),
            y: points.y.clone(),
            noise_variance: points.noise.clone(),
            weights: Vec::new(),
            first_observation: points.first.clone(),
            trend: Trend::Constant,
            slopes: parameters.slopes.clone(),
            nugget: parameters.nugget,
            calibration: model.calibration(),
        }
    }

    /// Takes the points and the parameters out of the fields, which are then empty.
    fn take_parts(&mut self) -> (Points, Parameters) {
        let merged = self.warnings.iter().find_map(|warning| match warning {
            Warning::MergedDuplicates { observations, .. } => Some(*observations),
            _ => None,
        });
        let points = Points {
            observations: merged.unwrap_or(self.y.len()),
            d: self.dimensions,
            x: take(&mut self.x),
            y: take(&mut self.y),
            noise: take(&mut self.noise_variance),
            first: take(&mut self.first_observation),
            within: 0.0,
        };
        let ranges = self.ranges.iter();
        let parameters = Parameters {
            mu: self.mu,
            sigma2: self.sigma2,
            ranges: ranges.map(|r| r.unwrap_or(f64::INFINITY)).collect(),
            slopes: take(&mut self.slopes),
            nugget: self.nugget,
        };
        (points, parameters)
    }

    fn into_model(mut self) -> Result<Model, Error> {
        self.check(self.y.len())?;
        let (points, parameters) = self.take_parts();
        let mut model = Model::assemble(self.kernel, self.trend, points, parameters, self.jitter);
        model.weights = self.weights;
        model.warnings = self.warnings;
        model.nll = self.negative_log_likelihood;
        model.calibration = self.calibration;
        model.coordinates.check()?;
        if !model.determines_trend() {
            return Err(Error::Trend {
                distinct: model.points(),
                coefficients: model.trend.coefficients(model.coordinates.active.len()),
            });
        }
        Ok(model)
    }

    /// Checks that the numbers fit together. `weights` is the expected number of weights.
    fn check(&self, weights: usize) -> Result<(), Error> {
        let (n, d) = (self.y.len(), self.dimensions);
        if n < 2 {
            return Err(Error::TooFewPoints { distinct: n });
        }
        let slopes = if self.trend.is_constant() { 0 } else { d };
        check_length("slopes", slopes, self.slopes.len())?;
        check_length("x", n.checked_mul(d).unwrap_or(0), self.x.len())?;
        check_length("ranges", d, self.ranges.len())?;
        check_length("noise variance", n, self.noise_variance.len())?;
        check_length("weights", weights, self.weights.len())?;
        check_length("first observation", n, self.first_observation.len())?;
        let ranges: Vec<f64> = self.ranges.iter().map(|r| r.unwrap_or(1.0)).collect();
        check_finite("x", &self.x)?;
        check_finite("y", &self.y)?;
        check_finite("ranges", &ranges)?;
        check_finite("noise variance", &self.noise_variance)?;
        check_finite("weights", &self.weights)?;
        check_finite("slopes", &self.slopes)?;
        check_noise(&self.noise_variance)?;
        let conditions = [
            ("sigma2", self.sigma2, self.sigma2 > 0.0),
            ("jitter", self.jitter, (0.0..=1.0).contains(&self.jitter)),
            ("nugget", self.nugget, self.nugget >= 0.0),
            ("calibration", self.calibration, self.calibration > 0.0),
        ];
        for (what, value, holds) in conditions {
            if !holds || !value.is_finite() {
                return Err(Error::OutOfRange { what, value });
            }
        }
        let what = "ranges";
        match ranges.into_iter().find(|r| *r <= 0.0) {
            Some(value) => Err(Error::OutOfRange { what, value }),
            None => Ok(()),
        }
    }
}
