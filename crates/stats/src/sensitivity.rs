//! Variance-based sensitivity: which share of an output's variance comes from which input.
//!
//! For an output Y of independent inputs X_1 … X_d, the first-order index of X_i is
//! S_i = Var(E(Y | X_i))/Var(Y), the share of the variance due to X_i alone. The total index
//! T_i = E(Var(Y | all but X_i))/Var(Y) includes its interactions with the other inputs. Both are
//! estimated from n (d + 2) outputs: at n points A, n points B, and for each input at the points A
//! with that input's coordinate from B. A and B are the two halves of a Sobol' sequence in 2 d
//! dimensions, scrambled after Owen.
//!
//! References: I. M. Sobol', *Math. Comput. Simul.* 55 (2001) 271–280; M. J. W. Jansen, *Comput.
//! Phys. Commun.* 117 (1999) 35–43; A. Saltelli et al., *Comput. Phys. Commun.* 181 (2010) 259–270,
//! whose Table 2 (b) and (f) are the two estimators.

use rand::{Rng, RngExt as _};

use crate::Error;
use crate::sobol::{SOBOL_DIMENSIONS, SOBOL_POINTS};

/// The most inputs of an analysis, each of which takes two dimensions of the sequence.
pub const SENSITIVITY_INPUTS: usize = SOBOL_DIMENSIONS / 2;
/// The most rows of an analysis, the length of the sequence.
pub const SENSITIVITY_ROWS: usize = SOBOL_POINTS;

/// Relative standard deviation below which an output varies by rounding only.
const ROUNDING: f64 = 1e-12;
/// The fewest rows for which bootstrap intervals are meaningful.
const FEWEST_ROWS: usize = 8;

/// The points where an output is needed, and the analysis of the outputs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SensitivityPlan {
    inputs: usize,
    rows: usize,
    scramble: u32,
}

/// A first-order or total index with its bootstrap interval. An estimate of a small index may be negative.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SensitivityIndex {
    /// The estimate.
    pub value: f64,
    /// Lower end of the 95 % interval.
    pub low: f64,
    /// Upper end of the 95 % interval.
    pub high: f64,
}

/// The indices of an output.
#[derive(Debug, Clone, PartialEq)]
pub struct Sensitivity {
    /// First-order indices S_i in the order of the inputs.
    pub first: Vec<SensitivityIndex>,
    /// Total indices T_i.
    pub total: Vec<SensitivityIndex>,
    /// Mean of the output.
    pub mean: f64,
    /// Variance of the output.
    pub variance: f64,
    /// Rows left out because an output in them was not finite.
    pub left_out: usize,
}

impl SensitivityPlan {
    /// A plan for `inputs` inputs with `rows` rows; a power of two as `rows` fills the space best.
    /// Plans with different `scramble` are independent of each other.
    ///
    /// # Errors
    ///
    /// [`Error::OutOfRange`] unless 1 ≤ `inputs` ≤ [`SENSITIVITY_INPUTS`] and
    /// 8 ≤ `rows` ≤ [`SENSITIVITY_ROWS`].
    pub fn new(inputs: usize, rows: usize, scramble: u32) -> Result<Self, Error> {
        if !(1..=SENSITIVITY_INPUTS).contains(&inputs) {
            return Err(Error::OutOfRange {
                name: "number of inputs",
                value: inputs as f64,
                expected: "from 1 to 128",
            });
        }
        if !(FEWEST_ROWS..=SENSITIVITY_ROWS).contains(&rows) {
            return Err(Error::OutOfRange {
                name: "number of rows",
                value: rows as f64,
                expected: "from 8 to 65536",
            });
        }
        Ok(Self {
            inputs,
            rows,
            scramble,
        })
    }

    /// Number of outputs needed: `rows` · (`inputs` + 2).
    #[must_use]
    pub const fn len(&self) -> usize {
        self.rows * self.width()
    }

