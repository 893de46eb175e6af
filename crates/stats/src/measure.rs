//! Measures of a random response, which are optimised or limited, with their estimates and intervals.
//!
//! All measures but percentile and probability are written as the mean of **scores**, one for each sample, which is
//! the estimate and gives its standard error at once. With the mean m, the standard deviation s and the percentile
//! q of the samples y:
//!
//! | measure | score of y |
//! |---|---|
//! | mean | y |
//! | mean + k sd | y + k (s + ((y − m)² − s²)/(2s)) |
//! | mean of the tail above q | q + max(y − q, 0)/(1 − level) (Rockafellar and Uryasev) |
//! | probability that y > limit | 1 or 0 |
//!
//! - An estimate from few samples is that of a normal response, m + z s with the [factor](Measure::normal_factor) z,
//!   or the mean of the scores, which assumes no distribution.
//! - The interval of many samples is Hall's: Student's t of the scores, transformed so that their skewness is
//!   taken out. Percentiles have the exact interval of [`order_statistic`], probabilities that of Clopper and Pearson.
//! - Two measures of samples that share their random numbers differ by the mean of the differences of their scores.
//!
//! References: R. T. Rockafellar, S. Uryasev, "Optimization of conditional value-at-risk", J. Risk 2 (2000) 21–41;
//! P. Hall, "On the removal of skewness by transformation", J. R. Statist. Soc. B 54 (1992) 221–228; C. J. Clopper,
//! E. S. Pearson, "The use of confidence or fiducial limits illustrated in the case of the binomial", Biometrika 26
//! (1934) 404–413.

use statrs::distribution::{Beta, Continuous as _, ContinuousCDF as _, Normal, StudentsT};

use crate::exact::normal_quantile;
use crate::moments::{check_finite, mean_sd};
use crate::order::{
    check, check_samples, order_interval_min_samples, order_statistic, paired_difference,
};
use crate::quantile::{HarrellDavisVariance, harrell_davis, harrell_davis_min_samples};
use crate::{Error, Estimate, IntervalEstimate, Method, Percentile};

/// A number that characterises a random response, to be optimised or limited.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Measure {
    /// The value that a share `level` of the samples stay below.
    Percentile {
        /// Strictly between 0 and 1.
        level: f64,
    },
    /// The expected value.
    Mean,
    /// The mean and `k` standard deviations; below the mean for a negative `k`.
    MeanPlusSd {
        /// The number of standard deviations.
        k: f64,
    },
    /// The mean of the tail beyond the percentile at `level`: superquantile, conditional value at risk.
    TailMean {
        /// Strictly between 0 and 1.
        level: f64,
        /// Whether the tail lies below the percentile.
        is_lower: bool,
    },
    /// The probability that the response exceeds `limit`.
    Exceedance {
        /// In the unit of the samples.
        limit: f64,
    },
}

impl Measure {
    /// The factor z with which the measure of a normal response is m + z s; `None` for a probability.
    #[must_use]
    pub fn normal_factor(&self) -> Option<f64> {
        match *self {
            Self::Percentile { level } => Some(normal_quantile(level)),
            Self::Mean => Some(0.0),
            Self::MeanPlusSd { k } => Some(k),
            Self::TailMean { level, is_lower } => {
                let density = Normal::standard().pdf(normal_quantile(level));
                Some(match is_lower {
                    true => -density / level,
                    false => density / (1.0 - level),
                })
            }
            Self::Exceedance { .. } => None,
        }
    }

    /// The fewest samples for an estimate that assumes no distribution.
    #[must_use]
    pub fn free_min_samples(&self) -> usize {
        match *self {
            Self::Percentile { level } | Self::TailMean { level, .. } => {
                harrell_davis_min_samples(level)
            }
            Self::Mean | Self::MeanPlusSd { .. } | Self::Exceedance { .. } => 4,
        }
    }

    /// The fewest samples with which [`verified`](Self::verified) has an interval. For the mean of a tail they leave
    /// ten samples in the tail.
    #[must_use]
    pub fn interval_min_samples(&self, confidence: f64) -> usize {
        match *self {
            Self::Percentile { level } => order_interval_min_samples(level, confidence),
            Self::TailMean { level, is_lower } => {
                let tail = if is_lower { level } else { 1.0 - level };
                (10.0 / tail - 1e-9).ceil() as usize
            }
            Self::Mean | Self::MeanPlusSd { .. } => 10,
            Self::Exceedance { .. } => 1,
        }
    }

