//! Models as JSON.

use serde::{Deserialize, Serialize};

use crate::data::Points;
use crate::gls::Trend;
use crate::kernel::Kernel;
use crate::model::{Model, Parameters};
use crate::{Error, Warning};

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

impl Model {
    /// The model as one JSON object. Numbers are written so that they are read back exactly.
    ///
    /// # Errors
    ///
    /// [`Error::Json`] if the writer fails.
    pub fn to_json(&self) -> Result<String, Error> {
        let stored = Stored {
            version: VERSION,
            kernel: self.kernel,
            dimensions: self.points.d,
            mu: self.parameters.mu,
            sigma2: self.parameters.sigma2,
            ranges: self
                .parameters
                .ranges
                .iter()
                .map(|r| r.is_finite().then_some(*r))
                .collect(),
            jitter: self.jitter,
            negative_log_likelihood: self.nll,
            warnings: self.points.warnings.clone(),
            x: self.points.x.clone(),
            y: self.points.y.clone(),
            noise_variance: self.points.noise.clone(),
            weights: self.weights.clone(),
            first_observation: self.points.first.clone(),
            trend: self.trend,
            slopes: self.parameters.slopes.clone(),
            nugget: self.parameters.nugget,
            calibration: self.calibration,
        };
        serde_json::to_string(&stored).map_err(Error::Json)
    }

    /// Reads what [`Model::to_json`] wrote. The means of the model read are bit for bit those of the
    /// model written; the covariance matrix is factorised when a variance is first asked for.
    ///
    /// # Errors
    ///
    /// [`Error::Json`] and [`Error::Version`] for text that is not such a model, [`Error::Shape`],
    /// [`Error::NonFinite`] and [`Error::NegativeNoise`] for one whose numbers do not fit together.
    pub fn from_json(text: &str) -> Result<Self, Error> {
        let Version { version } = serde_json::from_str(text).map_err(Error::Json)?;
        if version != VERSION {
            return Err(Error::Version {
                found: version,
                supported: VERSION,
            });
        }
        let stored: Stored = serde_json::from_str(text).map_err(Error::Json)?;
        stored.check()?;
        let points = Points {
            d: stored.dimensions,
            x: stored.x,
            y: stored.y,
            noise: stored.noise_variance,
            first: stored.first_observation,
            within: 0.0,
            warnings: stored.warnings,
        };
        let ranges = stored
            .ranges
            .iter()
            .map(|r| r.unwrap_or(f64::INFINITY))
            .collect();
        let parameters = Parameters {
            mu: stored.mu,
            sigma2: stored.sigma2,
            ranges,
            slopes: stored.slopes,
            nugget: stored.nugget,
        };
        let mut model = Self::assemble(
            stored.kernel,
            stored.trend,
            points,
            parameters,
            stored.jitter,
        );
        model.weights = stored.weights;
        model.nll = stored.negative_log_likelihood;
        model.calibration = stored.calibration;
        if !model.coordinates_are_finite() {
            return Err(Error::Extent { what: "x" });
        }
        if !model.determines_trend() {
            return Err(Error::Trend {
                distinct: model.points(),
                coefficients: model.trend.coefficients(model.active.len()),
            });
        }
        Ok(model)
    }
}

impl Stored {
    fn check(&self) -> Result<(), Error> {
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
            ("weights", n, self.weights.len()),
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
