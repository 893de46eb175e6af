//! Kriging models.

use std::sync::Arc;

use ::kriging::{Data, Error, FitOptions, Prediction, Response, Settings, Surrogate};
use numpy::{IntoPyArray as _, PyArray1, PyArray2, PyArrayMethods as _};
use pyo3::prelude::*;
use rayon::prelude::*;
use serde::de::DeserializeOwned;

use crate::arrays::{Matrix, Vector, numbers, rows, shape};
use crate::error::{PitchlineError, raised};
use crate::interrupt::{detached, interruptible};

/// The value of an option with this name.
fn option<T: DeserializeOwned>(key: &str, name: &str) -> PyResult<T> {
    serde_json::from_value(name.into())
        .map_err(|error| PitchlineError::new_err(format!("{key} is {name:?}: {error}")))
}

/// Number of correlations with observations that are computed in a tenth of a second.
const LONG: usize = 5_000_000;

/// A fitted model.
#[pyclass(module = "pitchline._pitchline", frozen)]
pub(crate) struct Model {
    model: Arc<Surrogate>,
}

impl Model {
    pub(crate) fn new(model: Surrogate) -> Self {
        Self {
            model: Arc::new(model),
        }
    }

    /// The result of `work` on the rows of `x`, with `times` predictions for each; an error unless they have as many
    /// coordinates as the model. Long work gets a copy of the rows, since it continues for a while after Ctrl-C.
    fn at<T: Send + 'static>(
        &self,
        py: Python<'_>,
        x: &Matrix<'_>,
        times: usize,
        work: impl FnOnce(&Surrogate, &[f64]) -> T + Send + 'static,
    ) -> PyResult<T> {
        let ([count, got], expected) = (shape(x), self.model.dimensions());
        if got != expected {
            let what = "a row of x";
            return Err(raised(Error::Shape {
                what,
                expected,
                got,
            }));
        }
        let x = rows(x);
        if count * times * self.model.points() < LONG {
            return detached(py, || work(&self.model, &x));
        }
        let (model, x) = (Arc::clone(&self.model), x.into_owned());
        interruptible(py, move |_| work(&model, &x))
    }
}

