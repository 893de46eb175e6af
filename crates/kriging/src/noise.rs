//! Noise variances smoothed over the points.
//!
//! A percentile m + 1.28 s has a variance proportional to s². An observation whose s came out small by chance
//! is too low and has too small a variance, so that the model is drawn towards low observations. A
//! variance that is smoothed over x hardly depends on the observation's own s. This is the
//! variance model of stochastic kriging (B. Ankenman, B. L. Nelson, J. Staum, *Stochastic kriging for
//! simulation metamodeling*, Operations Research 58 (2010) 371–382).

use rand::seq::SliceRandom as _;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use statrs::function::gamma::digamma;
use stats::streams::{Purpose, stream};

use crate::{Data, Error, FitOptions, Nugget, fit};

/// Number of points that the parameters of the variance model are estimated from; its predictions
/// use all points.
const SUBSET: usize = 500;

/// The source of the noise variances of observations that are estimates from samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Noise {
    /// The variance from the observation's own samples, as in the paper.
    #[default]
    Own,
    /// A variance smoothed over the observations, which hardly depends on the error of the observation itself.
    Smoothed,
}

impl Noise {
    /// The noise variances of the observations at the points `x` (row-major, `d` coordinates).
    ///
    /// `own` are the variances of the observations, each of which is in inverse proportion to its number of
    /// `samples`. The variance of one sample is estimated with `freedom` degrees of freedom.
    ///
    /// # Errors
    ///
    /// The errors of [`smoothed_noise`].
    pub fn variances(
        self,
        x: &[f64],
        d: usize,
        own: Vec<f64>,
        samples: &[f64],
        freedom: f64,
        seed: u64,
    ) -> Result<Vec<f64>, Error> {
        if self == Self::Own {
            return Ok(own);
        }
        let of_one: Vec<f64> = own.iter().zip(samples).map(|(v, n)| v * n).collect();
        let smooth = smoothed_noise(x, d, &of_one, freedom, seed)?;
        Ok(smooth.iter().zip(samples).map(|(v, n)| v / n).collect())
    }
}

/// The noise `variances` of the observations at the points `x` (row-major, `d` coordinates), smoothed by a
/// kriging model of their logarithms. Each is proportional to a sample variance with `freedom` degrees of
/// freedom. The scatter of the logarithms is estimated, as a nugget: samples that are not normal
/// scatter more than normal ones.
///
/// A variance of zero stays and does not enter the model. Variances that do not depend on x are all
/// replaced by one common value. Fewer than two positive variances stay, too.
///
/// # Errors
///
/// The errors of [`fit()`].
pub fn smoothed_noise(
    x: &[f64],
    d: usize,
    variances: &[f64],
    freedom: f64,
    seed: u64,
) -> Result<Vec<f64>, Error> {
    let mut positive: Vec<usize> = (0..variances.len()).collect();
    positive.retain(|&i| variances[i] > 0.0);
    if positive.len() < 2 {
        return Ok(variances.to_vec());
    }
    positive.shuffle(&mut stream(seed, Purpose::Fit, 3, 0));
    let rows = |which: &[usize]| -> Vec<f64> {
        let rows = which.iter().map(|&i| &x[i * d..(i + 1) * d]);
        rows.flatten().copied().collect()
    };
    let logarithms =
        |which: &[usize]| -> Vec<f64> { which.iter().map(|&i| variances[i].ln()).collect() };
    let (first, rest) = positive.split_at(SUBSET.min(positive.len()));
    let parts = [first, rest].map(|which| (rows(which), logarithms(which)));
    let no_noise = vec![0.0; positive.len()];
    let [first, rest] = [&parts[0], &parts[1]].map(|(x, y)| Data {
        x,
        d,
        y,
        noise_variance: &no_noise[..y.len()],
    });
    let options = FitOptions {
        seed,
        nugget: Nugget::Estimated,
        refuse_no_structure: true,
        ..FitOptions::default()
    };
    let at = rows(&positive);
    let means = match fit(&first, &options) {
        Ok(model) => model.with_points(&rest)?.means(&at)?,
        Err(Error::NoStructure { .. }) => {
            let all = logarithms(&positive);
            let mean = all.iter().sum::<f64>() / all.len() as f64;
            vec![mean; all.len()]
        }
        Err(error) => return Err(error),
    };
    // E ln(χ²/ν), the bias of the logarithm of a sample variance.
    let bias = digamma(0.5 * freedom) - (0.5 * freedom).ln();
    let mut smoothed = variances.to_vec();
    for (i, mean) in positive.into_iter().zip(means) {
        smoothed[i] = (mean - bias).exp();
    }
    Ok(smoothed)
}

#[cfg(test)]
mod tests {
    use rand::RngExt as _;

    use super::*;

    /// Sample variances with 9 degrees of freedom whose truth is `truth`, in two coordinates.
    fn sample(n: usize, truth: impl Fn(&[f64]) -> f64) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
        let mut rng = stream(11, Purpose::Test, n as u64, 0);
        let x: Vec<f64> = (0..2 * n).map(|_| rng.random()).collect();
        let truths: Vec<f64> = x.chunks(2).map(truth).collect();
        let mut chi2 = || {
            let normal = |rng: &mut stats::streams::StreamRng| {
                let radius = (-2.0 * (1.0 - rng.random::<f64>()).ln()).sqrt();
                radius * (std::f64::consts::TAU * rng.random::<f64>()).cos()
            };
            (0..9).map(|_| normal(&mut rng).powi(2)).sum::<f64>() / 9.0
        };
        let variances = truths.iter().map(|t| t * chi2()).collect();
        (x, truths, variances)
    }

    fn error(of: &[f64], truths: &[f64]) -> f64 {
        let squares = of.iter().zip(truths).map(|(v, t)| (v / t).ln().powi(2));
        (squares.sum::<f64>() / of.len() as f64).sqrt()
    }

    #[test]
    fn smoothing_comes_close_to_the_true_variances() {
        // More points than the subset, and fewer.
        for n in [200, 600] {
            let (x, truths, variances) = sample(n, |x| 0.01 * (2.0 * x[0] - x[1]).exp());
            let smooth = smoothed_noise(&x, 2, &variances, 9.0, 1).unwrap();
            let (before, after) = (error(&variances, &truths), error(&smooth, &truths));
            // Before smoothing, the error is √ψ′(4.5) = 0.50.
            assert!(before > 0.45 && after < 0.15, "{n}: {before} {after}");
        }
    }

    #[test]
    fn variances_that_do_not_depend_on_x_become_one() {
        let (x, truths, mut variances) = sample(100, |_| 0.04);
        variances[5] = 0.0;
        let smooth = smoothed_noise(&x, 2, &variances, 9.0, 1).unwrap();
        assert_eq!(smooth[5], 0.0, "an exact observation stays exact");
        assert!((smooth[0] / truths[0]).ln().abs() < 0.15, "{}", smooth[0]);
        assert!(
            smooth
                .iter()
                .skip(6)
                .all(|v| (v / smooth[0]).ln().abs() < 0.2)
        );
    }
}
