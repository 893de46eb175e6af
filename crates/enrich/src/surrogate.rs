//! The kriging models that a round is decided with.

use kriging::{Conditional, Data, FitOptions, Model};
use rayon::prelude::*;

use crate::Options;
use crate::belief::Belief;
use crate::state::Rows;

/// The quantity that a model is fitted to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Scale {
    /// The response.
    Plain,
    /// The logarithm of the response.
    Logarithm,
    /// The response minus its baseline.
    AboveBaseline,
}

/// A fitted model and the scale on which it models the response.
#[derive(Debug, Clone)]
pub(crate) struct Surrogate {
    model: Model,
    scale: Scale,
    /// Variance of an estimate from one sample, on the modelled scale; that of k samples is 1/k of
    /// it.
    noise_per_sample: f64,
    /// The rows that the model was fitted to.
    pub(crate) rows: Vec<usize>,
}

impl Surrogate {
    /// Fits a model on every scale that the `which` rows allow; the one that predicts left-out responses best comes
    /// first.
    ///
    /// No scale serves every response. The logarithm of a response that spans decades is smooth, but that of a bowl
    /// above a small value has a cusp at its foot. A baseline explains much of the response, but may have kinks that
    /// the response, a mean over random wear, does not have; the difference has the same kinks with the opposite sign.
    /// Models on different scales err in different places, so all of them choose infill points.
    pub(crate) fn fit(
        rows: &Rows,
        which: &[usize],
        options: &Options,
    ) -> Result<Vec<Self>, kriging::Error> {
        let sampled = || which.iter().map(|&i| &rows.sampled[i]);
        let mut scales = vec![Scale::Plain];
        if options.logarithm && sampled().all(|s| s.response > 0.0) {
            scales.push(Scale::Logarithm);
        }
        if sampled().any(|s| s.baseline != 0.0) {
            scales.push(Scale::AboveBaseline);
        }
        let fitted: Vec<Result<(f64, Self), kriging::Error>> = scales
            .into_par_iter()
            .map(|scale| {
                let model = Self::fit_on(scale, rows, which, options)?;
                Ok((model.log_density(rows), model))
            })
            .collect();
        let mut models = Vec::new();
        let mut refused = None;
        for one in fitted {
            match one {
                Ok(model) => models.push(model),
                Err(error) => refused = Some(error),
            }
        }
        models.sort_by(|a, b| b.0.total_cmp(&a.0));
        match (models.is_empty(), refused) {
            (true, Some(error)) => Err(error),
            _ => Ok(models.into_iter().map(|(_, model)| model).collect()),
        }
    }

    /// Whether the logarithm of the response is modelled.
    pub(crate) fn is_logarithm(&self) -> bool {
        self.scale == Scale::Logarithm
    }

    /// Whether this model and the other one have the same scale.
    pub(crate) fn has_scale_of(&self, other: &Self) -> bool {
        self.scale == other.scale
    }

    /// Fits one model to the `which` rows on this scale.
    fn fit_on(
        scale: Scale,
        rows: &Rows,
        which: &[usize],
        options: &Options,
    ) -> Result<Self, kriging::Error> {
        let sampled = || which.iter().map(|&i| &rows.sampled[i]);
        let x: Vec<f64> = sampled().flat_map(|s| s.x.iter().copied()).collect();
        let scaled: Vec<(f64, f64)> = sampled()
            .map(|s| match scale {
                Scale::Plain => (s.response, s.variance),
                Scale::Logarithm => {
                    let relative = s.variance / (s.response * s.response);
                    (s.response.ln(), relative)
                }
                Scale::AboveBaseline => (s.response - s.baseline, s.variance),
            })
            .collect();
        let (y, noise_variance): (Vec<f64>, Vec<f64>) = scaled.iter().copied().unzip();
        let model = kriging::fit(
            &Data {
                x: &x,
                d: options.bounds.dimension(),
                y: &y,
                noise_variance: &noise_variance,
            },
            &FitOptions {
                kernel: options.kernel,
                seed: options.seed,
                starts: options.fit_starts,
                ..FitOptions::default()
            },
        )?;
        // Residuals that are mostly noise hardly depend on the model's own variance, so a
        // calibration may widen it but never narrow it.
        let calibrated = model.clone().calibrated();
        let model = if calibrated.calibration() > 1.0 {
            calibrated
        } else {
            model
        };
        let mut per_sample: Vec<f64> = sampled()
            .zip(&noise_variance)
            .map(|(s, v)| v * f64::from(s.samples.max(1)))
            .collect();
        per_sample.sort_by(f64::total_cmp);
        let noise_per_sample = per_sample[per_sample.len() / 2];
        Ok(Self {
            model,
            scale,
            noise_per_sample,
            rows: which.to_vec(),
        })
    }

