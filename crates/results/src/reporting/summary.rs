//! The head of a report: what was put in, what is missing, and which design is recommended.

use campaign::file::GearSections;
use campaign::formulation::Constraint;
use campaign::{Approach, Criteria, Design};
use report::{Behind, Margin, NamedValue, Recommended, Summary};
use stages::optima::{approach_of, optimum_design};
use store::OptimumRow;

use super::called;
use super::optima::report_approach;
use super::sources::Sources;
use crate::percentile::percentile;
use crate::ranking::{Ranked, is_ranked, rank};
use crate::status::{Progress, Status};

/// The head of the report of a campaign; `made` says where and when the report was made.
pub(super) fn summary(
    sources: &Sources,
    status: &Status,
    made: &[(String, String)],
) -> anyhow::Result<Summary> {
    Ok(Summary {
        missing: missing(status),
        inputs: inputs(sources),
        made: made.to_vec(),
        recommended: recommended(sources)?,
        left_out: left_out(sources),
    })
}

/// What an unfinished campaign lacks.
fn missing(status: &Status) -> Vec<String> {
    if status.finished {
        return Vec::new();
    }
    let of = |progress: Progress, what: &str| {
        let Progress { done, wanted } = progress;
        (done < wanted).then(|| format!("{done} of {wanted} {what}"))
    };
    let designs = Progress {
        done: status.designs.done,
        wanted: status.designs.wanted,
    };
    let verified = Progress {
        done: status.optima.iter().map(|o| o.verified.done).sum(),
        wanted: status.optima.iter().map(|o| o.verified.wanted).sum(),
    };
    let complete = status
        .optima
        .iter()
        .any(|o| o.verified.wanted > 0 && o.verified.done >= o.verified.wanted);
    let verified = if complete {
        of(verified, "verification samples taken")
    } else {
        Some("no optimum verified yet".to_owned())
    };
    [
        of(designs, "designs sampled"),
        of(status.optimiser_runs, "optimiser runs done"),
        verified,
    ]
    .into_iter()
    .flatten()
    .collect()
}

/// The feasible optima with verification samples, the best first, of the approaches that move the variables of
/// the DoE.
fn ranked(sources: &Sources) -> Vec<Ranked<&OptimumRow>> {
    let is_ranked = |row: &&OptimumRow| {
        let approach = approach_of(&row.approach);
        row.feasible && approach.is_some_and(|approach| is_ranked(&sources.problem, approach))
    };
    let mut designs = Vec::new();
    for row in sources.optima.iter().filter(is_ranked) {
        if let Some(samples) = sources.verified.get(&row.approach) {
            designs.push((row, samples.clone()));
        }
    }
    rank(&sources.problem, designs)
}

/// The feasible optimum with the best verified percentile.
pub(super) fn best(sources: &Sources) -> Option<Design> {
    let best = ranked(sources).into_iter().next()?;
    optimum_design(&sources.problem, best.design)
}

fn recommended(sources: &Sources) -> anyhow::Result<Option<Recommended>> {
    let problem = &sources.problem;
    let ranked = ranked(sources);
    let Some(best) = ranked.first() else {
        return Ok(None);
    };
    let row = best.design;
    let Some(design) = optimum_design(problem, row) else {
        return Ok(None);
    };
    let name = |row: &OptimumRow| {
        approach_of(&row.approach).map_or_else(|| row.approach.clone(), |a| label(sources, a))
    };
    let sampling = &problem.campaign().sampling;
    let criteria: Option<Criteria> = serde_json::from_str(&row.criteria_json)?;
    let constraints = criteria.map_or_else(Vec::new, |criteria| problem.constraints(&criteria));
    let verified = sources.verified.get(&row.approach);
    let response = match problem.gears() {
        Some(_) => "ΔSTE".to_owned(),
        None => problem.sampled().name.to_string(),
    };
    let variables = problem.variables().iter().zip(design.values());
    let others = sources.optima.iter().filter_map(|row| {
        let approach = approach_of(&row.approach)?;
        (!is_ranked(problem, approach)).then(|| label(sources, approach))
    });
    let behind = |other: &Ranked<&OptimumRow>| {
        let (low, high) = other.behind?.interval?;
        Some(Behind {
            approach: name(other.design),
            difference: report::Percentile {
                value: other.behind?.value,
                low,
                high,
                samples: other.behind?.n,
            },
        })
    };
    Ok(Some(Recommended {
        approach: name(row),
        what: format!("{} of {response}", sampling.percentile_name()),
        unit: problem.sampled().unit.to_string(),
        percentile: percentile(sampling, verified.map_or(&[][..], Vec::as_slice)),
        variables: variables
            .map(|(variable, value)| NamedValue {
                name: called(sources, &variable.name),
                unit: variable.unit.to_string(),
                value: *value,
            })
            .collect(),
        margins: constraints.into_iter().map(margin).collect(),
        simulator_calls: row.simulator_calls,
        cpu_seconds: row.cpu_seconds,
        not_ranked: others.collect(),
        behind: ranked.iter().filter_map(behind).collect(),
    }))
}

