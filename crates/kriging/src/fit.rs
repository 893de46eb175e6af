//! The search for the maximum of the likelihood.
//!
//! Many starts are compared on a small random subset of the points, where an evaluation costs
//! milliseconds; the best are polished there, and the survivors on larger and larger subsets until
//! the last polish runs on all points and starts next to its optimum. One start has every range at
//! half its coordinate's extent: likelihoods of deterministic functions have a spurious optimum
//! where all ranges vanish and the model is white noise, and that start lies on the right side of it.

pub(crate) mod newton;
pub(crate) mod report;

use std::borrow::Cow;

use rand::RngExt as _;
use rand::seq::SliceRandom as _;
use rayon::prelude::*;
use stats::streams::{Purpose, stream};

use crate::data::contradiction;
use crate::data::scaled::{SIGMA2_BOUNDS, Scaled};
use crate::data::{Data, Points, keep, merge};
use crate::kernel::Kernel;
use crate::likelihood::gls::{Gls, Trend};
use crate::likelihood::{Form, JITTERS, Likelihood, Order};
use crate::model::{Model, Parameters};
use crate::{Error, Warning};
use newton::{Limits, Outcome, minimise};

/// Number of points on which starts are compared.
const SCREENING: usize = 300;
/// Each stage of polishing has about this times the points of the one before.
const GROWTH: f64 = 2.5;
/// From more points than this, the search goes by stages.
const STAGED: usize = 450;
/// How many of the starts are polished on the screening subset, and how many of the optima then
/// found are followed further.
const POLISHED: usize = 4;
const FOLLOWED: usize = 2;
/// Bounds of the nugget, relative to the variance of the observations, and its value at the starts.
const NUGGET_BOUNDS: (f64, f64) = (1e-12, 1e2);
const NUGGET_START: f64 = 1e-2;
/// Upper bound of a range, in units of its coordinate's extent. There the correlation of opposite
/// sides is 1 − 3·10⁻⁴ (Matérn 5/2): over the extent the process is a plane but for a fraction of that
/// order, so that a longer range, with σ² to match, gives the same predictions and nearly the same
/// likelihood, in which the search would wander, while the covariance matrix comes nearer to singular
/// with the square of the range.
const LONGEST_RANGE: f64 = 50.0;
/// A likelihood counts as found when a further step promises less than this.
const TOLERANCE: f64 = 1e-6;
const SUBSET_TOLERANCE: f64 = 1e-2;
/// Iterations that take the curvature from the likelihood: more where the search ends early, fewer
/// where quasi-Newton steps are to converge.
const RENEWED: usize = 3;
const RENEWED_LAST: usize = 2;

/// How to search for the parameters of the covariance.
#[derive(Debug, Clone, PartialEq)]
pub struct FitOptions {
    /// The correlation function.
    pub kernel: Kernel,
    /// Seed of the random starts and subsets (stream purpose [`Purpose::Fit`]).
    pub seed: u64,
    /// Number of starts; at least one is taken.
    pub starts: usize,
    /// The most quasi-Newton iterations of one search.
    pub max_iterations: usize,
    /// The trend around which the process varies.
    pub trend: Trend,
    /// Whether to estimate a nugget: one more noise variance, the same at all points, on top of the
    /// known ones ([`Parameters::nugget`]). Repeated observations of a point are then not merged,
    /// since their scatter tells of the nugget; the fit takes the time of that many points. Only
    /// noise-free copies of one observation count once.
    pub nugget: bool,
    /// Whether to calibrate the predicted variances, see [`Model::calibrated`].
    pub calibrate: bool,
    /// Whether to refuse, as [`Error::NoStructure`], what is otherwise a
    /// [`Warning::NoStructure`]: a model that is not better than a constant plus noise.
    pub refuse_no_structure: bool,
}

impl Default for FitOptions {
    fn default() -> Self {
        Self {
            kernel: Kernel::default(),
            seed: 0,
            starts: 20,
            max_iterations: 100,
            trend: Trend::Constant,
            nugget: false,
            calibrate: false,
            refuse_no_structure: false,
        }
    }
}

