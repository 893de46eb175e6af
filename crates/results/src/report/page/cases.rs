//! The table of the transmission error in each case of a gear pair's load.

use problem::formulation::Problem;

use crate::number::{MISSING, digits_of, fixed, interval, with_unit};
use crate::optima::VerifiedOptimum;
use crate::report::quantity::approach_name;
use crate::snapshot::Snapshot;

/// The measure of each case by the verification samples of every optimum.
pub(super) struct CasesView {
    pub(super) caption: String,
    pub(super) approaches: Vec<&'static str>,
    pub(super) rows: Vec<CaseRow>,
}

/// One case, or the objective over all of them.
pub(super) struct CaseRow {
    pub(super) case: String,
    /// The measure with its interval, at the optimum of each approach.
    pub(super) measures: Vec<String>,
}

impl CasesView {
    /// `None` for a load without cases, or without a verified optimum.
    pub(super) fn new(snapshot: &Snapshot) -> Option<Self> {
        let problem = &snapshot.problem;
        let load = &problem.campaign().gears()?.load;
        let optima: Vec<&VerifiedOptimum> = snapshot.optima.iter().collect();
        if load.cases.is_empty() || optima.iter().all(|optimum| optimum.measure.is_none()) {
            return None;
        }
        let weights = load.weights();
        let named = problem.sampled().iter().zip(&load.cases).enumerate();
        let mut rows: Vec<CaseRow> = named
            .map(|(place, (_, case))| {
                let wear = match case.wear {
                    0.0 => "new".to_owned(),
                    1.0 => "worn".to_owned(),
                    share => format!("{share} of the wear"),
                };
                let limit = case.delta_ste_max_um;
                let limit = limit.map_or_else(String::new, |um| format!(", at most {um} µm"));
                let weight = weights.as_ref().map_or_else(String::new, |weights| {
                    format!(", weight {}", fixed(weights[place], 2))
                });
                CaseRow {
                    case: format!("{} N·m, {wear}{weight}{limit}", load.torque_of(case)),
                    measures: optima
                        .iter()
                        .map(|optimum| measure_of(problem, optimum, place))
                        .collect(),
                }
            })
            .collect();
        let all = match weights {
            Some(_) => "weighted mean, which is minimised",
            None => "greatest, which is minimised",
        };
        rows.push(CaseRow {
            case: all.to_owned(),
            measures: optima
                .iter()
                .map(|optimum| shown(optimum.measure))
                .collect(),
        });
        Some(Self {
            caption: format!(
                "{} of ΔSTE in each case, from the verification samples, µm",
                snapshot.measure_name()
            ),
            approaches: optima
                .iter()
                .map(|optimum| approach_name(problem, optimum.optimum.approach))
                .collect(),
            rows,
        })
    }
}

/// The measure of one case by the verification samples of an optimum.
fn measure_of(problem: &Problem, optimum: &VerifiedOptimum, place: usize) -> String {
    let samples = optimum.samples().filter(|_| optimum.measure.is_some());
    let of_case = samples.map(|samples| samples.rows().map(|row| row[place]).collect());
    let of_case: Vec<f64> = of_case.unwrap_or_default();
    shown(problem.campaign().sampling.verified(&of_case).ok())
}

fn shown(measure: Option<stats::IntervalEstimate>) -> String {
    let Some(measure) = measure else {
        return MISSING.to_owned();
    };
    let digits = digits_of(measure.value, measure.interval);
    let ends = measure.interval.filter(|(low, high)| low < high);
    let ends = ends.map(|ends| format!(" {}", interval(ends, digits)));
    with_unit(measure.value, digits, "") + &ends.unwrap_or_default()
}