    /// Whether no output is needed, which is never the case.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.len() == 0
    }

    const fn width(&self) -> usize {
        self.inputs + 2
    }

    /// The point of output number `index` < [`len`](Self::len), one coordinate per input, each
    /// uniform in [0, 1).
    #[must_use]
    pub fn point(&self, index: usize) -> Vec<f64> {
        // Both fit: `new` bounds them.
        let row = (index / self.width()) as u32;
        let which = index % self.width();
        (0..self.inputs)
            .map(|input| {
                let from_b = which == 1 || which == input + 2;
                let dimension = input + if from_b { self.inputs } else { 0 };
                f64::from(sobol_burley::sample(row, dimension as u32, self.scramble))
            })
            .collect()
    }

    /// Computes the indices from the outputs at all points, in their order. Rows with an output
    /// that is not finite are left out. Intervals are the 2.5 % and 97.5 % quantiles of `resamples`
    /// bootstrap samples of the rows. They are too wide rather than too narrow: the bootstrap takes
    /// the rows for independent, while those of a Sobol' sequence complement each other.
    ///
    /// # Errors
    ///
    /// [`Error::OutOfRange`] unless there are as many outputs as points, at least 40 resamples, and
    /// outputs that vary; [`Error::TooFewSamples`] if fewer than 8 rows are left.
    pub fn analyse<R: Rng + ?Sized>(
        &self,
        outputs: &[f64],
        resamples: usize,
        rng: &mut R,
    ) -> Result<Sensitivity, Error> {
        let check = |holds: bool, name, value, expected| {
            if holds {
                Ok(())
            } else {
                Err(Error::OutOfRange {
                    name,
                    value,
                    expected,
                })
            }
        };
        let given = outputs.len();
        check(
            given == self.len(),
            "number of outputs",
            given as f64,
            "one per point of the plan",
        )?;
        check(
            resamples >= 40,
            "number of resamples",
            resamples as f64,
            "at least 40",
        )?;
        let rows: Vec<&[f64]> = outputs
            .chunks_exact(self.width())
            .filter(|row| row.iter().all(|output| output.is_finite()))
            .collect();
        if rows.len() < FEWEST_ROWS {
            return Err(Error::TooFewSamples {
                statistic: "a variance-based index",
                needed: FEWEST_ROWS,
                got: rows.len(),
            });
        }
        let all: Vec<usize> = (0..rows.len()).collect();
        let estimate = Estimate::from_rows(&rows, &all, self.inputs);
        check(
            estimate.variance.sqrt() > ROUNDING * estimate.mean.abs(),
            "variance of the output",
            estimate.variance,
            "above that of rounding: the output does not depend on any input",
        )?;
        let drawn: Vec<Estimate> = (0..resamples)
            .map(|_| {
                let picked: Vec<usize> = all
                    .iter()
                    .map(|_| rng.random_range(0..rows.len()))
                    .collect();
                Estimate::from_rows(&rows, &picked, self.inputs)
            })
            .collect();
        let index = |of: &dyn Fn(&Estimate) -> f64| {
            let mut values: Vec<f64> = drawn.iter().map(of).filter(|v| v.is_finite()).collect();
            values.sort_by(f64::total_cmp);
            let quantile = |p: f64| {
                let place = p * (values.len() as f64 - 1.0);
                values.get(place.round() as usize).copied()
            };
            SensitivityIndex {
                value: of(&estimate),
                low: quantile(0.025).unwrap_or(f64::NAN),
                high: quantile(0.975).unwrap_or(f64::NAN),
            }
        };
        Ok(Sensitivity {
            first: (0..self.inputs).map(|i| index(&|e| e.first[i])).collect(),
            total: (0..self.inputs).map(|i| index(&|e| e.total[i])).collect(),
            mean: estimate.mean,
            variance: estimate.variance,
            left_out: self.rows - rows.len(),
        })
    }
}

/// Indices and moments estimated from some rows.
struct Estimate {
    first: Vec<f64>,
    total: Vec<f64>,
    mean: f64,
    variance: f64,
}

