//! The search for the maximum of the likelihood.
//!
//! Many starts are compared on a small random subset of the points, where an evaluation costs
//! milliseconds; the best are polished there, and the survivors on larger and larger subsets until
//! the last polish runs on all points and starts next to its optimum. One start has every range at
//! half its coordinate's extent. The likelihood of a deterministic function has a spurious optimum
//! where all ranges vanish and the model is white noise; that start lies on the right side of it.

mod newton;
pub(crate) mod options;
pub(crate) mod report;
mod stages;
mod starts;

use std::borrow::Cow;

use rand::seq::SliceRandom as _;
use stats::streams::{Purpose, stream};
use tracing::info;

use crate::data::prepared::Prepared;
use crate::data::scaled::{SIGMA2_BOUNDS, ScaledData};
use crate::data::{Data, Points};
use crate::kernel::Kernel;
use crate::likelihood::gls::{Gls, Trend};
use crate::model::{Model, Parameters};
use crate::{Error, Warning};
use options::FitOptions;
use stages::{Optimum, SUBSET_TOLERANCE};
use starts::Search;

/// Fits ordinary kriging, equations (15) to (20), or universal kriging by maximum likelihood.
///
/// The ranges, the process variance, the nugget and the trend are those of the highest likelihood found; the
/// noise variances are taken as given. The result depends on the data and the options only, not on
/// the order of the observations or the number of threads (rayon's).
///
/// Progress is reported by [`tracing`] events, from 3000 points on.
///
/// Cost: a Cholesky factor and an inverse per iteration, about n³/2 multiplications, for n up to
/// [`FitOptions::subset`]. For more points, the parameters are those of a random subset of this size, and the model of
/// all points takes two more factorisations. Memory: 3 n² numbers.
///
/// # Errors
///
/// [`Error::Shape`], [`Error::NonFinite`], [`Error::NegativeNoise`] and [`Error::Extent`] for
/// unusable data; [`Error::Contradiction`], unless a nugget is estimated, for observations at
/// nearly the same point that differ by more than their noise permits; [`Error::TooFewPoints`] for
/// fewer than two distinct points; [`Error::Trend`] if the points do not determine the trend;
/// [`Error::NoStructure`] if `options` asks for it; and [`Error::NotPositiveDefinite`] if no
/// covariance of the search can be factorised. A successful fit may have [`Model::warnings`].
pub fn fit(data: &Data<'_>, options: &FitOptions) -> Result<Model, Error> {
    let Prepared {
        points,
        distinct,
        scaled,
        mut warnings,
    } = Prepared::new(data, options.nugget.is_estimated())?;
    if scaled.is_constant() {
        if options.refuse_no_structure {
            return Err(Error::NoStructure {
                gain: 0.0,
                needed: scaled.active.len() as f64,
            });
        }
        let mut model = constant(options.kernel, points, &scaled)?;
        model.warnings = warnings;
        return Ok(model);
    }
    if !determines_trend(&scaled, options.trend) {
        return Err(Error::Trend {
            distinct,
            coefficients: options.trend.coefficients(scaled.active.len()),
        });
    }

    let subset = options.subset.max(2);
    let searched = if scaled.len() > subset {
        let mut order: Vec<usize> = (0..scaled.len()).collect();
        order.shuffle(&mut stream(options.seed, Purpose::Fit, 2, 0));
        Cow::Owned(scaled.subset(&order[..subset]))
    } else {
        Cow::Borrowed(&scaled)
    };
    let search = Search::new(&searched, options);
    let mut optimum = search.run()?;
    let parameters = |at: &[f64]| {
        let ranges = |k: usize| at[if search.tied { 0 } else { k }].exp();
        let sigma2 = at[at.len() - 1].exp();
        let mut parameters = in_units_of_data(&points, &scaled, ranges, sigma2);
        if options.nugget.is_estimated() {
            parameters.nugget = at[at.len() - 2].exp() * scaled.y_scale * scaled.y_scale;
        }
        parameters
    };
    let (kernel, trend) = (options.kernel, options.trend);
    let model = |optimum: &Optimum| {
        let parameters = parameters(&optimum.outcome.at);
        Model::new(kernel, trend, points.clone(), parameters, optimum.jitter)
    };
    if searched.len() < scaled.len() {
        info!(
            points = scaled.len(),
            "factorising the covariance of all points"
        );
    }
    let mut made = model(&optimum)?;
    if searched.len() < scaled.len()
        && made.jitter > optimum.jitter
        && let Some(again) = search.polish(&searched, &optimum.outcome.at, made.jitter, true)
    {
        // All points together need more jitter, which moves the maximum of the likelihood.
        optimum = again;
        made = model(&optimum)?;
    }
    let of_search = search.warnings(&optimum, distinct);
    if options.refuse_no_structure {
        report::check_structure(&of_search)?;
    }
    warnings.extend(of_search);
    warnings.extend(made.jitter_warning());
    warnings.extend(made.warning_of_residuals());
    made.warnings = warnings;
    Ok(if options.calibrate {
        made.calibrated()
    } else {
        made
    })
}

