//! A verified percentile and its interval, as reports and tables show them.

use campaign::file::Sampling;
use report::Percentile;

/// The percentile of verification samples with its 95 % interval; no numbers where there are too few.
#[must_use]
pub fn percentile(sampling: &Sampling, samples: &[f64]) -> Percentile {
    let verified = sampling.verified(samples).ok();
    let (low, high) = verified
        .and_then(|verified| verified.interval)
        .unwrap_or((f64::NAN, f64::NAN));
    Percentile {
        value: verified.map_or(f64::NAN, |verified| verified.value),
        low,
        high,
        samples: samples.len(),
    }
}