impl Estimate {
    /// Estimates from the rows numbered in `picked`; a row holds the outputs at A, at B, and at A
    /// with each coordinate in turn from B.
    fn from_rows(rows: &[&[f64]], picked: &[usize], inputs: usize) -> Self {
        let n = picked.len() as f64;
        let both = || picked.iter().flat_map(|&row| rows[row][..2].iter());
        let mean = both().sum::<f64>() / (2.0 * n);
        let variance = both().map(|y| (y - mean).powi(2)).sum::<f64>() / (2.0 * n);
        let average = |of: &dyn Fn(&[f64]) -> f64| -> f64 {
            picked.iter().map(|&row| of(rows[row])).sum::<f64>() / n
        };
        // The mean is subtracted at B: otherwise a large mean drowns the difference in noise.
        let first = |i: usize| average(&|row| (row[1] - mean) * (row[i + 2] - row[0]));
        let total = |i: usize| average(&|row| 0.5 * (row[0] - row[i + 2]).powi(2));
        Self {
            first: (0..inputs).map(|i| first(i) / variance).collect(),
            total: (0..inputs).map(|i| total(i) / variance).collect(),
            mean,
            variance,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;
    use crate::streams::{Purpose, stream};

    fn analyse(
        inputs: usize,
        rows: usize,
        scramble: u32,
        f: impl Fn(&[f64]) -> f64,
    ) -> Result<Sensitivity, Error> {
        let plan = SensitivityPlan::new(inputs, rows, scramble)?;
        let outputs: Vec<f64> = (0..plan.len()).map(|i| f(&plan.point(i))).collect();
        plan.analyse(&outputs, 400, &mut stream(1, Purpose::Test, 0, 0))
    }

    /// sin x1 + 7 sin² x2 + 0.1 x3⁴ sin x1 on (−π, π)³ (Ishigami and Homma 1990), a = 7, b = 0.1.
    fn ishigami(u: &[f64]) -> f64 {
        let x: Vec<f64> = u.iter().map(|u| PI * (2.0 * u - 1.0)).collect();
        x[0].sin() + 7.0 * x[1].sin().powi(2) + 0.1 * x[2].powi(4) * x[0].sin()
    }

    /// The indices are known in closed form: V = a²/8 + b π⁴/5 + b² π⁸/18 + 1/2,
    /// V_1 = (1 + b π⁴/5)²/2, V_2 = a²/8, V_3 = 0, V_13 = 8 b² π⁸/225.
    #[test]
    fn the_indices_of_the_ishigami_function_are_found() {
        let (a, b) = (7.0, 0.1);
        let v1 = 0.5 * (1.0 + b * PI.powi(4) / 5.0).powi(2);
        let v2 = a * a / 8.0;
        let v13 = 8.0 * b * b * PI.powi(8) / 225.0;
        let v = v1 + v2 + v13;
        let first = [v1 / v, v2 / v, 0.0];
        let total = [(v1 + v13) / v, v2 / v, v13 / v];
        assert!((first[0] - 0.3139).abs() < 1e-4 && (total[2] - 0.2437).abs() < 1e-4);
        let mut held = 0;
        for scramble in 0..8 {
            let found = analyse(3, 4096, scramble, ishigami).unwrap();
            // Half of sin² is the mean of 7 sin².
            assert!((found.mean - 3.5).abs() < 0.05, "{}", found.mean);
            assert!((found.variance / v - 1.0).abs() < 0.02);
            for i in 0..3 {
                for (index, truth) in [(found.first[i], first[i]), (found.total[i], total[i])] {
                    // Measured over these scrambles: 0.01 at most.
                    assert!((index.value - truth).abs() < 0.02, "{i}: {index:?} {truth}");
                    assert!(index.low <= index.value && index.value <= index.high);
                    held += u32::from((index.low..=index.high).contains(&truth));
                }
            }
        }
        // 48 intervals of at least 95 %: 42 or fewer would have a probability below 2 %.
        assert!(held >= 43, "{held} of 48 intervals hold the truth");
    }

    #[test]
    fn inputs_that_only_add_share_the_variance_by_their_squares() {
        let found = analyse(3, 1024, 5, |u| 3.0 * u[0] + 4.0 * u[1] + 100.0).unwrap();
        for (i, share) in [9.0 / 25.0, 16.0 / 25.0, 0.0].into_iter().enumerate() {
            // A Sobol' sequence integrates polynomials far better than chance would.
            assert!((found.first[i].value - share).abs() < 5e-3, "{found:?}");
            assert!((found.total[i].value - share).abs() < 5e-3, "{found:?}");
        }
        assert_eq!(found.total[2].value, 0.0, "an input without effect");
    }

    #[test]
    fn rows_without_a_number_are_left_out_and_counted() {
        let f = |u: &[f64]| if u[0] > 0.9 { f64::NAN } else { u[0] + u[1] };
        let found = analyse(2, 512, 0, f).unwrap();
        // A and B miss independently: 1 − 0.9² of 512 rows are 97.
        assert!((80..115).contains(&found.left_out), "{}", found.left_out);
        assert!(found.first[0].value > 0.3);
    }

    #[test]
    fn plans_and_outputs_that_make_no_sense_are_refused() {
        assert!(SensitivityPlan::new(0, 64, 0).is_err());
        assert!(SensitivityPlan::new(129, 64, 0).is_err());
        assert!(SensitivityPlan::new(3, 7, 0).is_err());
        let plan = SensitivityPlan::new(2, 64, 0).unwrap();
        assert_eq!((plan.len(), plan.is_empty()), (256, false));
        let rng = &mut stream(1, Purpose::Test, 0, 0);
        assert!(plan.analyse(&[1.0], 400, rng).is_err());
        assert!(plan.analyse(&[1.0; 256], 10, rng).is_err());
    }
}
