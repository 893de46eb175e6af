//! The steps that the coordinator does itself: pure work between reading and writing the store.

use anyhow::Context as _;
use campaign::formulation::{Problem, ROBUST_VARIABLES};
use campaign::optimise::{Found, RunResult};
use campaign::{Approach, Campaign};
use kriging::{Data, FitOptions, Model};
use serde::{Deserialize, Serialize};
use store::{CriteriaRow, DesignRow, ModelRow, OptimiserRunRow, OptimumRow, ResponseRow};

use crate::snapshot::{P90_MODEL, variables_to_json};

/// What a reader wants to know of a fitted model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ModelSummary {
    /// The covariance function.
    pub kernel: String,
    /// How many points it was fitted to.
    pub points: usize,
    /// The mean µ, µm.
    pub mu_um: f64,
    /// The process variance σ², µm².
    pub sigma2_um2: f64,
    /// The ranges in the order of the variables; none where the response does not depend on one.
    pub ranges: Vec<Option<f64>>,
    /// −log likelihood.
    pub negative_log_likelihood: f64,
    /// Q² of leave-one-out predictions.
    pub q2: f64,
    /// Root mean square of the leave-one-out residuals, µm.
    pub rmse_um: f64,
    /// The share of observations within their leave-one-out 90 % interval.
    pub coverage90: f64,
    /// The leave-one-out residuals (observation minus prediction) by design, µm.
    pub residuals_um: Vec<(u64, f64)>,
    /// What a user ought to know.
    pub warnings: Vec<String>,
    /// CPU time of the fit, seconds.
    pub cpu_seconds: f64,
}

/// Makes the DoE, or what is missing of it beside the `existing` designs, which stay as they are.
///
/// # Errors
///
/// Those of [`check_growth`]; nothing else for a validated campaign.
pub fn doe(problem: &Problem, existing: &[DesignRow]) -> anyhow::Result<Vec<DesignRow>> {
    let campaign = problem.campaign();
    let options = doe::Options {
        seed: campaign.seed,
        ..doe::Options::default()
    };
    let n = campaign.doe.designs as usize;
    let design = if existing.is_empty() {
        campaign.doe.method.design(n, ROBUST_VARIABLES, &options)?
    } else {
        campaign
            .doe
            .method
            .enlarge(&held(problem, existing), n, &options)?
    };
    Ok((existing.len()..n)
        .map(|index| DesignRow::new(index as u64, problem.robust_point(design.point(index))))
        .collect())
}

/// Whether [`doe()`] can add what is missing to the `existing` designs: asked before a store takes a
/// campaign that has grown, which it could not give back.
///
/// # Errors
///
/// A design outside of the campaign's bounds, or more designs than the campaign wants.
pub fn check_growth(problem: &Problem, existing: &[DesignRow]) -> anyhow::Result<()> {
    let campaign = problem.campaign();
    let n = campaign.doe.designs as usize;
    // None yet, or as many as before: then there is nothing to add to.
    if existing.is_empty() || existing.len() == n {
        return Ok(());
    }
    let method = campaign.doe.method;
    let checked = method.check_enlarge(&held(problem, existing), n, campaign.seed);
    checked.with_context(|| {
        format!(
            "doe.designs is {n}, but the {} designs that the store holds cannot grow to that by \
             the method {method}; the store is as it was",
            existing.len()
        )
    })
}

/// The designs that a store holds, in the unit box of the campaign's bounds.
#[must_use]
pub fn held(problem: &Problem, existing: &[DesignRow]) -> doe::Design {
    doe::Design {
        n: existing.len(),
        d: ROBUST_VARIABLES,
        points: existing
            .iter()
            .flat_map(|row| problem.unit_point(&row.point()))
            .collect(),
    }
}

/// Beyond so many designs the discrepancy, which takes the square of their number, is not computed.
const MEASURED_DESIGNS: usize = 20_000;

/// How evenly the `existing` designs fill the box of the bounds, in words: their smallest distance and
/// their centred discrepancy, in parts of the box's edges. None for fewer than two designs.
#[must_use]
pub fn evenness(problem: &Problem, existing: &[DesignRow]) -> Option<String> {
    if existing.len() < 2 {
        return None;
    }
    let design = held(problem, existing);
    let mut text = format!("smallest distance {:.4}", design.min_distance());
    if design.n <= MEASURED_DESIGNS {
        text += &format!(", centred discrepancy {:.5}", design.centred_discrepancy());
    }
    Some(text)
}

