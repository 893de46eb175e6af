//! The head of a report: inputs, missing parts, and the effects that the recommended number leaves out.

use problem::file::{GearSections, Material};
use problem::formulation::Problem;

use super::quantity::variable_name;
use crate::costs::StageCost;
use crate::number::seconds;
use crate::snapshot::Snapshot;
use crate::status::{Progress, Status};

/// The missing parts of an unfinished campaign.
pub(super) fn missing(status: &Status) -> Vec<String> {
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
    let verified = status.verified();
    let complete = status
        .optima
        .iter()
        .any(|o| o.verified.wanted > 0 && o.verified.done >= o.verified.wanted);
    let verified = if complete {
        of(verified, "verification samples taken")
    } else {
        Some("no optimum verified yet".to_owned())
    };
    let missing: Vec<String> = [
        of(designs, "designs simulated"),
        of(status.optimiser_runs, "optimiser runs done"),
        verified,
    ]
    .into_iter()
    .flatten()
    .collect();
    match missing.is_empty() {
        // Between two rounds of an enrichment, for example.
        true => vec![format!("the stage “{}” has not ended", status.stage)],
        false => missing,
    }
}

/// The main inputs of the campaign file, and the duration of the campaign.
pub(super) fn inputs(snapshot: &Snapshot) -> Vec<(String, String)> {
    let problem = &snapshot.problem;
    let mut inputs: Vec<(String, String)> = Vec::new();
    if let Some(sections) = problem.campaign().gears() {
        gears(sections, &mut inputs);
    }
    let ranges = problem.coordinates().iter().map(|coordinate| {
        let [low, high] = coordinate.range;
        let range = format!("{low} to {high} {}", coordinate.unit).replace('-', "−");
        (
            variable_name(problem, &coordinate.name),
            range.trim_end().to_owned(),
        )
    });
    inputs.extend(ranges.map(|(name, range)| (format!("Range of {name}"), range)));
    inputs.extend(duration(&snapshot.costs));
    inputs
}

/// Wall and CPU time of the whole campaign; `None` before any stage has begun.
fn duration(stages: &[StageCost]) -> Option<(String, String)> {
    let sum = |of: fn(&StageCost) -> f64| {
        let known = stages.iter().map(of).filter(|seconds| seconds.is_finite());
        known.sum::<f64>()
    };
    let (wall, cpu) = (sum(|s| s.wall_seconds), sum(|s| s.cpu_seconds));
    let text = || {
        let [wall, cpu] = [wall, cpu].map(seconds);
        format!("{wall} s, CPU time {cpu} s; by stage below")
    };
    (wall > 0.0).then(|| ("Wall time".to_owned(), text()))
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
    let of = |material: &Material| {
        let name = material
            .name
            .map_or_else(String::new, |name| format!("{name}: "));
        let (e, nu) = (material.youngs_modulus_gpa, material.poisson_ratio);
        let bending = material.bending_limit_mpa;
        let bending = bending.map_or_else(String::new, |limit| format!(", σ_FE {limit} MPa"));
        let pressure = material.contact_limit_mpa;
        format!("{name}E {e} GPa, ν {nu}, σ_Hlim {pressure} MPa{bending}")
    };
    match &sections.material.mate {
        None => add("Material", of(&sections.material.pinion)),
        Some(mate) => {
            add("Material of the pinion", of(&sections.material.pinion));
            add("Material of the mate", of(mate));
        }
    }
}

/// The effects that the recommended number does not include.
pub(super) fn left_out(problem: &Problem) -> String {
    let campaign = problem.campaign();
    let Some(sections) = campaign.gears() else {
        return String::new();
    };
    if campaign.is_external() {
        return String::new();
    }
    let is_misaligned =
        |one: problem::file::Manufacture| one.misalignment_um.is_some_and(|um| um > 0.0);
    let mut effects = vec![match sections.manufacture {
        Some(_) => "pitch and form deviations",
        None => "deviations of manufacture",
    }];
    effects.extend(["dynamics", "friction"]);
    if !sections.manufacture.is_some_and(is_misaligned) {
        effects.push("misalignment");
    }
    effects.push(match sections.pair.tooth_model {
        gear::ToothModel::Coupled => "rims and webs",
        _ => "the coupling of neighbouring teeth, the deflection of gear bodies",
    });
    format!(
        "{}, and the deflection of shafts and bearings.",
        effects.join(", ")
    )
}