/// Fits ordinary kriging, equations (15) to (20), or universal kriging by maximum likelihood.
///
/// The ranges, the process variance, the nugget and the trend are those of the highest likelihood found; the
/// noise variances are taken as given. The result depends on the data and the options only, not on
/// the order of the observations or the number of threads (rayon's).
///
/// Cost: a Cholesky factor and an inverse per iteration, about n³/2 multiplications; memory 3 n²
/// numbers.
///
/// # Errors
///
/// [`Error::Shape`], [`Error::NonFinite`], [`Error::NegativeNoise`] and [`Error::Extent`] for
/// unusable data, [`Error::Contradiction`] for observations of one place that differ although they
/// are said to be exact, unless a nugget is estimated,
/// [`Error::TooFewPoints`] for fewer than two distinct points, [`Error::Trend`] where
/// the points do not determine the trend, [`Error::NoStructure`] if `options` asks for it, and
/// [`Error::NotPositiveDefinite`] where no covariance of the search can be factorised. What a user
/// ought to know of a fit that did succeed is in [`Model::warnings`].
pub fn fit(data: &Data<'_>, options: &FitOptions) -> Result<Model, Error> {
    let mut points = if options.nugget {
        keep(data)?
    } else {
        merge(data)?
    };
    let distinct = points.distinct();
    if distinct < 2 {
        return Err(Error::TooFewPoints { distinct });
    }
    let scaled = Scaled::new(&points)?;
    if !options.nugget {
        contradiction::check(&points, &scaled)?;
    }
    for coordinate in (0..data.d).filter(|j| !scaled.active.contains(j)) {
        points
            .warnings
            .push(Warning::IgnoredCoordinate { coordinate });
    }
    if scaled.y.iter().all(|y| *y == scaled.y[0]) {
        points.warnings.push(Warning::ConstantResponse);
        if options.refuse_no_structure {
            return Err(Error::NoStructure {
                gain: 0.0,
                needed: scaled.active.len() as f64,
            });
        }
        return constant(options.kernel, points, &scaled);
    }
    if !determines_trend(&scaled, options.trend) {
        return Err(Error::Trend {
            distinct,
            coefficients: options.trend.coefficients(scaled.active.len()),
        });
    }

    let search = Search::new(&scaled, options);
    points.warnings.extend(search.few_points(distinct));
    let found = search.run()?;
    let warnings = search.warnings(&found);
    if options.refuse_no_structure
        && let Some((gain, needed)) = warnings.iter().find_map(|warning| match warning {
            Warning::NoStructure { gain, needed } => Some((*gain, *needed)),
            _ => None,
        })
    {
        return Err(Error::NoStructure { gain, needed });
    }
    points.warnings.extend(warnings);
    let at = &found.outcome.at;
    let ranges = |k: usize| at[if search.tied { 0 } else { k }].exp();
    let sigma2 = at[at.len() - 1].exp();
    let mut parameters = in_units_of_data(&points, &scaled, ranges, sigma2);
    if options.nugget {
        parameters.nugget = at[at.len() - 2].exp() * scaled.y_scale * scaled.y_scale;
    }
    let mut model = Model::new(
        options.kernel,
        options.trend,
        points,
        parameters,
        found.jitter,
    )?;
    let outliers = model.leave_one_out().warning(&model.points);
    model.points.warnings.extend(outliers);
    Ok(if options.calibrate {
        model.calibrated()
    } else {
        model
    })
}

/// Whether the points tell the trend's coefficients apart and leave something for the process.
fn determines_trend(scaled: &Scaled, trend: Trend) -> bool {
    if trend.is_constant() {
        return true;
    }
    let n = scaled.len();
    let basis = trend.basis(&scaled.columns, n, 0.5);
    n > trend.coefficients(scaled.columns.len()) && Gls::new(&basis, basis.clone(), n).is_some()
}

/// A model without any variation: the likelihood is highest for σ² → 0.
fn constant(kernel: Kernel, points: Points, scaled: &Scaled) -> Result<Model, Error> {
    let parameters = in_units_of_data(&points, scaled, |_| 0.5, constant_sigma2(scaled));
    Model::new(kernel, Trend::Constant, points, parameters, 0.0)
}

/// What stands for σ² = 0 where all observations are equal.
pub(crate) fn constant_sigma2(scaled: &Scaled) -> f64 {
    let noise = scaled.noise.iter().sum::<f64>() / scaled.len() as f64;
    // The smallest normal number stands for zero, whose logarithm the likelihood could not hold.
    (SIGMA2_BOUNDS.0 * noise).max(f64::MIN_POSITIVE)
}