    pub(crate) fn warnings(&self) -> &[kriging::Warning] {
        self.model.warnings()
    }

    /// The expected variance of an estimate from `samples` samples, on the modelled scale.
    pub(crate) fn noise(&self, samples: u32) -> f64 {
        self.noise_per_sample / f64::from(samples.max(1))
    }

    /// The predicted distribution of the response at `x`, whose baseline is given in µm.
    pub(crate) fn belief(&self, x: &[f64], baseline: f64) -> Belief {
        let prediction = self.model.predict(x);
        Belief {
            mean: prediction.mean + self.shift(baseline),
            sd: prediction.variance.max(0.0).sqrt(),
            logarithm: self.is_logarithm(),
        }
    }

    /// The mean of [`Surrogate::belief`].
    pub(crate) fn mean_above(&self, x: &[f64], baseline: f64) -> f64 {
        self.mean(x) + self.shift(baseline)
    }

    /// The constant that turns the fitted mean into that of the response or its logarithm: the baseline for a model
    /// above it, otherwise 0.
    pub(crate) fn shift(&self, baseline: f64) -> f64 {
        match self.scale {
            Scale::AboveBaseline => baseline,
            Scale::Plain | Scale::Logarithm => 0.0,
        }
    }

    /// The mean at `x` on the modelled scale.
    fn mean(&self, x: &[f64]) -> f64 {
        self.model.mean(x)
    }

    /// The model with more observations on the modelled scale.
    fn with_points(
        &self,
        x: &[f64],
        y: &[f64],
        noise_variance: &[f64],
    ) -> Result<Self, kriging::Error> {
        let data = Data {
            x,
            d: self.model.dimensions(),
            y,
            noise_variance,
        };
        Ok(Self {
            model: self.model.with_points(&data)?,
            ..self.clone()
        })
    }

    /// Kriging believer: the model as if `samples` samples at `x` had confirmed its prediction. The
    /// means stay, the variance around `x` falls.
    pub(crate) fn kriging_believer(&self, x: &[f64], samples: u32) -> Result<Self, kriging::Error> {
        self.observed(x, self.mean(x), samples)
    }

    /// The change of the mean at `of` if the observation at `x` from `samples` samples comes out one standard deviation
    /// √(s² + τ²) above its prediction: cov(of, x)/√(s² + τ²). 0 where the observation has no scatter at all.
    pub(crate) fn mean_change(&self, of: &Conditional, x: &Conditional, samples: u32) -> f64 {
        let total = x.prediction.variance.max(0.0) + self.noise(samples);
        if total > 0.0 {
            self.model.covariance(of, x) / total.sqrt()
        } else {
            0.0
        }
    }

    /// The modelled function at `x`.
    pub(crate) fn conditional(&self, x: &[f64]) -> Conditional {
        self.model.conditional(x)
    }

