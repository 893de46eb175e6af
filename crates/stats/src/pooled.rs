//! A percentile of many designs whose responses differ in location and scale only.
//!
//! If the standardised response has the same distribution at every design, its quantile q can be estimated
//! from the samples of all designs together, and each design needs only its mean m and standard deviation s:
//! the percentile is m + q s. [`Shape::pool`] takes q from the residuals (x − m)/s of all designs. For k samples a
//! design these are less spread than the standardised response, by a factor that depends on the distribution.
//! The factor for normal samples is known (Thompson's distribution), and q is scaled by it, so that the estimate has
//! no bias for normal samples.
//!
//! The variance of m + q s follows from skewness and kurtosis of the residuals, by the usual first-order
//! formula: σ²/k (1 + q γ + q² (κ − 1)/4). The error of q itself is common to all designs and not part of it.
//!
//! Reference: W. R. Thompson, "On a criterion for the rejection of observations and the distribution of the
//! ratio of deviation to sample standard deviation", Ann. Math. Statist. 6 (1935) 214–219.

use statrs::distribution::{ContinuousCDF as _, StudentsT};

use crate::{Error, Percentile, c4, mean_sd, normal_quantile, order_statistic};

/// The shape that the responses of all designs share.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shape {
    /// The quantile q of the standardised response, for m + q s.
    pub quantile: f64,
    /// Skewness γ of the residuals.
    pub skewness: f64,
    /// Kurtosis κ of the residuals, 3 for normal samples.
    pub kurtosis: f64,
}

impl Shape {
    /// The shape at a `level`, from the samples of all designs. Designs whose samples are all equal, or fewer
    /// than four, do not count.
    ///
    /// # Errors
    ///
    /// [`Error::TooFewSamples`] if no design counts, and those of [`mean_sd`].
    pub fn pool<'a>(designs: impl Iterator<Item = &'a [f64]>, level: f64) -> Result<Self, Error> {
        let mut residuals = Vec::new();
        let mut counted = 0_usize;
        for samples in designs.filter(|samples| samples.len() >= 4) {
            let (mean, sd) = mean_sd(samples)?;
            if sd > 0.0 {
                counted += 1;
                residuals.extend(samples.iter().map(|sample| (sample - mean) / sd));
            }
        }
        let quantile = order_statistic(&residuals, level, 0.95)?.value;
        let n = residuals.len() as f64;
        let moment = |power: i32| residuals.iter().map(|r| r.powi(power)).sum::<f64>() / n;
        let (second, third, fourth) = (moment(2), moment(3), moment(4));
        let k = (residuals.len() / counted).max(4);
        Ok(Self {
            quantile: quantile * normal_factor(level, k)?,
            skewness: third / second.powf(1.5),
            kurtosis: fourth / (second * second),
        })
    }

    /// The percentile of one design's samples.
    ///
    /// # Errors
    ///
    /// The errors of [`mean_sd`].
    pub fn percentile(&self, samples: &[f64]) -> Result<Percentile, Error> {
        let (mean, sd) = mean_sd(samples)?;
        let (n, q) = (samples.len(), self.quantile);
        let relative = 1.0 + q * self.skewness + 0.25 * q * q * (self.kurtosis - 1.0);
        Ok(Percentile {
            n,
            mean,
            sd,
            p90: mean + q * sd,
            variance: sd * sd / n as f64 * relative.max(0.0),
        })
    }
}

/// The factor from a quantile of the residuals of `k` normal samples to the z with which m + z s has no bias.
fn normal_factor(level: f64, k: usize) -> Result<f64, Error> {
    let z = normal_quantile(level);
    if z == 0.0 {
        return Ok(1.0);
    }
    let student =
        StudentsT::new(0.0, 1.0, (k - 2) as f64).expect("at least two degrees of freedom");
    let t = student.inverse_cdf(level);
    let k = k as f64;
    let residual = t * (k - 1.0) / (k * (k - 2.0 + t * t)).sqrt();
    Ok(z / c4(k as usize)? / residual)
}
