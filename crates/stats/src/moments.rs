//! Mean and standard deviation.

use crate::Error;

/// Returns the mean and the standard deviation (divisor n − 1) of `samples`, equation (9).
///
/// Both passes subtract a number close to the mean first, so data such as 10⁷ ± 0.1 lose no digits
/// to cancellation; the second pass carries the correction term of Chan, Golub and LeVeque,
/// "Algorithms for computing the sample variance" (1983), equation (1.7).
///
/// # Errors
///
/// [`Error::TooFewSamples`] below two samples, [`Error::NonFinite`] with the index of the first NaN
/// or infinity, [`Error::Overflow`] when finite samples have no finite mean or standard deviation.
pub fn mean_sd(samples: &[f64]) -> Result<(f64, f64), Error> {
    let n = samples.len();
    if n < 2 {
        return Err(Error::TooFewSamples {
            statistic: "a standard deviation",
            needed: 2,
            got: n,
        });
    }
    check_finite(samples)?;

    let count = n as f64;
    let shift = samples[0];
    let mean = shift + samples.iter().map(|x| x - shift).sum::<f64>() / count;
    let (sum, squares) = samples.iter().fold((0.0, 0.0), |(sum, squares), x| {
        let deviation = x - mean;
        (sum + deviation, squares + deviation * deviation)
    });
    let variance = (squares - sum * sum / count) / (count - 1.0);
    if !mean.is_finite() || !variance.is_finite() {
        return Err(Error::Overflow { n });
    }
    // When the sum of squares is zero but for rounding, the correction term can exceed it.
    Ok((mean, variance.max(0.0).sqrt()))
}

/// [`Error::NonFinite`] for the first sample that is NaN or infinite.
pub(crate) fn check_finite(samples: &[f64]) -> Result<(), Error> {
    match samples.iter().position(|x| !x.is_finite()) {
        Some(index) => Err(Error::NonFinite {
            index,
            value: samples[index],
        }),
        None => Ok(()),
    }
}