/// What the report calls an approach.
fn label(sources: &Sources, approach: Approach) -> String {
    match sources.problem.gears() {
        Some(_) => report_approach(approach).label().to_owned(),
        None => sources.problem.approach_name(approach).to_owned(),
    }
}

fn margin(constraint: Constraint) -> Margin {
    Margin {
        relation: constraint.bound.sign().to_owned(),
        limit: constraint.limit,
        // No zero with a sign.
        margin: 0.0 - constraint.excess,
        value: super::problem::limited(constraint).0,
    }
}

/// What the campaign file says, for a reader who does not have it.
fn inputs(sources: &Sources) -> Vec<(String, String)> {
    let problem = &sources.problem;
    let mut inputs: Vec<(String, String)> = Vec::new();
    if let Some(sections) = problem.campaign().gears() {
        gears(sections, &mut inputs);
    }
    let ranges = problem.coordinates().iter().map(|coordinate| {
        let [low, high] = coordinate.range;
        let range = format!("{low} to {high} {}", coordinate.unit).replace('-', "−");
        (
            called(sources, &coordinate.name),
            range.trim_end().to_owned(),
        )
    });
    inputs.extend(ranges.map(|(name, range)| (format!("Range of {name}"), range)));
    inputs
}

fn gears(sections: &GearSections, inputs: &mut Vec<(String, String)>) {
    let pair = &sections.pair;
    let mut add = |label: &str, value: String| inputs.push((label.to_owned(), value));
    let [pinion, mate] = pair.teeth();
    add("Teeth", format!("{pinion} / {mate}"));
    if let Some(module) = pair.normal_module_mm {
        add("Normal module", format!("{module} mm"));
    }
    if let Some(distance) = pair.centre_distance_mm {
        add("Centre distance", format!("{distance} mm"));
    }
    add("Pressure angle", format!("{}°", pair.pressure_angle_deg));
    add("Face width", format!("{} mm", pair.face_width_mm));
    let torque = sections.load.pinion_torque_nm;
    add("Torque on the pinion", format!("{torque} N·m"));
    let material = &sections.material;
    let name = material
        .name
        .map_or_else(String::new, |name| format!("{name}: "));
    let (e, nu) = (material.youngs_modulus_gpa, material.poisson_ratio);
    let (yields, pressure) = (material.yield_mpa, material.hertz_limit_mpa);
    add(
        "Material",
        format!(
            "{name}E {e} GPa, ν {nu}, yield stress {yields} MPa, permissible pressure {pressure} MPa"
        ),
    );
}

/// What the recommended number does not include.
fn left_out(sources: &Sources) -> String {
    let campaign = sources.problem.campaign();
    let Some(sections) = campaign.gears() else {
        return String::new();
    };
    let manufacture = match sections.manufacture {
        Some(_) => "pitch and form deviations",
        None => "deviations of manufacture",
    };
    if campaign.is_external() {
        return String::new();
    }
    format!(
        "{manufacture}, dynamics, friction, misalignment, and the deflection of shafts, bearings and \
         gear bodies."
    )
}
