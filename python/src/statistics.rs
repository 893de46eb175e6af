//! Measures of samples.

use ::stats::{
    ChoiceRule, HarrellDavisVariance, IntervalEstimate, Measure, NormalOptions, VarianceFormula,
};
use pyo3::prelude::*;

use crate::arrays::{Vector, numbers};
use crate::error::{PitchlineError, raised};

/// The names of the measures, with the meaning of their number.
const MEASURES: &str = "percentile (level), mean, mean-plus-sd (k), tail-mean (level), lower-tail-mean (level) or \
                        exceedance (limit)";

fn measure(name: &str, value: f64) -> PyResult<Measure> {
    Ok(match name {
        "percentile" => Measure::Percentile { level: value },
        "mean" => Measure::Mean,
        "mean-plus-sd" => Measure::MeanPlusSd { k: value },
        "tail-mean" | "lower-tail-mean" => Measure::TailMean {
            level: value,
            is_lower: name == "lower-tail-mean",
        },
        "exceedance" => Measure::Exceedance { limit: value },
        _ => {
            let text = format!("measure is {name:?}, it must be {MEASURES}");
            return Err(PitchlineError::new_err(text));
        }
    })
}

type Interval = (f64, Option<(f64, f64)>, usize);

fn interval(found: IntervalEstimate) -> Interval {
    (found.value, found.interval, found.n)
}

/// The measure of many samples: its value, its interval at `confidence`, the number of samples.
#[pyfunction]
pub(crate) fn verified(
    samples: Vector<'_>,
    name: &str,
    value: f64,
    confidence: f64,
) -> PyResult<Interval> {
    let measure = measure(name, value)?;
    let found = measure.verified(&numbers(&samples), confidence);
    found.map(interval).map_err(raised)
}

/// The measure of the first samples less that of the second, which have the same random numbers.
#[pyfunction]
pub(crate) fn difference(
    first: Vector<'_>,
    second: Vector<'_>,
    name: &str,
    value: f64,
    confidence: f64,
) -> PyResult<Option<Interval>> {
    let measure = measure(name, value)?;
    let found = measure.difference(&numbers(&first), &numbers(&second), confidence);
    Ok(found.map_err(raised)?.map(interval))
}

/// The measure of few samples: its value, the variance of this value, whether a normal response was assumed, and the
/// p-value of normality.
#[pyfunction]
pub(crate) fn estimate(
    samples: Vector<'_>,
    name: &str,
    value: f64,
    significance: f64,
) -> PyResult<(f64, f64, bool, Option<f64>)> {
    let measure = measure(name, value)?;
    let rule = ChoiceRule {
        measure,
        significance,
        normal: NormalOptions {
            z: measure.normal_factor().unwrap_or_default(),
            variance: VarianceFormula::Exact,
            unbiased: true,
        },
        harrell_davis: HarrellDavisVariance::Jackknife,
    };
    let chosen = ::stats::choose(&numbers(&samples), &rule).map_err(raised)?;
    let ::stats::Estimate {
        method,
        value,
        variance,
        ..
    } = chosen.chosen;
    let is_normal = method == ::stats::Method::Normal;
    Ok((value, variance, is_normal, chosen.p_value))
}

/// Lilliefors' test of normality: the statistic and its p-value.
#[pyfunction]
pub(crate) fn lilliefors(samples: Vector<'_>) -> PyResult<(f64, f64)> {
    let found = ::stats::lilliefors(&numbers(&samples)).map_err(raised)?;
    Ok((found.statistic, found.p_value))
}