/// Fits the kriging model of P90; `cpu_seconds` is left zero.
///
/// # Errors
///
/// The data cannot be fitted: too few feasible designs, for example.
pub fn fit(
    campaign: &Campaign,
    designs: &[DesignRow],
    responses: &[ResponseRow],
) -> anyhow::Result<(Model, ModelSummary)> {
    let points: Vec<(&DesignRow, &ResponseRow)> = responses
        .iter()
        .filter_map(|response| Some((designs.get(response.design as usize)?, response)))
        .collect();
    let x: Vec<f64> = points
        .iter()
        .flat_map(|(design, _)| design.point())
        .collect();
    let y: Vec<f64> = points.iter().map(|(_, response)| response.p90_um).collect();
    let noise: Vec<f64> = points
        .iter()
        .map(|(_, response)| response.p90_variance_um2)
        .collect();
    let data = Data {
        x: &x,
        d: campaign::formulation::ROBUST_VARIABLES,
        y: &y,
        noise_variance: &noise,
    };
    let options = FitOptions {
        kernel: campaign.kriging.kernel.parse()?,
        seed: campaign.seed,
        // The optimum of a model that is no better than noise would be a matter of luck.
        refuse_no_structure: true,
        ..FitOptions::default()
    };
    let model = kriging::fit(&data, &options)?;
    let validation = model.leave_one_out();
    let parameters = model.parameters();
    let summary = ModelSummary {
        kernel: model.kernel().to_string(),
        points: model.points(),
        mu_um: parameters.mu,
        sigma2_um2: parameters.sigma2,
        ranges: parameters
            .ranges
            .iter()
            .map(|range| range.is_finite().then_some(*range))
            .collect(),
        negative_log_likelihood: model.negative_log_likelihood(),
        q2: validation.q2,
        rmse_um: validation.rmse,
        coverage90: validation.coverage90,
        residuals_um: points
            .iter()
            .map(|(_, response)| response.design)
            .zip(validation.residuals.iter().copied())
            .collect(),
        warnings: model.warnings().iter().map(ToString::to_string).collect(),
        cpu_seconds: 0.0,
    };
    Ok((model, summary))
}

/// The row of a fitted model.
///
/// # Errors
///
/// The model cannot be written as JSON: one of its numbers is not finite.
pub fn model_row(model: &Model, summary: &ModelSummary) -> anyhow::Result<ModelRow> {
    Ok(ModelRow {
        name: P90_MODEL.to_owned(),
        json: model.to_json()?,
        summary_json: serde_json::to_string(summary)?,
    })
}

/// What the DoE's samples cost, for the approaches that rest on them.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Cost {
    /// Calls of the simulator.
    pub simulator_calls: u64,
    /// CPU time, seconds.
    pub cpu_seconds: f64,
}

/// The calls that `samples` of the DoE took: one unworn analysis per design that can be simulated,
/// one with Archard's wear, and the samples. Designs that cannot be simulated cost one attempt.
#[must_use]
pub fn sampling_calls(criteria: &[CriteriaRow], samples: u64) -> u64 {
    let feasible = criteria.iter().filter(|row| row.feasible).count() as u64;
    criteria.len() as u64 + feasible + samples
}

/// Chooses the best design that the runs of an approach found.
///
/// `extra` is what the approach's metamodel cost. A run that was given up is not among `rows`.
///
/// # Errors
///
/// A stored run cannot be read.
pub fn choose_run(
    problem: &Problem,
    approach: Approach,
    rows: &[OptimiserRunRow],
    extra: Cost,
) -> anyhow::Result<OptimumRow> {
    let rows: Vec<_> = rows
        .iter()
        .filter(|row| row.approach == approach.name())
        .collect();
    let runs: Vec<RunResult> = rows
        .iter()
        .map(|row| serde_json::from_str(&row.result_json))
        .collect::<Result<_, _>>()?;
    let calls: u64 = runs.iter().map(|run| run.simulator_calls).sum();
    let cpu_seconds: f64 = rows.iter().map(|row| row.cpu_seconds).sum();
    let cost = Cost {
        simulator_calls: calls + extra.simulator_calls,
        cpu_seconds: cpu_seconds + extra.cpu_seconds,
    };
    let better = |a: &&Found, b: &&Found| a.criterion_um.total_cmp(&b.criterion_um);
    let best = runs
        .iter()
        .filter_map(|run| run.best.as_ref())
        .min_by(better);
    let note = continuation_note(problem, &runs);
    if let Some(found) = best {
        return optimum(approach, Some(found), cost, note);
    }
    let printed = runs
        .iter()
        .filter_map(|run| run.printed.as_ref())
        .min_by(better);
    let note = match printed {
        Some(found) => format!(
            "No run found a design that satisfies every constraint: the best penalised one breaks \
             some ({}).",
            broken(problem, found)
        ),
        None => "No run found a design that can be simulated.".to_owned(),
    };
    optimum(approach, None, cost, note)
}

