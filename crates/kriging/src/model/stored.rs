//! Models as JSON.

use serde::{Deserialize, Serialize};

use crate::data::Points;
use crate::kernel::Kernel;
use crate::likelihood::gls::Trend;
use crate::model::{Model, Parameters};
use crate::{Error, Vecchia, Warning};

/// Raised when a change of the format would make older programs misread it.
const VERSION: u32 = 1;

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Stored {
    version: u32,
    kernel: Kernel,
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
    // Absent for the plain model, so that programs older than these abilities read it, and refuse
    // the others.
    #[serde(default, skip_serializing_if = "Trend::is_constant")]
    trend: Trend,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    slopes: Vec<f64>,
    #[serde(default, skip_serializing_if = "is_zero")]
    nugget: f64,
    #[serde(default = "one", skip_serializing_if = "is_one")]
    calibration: f64,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde passes references")]
fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde passes references")]
fn is_one(value: &f64) -> bool {
    *value == 1.0
}

fn one() -> f64 {
    1.0
}

/// Only the version, which must be readable whatever the rest looks like.
#[derive(Deserialize)]
struct Version {
    version: u32,
}

/// A model of nearest neighbours. Its name in the file keeps it from being read as the other kind.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct StoredVecchia {
    version: u32,
    method: Method,
    /// Observations per prediction.
    neighbours: usize,
    model: Stored,
}

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Method {
    Vecchia,
}

/// Refuses text of another format version.
fn check_version(text: &str) -> Result<(), Error> {
    let Version { version } = serde_json::from_str(text).map_err(Error::Json)?;
    if version != VERSION {
        return Err(Error::Version {
            found: version,
            supported: VERSION,
        });
    }
    Ok(())
}

impl Vecchia {
    /// The model as one JSON object. Numbers are written so that they are read back exactly.
    ///
    /// # Errors
    ///
    /// [`Error::Json`] if the writer fails.
    pub fn to_json(&self) -> Result<String, Error> {
        let model = Stored {
            negative_log_likelihood: self.nll,
            calibration: self.calibration,
            ..Stored::new(self.kernel, &self.points, &self.parameters)
        };
        let stored = StoredVecchia {
            version: VERSION,
            method: Method::Vecchia,
            neighbours: self.neighbours,
            model,
        };
        serde_json::to_string(&stored).map_err(Error::Json)
    }

    /// Reads what [`Vecchia::to_json`] wrote. The means of the model read are bit for bit those of the
    /// model written.
    ///
    /// # Errors
    ///
    /// As [`Model::from_json`], and [`Error::OutOfRange`] for an impossible number of neighbours.
    pub fn from_json(text: &str) -> Result<Self, Error> {
        check_version(text)?;
        let stored: StoredVecchia = serde_json::from_str(text).map_err(Error::Json)?;
        let (model, neighbours) = (stored.model, stored.neighbours);
        if neighbours == 0 || neighbours > model.y.len() {
            return Err(Error::OutOfRange {
                what: "neighbours",
                value: neighbours as f64,
            });
        }
        let kernel = model.kernel;
        model.check(0)?;
        let (nll, calibration) = (model.negative_log_likelihood, model.calibration);
        let (points, parameters) = model.into_parts();
        let mut read = Self::assemble(kernel, points, parameters, nll, neighbours);
        read.calibration = calibration;
        if read.coordinates.are_finite() {
            Ok(read)
        } else {
            Err(Error::Extent { what: "x" })
        }
    }
}

impl Model {
    /// The model as one JSON object. Numbers are written so that they are read back exactly.
    ///
    /// # Errors
    ///
    /// [`Error::Json`] if the writer fails.
    pub fn to_json(&self) -> Result<String, Error> {
        serde_json::to_string(&Stored::of(self)).map_err(Error::Json)
    }

    /// Reads what [`Model::to_json`] wrote. The means of the model read are bit for bit those of the
    /// model written; the covariance matrix is factorised when a variance is first asked for.
    ///
    /// # Errors
    ///
    /// [`Error::Json`] and [`Error::Version`] for text that is not such a model, [`Error::Shape`],
    /// [`Error::NonFinite`] and [`Error::NegativeNoise`] for one whose numbers do not fit together.
    pub fn from_json(text: &str) -> Result<Self, Error> {
        check_version(text)?;
        let stored: Stored = serde_json::from_str(text).map_err(Error::Json)?;
        stored.into_model()
    }
}

