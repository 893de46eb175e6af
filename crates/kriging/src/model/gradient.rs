//! The gradient of the prediction.

use super::Model;
use crate::kernel::Kernel;

impl Model {
    /// The gradient of [`Model::mean`] at `x` (d coordinates), in units of y per unit of x. Zero in coordinates that
    /// the model ignores. The mean of an exponential kernel has kinks at the observations; there, the term of that
    /// observation counts as zero.
    ///
    /// # Panics
    ///
    /// If `x` has another length than [`Model::dimensions`].
    #[must_use]
    pub fn gradient(&self, x: &[f64]) -> Vec<f64> {
        let at = self.coordinates.scaled(x);
        let columns = &self.coordinates.columns;
        let mut terms = vec![0.0; self.points.len()];
        self.kernel.correlations(&at, |j| &columns[j], &mut terms);
        for (term, weight) in terms.iter_mut().zip(&self.weights) {
            *term *= weight;
        }
        let mut gradient = match self.parameters.slopes.as_slice() {
            [] => vec![0.0; self.points.d],
            slopes => slopes.to_vec(),
        };
        for (i, term) in terms.iter().enumerate() {
            let away = |k: usize| at[k] - columns[k][i];
            let radius = (0..at.len()).map(|k| away(k).powi(2)).sum::<f64>().sqrt();
            for (k, &j) in self.coordinates.active.iter().enumerate() {
                let a = if self.kernel.is_radial() {
                    radius
                } else {
                    away(k).abs()
                };
                let scale = self.coordinates.scale[k];
                gradient[j] += term * self.kernel.log_slope(a) * away(k) * scale;
            }
        }
        gradient
    }
}

impl Kernel {
    /// f′(a)/(a f(a)) of the module's one-dimensional functions f; zero where a kink has none.
    fn log_slope(self, a: f64) -> f64 {
        match self {
            Self::Matern52 | Self::RadialMatern52 => -(1.0 + a) / (3.0 + a * (3.0 + a)),
            Self::Matern32 | Self::RadialMatern32 => -1.0 / (1.0 + a),
            Self::SquaredExponential => -2.0,
            Self::Exponential | Self::RadialExponential if a == 0.0 => 0.0,
            Self::Exponential | Self::RadialExponential => -1.0 / a,
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::{Data, FitOptions, Kernel, Trend, fit};

    #[test]
    fn gradients_are_the_limits_of_differences() {
        let x: Vec<f64> = (0..40)
            .flat_map(|i| [f64::from(i * 7 % 40) / 40.0, 30.0 * f64::from(i * 11 % 40)])
            .collect();
        let y: Vec<f64> = x
            .chunks(2)
            .map(|x| (4.0 * x[0]).sin() + (0.002 * x[1]).powi(2))
            .collect();
        let noise_variance = &[1e-6; 40];
        for kernel in Kernel::ALL {
            for trend in [Trend::Constant, Trend::Linear] {
                let data = Data {
                    x: &x,
                    d: 2,
                    y: &y,
                    noise_variance,
                };
                let options = FitOptions {
                    kernel,
                    trend,
                    ..FitOptions::default()
                };
                let model = fit(&data, &options).unwrap();
                let at = [0.433, 611.0];
                let gradient = model.gradient(&at);
                for (j, step) in [1e-4, 0.1].into_iter().enumerate() {
                    let moved = |step: f64| {
                        let mut to = at;
                        to[j] += step;
                        model.mean(&to)
                    };
                    let difference = (moved(step) - moved(-step)) / (2.0 * step);
                    let scale = [4.0, 0.004][j];
                    assert!(
                        (gradient[j] - difference).abs() < 1e-3 * scale,
                        "{kernel} {trend:?} {j}: {} and {difference}",
                        gradient[j]
                    );
                }
            }
        }
    }
}