/// Whether the points determine the trend's coefficients and outnumber them.
fn determines_trend(scaled: &ScaledData, trend: Trend) -> bool {
    if trend.is_constant() {
        return true;
    }
    let n = scaled.len();
    let basis = trend.basis(&scaled.columns, n, 0.5);
    n > trend.coefficients(scaled.columns.len()) && Gls::new(&basis, basis.clone(), n).is_some()
}

/// The model of equal observations, whose likelihood is highest for σ² → 0.
fn constant(kernel: Kernel, points: Points, scaled: &ScaledData) -> Result<Model, Error> {
    let parameters = in_units_of_data(&points, scaled, |_| 0.5, constant_sigma2(scaled));
    Model::new(kernel, Trend::Constant, points, parameters, 0.0)
}

/// The value that stands for σ² = 0 when all observations are equal.
pub(crate) fn constant_sigma2(scaled: &ScaledData) -> f64 {
    let noise = scaled.noise.iter().sum::<f64>() / scaled.len() as f64;
    // The smallest normal number stands for zero, whose logarithm the likelihood could not hold.
    (SIGMA2_BOUNDS.0 * noise).max(f64::MIN_POSITIVE)
}

/// The parameters of highest likelihood of a subset, in scaled units.
pub(crate) struct SubsetFit {
    /// ln θ₁ … ln θ_d.
    pub(crate) ln_ranges: Vec<f64>,
    /// The nugget; zero if none was estimated.
    pub(crate) nugget: f64,
    pub(crate) sigma2: f64,
    /// Number of ranges that were estimated: one where the subset is too small for more.
    pub(crate) ranges: usize,
    /// Warnings about the search, about parameters at its bounds, and about ranges that the subset
    /// does not determine.
    pub(crate) warnings: Vec<Warning>,
}

/// The parameters of highest likelihood of a subset of `of` points, found as in [`fit()`]. If the
/// subset leaves points out, the last steps of the search are skipped: those points move the optimum
/// by more.
pub(crate) fn fit_subset(
    subset: &ScaledData,
    of: usize,
    options: &FitOptions,
) -> Result<SubsetFit, Error> {
    let mut search = Search::new(subset, options);
    if subset.len() < of {
        search.tolerance = SUBSET_TOLERANCE;
    }
    let optimum = search.run()?;
    let mut warnings = search.bound_warnings(&optimum);
    warnings.extend(search.search_warnings(&optimum));
    let mut ln_ranges = optimum.outcome.at;
    let mut variance = || ln_ranges.pop().map_or(0.0, f64::exp);
    let sigma2 = variance();
    let nugget = if options.nugget.is_estimated() {
        variance()
    } else {
        0.0
    };
    let ranges = ln_ranges.len();
    if search.tied {
        // A subset too small for a range per coordinate has one range for all.
        ln_ranges = vec![ln_ranges[0]; subset.columns.len()];
    }
    Ok(SubsetFit {
        ln_ranges,
        nugget,
        sigma2,
        ranges,
        warnings,
    })
}

/// The parameters in units of the data; `range` gives the range of column k in units of its extent. The
/// trend and the nugget are zero.
pub(crate) fn in_units_of_data(
    points: &Points,
    scaled: &ScaledData,
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