    /// The measure of a normal response with the mean and the standard deviation of `normal`, whose `p90` and
    /// `variance` are those of m + z s with this measure's z.
    #[must_use]
    pub fn of_normal(&self, normal: &Percentile) -> Estimate {
        let Percentile {
            n,
            mean,
            sd,
            p90,
            variance,
        } = *normal;
        let (value, variance) = match *self {
            Self::Exceedance { limit } if sd == 0.0 => (f64::from(u8::from(mean > limit)), 0.0),
            Self::Exceedance { limit } => {
                let z = (mean - limit) / sd;
                let standard = Normal::standard();
                // The variance of z is (1 + z²/2)/n to first order. It would vanish far from the limit, where the
                // normal tail is an assumption. The standard error is therefore at least 1/(2(n + 1)), half of one
                // sample.
                let slope = standard.pdf(z);
                let least = 0.5 / (n as f64 + 1.0);
                let variance = slope * slope * (1.0 + 0.5 * z * z) / n as f64;
                (standard.cdf(z), variance.max(least * least))
            }
            _ => (p90, variance),
        };
        Estimate {
            method: Method::Normal,
            n,
            value,
            variance,
        }
    }

    /// The estimate and its variance without an assumption about the distribution: Harrell and Davis's percentile, or
    /// the mean of the scores. A probability is (c + ½)/(n + 1) with c samples beyond the limit, since 0 of n samples
    /// are no proof of 0.
    ///
    /// # Errors
    ///
    /// [`Error::TooFewSamples`] below [`free_min_samples`](Self::free_min_samples), [`Error::NonFinite`],
    /// [`Error::Overflow`].
    pub fn distribution_free(
        &self,
        samples: &[f64],
        variance: HarrellDavisVariance,
    ) -> Result<Estimate, Error> {
        if let Self::Percentile { level } = *self {
            return harrell_davis(samples, level, variance);
        }
        let (n, needed) = (samples.len(), self.free_min_samples());
        if n < needed {
            return Err(Error::TooFewSamples {
                statistic: "a measure without a distribution",
                needed,
                got: n,
            });
        }
        let of_n = n as f64;
        let (value, variance) = match *self {
            Self::Exceedance { limit } => {
                check_finite(samples)?;
                let beyond = samples.iter().filter(|sample| **sample > limit).count();
                let share = (beyond as f64 + 0.5) / (of_n + 1.0);
                (share, share * (1.0 - share) / of_n)
            }
            _ => {
                let (mean, sd) = mean_sd(&self.scores(samples)?)?;
                (mean, sd * sd / of_n)
            }
        };
        Ok(Estimate {
            method: Method::DistributionFree,
            n,
            value,
            variance,
        })
    }

    /// The measure of many samples with an interval that assumes no distribution. Samples may be infinite: percentiles
    /// and probabilities depend on their order only; all other measures are then infinite and have no interval.
    ///
    /// # Errors
    ///
    /// [`Error::TooFewSamples`] without samples (for a mean, below two), [`Error::NonFinite`] for one that is not a
    /// number, [`Error::OutOfRange`] unless level and confidence lie strictly between 0 and 1, [`Error::Overflow`].
    pub fn verified(&self, samples: &[f64], confidence: f64) -> Result<IntervalEstimate, Error> {
        let n = samples.len();
        match *self {
            Self::Percentile { level } => order_statistic(samples, level, confidence),
            Self::Exceedance { limit } => {
                check_samples(samples, confidence)?;
                let beyond = samples.iter().filter(|sample| **sample > limit).count();
                Ok(IntervalEstimate {
                    n,
                    value: beyond as f64 / n as f64,
                    interval: Some(clopper_pearson(beyond, n, confidence)),
                })
            }
            _ => {
                let infinite = samples.iter().find(|sample| sample.is_infinite());
                if let Some(&value) = infinite {
                    let interval = None;
                    return Ok(IntervalEstimate { n, value, interval });
                }
                let mut found = mean_of(&self.scores(samples)?, confidence)?;
                if n < self.interval_min_samples(confidence) {
                    found.interval = None;
                }
                Ok(found)
            }
        }
    }

