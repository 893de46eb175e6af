//! Remarks and warnings, and what the model leaves out.

use campaign::file::FailedSamples;
use campaign::formulation::Problem;
use stages::optima::optimum_design;
use store::ResponseRow;

use super::sources::{Failed, Sources};

/// The warning about an external program none of whose samples depends on its seed.
pub(crate) fn ignored_seeds(problem: &Problem, responses: &[ResponseRow]) -> Option<String> {
    // The mean of equal numbers is rounded, and so is their standard deviation.
    let is_constant = |row: &ResponseRow| row.sd_um <= 1e-12 * row.mean_um.abs();
    let is_suspicious = problem.campaign().is_external()
        && !responses.is_empty()
        && responses.iter().all(is_constant);
    is_suspicious.then(|| {
        format!(
            "The program seems to ignore its seed: in each of {} designs, all samples of {} are equal. The \
             percentiles are those of a response without random effects.",
            responses.len(),
            problem.sampled().name,
        )
    })
}

pub(super) fn notes(sources: &Sources, failures: &[store::FailureRow]) -> Vec<String> {
    let campaign = sources.problem.campaign();
    let mut notes = campaign.warnings();
    if let Some(model) = &sources.model {
        notes.extend(
            model
                .warnings
                .iter()
                .map(|warning| format!("Kriging: {warning}.")),
        );
    }
    notes.extend(ignored_seeds(&sources.problem, &sources.responses));
    if !campaign.is_external() {
        notes.extend(pointed_tips(sources));
    }
    let panics = |name: &str| {
        sources
            .criteria
            .iter()
            .filter(|row| {
                row.reason
                    .as_deref()
                    .is_some_and(|reason| reason.starts_with(name))
            })
            .count()
    };
    for (name, what) in [
        (campaign::task::SIMULATOR_PANIC, "made the simulator panic"),
        (
            campaign::task::NOT_A_NUMBER,
            "gave results that are no numbers",
        ),
        (campaign::task::FAILED, "failed in every attempt"),
    ] {
        let count = panics(name);
        if count > 0 {
            notes.push(format!(
                "{count} designs {what}; they are recorded as not simulable."
            ));
        }
    }
    notes.extend(failed(sources));
    let mut quarantined: Vec<&str> = failures
        .iter()
        .filter(|row| row.kind == store::FailureKind::Quarantine)
        .map(|row| row.job.as_str())
        .collect();
    quarantined.dedup();
    if !quarantined.is_empty() {
        notes.push(format!(
            "Jobs that were quarantined: {}.",
            quarantined.join(", ")
        ));
    }
    if campaign.gears().is_none() {
        return notes;
    }
    notes.push(
        "The contact pressure of approach 1 is that of unworn flanks; the designs of the problems \
         with wear are judged by the pressure on flanks with Archard’s wear."
            .to_owned(),
    );
    notes.push(if campaign.is_external() {
        "An external program simulated the designs. What only the built-in model knows is left \
         out: drawings of the optima, their transmission error curves and profiles of worn flanks."
            .to_owned()
    } else {
        "The model leaves out dynamics, friction, misalignment, pitch errors and the elastic \
         coupling of neighbouring slices; its compliance has no gear body."
            .to_owned()
    });
    notes
}

/// The failures that are results, and their meaning.
fn failed(sources: &Sources) -> Vec<String> {
    let Failed {
        samples,
        designs,
        verified,
        evaluations,
    } = sources.failed;
    let meaning = match sources.problem.campaign().sampling.failed {
        FailedSamples::LeftOut => "They are left out of the percentiles.",
        FailedSamples::RefusesDesign => "A design with one of them has no percentile.",
        FailedSamples::Worst | FailedSamples::QuarantinesDesign => {
            "They count as worse than all others."
        }
    };
    let of = sources.samples;
    let notes = [
        (samples > 0).then(|| format!("{samples} of {of} samples of the DoE failed. {meaning}")),
        (designs > 0).then(|| {
            format!(
                "{designs} designs have no percentile, because too many of their samples failed."
            )
        }),
        (verified > 0).then(|| format!("{verified} verification samples failed. {meaning}")),
        (evaluations > 0).then(|| {
            format!(
                "{evaluations} evaluations in the searches failed; these candidates ranked last."
            )
        }),
    ];
    notes.into_iter().flatten().collect()
}

/// Names optima whose teeth have no tip land left: no constraint of the paper asks for one, and
/// the slenderness of such tips makes their ΔSTE depend on how the beam model ends.
fn pointed_tips(sources: &Sources) -> Vec<String> {
    let mut notes = Vec::new();
    for row in &sources.optima {
        let Some(pair) = optimum_design(&sources.problem, row)
            .and_then(|design| sources.problem.gears()?.pair(&design).ok())
        else {
            continue;
        };
        let pointed = pair.geometry().pointed;
        let who = match pointed {
            [false, false] => continue,
            [true, false] => "The pinion of",
            [false, true] => "The mate of",
            [true, true] => "Both gears of",
        };
        notes.push(format!(
            "{who} the optimum “{}” has pointed teeth: the constraints ask for no tip land. Its \
             ΔSTE rests on where the beam model ends a tooth that thins to nothing; shortened to a \
             usual tip land, such a pair loses much of what it gained.",
            row.approach
        ));
    }
    notes
}