/// Chooses the best design of the DoE that satisfies every constraint, with its worn pressure.
///
/// # Errors
///
/// The row cannot be written.
pub fn choose_of_doe(
    problem: &Problem,
    frozen: &campaign::Frozen,
    designs: &[DesignRow],
    criteria: &[CriteriaRow],
    responses: &[ResponseRow],
    cost: Cost,
) -> anyhow::Result<OptimumRow> {
    let mut best: Option<Found> = None;
    for response in responses {
        let better = best
            .as_ref()
            .is_none_or(|found| response.p90_um < found.criterion_um);
        let (Some(design), true) = (designs.get(response.design as usize), better) else {
            continue;
        };
        let variables = campaign::Variables::robust(&design.point(), frozen);
        let criteria = criteria
            .iter()
            .find(|row| row.design == response.design)
            .and_then(|row| worn_criteria(problem, &variables, row));
        let Some(criteria) = criteria else { continue };
        if problem.is_feasible(&criteria) {
            best = Some(Found {
                variables,
                criterion_um: response.p90_um,
                criteria,
                feasible: true,
            });
        }
    }
    let note = if best.is_some() {
        String::new()
    } else {
        "No design of the DoE satisfies every constraint.".to_owned()
    };
    optimum(Approach::BestOfDoe, best.as_ref(), cost, note)
}

/// The criteria that the simulator gave for a design, with the contact pressure of worn flanks.
pub(crate) fn worn_criteria(
    problem: &Problem,
    variables: &campaign::Variables,
    row: &CriteriaRow,
) -> Option<campaign::Criteria> {
    Some(campaign::Criteria {
        contact_ratio: row.contact_ratio?,
        specific_sliding: row.specific_sliding?,
        hertz_pressure_mpa: row.hertz_pressure_worn_mpa?,
        root_stress_mpa: row.root_stress_mpa?,
        clearance_mm: [row.clearance_p_mm?, row.clearance_r_mm?],
        flank_margin_mm: [row.flank_margin_p_mm?, row.flank_margin_r_mm?],
        normal_module_mm: problem.normal_module(variables).ok()?,
    })
}

/// The row of an approach for which nothing could be done.
///
/// # Errors
///
/// The row cannot be written.
pub fn left_out(approach: Approach, note: String) -> anyhow::Result<OptimumRow> {
    optimum(approach, None, Cost::default(), note)
}

/// The row of what an approach found.
pub(crate) fn optimum(
    approach: Approach,
    found: Option<&Found>,
    cost: Cost,
    note: String,
) -> anyhow::Result<OptimumRow> {
    Ok(OptimumRow {
        approach: approach.name().to_owned(),
        x_json: variables_to_json(found.map(|found| &found.variables)),
        // The paper values what cannot be simulated at 100; there is no design to value here.
        criterion_um: found.map_or(0.0, |found| found.criterion_um),
        feasible: found.is_some_and(|found| found.feasible),
        criteria_json: serde_json::to_string(&found.map(|found| found.criteria))?,
        simulator_calls: cost.simulator_calls,
        cpu_seconds: cost.cpu_seconds,
        note,
    })
}

/// Says where the printed penalty weight alone would have ended.
fn continuation_note(problem: &Problem, runs: &[RunResult]) -> String {
    let ended: Vec<&Found> = runs
        .iter()
        .filter(|run| run.continuations > 0)
        .filter_map(|run| run.printed.as_ref())
        .collect();
    let Some(worst) = ended
        .iter()
        .min_by(|a, b| a.criterion_um.total_cmp(&b.criterion_um))
    else {
        return String::new();
    };
    format!(
        "With the printed penalty weight p = {}, {} of {} runs ended on a design that breaks a \
         constraint (the lowest at {:.3} µm with {}); those runs went on, ranking feasible designs \
         first, until they ended on one that breaks none.",
        problem.campaign().optimise.penalty,
        ended.len(),
        runs.len(),
        worst.criterion_um,
        broken(problem, worst),
    )
}