/// The parameters of a subset: (ln θ₁ … ln θ_d, ln σ²).
pub(crate) struct Start {
    pub(crate) at: Vec<f64>,
    /// Number of ranges that were estimated: one where the subset is too small for more.
    pub(crate) ranges: usize,
    /// Of the search, of what ended at a bound of it, and of the ranges that the subset does not determine.
    pub(crate) warnings: Vec<Warning>,
}

/// The parameters of highest likelihood of a subset of `of` points, found as [`fit()`] finds them; but for
/// the last steps, which more points than those of the subset make pointless.
pub(crate) fn start_from_subset(
    subset: &Scaled,
    of: usize,
    options: &FitOptions,
) -> Result<Start, Error> {
    let mut search = Search::new(subset, options);
    if subset.len() < of {
        search.tolerance = SUBSET_TOLERANCE;
    }
    let found = search.run()?;
    let mut warnings = search.at_bounds(&found);
    warnings.extend(search.of_search(&found));
    let found = found.outcome.at;
    // A subset too small for a range per coordinate has one for all.
    let widen = |values: &[f64]| -> Vec<f64> {
        let mut wide: Vec<f64> = (0..subset.columns.len())
            .map(|k| values[if search.tied { 0 } else { k }])
            .collect();
        wide.push(values[values.len() - 1]);
        wide
    };
    Ok(Start {
        at: widen(&found),
        ranges: if search.tied { 1 } else { subset.columns.len() },
        warnings,
    })
}

pub(crate) fn in_units_of_data(
    points: &Points,
    scaled: &Scaled,
    range: impl Fn(usize) -> f64,
    sigma2: f64,
) -> Parameters {
    let mut ranges = vec![f64::INFINITY; points.d];
    for (k, (&j, extent)) in scaled.active.iter().zip(&scaled.extents).enumerate() {
        ranges[j] = range(k) * extent;
    }
    // Model::new estimates the trend.
    Parameters {
        mu: 0.0,
        slopes: Vec::new(),
        nugget: 0.0,
        sigma2: sigma2 * scaled.y_scale * scaled.y_scale,
        ranges,
    }
}

struct Search<'a> {
    data: &'a Scaled,
    options: &'a FitOptions,
    /// Whether all coordinates share one range.
    tied: bool,
    lower: Vec<f64>,
    upper: Vec<f64>,
    /// A random order of the points; subsets are its first ones.
    order: Vec<usize>,
    /// When the search of all points ends.
    tolerance: f64,
}

struct Found {
    outcome: Outcome,
    jitter: f64,
}

impl<'a> Search<'a> {
    fn new(data: &'a Scaled, options: &'a FitOptions) -> Self {
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
        if options.nugget {
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
            tolerance: TOLERANCE,
        }
    }

    fn run(&self) -> Result<Found, Error> {
        let n = self.data.len();
        let mut sizes = vec![n];
        while let Some(&last) = sizes.last()
            && last > STAGED
        {
            let next = (last as f64 / GROWTH) as usize;
            sizes.push(next.max(SCREENING));
        }
        sizes.reverse();

        let mut candidates = self.screen(&self.subset(sizes[0]))?;
        for (stage, &size) in sizes.iter().enumerate() {
            let last = size == n;
            let subset = self.subset(size);
            if last && stage > 0 {
                candidates = self.best_of(&subset, candidates);
            }
            let polished: Vec<Found> = candidates
                .par_iter()
                .filter_map(|(start, jitter)| self.polish(&subset, start, *jitter, last))
                .collect();
            let mut distinct: Vec<Found> = Vec::new();
            for found in by_value(polished) {
                let same = |other: &Found| {
                    (other.outcome.value - found.outcome.value).abs() < 0.1
                        && distance(&other.outcome.at, &found.outcome.at) < 0.1
                };
                if !distinct.iter().any(same) {
                    distinct.push(found);
                }
            }
            if last {
                if let Some(best) = distinct.into_iter().next() {
                    return Ok(best);
                }
                break;
            }
            candidates = distinct
                .into_iter()
                .take(FOLLOWED)
                .map(|found| (found.outcome.at, found.jitter))
                .collect();
        }
        Err(Error::NotPositiveDefinite {
            jitter: JITTERS[JITTERS.len() - 1],
        })
    }

