//! The kriging models that a round is decided with.

use kriging::{Data, FitOptions, Model};

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
    /// Fits one model to the `which` rows, or two if there are baselines: of the response minus its
    /// baseline and of the response itself. The model with the smaller leave-one-out residuals comes
    /// first.
    ///
    /// A baseline explains much of the response, but it may have kinks that the response, a mean over
    /// random wear, does not have. The difference then has the same kinks upside down, so the two models
    /// err in different places.
    pub(crate) fn fit(
        rows: &Rows,
        which: &[usize],
        options: &Options,
    ) -> Result<Vec<Self>, kriging::Error> {
        let sampled = || which.iter().map(|&i| &rows.sampled[i]);
        let itself = if options.logarithm && sampled().all(|s| s.response > 0.0) {
            Scale::Logarithm
        } else {
            Scale::Plain
        };
        let alone = Self::fit_on(itself, rows, which, options);
        if sampled().all(|s| s.baseline == 0.0) {
            return Ok(vec![alone?]);
        }
        let above = Self::fit_on(Scale::AboveBaseline, rows, which, options);
        let (above, alone) = match (above, alone) {
            (Ok(above), Ok(alone)) => (above, alone),
            (above, alone) => return Ok(vec![above.or(alone)?]),
        };
        let error = |model: &Self| model.error_at(rows, which);
        Ok(if error(&alone) < error(&above) {
            vec![alone, above]
        } else {
            vec![above, alone]
        })
    }

    /// Whether the logarithm of the response is modelled.
    pub(crate) fn is_logarithm(&self) -> bool {
        self.scale == Scale::Logarithm
    }

    /// Whether both model the response on the same scale.
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

    /// The constant between the modelled mean and the response's.
    fn shift(&self, baseline: f64) -> f64 {
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

    /// The changes of the means at `points` if the observation at `x` from `samples` samples comes out
    /// one standard deviation √(s² + τ²) above its prediction: cov(point, x)/√(s² + τ²).
    pub(crate) fn mean_changes(
        &self,
        x: &[f64],
        samples: u32,
        points: &[&[f64]],
    ) -> Result<Vec<f64>, kriging::Error> {
        let prediction = self.model.predict(x);
        let deviation = (prediction.variance.max(0.0) + self.noise(samples)).sqrt();
        let after = self.observed(x, prediction.mean + deviation, samples)?;
        let change = |p: &&[f64]| after.mean(p) - self.mean(p);
        Ok(points.iter().map(change).collect())
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

    /// Root mean square of the leave-one-out residuals at the given rows.
    pub(crate) fn error_at(&self, rows: &Rows, which: &[usize]) -> f64 {
        let residuals = self.model.leave_one_out().residuals;
        let chosen = self.rows.iter().zip(&residuals);
        let squares: Vec<f64> = chosen
            .filter(|(row, _)| which.contains(row))
            .map(|(&row, r)| match self.scale {
                // To first order.
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
        let change = surrogate.mean_changes(&x, 5, &[&x]).unwrap()[0];
        close(change, variance / total.sqrt());
        let after = surrogate.kriging_believer(&x, 5).unwrap().belief(&x, 0.0);
        close(after.sd.powi(2), variance * noise / total);
    }
}
