//! Remarks and warnings, and what the model leaves out.

use problem::Approach;
use stages::names;

use crate::report::quantity::approach_name;
use crate::snapshot::Snapshot;

/// The notes of a campaign, a sentence or more each.
pub(super) fn notes(snapshot: &Snapshot) -> Vec<String> {
    let campaign = snapshot.problem.campaign();
    let mut notes = campaign.warnings();
    if let Some((model, _)) = &snapshot.model {
        notes.extend(
            model
                .warnings
                .iter()
                .map(|warning| format!("Kriging: {warning}.")),
        );
    }
    notes.extend(snapshot.doubts.clone());
    if !campaign.is_external() {
        notes.extend(pointed_tips(snapshot));
    }
    let panics = |name: &str| {
        snapshot
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
        (problem::task::SIMULATOR_PANIC, "made the simulator panic"),
        (
            problem::task::NOT_A_NUMBER,
            "gave results that are not numbers",
        ),
    ] {
        let count = panics(name);
        if count > 0 {
            notes.push(format!(
                "{count} designs {what}; they are recorded as not simulable."
            ));
        }
    }
    let mut quarantined: Vec<String> = snapshot
        .failures
        .iter()
        .filter(|row| row.kind == store::FailureKind::Quarantine)
        .map(names::failed_job)
        .collect();
    quarantined.sort();
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
    notes.push(format!(
        "The contact pressure of the approach “{}” is that of unworn flanks; the other designs are judged by the \
         pressure on flanks with the mean wear.",
        approach_name(&snapshot.problem, Approach::Nominal)
    ));
    if campaign.is_external() {
        notes.push(
            "An external program simulated the designs. Results that only the built-in model gives \
             are left out: drawings of the optima, their transmission error curves and profiles of worn flanks."
                .to_owned(),
        );
    }
    notes
}

/// A note for each optimum whose teeth have no tip land left, which no constraint of the paper requires: such tips are so
/// slender that ΔSTE depends on how the beam model ends.
fn pointed_tips(snapshot: &Snapshot) -> Vec<String> {
    let mut notes = Vec::new();
    for verified in snapshot.optima.iter() {
        let optimum = &verified.optimum;
        let found = optimum.found.as_ref().ok();
        let Some(pair) = found.and_then(|found| {
            let gears = snapshot.problem.gears()?;
            gears.pair(&found.design).ok()
        }) else {
            continue;
        };
        let pointed = pair.geometry().pointed;
        let (who, have) = match pointed {
            [false, false] => continue,
            [true, false] => ("The pinion of", "has"),
            [false, true] => ("The mate of", "has"),
            [true, true] => ("Both gears of", "have"),
        };
        notes.push(format!(
            "{who} the optimum “{}” {have} pointed teeth: no constraint requires a tip land. Its \
             ΔSTE depends on where the beam model cuts off the vanishing tip; shortened to a \
             usual tip land, such a pair loses much of what it gained.",
            optimum.approach.name()
        ));
    }
    notes
}