/// Names the constraints that a design breaks.
fn broken(problem: &Problem, found: &Found) -> String {
    let broken: Vec<String> = problem
        .constraints(&found.criteria)
        .iter()
        .filter(|constraint| !constraint.holds())
        .map(ToString::to_string)
        .collect();
    broken.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn problem(method: doe::Method, designs: u32) -> Problem {
        let mut campaign = Campaign::parse("paper.toml", Campaign::PAPER).unwrap();
        campaign.doe = campaign::file::Doe { designs, method };
        Problem::new(campaign)
    }

    /// As a store holds them: in the variables' units, so that the last digits of the unit box are lost.
    #[test]
    fn designs_of_every_method_grow_again_and_again() {
        for method in doe::Method::ALL {
            let mut rows: Vec<DesignRow> = Vec::new();
            for n in [30, 40, 52] {
                let problem = problem(method, n);
                check_growth(&problem, &rows).unwrap();
                let added = doe(&problem, &rows).unwrap();
                assert_eq!(added[0].design, rows.len() as u64);
                rows.extend(added);
                assert_eq!(rows.len(), n as usize, "{method}");
                // Then there is nothing to check any more.
                check_growth(&problem, &rows).unwrap();
                assert!(doe(&problem, &rows).is_err(), "nothing is missing");
                let said = evenness(&problem, &rows).unwrap();
                let design = held(&problem, &rows);
                let expected = [design.min_distance(), design.centred_discrepancy()];
                let numbers: Vec<f64> = said
                    .split(|c: char| !c.is_ascii_digit() && c != '.')
                    .filter_map(|word| word.parse().ok())
                    .collect();
                for (found, expected) in numbers.iter().zip(expected) {
                    assert!((found - expected).abs() < 1e-4, "{said}");
                }
                assert_eq!(numbers.len(), 2, "{said}");
            }
        }
    }

    #[test]
    fn a_model_that_is_no_better_than_noise_is_refused() {
        let problem = problem(doe::Method::Maximin, 40);
        let designs = doe(&problem, &[]).unwrap();
        let fitted = |slope: f64| {
            let response = |row: &DesignRow| {
                // Scatter with a standard deviation of about 0.6, and what depends on the design.
                let scatter = (17.0 * row.design as f64).sin() + (29.0 * row.design as f64).cos();
                ResponseRow {
                    design: row.design,
                    mean_um: 1.0,
                    sd_um: 1.0,
                    p90_um: 5.0 + 0.6 * scatter + slope * row.x_p,
                    p90_variance_um2: 0.36,
                    lilliefors_p: None,
                }
            };
            let responses: Vec<ResponseRow> = designs.iter().map(response).collect();
            fit(problem.campaign(), &designs, &responses)
        };
        let refusal = fitted(0.0).unwrap_err().to_string();
        assert!(refusal.contains("no dependence on x"), "{refusal}");
        let (_, summary) = fitted(20.0).unwrap();
        assert!(summary.q2 > 0.9, "{}", summary.q2);
    }

    #[test]
    fn growth_that_cannot_be_is_refused_beforehand() {
        let rows = doe(&problem(doe::Method::Maximin, 20), &[]).unwrap();
        let larger = problem(doe::Method::Maximin, 30);
        let refused = |problem: &Problem, rows: &[DesignRow]| {
            format!("{:#}", check_growth(problem, rows).unwrap_err())
        };
        // A file that somebody edited: beyond the bounds.
        let mut outside = rows.clone();
        outside[4].x_r = 7.0;
        let said = refused(&larger, &outside);
        assert!(
            said.contains("doe.designs is 30") && said.contains("point 4"),
            "{said}"
        );
        let said = refused(&problem(doe::Method::Maximin, 19), &rows);
        assert!(said.contains("19 points requested"), "{said}");
        let said = refused(&problem(doe::Method::Sobol, 30), &rows);
        assert!(
            said.contains("method sobol") && said.contains("sequence"),
            "{said}"
        );
    }
}
