//! A control variate for the normal percentile: a cheap response, correlated with the costly one,
//! whose distribution is known.
//!
//! With samples yᵢ, controls cᵢ of known mean μ and standard deviation τ, and the linear model
//! y = α + β c + ε, ε ~ N(0, σ_ε²), the regression gives β̂, the residual variance s_ε² (divisor
//! n − 2) and, with S = Σ(cᵢ − c̄)²:
//!
//! - mean: m = ȳ − β̂ (c̄ − μ), unbiased, with the variance s_ε² (1/n + (c̄ − μ)²/S);
//! - variance: σ̂² = (β̂² − s_ε²/S) τ² + s_ε², unbiased, since β̂² exceeds β² by σ_ε²/S on average;
//!   its variance is τ⁴ (4β²v + 2v²) + (1 − τ²/S)² 2σ_ε⁴/(n − 2), v = σ_ε²/S;
//! - their covariance −2βτ² (c̄ − μ) v.
//!
//! The percentile m + z σ̂ has the bias −z Var(σ̂²)/(8σ³) to second order, about (1 − ρ⁴) times the
//! plain estimate's −z σ/(4n). Its variance comes from linearising the root.
//!
//! When y hardly depends on c, the estimate loses the accuracy of about one sample, and σ̂² may be
//! negative; the plain ȳ + z s is then returned. When the model is not linear, the mean keeps a
//! bias of order 1/n, and the variance lacks the part of y that depends on c in a non-linear way:
//! look at the residuals first.
//!
//! Reference: S. S. Lavenberg, P. D. Welch, "A perspective on the use of control variables to
//! increase the efficiency of Monte Carlo simulations", Management Science 27 (1981) 322–335.

use crate::{Error, mean_sd, percentile_variance};

/// The fewest samples a control variate is fitted to: its residual variance needs n − 2 ≥ 2.
pub const CONTROL_MIN_SAMPLES: usize = 4;

/// The known moments of a control variate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Control {
    /// Mean of the control.
    pub mean: f64,
    /// Standard deviation of the control.
    pub sd: f64,
}

/// A normal percentile with a control variate, and the variances of its parts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ControlledPercentile {
    /// Number of samples.
    pub n: usize,
    /// The mean, in the unit of the samples.
    pub mean: f64,
    /// The standard deviation, in that unit.
    pub sd: f64,
    /// mean + z sd.
    pub p90: f64,
    /// Estimated variance of `mean`.
    pub mean_variance: f64,
    /// Estimated variance of `sd`.
    pub sd_variance: f64,
    /// Estimated variance of `p90`: the noise variance of kriging.
    pub variance: f64,
    /// The slope β̂ of the samples on the controls; zero when the plain estimate was taken.
    pub slope: f64,
    /// Correlation of the samples with the control. Relative to the plain estimates, the variance
    /// of the mean falls to about 1 − correlation², that of the standard deviation to
    /// 1 − correlation⁴.
    pub correlation: f64,
}

/// Estimates mean + z sd of `samples` with one control per sample. `control` holds the controls' true
/// mean and standard deviation.
///
/// # Errors
///
/// [`Error::TooFewSamples`] below [`CONTROL_MIN_SAMPLES`], [`Error::OutOfRange`] unless there is one control per
/// sample, for a `control` with a mean that is not finite or without spread, or for a `z` that is not finite;
/// [`Error::Constant`] if all controls are equal, and the errors of [`mean_sd`].
pub fn control_variate_p90(
    samples: &[f64],
    controls: &[f64],
    control: Control,
    z: f64,
) -> Result<ControlledPercentile, Error> {
    let n = samples.len();
    if n < CONTROL_MIN_SAMPLES {
        return Err(Error::TooFewSamples {
            statistic: "a control variate",
            needed: CONTROL_MIN_SAMPLES,
            got: n,
        });
    }
    let checks = [
        (
            "number of controls",
            controls.len() as f64,
            controls.len() == n,
            "that of the samples",
        ),
        (
            "mean of the control",
            control.mean,
            control.mean.is_finite(),
            "finite",
        ),
        (
            "standard deviation of the control",
            control.sd,
            control.sd.is_finite() && control.sd > 0.0,
            "finite and positive",
        ),
        ("z", z, z.is_finite(), "finite"),
    ];
    for (name, value, holds, expected) in checks {
        if !holds {
            return Err(Error::OutOfRange {
                name,
                value,
                expected,
            });
        }
    }
    let (mean_y, sd_y) = mean_sd(samples)?;
    let (mean_c, sd_c) = mean_sd(controls)?;
    if sd_c == 0.0 {
        let value = controls[0];
        return Err(Error::Constant { n, value });
    }

    let count = n as f64;
    let squares = (count - 1.0) * sd_c * sd_c;
    let products: f64 = samples
        .iter()
        .zip(controls)
        .map(|(y, c)| (y - mean_y) * (c - mean_c))
        .sum();
    let slope = products / squares;
    let residual: f64 = samples
        .iter()
        .zip(controls)
        .map(|(y, c)| (y - mean_y - slope * (c - mean_c)).powi(2))
        .sum::<f64>()
        / (count - 2.0);

    let off = mean_c - control.mean;
    let of_slope = residual / squares;
    let tau2 = control.sd * control.sd;
    let mean = mean_y - slope * off;
    let squared_slope = (slope * slope - of_slope).max(0.0);
    let variance_of_y = ((slope * slope - of_slope) * tau2 + residual).max(0.0);
    let sd = variance_of_y.sqrt();
    let mean_variance = residual * (1.0 / count + off * off / squares);
    let of_variance = tau2 * tau2 * (4.0 * squared_slope * of_slope + 2.0 * of_slope * of_slope)
        + (1.0 - tau2 / squares).powi(2) * 2.0 * residual * residual / (count - 2.0);
    let (sd_variance, covariance) = if sd > 0.0 {
        let slope_of_root = 0.5 / sd;
        (
            of_variance * slope_of_root * slope_of_root,
            -2.0 * slope * tau2 * off * of_slope * slope_of_root,
        )
    } else {
        (0.0, 0.0)
    };
    let correlation = if sd_y > 0.0 {
        (slope * sd_c / sd_y).clamp(-1.0, 1.0)
    } else {
        0.0
    };
    let variance = (mean_variance + z * z * sd_variance + 2.0 * z * covariance).max(0.0);
    // Without a positive σ̂² the root cannot be linearised; its variance is unknown, not zero.
    if variance_of_y == 0.0 && sd_y > 0.0 {
        let mean_variance = sd_y * sd_y / count;
        return Ok(ControlledPercentile {
            n,
            mean: mean_y,
            sd: sd_y,
            p90: mean_y + z * sd_y,
            mean_variance,
            sd_variance: percentile_variance(sd_y * sd_y, n, 1.0)? - mean_variance,
            variance: percentile_variance(sd_y * sd_y, n, z)?,
            slope: 0.0,
            correlation,
        });
    }
    let p90 = mean + z * sd;
    if !(p90.is_finite() && variance.is_finite()) {
        return Err(Error::Overflow { n });
    }
    Ok(ControlledPercentile {
        n,
        mean,
        sd,
        p90,
        mean_variance,
        sd_variance,
        variance,
        slope,
        correlation,
    })
}
