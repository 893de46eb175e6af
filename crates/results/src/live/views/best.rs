//! The best design so far.

use problem::Design;
use problem::formulation::{Constraint, Problem};
use problem::optimise::Solution;
use serde::Serialize;
use stats::IntervalEstimate;

use crate::number::fixed;
use crate::optima::{VerifiedLimit, VerifiedOptimum};
use crate::report::{self, NamedValue, charts, limits, response_name, values};

use super::Chart;
use super::chart::rows_of;

/// The best design so far.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BestView {
    /// Whether the campaign is finished. Before that, the result is not conclusive.
    pub finished: bool,
    /// Name of the optimised measure, such as P90.
    pub measure: String,
    /// Name of the response, as pages show it.
    pub response: String,
    /// Unit of the response; empty for a number without one.
    pub unit: String,
    /// A sentence about the number, or the reason why there is none.
    pub note: String,
    /// The design; `None` until a design has a measure and is feasible.
    pub best: Option<BestDesign>,
}

/// A design.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BestDesign {
    /// The origin: a design of the DoE, or an approach.
    pub name: String,
    /// Whether the measure was estimated from verification samples, taken after the design was
    /// chosen.
    pub verified: bool,
    pub value: f64,
    /// Lower end of the 95 % confidence interval.
    pub low: f64,
    /// Upper end of the 95 % confidence interval.
    pub high: f64,
    /// Number of samples behind the measure.
    pub samples: u64,
    pub variables: Vec<NamedValue>,
    /// The variables' names as pages show them.
    pub variable_labels: Vec<String>,
    /// The variables' values as pages show them.
    pub variable_texts: Vec<String>,
    pub constraints: Vec<Constraint>,
    /// Value, limit and margin of each constraint as pages show them.
    pub constraint_texts: Vec<[String; 3]>,
    /// For a gear pair: its section and its transmission error.
    pub charts: Vec<Chart>,
}

/// The design of the DoE with the best estimated measure.
#[derive(Debug, Clone, PartialEq)]
pub struct BestOfDoe {
    pub number: u64,
    /// The design with its criteria.
    pub found: Solution,
    /// The estimate of the measure with its 95 % confidence interval.
    pub measure: IntervalEstimate,
}

/// The best design so far: the `recommended` optimum if there is any, otherwise the best of the DoE,
/// chosen as the lowest of `estimates` estimates.
#[must_use]
pub fn best(
    problem: &Problem,
    finished: bool,
    recommended: Option<&VerifiedOptimum>,
    of_doe: Option<&BestOfDoe>,
    estimates: usize,
) -> BestView {
    let verified = recommended.and_then(|verified| of_optimum(problem, verified));
    let note = match (&verified, of_doe) {
        (Some(_), _) if finished => "Verified with samples of its own.".to_owned(),
        (Some(_), _) => {
            "Verified with samples of its own; the campaign is not finished.".to_owned()
        }
        (None, Some(_)) => format!(
            "Best so far, not verified: the best of {estimates} estimates is probably too good."
        ),
        (None, None) if estimates == 0 => "No design has its samples yet.".to_owned(),
        (None, None) => {
            format!("{estimates} designs have their samples; none of them keeps every constraint.")
        }
    };
    BestView {
        finished,
        measure: problem.measured().name.to_string(),
        response: response_name(problem),
        unit: problem.measured().unit.to_string(),
        note,
        best: verified.or_else(|| {
            let BestOfDoe {
                number,
                found,
                measure,
            } = of_doe?;
            let name = format!("design {number} of the DoE");
            Some(of_design(problem, name, false, found, *measure))
        }),
    }
}

/// A verified optimum with its numbers and charts; `None` until it has its samples.
#[must_use]
pub fn of_optimum(problem: &Problem, verified: &VerifiedOptimum) -> Option<BestDesign> {
    let found = verified.optimum.feasible()?;
    let approach = report::approach_name(problem, verified.optimum.approach);
    let name = format!("optimum of the approach “{approach}”");
    let constraints = verified.constraints.iter().cloned();
    let of_samples = verified.limits.iter().map(VerifiedLimit::constraint);
    let constraints: Vec<Constraint> = constraints.chain(of_samples).collect();
    Some(BestDesign {
        constraint_texts: limits(&constraints),
        constraints,
        ..of_design(problem, name, true, found, verified.measure?)
    })
}

fn of_design(
    problem: &Problem,
    name: String,
    verified: bool,
    found: &Solution,
    measure: IntervalEstimate,
) -> BestDesign {
    let variables = problem.variables().iter().zip(found.design.values());
    let variables: Vec<NamedValue> = variables
        .map(|(variable, value)| NamedValue {
            name: variable.name.to_string(),
            unit: variable.unit.to_string(),
            value: *value,
        })
        .collect();
    let shown = report::variables(problem, &found.design);
    let constraints = problem.constraints(&found.criteria);
    let (low, high) = measure.interval.unwrap_or((f64::NAN, f64::NAN));
    BestDesign {
        name,
        verified,
        value: measure.value,
        low,
        high,
        samples: measure.n as u64,
        variable_texts: values(&shown),
        variable_labels: shown.into_iter().map(|one| one.name).collect(),
        variables,
        constraint_texts: limits(&constraints),
        constraints,
        charts: charts(problem, &found.design),
    }
}

/// The charts of a gear pair. They are drawn only for the built-in model.
fn charts(problem: &Problem, design: &Design) -> Vec<Chart> {
    let built_in = !problem.campaign().is_external();
    let Some(gears) = problem.gears().filter(|_| built_in) else {
        return Vec::new();
    };
    let Ok(pair) = gears.pair(design) else {
        return Vec::new();
    };
    let section = charts::gears(&report::drawing(&pair));
    let ste = report::ste(&pair, gears.wear());
    let texts = |values: &[f64], decimals| values.iter().map(|v| fixed(*v, decimals)).collect();
    let rows = [
        texts(&ste.phase, 3),
        texts(&ste.unworn_um, 4),
        texts(&ste.worn_um, 4),
    ];
    let columns = [
        "mesh phase (periods)",
        "STE unworn (µm)",
        "STE with mean wear (µm)",
    ];
    let curve = Chart::new(charts::ste(&ste), &columns, rows_of(&rows));
    Chart::new(section, &[], Vec::new())
        .into_iter()
        .chain(curve)
        .collect()
}
