//! The Lilliefors test: Kolmogorov and Smirnov's distance when mean and variance are estimated.
//!
//! The p-value is Dallal and Wilkinson's analytic approximation where it holds (p ≤ 0.1), and above
//! that a polynomial in Stephens' modified statistic, as in `lillie.test` of the R package nortest.
//!
//! # References
//!
//! - H. Lilliefors, "On the Kolmogorov–Smirnov test for normality with mean and variance unknown",
//!   JASA 62 (1967) 399–402.
//! - G. Dallal, L. Wilkinson, "An analytic approximation to the distribution of Lilliefors's test
//!   statistic for normality", The American Statistician 40 (1986) 294–296.
//! - M. Stephens, "EDF statistics for goodness of fit and some comparisons", JASA 69 (1974) 730–737.

use statrs::distribution::{ContinuousCDF, Normal};

use crate::moments::check_finite;
use crate::{Error, mean_sd};

/// The fewest samples the p-value's approximation holds for.
pub const LILLIEFORS_MIN_SAMPLES: usize = 5;

/// Outcome of the Lilliefors test of normality.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lilliefors {
    /// D: the largest distance between the empirical distribution function and the normal one of
    /// the sample's own mean and standard deviation.
    pub statistic: f64,
    /// Probability, if the sample is normal, of a `statistic` at least as large. The two
    /// approximations meet at 0.1 with a step of less than 0.01 (0.02 for thousands of samples).
    pub p_value: f64,
}

/// Tests whether `samples` may come from a normal distribution of unknown mean and variance.
///
/// # Errors
///
/// [`Error::TooFewSamples`] below [`LILLIEFORS_MIN_SAMPLES`], [`Error::NonFinite`],
/// [`Error::Constant`] when all samples are equal, [`Error::Overflow`].
pub fn lilliefors(samples: &[f64]) -> Result<Lilliefors, Error> {
    let n = samples.len();
    if n < LILLIEFORS_MIN_SAMPLES {
        let needed = LILLIEFORS_MIN_SAMPLES;
        return Err(Error::TooFewSamples {
            statistic: "the Lilliefors test",
            needed,
            got: n,
        });
    }
    check_finite(samples)?;
    let (mean, sd) = mean_sd(samples)?;
    let constant = samples.iter().all(|x| *x == samples[0]);
    // A zero deviation of unequal samples: their squares underflow.
    if constant || sd == 0.0 {
        return Err(Error::Constant {
            n,
            value: samples[0],
        });
    }

    let mut sorted = samples.to_vec();
    sorted.sort_by(f64::total_cmp);
    let normal = Normal::standard();
    let mut statistic = 0.0_f64;
    for (i, x) in sorted.iter().enumerate() {
        let p = normal.cdf((x - mean) / sd);
        let above = (i + 1) as f64 / n as f64 - p;
        let below = p - i as f64 / n as f64;
        statistic = statistic.max(above).max(below);
    }
    Ok(Lilliefors {
        statistic,
        p_value: p_value(statistic, n),
    })
}

fn p_value(d: f64, n: usize) -> f64 {
    let n = n as f64;
    // Dallal and Wilkinson, equation (2), with their substitution beyond n = 100.
    let (d100, n100) = if n <= 100.0 {
        (d, n)
    } else {
        (d * (n / 100.0).powf(0.49), 100.0)
    };
    let scale = n100 + 2.78019;
    let tail = (-7.01256 * d100 * d100 * scale + 2.99587 * d100 * scale.sqrt() - 0.122119
        + 0.974598 / n100.sqrt()
        + 1.67997 / n100)
        .exp();
    if tail <= 0.1 {
        return tail;
    }
    let k = (n.sqrt() - 0.01 + 0.85 / n.sqrt()) * d;
    let [c0, c1, c2, c3, c4] = match k {
        k if k <= 0.302 => return 1.0,
        k if k <= 0.5 => [2.76773, -19.828315, 80.709644, -138.55152, 81.218052],
        k if k <= 0.9 => [-4.901232, 40.662806, -97.490286, 94.029866, -32.355711],
        // From here to its end at 1.31 the polynomial only ever serves p of about 0.1.
        k if k <= 1.31 => [6.198765, -19.558097, 23.186922, -12.234627, 2.423045],
        _ => return 0.0,
    };
    (c0 + k * (c1 + k * (c2 + k * (c3 + k * c4)))).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Critical values at 20, 15, 10, 5 and 1 %.
    ///
    /// P. Molin, H. Abdi, "New tables and numerical approximation for the
    /// Kolmogorov–Smirnov/Lilliefors/Van Soest test of normality" (1998): Monte Carlo with 10⁵
    /// samples per size.
    const MOLIN_ABDI: [(usize, [f64; 5]); 8] = [
        (10, [0.2171, 0.2273, 0.2410, 0.2616, 0.3037]),
        (20, [0.1589, 0.1666, 0.1764, 0.1920, 0.2226]),
        (25, [0.1429, 0.1498, 0.1589, 0.1726, 0.2010]),
        (30, [0.1315, 0.1378, 0.1460, 0.1590, 0.1848]),
        (35, [0.1220, 0.1278, 0.1356, 0.1478, 0.1720]),
        (40, [0.1147, 0.1204, 0.1275, 0.1386, 0.1616]),
        (45, [0.1083, 0.1134, 0.1204, 0.1309, 0.1525]),
        (5, [0.2893, 0.3027, 0.3188, 0.3427, 0.3959]),
    ];
    const LEVELS: [f64; 5] = [0.20, 0.15, 0.10, 0.05, 0.01];

    #[test]
    fn p_values_at_published_critical_values_are_their_levels() {
        // The tables carry about 0.0005 in D, which is 3 % of a p-value; the approximations add
        // about as much, and more below n = 10 (Dallal and Wilkinson, table 1).
        for (n, critical) in MOLIN_ABDI {
            let relative = if n < 10 { 0.12 } else { 0.07 };
            for (d, level) in critical.iter().zip(LEVELS) {
                let p = p_value(*d, n);
                assert!(
                    (p - level).abs() < relative * level,
                    "n {n} d {d}: {p} against {level}"
                );
            }
        }
    }

    #[test]
    fn the_two_approximations_meet() {
        for (n, jump) in [
            (5, 0.01),
            (10, 0.01),
            (30, 0.01),
            (100, 0.01),
            (101, 0.01),
            (500, 0.01),
            (5000, 0.02),
        ] {
            let step = 1e-4 / (n as f64).sqrt();
            let mut previous = 1.0;
            let mut d = 0.0;
            while d < 1.5 / (n as f64).sqrt() {
                let p = p_value(d, n);
                assert!((0.0..=1.0).contains(&p));
                assert!(p <= previous + jump, "n {n} d {d}: {p} after {previous}");
                assert!(previous - p < 0.02, "n {n} d {d}: {p} after {previous}");
                previous = p;
                d += step;
            }
        }
    }
}