    /// The one of several candidates whose likelihood on `subset` is highest: a few hundred points may
    /// have preferred another.
    fn best_of(&self, subset: &Scaled, candidates: Vec<(Vec<f64>, f64)>) -> Vec<(Vec<f64>, f64)> {
        if candidates.len() < 2 {
            return candidates;
        }
        let value = |(at, jitter): &(Vec<f64>, f64)| {
            let mut likelihood = Likelihood::new(self.form(), Cow::Borrowed(subset), *jitter);
            let evaluation = likelihood.evaluate(at, Order::Value);
            evaluation.map_or(f64::INFINITY, |evaluation| evaluation.value)
        };
        let values: Vec<f64> = candidates.par_iter().map(value).collect();
        let by_value = candidates.into_iter().zip(values);
        let best = by_value.min_by(|(_, a), (_, b)| a.total_cmp(b));
        best.into_iter().map(|(candidate, _)| candidate).collect()
    }

    /// The starts of highest likelihood on `subset`, each with the smallest jitter it needs there.
    fn screen(&self, subset: &Scaled) -> Result<Vec<(Vec<f64>, f64)>, Error> {
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
            return Err(Error::NotPositiveDefinite {
                jitter: JITTERS[JITTERS.len() - 1],
            });
        }
        // The first start stays whatever its value: it is the one that keeps clear of white noise.
        screened[1..].sort_by(|a, b| a.0.total_cmp(&b.0));
        screened.truncate(POLISHED);
        Ok(screened
            .into_iter()
            .map(|(_, at, jitter)| (at, jitter))
            .collect())
    }

    /// Start 0 has all ranges at half the extent, the others are random between a tenth and five
    /// times it.
    fn start(&self, i: usize) -> Vec<f64> {
        let mut rng = stream(self.options.seed, Purpose::Fit, 1, i as u64);
        let count = self.lower.len() - 1 - usize::from(self.options.nugget);
        let (low, high) = (0.1_f64.ln(), 5.0_f64.ln());
        let mut start: Vec<f64> = (0..count)
            .map(|_| {
                if i == 0 {
                    0.5_f64.ln()
                } else {
                    low + (high - low) * rng.random::<f64>()
                }
            })
            .collect();
        if self.options.nugget {
            start.push(NUGGET_START.ln());
        }
        start.push(0.0);
        start
    }

    fn form(&self) -> Form {
        Form {
            kernel: self.options.kernel,
            trend: self.options.trend,
            tied: self.tied,
            nugget: self.options.nugget,
        }
    }

    /// The value at a start's ranges and a σ² that fits them better, if the first guess at one does.
    fn value_at(&self, subset: &Scaled, at: Vec<f64>, jitter: f64) -> Option<(f64, Vec<f64>)> {
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

    /// Searches from `start`. The jitter grows while the search keeps running into matrices that are
    /// not positive definite and more jitter raises the likelihood.
    fn polish(&self, subset: &Scaled, start: &[f64], jitter: f64, last: bool) -> Option<Found> {
        let limits = Limits {
            lower: &self.lower,
            upper: &self.upper,
            max_iterations: self.options.max_iterations,
            renewed: if last { RENEWED_LAST } else { RENEWED },
            tolerance: if last {
                self.tolerance
            } else {
                SUBSET_TOLERANCE
            },
        };
        let mut likelihood = Likelihood::new(self.form(), Cow::Borrowed(subset), jitter);
        let mut best: Option<Found> = None;
        for jitter in JITTERS.into_iter().filter(|j| *j >= jitter) {
            likelihood.jitter = jitter;
            let from = best.as_ref().map_or(start, |found| &found.outcome.at);
            let evaluate = |at: &[f64], curvature: bool| {
                let order = if curvature {
                    Order::Curvature
                } else {
                    Order::Gradient
                };
                likelihood.evaluate(at, order)
            };
            let Some(outcome) = minimise(evaluate, from, &limits) else {
                continue;
            };
            let better = best
                .as_ref()
                .is_none_or(|b| outcome.value < b.outcome.value - TOLERANCE);
            if !better {
                break;
            }
            let met_failure = outcome.met_failure;
            best = Some(Found { outcome, jitter });
            if !met_failure {
                break;
            }
        }
        best
    }

    fn subset(&self, size: usize) -> Scaled {
        self.data.subset(&self.order[..size])
    }
}

fn by_value(mut found: Vec<Found>) -> Vec<Found> {
    found.sort_by(|a, b| a.outcome.value.total_cmp(&b.outcome.value));
    found
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter()
        .zip(b)
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, f64::max)
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
