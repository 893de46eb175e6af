//! Estimates of a percentile of a normal sample.

use crate::Error;
use crate::exact::{c4, exact_percentile_variance};
use crate::moments::mean_sd;
use crate::percentile::{PAPER_Z90, Percentile, percentile_variance};

/// Estimates the 90th percentile of a normal sample, and the variance of that estimate: equations
/// (8), (9) and (14) with z = [`PAPER_Z90`].
///
/// # Errors
///
/// [`Error::TooFewSamples`] below [`crate::PERCENTILE_MIN_SAMPLES`], and the errors of [`mean_sd`].
pub fn percentile_p90(samples: &[f64]) -> Result<Percentile, Error> {
    normal_p90(samples, &NormalOptions::default())
}

/// The formula for the variance of m + z s.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum VarianceFormula {
    /// [`percentile_variance`], the paper's equation (14).
    #[default]
    Taylor,
    /// [`exact_percentile_variance`], from the χ distribution of s.
    Exact,
}

/// Options of the estimate of a percentile of a normal sample. The default is that of
/// [`percentile_p90`], the paper's estimate of the 90th percentile.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NormalOptions {
    /// z of m + z s: [`crate::normal_quantile`] of the level, or the paper's rounded [`PAPER_Z90`].
    pub z: f64,
    /// The formula of the reported variance.
    pub variance: VarianceFormula,
    /// Whether s is divided by c₄, so that the percentile has no bias (and a slightly larger
    /// variance, which is then z²(1/c₄² − 1) in place of z²(1 − c₄²)).
    pub unbiased: bool,
}

impl Default for NormalOptions {
    fn default() -> Self {
        Self {
            z: PAPER_Z90,
            variance: VarianceFormula::Taylor,
            unbiased: false,
        }
    }
}

/// Estimates the percentile m + z s of a normal sample, with z, variance and bias as in `options`.
///
/// # Errors
///
/// The errors of [`percentile_p90`].
pub fn normal_p90(samples: &[f64], options: &NormalOptions) -> Result<Percentile, Error> {
    let n = samples.len();
    let z = options.z;
    let relative = c4(n)?;
    // Dividing s by c₄ is multiplying z by 1/c₄.
    let z = if options.unbiased { z / relative } else { z };
    let (mean, sd) = mean_sd(samples)?;
    let variance = match options.variance {
        VarianceFormula::Taylor => percentile_variance(sd * sd, n, z)?,
        VarianceFormula::Exact => exact_percentile_variance(sd * sd, n, z)?,
    };
    let p90 = mean + z * sd;
    if !p90.is_finite() {
        return Err(Error::Overflow { n });
    }
    Ok(Percentile {
        n,
        mean,
        sd,
        p90,
        variance,
    })
}