    /// The model with an observation `y` at `x` from `samples` samples.
    ///
    /// A calibrated model predicts c times the variances that its covariance matrix implies. For
    /// the update, the ratio of the prediction's variance c s² to the noise τ² is right if the
    /// matrix, which implies s², is given the noise τ²/c.
    pub(crate) fn observed(&self, x: &[f64], y: f64, samples: u32) -> Result<Self, kriging::Error> {
        let noise = self.noise(samples) / self.model.calibration();
        self.with_points(x, &[y], &[noise])
    }

    /// The model that interpolates this one's means at the points it was fitted to.
    pub(crate) fn reinterpolated(&self) -> Result<Self, kriging::Error> {
        Ok(Self {
            model: self.model.reinterpolated()?,
            ..self.clone()
        })
    }

    /// Mean log density of the responses under the leave-one-out predictions, up to a constant.
    fn log_density(&self, rows: &Rows) -> f64 {
        let left_out = self.model.leave_one_out();
        let mut sum = 0.0;
        for ((&row, r), z) in self
            .rows
            .iter()
            .zip(&left_out.residuals)
            .zip(&left_out.standardised)
        {
            let sd = if *z == 0.0 { 0.0 } else { r / z };
            if sd > 0.0 {
                sum -= sd.ln() + 0.5 * z * z;
            }
            if self.is_logarithm() {
                sum -= rows.sampled[row].response.ln();
            }
        }
        sum / self.rows.len() as f64
    }

    /// Root mean square of the leave-one-out residuals at the given rows.
    pub(crate) fn error_at(&self, rows: &Rows, which: &[usize]) -> f64 {
        let residuals = self.model.leave_one_out().residuals;
        let chosen = self.rows.iter().zip(&residuals);
        let squares: Vec<f64> = chosen
            .filter(|(row, _)| which.contains(row))
            .map(|(&row, r)| match self.scale {
                // To first order, a residual of the logarithm is a relative residual of the response.
                Scale::Logarithm => r * rows.sampled[row].response,
                Scale::Plain | Scale::AboveBaseline => *r,
            })
            .map(|r| r * r)
            .collect();
        (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::state::{SampledDesign, State};

    /// A function that is smooth over most of its range and rough at its end, so that the model
    /// needs a calibration.
    fn rough_at_the_end() -> (Rows, Options) {
        let options = Options {
            logarithm: false,
            ..Options::new(cmaes::Bounds::unit(1).unwrap())
        };
        let sampled = (0..60).map(|i| {
            let x = f64::from(i) / 59.0;
            let rough = if x > 0.75 { (97.0 * x).sin() } else { 0.0 };
            SampledDesign {
                x: vec![x],
                samples: 10,
                response: 5.0 + x + rough,
                variance: 0.001,
                violation: 0.0,
                baseline: 0.0,
            }
        });
        let state = State {
            sampled: sampled.collect(),
            ..State::default()
        };
        (Rows::new(&state, &options).unwrap(), options)
    }

    /// An observation changes the mean of a normal belief with the variance s² by s²/√(s² + τ²),
    /// and leaves it the variance s²τ²/(s² + τ²).
    #[test]
    fn a_calibrated_model_learns_by_its_calibrated_variance() {
        let (rows, options) = rough_at_the_end();
        let all: Vec<usize> = (0..rows.sampled.len()).collect();
        let surrogate = Surrogate::fit(&rows, &all, &options).unwrap().remove(0);
        let calibration = surrogate.model.calibration();
        assert!(calibration > 1.05, "{calibration}");
        let x = [0.507];
        let (variance, noise) = (surrogate.belief(&x, 0.0).sd.powi(2), surrogate.noise(5));
        let total = variance + noise;
        let close = |a: f64, b: f64| assert!((a / b - 1.0).abs() < 1e-6, "{a} {b}");
        let at = surrogate.conditional(&x);
        let change = surrogate.mean_change(&at, &at, 5);
        close(change, variance / total.sqrt());
        let after = surrogate.kriging_believer(&x, 5).unwrap().belief(&x, 0.0);
        close(after.sd.powi(2), variance * noise / total);
    }
}