#[pymethods]
impl Model {
    #[staticmethod]
    #[expect(
        clippy::too_many_arguments,
        reason = "the options of a fit, all named in Python"
    )]
    fn fit(
        py: Python<'_>,
        x: Matrix<'_>,
        y: Vector<'_>,
        noise_variance: Vector<'_>,
        kernel: &str,
        trend: &str,
        nugget: &str,
        method: &str,
        response: &str,
        estimator: &str,
        calibrate: bool,
        starts: usize,
        seed: u64,
    ) -> PyResult<Self> {
        let settings = Settings {
            fit: FitOptions {
                kernel: option("kernel", kernel)?,
                trend: option("trend", trend)?,
                nugget: option("nugget", nugget)?,
                estimator: option("estimator", estimator)?,
                calibrate,
                starts,
                seed,
                ..FitOptions::default()
            },
            method: option("method", method)?,
            response: option("response", response)?,
            ..Settings::default()
        };
        let [_, d] = shape(&x);
        let (x, y) = (rows(&x).into_owned(), numbers(&y).into_owned());
        let noise_variance = numbers(&noise_variance).into_owned();
        let fitted = interruptible(py, move |_| {
            let data = Data {
                x: &x,
                d,
                y: &y,
                noise_variance: &noise_variance,
            };
            Surrogate::fit(&data, &settings)
        })?;
        Ok(Self::new(fitted.map_err(raised)?))
    }

    fn means<'py>(&self, py: Python<'py>, x: Matrix<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let means = self.at(py, &x, 1, Surrogate::means)?;
        Ok(means.map_err(raised)?.into_pyarray(py))
    }

    fn predict<'py>(
        &self,
        py: Python<'py>,
        x: Matrix<'py>,
    ) -> PyResult<(Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>)> {
        let predictions = self.at(py, &x, 1, Surrogate::predict_many)?;
        let predictions = predictions.map_err(raised)?;
        let of = |part: fn(&Prediction) -> f64| {
            predictions
                .iter()
                .map(part)
                .collect::<Vec<f64>>()
                .into_pyarray(py)
        };
        Ok((of(|one| one.mean), of(|one| one.variance)))
    }

    /// The means of the modelled quantity and their covariance; `None` for the approximate method.
    fn joint<'py>(
        &self,
        py: Python<'py>,
        x: Matrix<'py>,
    ) -> PyResult<Option<(Bound<'py, PyArray1<f64>>, Bound<'py, PyArray2<f64>>)>> {
        let [m, d] = shape(&x);
        let joint = self.at(py, &x, m, move |model, x| {
            let model = model.exact()?;
            let points: Vec<_> = x.par_chunks(d).map(|x| model.conditional(x)).collect();
            let row = |a| points.iter().map(move |b| (a, b));
            let pairs: Vec<_> = points.iter().flat_map(row).collect();
            let pairs = pairs.par_iter();
            let covariance: Vec<f64> = pairs.map(|(a, b)| model.covariance(a, b)).collect();
            let means: Vec<f64> = points.iter().map(|one| one.prediction.mean).collect();
            Some((means, covariance))
        })?;
        let Some((means, covariance)) = joint else {
            return Ok(None);
        };
        let covariance = covariance.into_pyarray(py).reshape([m, m])?;
        Ok(Some((means.into_pyarray(py), covariance)))
    }

    /// The gradients of the mean, one row per point; `None` for the approximate method.
    fn gradients<'py>(
        &self,
        py: Python<'py>,
        x: Matrix<'py>,
    ) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
        let shape = shape(&x);
        let gradients = self.at(py, &x, 1, move |model, x| {
            let rows = x.par_chunks(shape[1]);
            rows.map(|x| model.gradient(x))
                .collect::<Option<Vec<Vec<f64>>>>()
        })?;
        gradients
            .map(|gradients| gradients.concat().into_pyarray(py).reshape(shape))
            .transpose()
    }

    /// The quantiles at `level` of the function at points with these predictions, the noise of observations with
    /// this variance added.
    fn quantiles<'py>(
        &self,
        py: Python<'py>,
        mean: Vector<'py>,
        variance: Vector<'py>,
        noise_variance: f64,
        level: f64,
    ) -> Bound<'py, PyArray1<f64>> {
        let (mean, variance) = (numbers(&mean), numbers(&variance));
        let pairs = mean.iter().zip(variance.iter());
        let quantile = |(&mean, &variance)| {
            let prediction = Prediction { mean, variance };
            let observed = self.model.observed(prediction, noise_variance);
            self.model.quantile(observed, level)
        };
        pairs.map(quantile).collect::<Vec<f64>>().into_pyarray(py)
    }

    /// Observations, residuals, standardised residuals, Q², root mean square, coverage of 90 % intervals.
    fn leave_one_out<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(
        Bound<'py, PyArray1<usize>>,
        Bound<'py, PyArray1<f64>>,
        Bound<'py, PyArray1<f64>>,
        f64,
        f64,
        f64,
    )> {
        let model = Arc::clone(&self.model);
        let found = interruptible(py, move |_| model.leave_one_out())?;
        Ok((
            found.observations.into_pyarray(py),
            found.residuals.into_pyarray(py),
            found.standardised.into_pyarray(py),
            found.q2,
            found.rmse,
            found.coverage90,
        ))
    }

    /// μ, σ², ranges, slopes and nugget.
    fn parameters<'py>(
        &self,
        py: Python<'py>,
    ) -> (
        f64,
        f64,
        Bound<'py, PyArray1<f64>>,
        Bound<'py, PyArray1<f64>>,
        f64,
    ) {
        let found = self.model.parameters();
        (
            found.mu,
            found.sigma2,
            PyArray1::from_slice(py, &found.ranges),
            PyArray1::from_slice(py, &found.slopes),
            found.nugget,
        )
    }

    /// Whether ln y is modelled.
    fn is_log(&self) -> bool {
        self.model.response() == Response::Log
    }

    fn kernel(&self) -> String {
        self.model.kernel().to_string()
    }

    fn log_likelihood(&self) -> f64 {
        -self.model.negative_log_likelihood()
    }

    fn calibration(&self) -> f64 {
        self.model.calibration()
    }

    fn warnings(&self) -> Vec<String> {
        self.model
            .warnings()
            .iter()
            .map(ToString::to_string)
            .collect()
    }

    fn to_json(&self) -> PyResult<String> {
        self.model.to_json().map_err(raised)
    }

    #[staticmethod]
    fn from_json(text: &str) -> PyResult<Self> {
        Ok(Self::new(Surrogate::from_json(text).map_err(raised)?))
    }
}
