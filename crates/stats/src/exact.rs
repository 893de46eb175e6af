//! The exact moments of the standard deviation of a normal sample, which the Taylor expansion of
//! (10)–(13) approximates.
//!
//! For k normal samples, s is distributed as σ χ/√(k − 1), χ with k − 1 degrees of freedom, and is
//! independent of the mean m: E(s) = c₄ σ with c₄ = √(2/(k − 1)) Γ(k/2)/Γ((k − 1)/2), and
//! Var(s) = (1 − c₄²) σ². So m + z s has the bias −z (1 − c₄) σ and the variance
//! σ² [1/k + z² (1 − c₄²)].
//!
//! Reference: N. L. Johnson, S. Kotz, N. Balakrishnan, "Continuous Univariate Distributions", vol. 1
//! (1994), section 13.8.2 and chapter 18 (the χ distribution).

use statrs::distribution::{ContinuousCDF as _, Normal};

use crate::Error;
use crate::percentile::{PERCENTILE_MIN_SAMPLES, check_variance_arguments};

/// The 90 % quantile of the standard normal distribution.
pub const EXACT_Z90: f64 = 1.281_551_565_544_600_4;

/// The quantile z of the standard normal distribution at a `level` between 0 and 1, both excluded.
#[must_use]
pub fn normal_quantile(level: f64) -> f64 {
    match level {
        0.9 => EXACT_Z90,
        0.1 => -EXACT_Z90,
        _ => Normal::standard().inverse_cdf(level),
    }
}

/// The probability that a standard normal number is at most `z`.
#[must_use]
pub fn normal_probability(z: f64) -> f64 {
    Normal::standard().cdf(z)
}

/// The exact variance of m + z s for `k` normal samples of variance `sigma2`:
/// σ² [1/k + z² (1 − c₄²)]. With the unbiased s² in the place of σ² it is unbiased itself.
///
/// # Errors
///
/// As [`crate::percentile_variance`].
pub fn exact_percentile_variance(sigma2: f64, k: usize, z: f64) -> Result<f64, Error> {
    check_variance_arguments(sigma2, k, z)?;
    let spread = -(2.0 * ln_c4(k)).exp_m1();
    Ok(sigma2 * (1.0 / k as f64 + z * z * spread))
}

/// The bias E(s) − σ of the standard deviation of `k` normal samples of standard deviation `sigma`:
/// −(1 − c₄) σ, about −σ/(4 k). The bias of the percentile m + z s is z times this.
///
/// # Errors
///
/// [`Error::TooFewSamples`] below 4 samples, [`Error::OutOfRange`] unless `sigma` is finite and not
/// negative.
pub fn sd_bias(sigma: f64, k: usize) -> Result<f64, Error> {
    check_variance_arguments(sigma, k, 0.0)?;
    Ok(sigma * ln_c4(k).exp_m1())
}

/// c₄ = E(s)/σ for `k` normal samples.
///
/// # Errors
///
/// [`Error::TooFewSamples`] below 4 samples.
pub fn c4(k: usize) -> Result<f64, Error> {
    check_variance_arguments(1.0, k, 0.0)?;
    Ok(ln_c4(k).exp())
}

/// ln c₄ for k ≥ [`PERCENTILE_MIN_SAMPLES`]. With x = (k − 1)/2, c₄ = Γ(x + ½)/(Γ(x) √x), whose
/// logarithm has the asymptotic series −1/(8x) + 1/(192x³) − 1/(640x⁵) + 17/(14336x⁷) − …
/// (Abramowitz and Stegun 6.1.40 for both gammas). From x = 20 on, the first term left out is below
/// 4·10⁻¹⁵; smaller x are raised by Γ(x + 1) = x Γ(x).
fn ln_c4(k: usize) -> f64 {
    assert!(k >= PERCENTILE_MIN_SAMPLES);
    let low = (k - 1) as f64 / 2.0;
    let mut x = low;
    let mut sum = 0.0;
    while x < 20.0 {
        // c₄(x)/c₄(x + 1) = x/(x + ½) · √((x + 1)/x).
        sum -= (0.5 / x).ln_1p() - 0.5 * (1.0 / x).ln_1p();
        x += 1.0;
    }
    let inverse = 1.0 / x;
    let square = inverse * inverse;
    let series = 1.0 / 192.0 + square * (-1.0 / 640.0 + square * (17.0 / 14336.0));
    sum + inverse * (-0.125 + square * series)
}
