//! Bounds and starts of a search.

use std::borrow::Cow;

use rand::RngExt as _;
use rand::seq::SliceRandom as _;
use rayon::prelude::*;
use stats::streams::{Purpose, stream};

use super::newton::INSIGNIFICANT;
use super::options::FitOptions;
use crate::Error;
use crate::data::scaled::{SIGMA2_BOUNDS, ScaledData};
use crate::likelihood::{Likelihood, ModelForm, Order};
use crate::linalg::JITTERS;

/// Number of starts that are polished.
const POLISHED: usize = 4;
/// Bounds of the nugget, relative to the variance of the observations.
const NUGGET_BOUNDS: (f64, f64) = (1e-12, 1e2);
/// The nugget at the starts, in the same unit.
const NUGGET_START: f64 = 1e-2;
/// Upper bound of a range, in units of its coordinate's extent. At this range the correlation of
/// opposite sides is 1 − 3·10⁻⁴ (Matérn 5/2): over the extent the process is a plane, up to a
/// fraction of that order. A longer range, with σ² to match, gives the same predictions and nearly
/// the same likelihood, in which the search would wander, and the covariance matrix comes nearer to
/// singular with the square of the range.
const LONGEST_RANGE: f64 = 50.0;
/// Number of points above which the search goes by stages, from a subset to all points.
pub(super) const STAGED: usize = 450;
/// Predicted improvement below which a likelihood counts as maximal.
pub(super) const TOLERANCE: f64 = 1e-6;

/// The search for the parameters of one set of data: (ln θ₁ … ln θ_d, or one ln θ for all, ln τ² of a nugget,
/// ln σ²).
pub(super) struct Search<'a> {
    pub(super) data: &'a ScaledData,
    pub(super) options: &'a FitOptions,
    /// Whether all coordinates share one range.
    pub(super) tied: bool,
    pub(super) lower: Vec<f64>,
    pub(super) upper: Vec<f64>,
    /// A random order of the points; a subset consists of the first ones.
    pub(super) order: Vec<usize>,
    /// Tolerance of the search on all points.
    pub(super) tolerance: f64,
}

impl<'a> Search<'a> {
    pub(super) fn new(data: &'a ScaledData, options: &'a FitOptions) -> Self {
        let n = data.len();
        let dimensions = data.columns.len();
        let tied = n < dimensions + 2 + options.trend.coefficients(dimensions);
        let mut lower: Vec<f64> = data
            .columns
            .iter()
            .map(|c| shortest_range(c).ln())
            .collect();
        if tied {
            lower = vec![lower.iter().copied().fold(0.0, f64::min)];
        }
        let mut upper = vec![LONGEST_RANGE.ln(); lower.len()];
        if options.nugget.is_estimated() {
            lower.push(NUGGET_BOUNDS.0.ln());
            upper.push(NUGGET_BOUNDS.1.ln());
        }
        lower.push(SIGMA2_BOUNDS.0.ln());
        upper.push(SIGMA2_BOUNDS.1.ln());
        let mut order: Vec<usize> = (0..n).collect();
        order.shuffle(&mut stream(options.seed, Purpose::Fit, 0, 0));
        Self {
            data,
            options,
            tied,
            lower,
            upper,
            order,
            // A likelihood of many points costs n³.
            tolerance: if n > STAGED { INSIGNIFICANT } else { TOLERANCE },
        }
    }

    /// The starts of highest likelihood on `subset`, each with the smallest jitter it needs there.
    pub(super) fn screen(&self, subset: &ScaledData) -> Result<Vec<(Vec<f64>, f64)>, Error> {
        let starts = self.options.starts.max(1);
        let mut screened: Vec<(f64, Vec<f64>, f64)> = (0..starts)
            .into_par_iter()
            .filter_map(|i| {
                let start = self.start(i);
                JITTERS.iter().find_map(|&jitter| {
                    let (value, at) = self.value_at(subset, start.clone(), jitter)?;
                    Some((value, at, jitter))
                })
            })
            .collect();
        if screened.is_empty() {
            return Err(Error::not_positive_definite(None));
        }
        // The first start stays whatever its value, because it keeps clear of white noise.
        screened[1..].sort_by(|a, b| a.0.total_cmp(&b.0));
        screened.truncate(POLISHED);
        Ok(screened
            .into_iter()
            .map(|(_, at, jitter)| (at, jitter))
            .collect())
    }

    /// Start 0 has all ranges at half the extent; in the others they are random between a tenth and
    /// five times the extent. More than six ranges are longer in proportion to their number,
    /// because distances grow with the dimension. For 40 points in 20 dimensions this finds
    /// likelihoods that shorter starts miss (`docs/kriging.md`).
    fn start(&self, i: usize) -> Vec<f64> {
        let mut rng = stream(self.options.seed, Purpose::Fit, 1, i as u64);
        let count = self.lower.len() - 1 - usize::from(self.options.nugget.is_estimated());
        let longer = (count as f64 / 6.0).max(1.0).ln();
        let (low, high) = (0.1_f64.ln() + longer, 5.0_f64.ln() + longer);
        let mut start: Vec<f64> = (0..count)
            .map(|_| {
                if i == 0 {
                    0.5_f64.ln() + longer
                } else {
                    low + (high - low) * rng.random::<f64>()
                }
            })
            .collect();
        if self.options.nugget.is_estimated() {
            start.push(NUGGET_START.ln());
        }
        start.push(0.0);
        start
    }

    /// The form of the model that the search fits.
    pub(super) fn form(&self) -> ModelForm {
        ModelForm {
            kernel: self.options.kernel,
            estimator: self.options.estimator,
            trend: self.options.trend,
            tied: self.tied,
            nugget: self.options.nugget.is_estimated(),
        }
    }

    /// The value at `at`, or at the same ranges and a σ² that fits them better, if that is an
    /// improvement.
    pub(super) fn value_at(
        &self,
        subset: &ScaledData,
        at: Vec<f64>,
        jitter: f64,
    ) -> Option<(f64, Vec<f64>)> {
        let mut likelihood = Likelihood::new(self.form(), Cow::Borrowed(subset), jitter);
        let last = at.len() - 1;
        let first = likelihood.evaluate(&at, Order::Value)?;
        let mut next = at.clone();
        let ln_sigma2 = first.next_sigma2.ln();
        next[last] = ln_sigma2.clamp(self.lower[last], self.upper[last]);
        match likelihood.evaluate(&next, Order::Value) {
            Some(second) if second.value < first.value => Some((second.value, next)),
            _ => Some((first.value, at)),
        }
    }

    /// The first `size` points in the random order.
    pub(super) fn subset(&self, size: usize) -> ScaledData {
        self.data.subset(&self.order[..size])
    }
}

/// A fifth of the median gap between neighbouring distinct values of a coordinate: below that, even
/// points that differ in this coordinate only are uncorrelated.
fn shortest_range(column: &[f64]) -> f64 {
    let mut sorted = column.to_vec();
    sorted.sort_by(f64::total_cmp);
    let mut gaps: Vec<f64> = sorted
        .windows(2)
        .map(|pair| pair[1] - pair[0])
        .filter(|gap| *gap > 0.0)
        .collect();
    gaps.sort_by(f64::total_cmp);
    let median = gaps.get(gaps.len() / 2).copied().unwrap_or(1.0);
    (0.2 * median).clamp(1e-6, 0.1)
}
