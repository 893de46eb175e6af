//! The best design so far.

use campaign::formulation::{Constraint, Problem};
use campaign::{Criteria, Design};
use results::reporting;
use serde::Serialize;
use stages::optima::{approach_of, optimum_design};
use store::OptimumRow;

use super::{Chart, Named, SCHEMA_VERSION};

/// The best design so far.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Best {
    /// The version of this object.
    pub schema_version: u32,
    /// Whether the campaign is finished. Before that, the result is not conclusive.
    pub finished: bool,
    /// Name of the minimised percentile, such as P90.
    pub percentile: String,
    /// Name of the response.
    pub response: String,
    /// Unit of the response; empty for a number without one.
    pub unit: String,
    /// A sentence about the number, or the reason why there is none.
    pub note: String,
    /// The design; `None` until a design has a percentile and is feasible.
    pub best: Option<BestDesign>,
}

/// A design.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BestDesign {
    /// The origin: a design of the DoE, or an approach.
    pub name: String,
    /// Whether the percentile was estimated from verification samples, taken after the design was
    /// chosen.
    pub verified: bool,
    /// The percentile.
    pub value: f64,
    /// Lower end of the 95 % confidence interval.
    pub low: f64,
    /// Upper end of the 95 % confidence interval.
    pub high: f64,
    /// Number of samples behind the percentile.
    pub samples: u64,
    /// The variables.
    pub variables: Vec<Named>,
    /// The constraints.
    pub constraints: Vec<Limit>,
    /// For a gear pair: its section and its transmission error.
    pub charts: Vec<Chart>,
}

/// A constraint of a design.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Limit {
    /// The constrained quantity.
    pub name: String,
    /// Its unit; empty for a number without one.
    pub unit: String,
    /// Its value.
    pub value: f64,
    /// The relation that must hold between value and limit: `<`, `≤`, `>` or `≥`.
    pub relation: &'static str,
    /// The limit.
    pub limit: f64,
    /// Whether the constraint holds.
    pub holds: bool,
}

/// An estimate of a design's percentile.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    /// The design as a row of an optimum. Its criterion is not used.
    pub row: OptimumRow,
    /// The design's number, if it is from the DoE.
    pub design: Option<u64>,
    /// The percentile with its 95 % confidence interval.
    pub percentile: report::Percentile,
}

/// The best of `candidates`: the best verified one if there is any, otherwise the best of the DoE,
/// chosen as the lowest of `estimates` estimates.
#[must_use]
pub fn best(problem: &Problem, finished: bool, candidates: &[Candidate], estimates: usize) -> Best {
    let is_usable =
        |candidate: &&Candidate| candidate.row.feasible && candidate.percentile.value.is_finite();
    let usable = || candidates.iter().filter(is_usable);
    let cost = |candidate: &Candidate| problem.cost(candidate.percentile.value);
    let least = |a: &&Candidate, b: &&Candidate| cost(a).total_cmp(&cost(b));
    let verified = usable().filter(|candidate| candidate.design.is_none());
    let chosen = verified.min_by(least).or_else(|| usable().min_by(least));
    let sampling = &problem.campaign().sampling;
    let note = match chosen {
        None if estimates == 0 => "No design has its samples yet.".to_owned(),
        None => {
            format!("{estimates} designs have their samples; none of them keeps every constraint.")
        }
        Some(Candidate { design: None, .. }) if finished => {
            "Verified with samples of its own.".to_owned()
        }
        Some(Candidate { design: None, .. }) => {
            "Verified with samples of its own; the campaign is not finished.".to_owned()
        }
        Some(_) => format!(
            "Best so far, not verified: the least of {estimates} estimates is probably too low."
        ),
    };
    Best {
        schema_version: SCHEMA_VERSION,
        finished,
        percentile: sampling.percentile_name(),
        response: problem.sampled().name.to_string(),
        unit: problem.sampled().unit.to_string(),
        note,
        best: chosen.and_then(|candidate| of_design(problem, candidate)),
    }
}

/// A candidate with its numbers and charts; `None` if the row does not belong to this problem.
#[must_use]
pub fn of_design(problem: &Problem, candidate: &Candidate) -> Option<BestDesign> {
    let design = optimum_design(problem, &candidate.row)?;
    let criteria: Option<Criteria> = serde_json::from_str(&candidate.row.criteria_json).ok()?;
    let variables = problem.variables().iter().zip(design.values());
    let percentile = candidate.percentile;
    Some(BestDesign {
        name: match candidate.design {
            Some(number) => format!("design {number} of the DoE"),
            None => approach_of(&candidate.row.approach).map_or_else(
                || candidate.row.approach.clone(),
                |approach| {
                    format!(
                        "optimum of the approach {}",
                        problem.approach_name(approach)
                    )
                },
            ),
        },
        verified: candidate.design.is_none(),
        value: percentile.value,
        low: percentile.low,
        high: percentile.high,
        samples: percentile.samples as u64,
        variables: variables
            .map(|(variable, value)| Named {
                name: variable.name.to_string(),
                unit: variable.unit.to_string(),
                value: *value,
            })
            .collect(),
        constraints: criteria.map_or_else(Vec::new, |criteria| {
            problem.constraints(&criteria).iter().map(limit).collect()
        }),
        charts: charts(problem, &design),
    })
}

fn limit(constraint: &Constraint) -> Limit {
    Limit {
        name: constraint.name.to_string(),
        unit: constraint.unit.trim_start().to_owned(),
        value: constraint.value,
        relation: constraint.bound.sign(),
        limit: constraint.limit,
        holds: constraint.holds(),
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
    let section = report::chart_gears(&reporting::drawing(&pair));
    let ste = reporting::ste(&pair, gears.wear());
    let rows = ste.phase.iter().zip(&ste.unworn_um).zip(&ste.worn_um);
    let rows = rows.map(|((phase, unworn), worn)| {
        vec![
            format!("{phase:.3}"),
            format!("{unworn:.4}"),
            format!("{worn:.4}"),
        ]
    });
    let columns = [
        "mesh phase (periods)",
        "STE unworn (µm)",
        "STE with mean wear (µm)",
    ];
    let curve = Chart::new(report::chart_ste(&ste), &columns, rows.collect());
    Chart::new(section, &[], Vec::new())
        .into_iter()
        .chain(curve)
        .collect()
}