    /// The measure of `first` less that of `second`, with its interval. Samples of one index must have the same
    /// random numbers; those beyond the shorter list are left out. `None` without an interval.
    ///
    /// # Errors
    ///
    /// As [`verified`](Self::verified).
    pub fn difference(
        &self,
        first: &[f64],
        second: &[f64],
        confidence: f64,
    ) -> Result<Option<IntervalEstimate>, Error> {
        let n = first.len().min(second.len());
        let (first, second) = (&first[..n], &second[..n]);
        if let Self::Percentile { level } = *self {
            return paired_difference(first, second, level, confidence);
        }
        let is_probability = matches!(self, Self::Exceedance { .. });
        let is_finite = |samples: &[f64]| samples.iter().all(|sample| sample.is_finite());
        let counts = n >= self.interval_min_samples(confidence).max(2);
        if !counts || !(is_probability || is_finite(first) && is_finite(second)) {
            return Ok(None);
        }
        let pairs = self.scores(first)?.into_iter().zip(self.scores(second)?);
        let differences: Vec<f64> = pairs.map(|(a, b)| a - b).collect();
        mean_of(&differences, confidence).map(Some)
    }

    /// The score of every sample, whose mean is the measure.
    fn scores(&self, samples: &[f64]) -> Result<Vec<f64>, Error> {
        if samples.is_empty() {
            return Ok(Vec::new());
        }
        let scores = |score: &dyn Fn(f64) -> f64| samples.iter().map(|y| score(*y)).collect();
        Ok(match *self {
            Self::Exceedance { limit } => scores(&|y| f64::from(u8::from(y > limit))),
            Self::MeanPlusSd { k } => {
                let (mean, sd) = mean_sd(samples)?;
                if sd == 0.0 {
                    return Ok(samples.to_vec());
                }
                // With the divisor n of the mean of squares, the mean of the scores is m + k s.
                let n = samples.len() as f64;
                let of_n = sd * sd * (n - 1.0) / n;
                scores(&|y| y + k * (sd + ((y - mean).powi(2) - of_n) / (2.0 * sd)))
            }
            Self::TailMean { level, is_lower } => {
                let (sign, tail) = match is_lower {
                    true => (-1.0, level),
                    false => (1.0, 1.0 - level),
                };
                let mut sorted = samples.to_vec();
                sorted.sort_by(f64::total_cmp);
                // The empirical percentile, at which the mean of the scores is the mean of the tail.
                let n = sorted.len();
                // 0.9 · 30 may be just above 27.
                let below = |level: f64| (level * n as f64 - 1e-9).ceil() as usize;
                let rank = match is_lower {
                    true => n + 1 - below(1.0 - level),
                    false => below(level),
                };
                let q = sorted[rank.clamp(1, n) - 1];
                scores(&|y| q + sign * (sign * (y - q)).max(0.0) / tail)
            }
            Self::Mean | Self::Percentile { .. } => samples.to_vec(),
        })
    }
}

/// The mean of `scores` and its interval by Hall's transformation of Student's t.
fn mean_of(scores: &[f64], confidence: f64) -> Result<IntervalEstimate, Error> {
    let n = scores.len();
    check(confidence, "confidence")?;
    let (mean, sd) = mean_sd(scores)?;
    if sd == 0.0 {
        return Ok(IntervalEstimate {
            n,
            value: mean,
            interval: Some((mean, mean)),
        });
    }
    let of_n = n as f64;
    let cubes: f64 = scores.iter().map(|y| ((y - mean) / sd).powi(3)).sum();
    let skewness = cubes / of_n;
    let student = StudentsT::new(0.0, 1.0, of_n - 1.0).expect("at least one degree of freedom");
    let t = student.inverse_cdf(0.5 + 0.5 * confidence);
    let (root, a) = (of_n.sqrt(), skewness / 3.0);
    // The studentised mean at which Hall's transformation is x.
    let inverse = |x: f64| {
        if a.abs() < 1e-6 {
            return x;
        }
        let cube = 1.0 + 3.0 * a * (x / root - skewness / (6.0 * of_n));
        root / a * (cube.cbrt() - 1.0)
    };
    let limit = |x: f64| mean - sd / root * inverse(x);
    Ok(IntervalEstimate {
        n,
        value: mean,
        interval: Some((limit(t), limit(-t))),
    })
}

/// The exact interval of a probability of which `count` of `n` trials were hits.
fn clopper_pearson(count: usize, n: usize, confidence: f64) -> (f64, f64) {
    let tail = 0.5 * (1.0 - confidence);
    let beta = |a: usize, b: usize| Beta::new(a as f64, b as f64).expect("positive parameters");
    let low = match count {
        0 => 0.0,
        _ => beta(count, n - count + 1).inverse_cdf(tail),
    };
    let high = match n - count {
        0 => 1.0,
        rest => beta(count + 1, rest).inverse_cdf(1.0 - tail),
    };
    (low, high)
}