impl Stored {
    /// What all models have; no weights, likelihood, jitter or trend.
    fn new(kernel: Kernel, points: &Points, parameters: &Parameters) -> Self {
        let ranges = parameters.ranges.iter();
        Self {
            version: VERSION,
            kernel,
            dimensions: points.d,
            mu: parameters.mu,
            sigma2: parameters.sigma2,
            ranges: ranges.map(|r| r.is_finite().then_some(*r)).collect(),
            jitter: 0.0,
            negative_log_likelihood: 0.0,
            warnings: points.warnings.clone(),
            x: points.x.clone(),
            y: points.y.clone(),
            noise_variance: points.noise.clone(),
            weights: Vec::new(),
            first_observation: points.first.clone(),
            trend: Trend::Constant,
            slopes: parameters.slopes.clone(),
            nugget: parameters.nugget,
            calibration: 1.0,
        }
    }

    fn of(model: &Model) -> Self {
        Self {
            jitter: model.jitter,
            negative_log_likelihood: model.nll,
            weights: model.weights.clone(),
            trend: model.trend,
            calibration: model.calibration,
            ..Self::new(model.kernel, &model.points, &model.parameters)
        }
    }

    fn into_parts(self) -> (Points, Parameters) {
        let points = Points {
            d: self.dimensions,
            x: self.x,
            y: self.y,
            noise: self.noise_variance,
            first: self.first_observation,
            within: 0.0,
            warnings: self.warnings,
        };
        let ranges = self.ranges.iter();
        let parameters = Parameters {
            mu: self.mu,
            sigma2: self.sigma2,
            ranges: ranges.map(|r| r.unwrap_or(f64::INFINITY)).collect(),
            slopes: self.slopes,
            nugget: self.nugget,
        };
        (points, parameters)
    }

    fn into_model(mut self) -> Result<Model, Error> {
        self.check(self.y.len())?;
        let (kernel, trend, jitter) = (self.kernel, self.trend, self.jitter);
        let (nll, calibration) = (self.negative_log_likelihood, self.calibration);
        let weights = std::mem::take(&mut self.weights);
        let (points, parameters) = self.into_parts();
        let mut model = Model::assemble(kernel, trend, points, parameters, jitter);
        model.weights = weights;
        model.nll = nll;
        model.calibration = calibration;
        if !model.coordinates.are_finite() {
            return Err(Error::Extent { what: "x" });
        }
        if !model.determines_trend() {
            return Err(Error::Trend {
                distinct: model.points(),
                coefficients: model.trend.coefficients(model.coordinates.active.len()),
            });
        }
        Ok(model)
    }

    /// Whether the numbers fit together, with so many weights.
    fn check(&self, weights: usize) -> Result<(), Error> {
        let (n, d) = (self.y.len(), self.dimensions);
        if n < 2 {
            return Err(Error::TooFewPoints { distinct: n });
        }
        let slopes = if self.trend.is_constant() { 0 } else { d };
        let shapes = [
            ("slopes", slopes, self.slopes.len()),
            ("x", n.checked_mul(d).unwrap_or(0), self.x.len()),
            ("ranges", d, self.ranges.len()),
            ("noise variance", n, self.noise_variance.len()),
            ("weights", weights, self.weights.len()),
            ("first observation", n, self.first_observation.len()),
        ];
        for (what, expected, got) in shapes {
            if got != expected {
                return Err(Error::Shape {
                    what,
                    expected,
                    got,
                });
            }
        }
        let ranges: Vec<f64> = self.ranges.iter().map(|r| r.unwrap_or(1.0)).collect();
        let numbers = [
            ("x", &self.x),
            ("y", &self.y),
            ("ranges", &ranges),
            ("noise variance", &self.noise_variance),
            ("weights", &self.weights),
            ("slopes", &self.slopes),
        ];
        for (what, values) in numbers {
            if let Some(index) = values.iter().position(|v| !v.is_finite()) {
                return Err(Error::NonFinite {
                    what,
                    index,
                    value: values[index],
                });
            }
        }
        if let Some(index) = self.noise_variance.iter().position(|v| *v < 0.0) {
            return Err(Error::NegativeNoise {
                index,
                value: self.noise_variance[index],
            });
        }
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
        match ranges.iter().find(|r| **r <= 0.0) {
            Some(&value) => Err(Error::OutOfRange {
                what: "ranges",
                value,
            }),
            None => Ok(()),
        }
    }
}
