//! A percentile and its interval, as reports and tables show them.

use campaign::file::Sampling;
use report::Percentile;

/// The percentile of verification samples with its 95 % interval; no numbers where there are too few.
#[must_use]
pub fn percentile(sampling: &Sampling, samples: &[f64]) -> Percentile {
    let nothing = Percentile {
        value_um: f64::NAN,
        low_um: f64::NAN,
        high_um: f64::NAN,
        samples: samples.len(),
    };
    let Ok(estimate) = sampling.verified(samples) else {
        return nothing;
    };
    let (low_um, high_um) = stats::p90_interval(&estimate, 0.95).unwrap_or((f64::NAN, f64::NAN));
    Percentile {
        value_um: estimate.p90,
        low_um,
        high_um,
        samples: samples.len(),
    }
}
