//! The calls of the simulator: those that a campaign plans, and those that it made.

use problem::Approach;
use problem::formulation::Problem;
use store::{CriteriaRow, InfillRow, Progress, RoundRow};

use crate::constraints;
use crate::stage::Stage;

/// The most calls of a stage, if nothing fails and every search finds a feasible design in its budget.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Calls {
    pub stage: Stage,
    /// Evaluations without random effects.
    pub evaluations: u64,
    pub samples: u64,
}

impl Calls {
    /// The number of calls.
    #[must_use]
    pub const fn count(&self) -> u64 {
        self.evaluations + self.samples
    }
}

/// The most calls of each stage that calls the program.
#[must_use]
pub fn planned(problem: &Problem) -> Vec<Calls> {
    let campaign = problem.campaign();
    let designs = u64::from(campaign.doe.designs);
    let of_design = u64::from(campaign.sampling.samples_max());
    let doe = Calls {
        stage: Stage::Sample,
        evaluations: (0..designs)
            .map(|design| evaluations(problem, design))
            .sum(),
        samples: designs * of_design
            - known(problem, (0..designs).map(|design| (design, of_design))),
    };
    let of_run = u64::from(campaign.optimise.evaluations);
    let is_direct = problem.approaches().any(|one| one == Approach::Direct);
    let directly = u64::from(is_direct) * u64::from(campaign.optimise.starts) * of_run;
    let search = Calls {
        stage: Stage::Optimise,
        evaluations: problem.optimiser_runs() * of_run,
        samples: directly * u64::from(campaign.sampling.samples_per_design),
    };
    let infill = campaign.enrichment.map(|section| {
        let least = designs * u64::from(campaign.sampling.samples_per_design);
        let samples = u64::from(section.samples).saturating_sub(least);
        Calls {
            stage: Stage::Enrich,
            evaluations: samples / u64::from(section.samples_per_point),
            samples,
        }
    });
    let verified = problem.approaches().count() as u64;
    let verification = Calls {
        stage: Stage::Verify,
        evaluations: 0,
        samples: verified * u64::from(campaign.verify.most()),
    };
    let all = [Some(doe), Some(search), infill, Some(verification)];
    all.into_iter().flatten().collect()
}

/// The calls that `samples` of the DoE took: the evaluations of its designs, and the samples. A design that cannot be
/// simulated costs one attempt.
#[must_use]
pub fn sampling(problem: &Problem, criteria: &[CriteriaRow], samples: u64) -> u64 {
    let of_design = |row: &CriteriaRow| match row.simulable {
        true => evaluations(problem, row.design),
        false => 1,
    };
    let most = u64::from(problem.campaign().sampling.samples_max());
    let sampled = criteria
        .iter()
        .filter(|row| row.simulable && row.reason.is_none());
    let known = known(problem, sampled.map(|row| (row.design, most)));
    criteria.iter().map(of_design).sum::<u64>() + samples.saturating_sub(known)
}

/// The calls that the rounds took: the search for points, the evaluations of points whose constraints only
/// an external program knows, and the samples.
#[must_use]
pub fn infill(problem: &Problem, rounds: &[RoundRow], infill: &[InfillRow]) -> u64 {
    let searching: u64 = rounds.iter().map(|round| round.simulator_calls).sum();
    let evaluated = infill
        .iter()
        .filter(|row| constraints::is_asked(problem, row));
    let sampled = infill.iter().filter(|row| !row.failed);
    searching + evaluated.count() as u64 + sampled.map(|row| row.samples).sum::<u64>()
}

/// The number of stored samples that come from the campaign file and cost no call. `counts` holds the number of stored
/// samples of each design.
pub fn known(problem: &Problem, counts: impl IntoIterator<Item = (u64, u64)>) -> u64 {
    let counts = counts.into_iter();
    counts
        .map(|(design, count)| count.min(problem.own_samples(design).len() as u64))
        .sum()
}

/// The samples of all stages that the store has counted.
#[must_use]
pub fn samples(problem: &Problem, progress: &Progress) -> u64 {
    let of_searches = progress.evaluation_values / problem.sampled().len() as u64;
    progress.samples + progress.point_samples + of_searches
}

/// Evaluations of a simulable design of the DoE: none if the campaign file has its responses, otherwise one; for a gear
/// pair two, without wear and with Archard's.
fn evaluations(problem: &Problem, design: u64) -> u64 {
    match problem.own_responses(design) {
        Some(_) => 0,
        None => 1 + u64::from(problem.gears().is_some()),
    }
}

#[cfg(test)]
mod tests {
    use problem::Campaign;

    use super::*;

    #[test]
    fn every_stage_that_calls_the_program_is_counted() {
        let text = include_str!("../../../campaigns/cantilever/campaign.toml");
        let problem = Problem::new(Campaign::parse("campaign.toml", text).unwrap());
        let of = |stage: Stage| {
            let planned = planned(&problem);
            let calls = planned.into_iter().find(|calls| calls.stage == stage);
            calls.map(|calls| (calls.evaluations, calls.samples))
        };
        assert_eq!(of(Stage::Sample), Some((40, 40 * 25)));
        // The baseline and kriging.
        assert_eq!(of(Stage::Optimise), Some((600, 0)));
        assert_eq!(of(Stage::Enrich), None);
        assert_eq!(of(Stage::Verify), Some((0, 3 * 400)));
    }

    #[test]
    fn the_program_is_not_asked_for_what_the_campaign_file_knows() {
        let text = include_str!("../../../campaigns/cantilever/campaign.toml");
        let own = "[doe]\npoints = [[2.0, 3.0], [1.5, 3.5]]\nresponses = [[], [5.25, 2.0]]\n\
                   samples = [[[0.1], [0.2]]]\n";
        let text = text.replacen("[doe]\n", own, 1);
        let problem = Problem::new(Campaign::parse("campaign.toml", &text).unwrap());
        let doe = planned(&problem)[0];
        assert_eq!((doe.evaluations, doe.samples), (39, 40 * 25 - 2));
        let row = |design| CriteriaRow {
            design,
            simulable: true,
            ..CriteriaRow::default()
        };
        let criteria: Vec<CriteriaRow> = (0..3).map(row).collect();
        assert_eq!(sampling(&problem, &criteria, 75), 2 + 73);
        assert_eq!(known(&problem, [(0, 1), (1, 25)]), 1);
    }

    #[test]
    fn a_design_is_evaluated_once_and_a_gear_pair_in_two_states() {
        let row = |simulable| CriteriaRow {
            simulable,
            ..CriteriaRow::default()
        };
        let criteria = [true, false, true].map(row);
        let calls = |text: &str| {
            let problem = Problem::new(Campaign::parse("campaign.toml", text).unwrap());
            sampling(&problem, &criteria, 50)
        };
        let cantilever = include_str!("../../../campaigns/cantilever/campaign.toml");
        assert_eq!(calls(cantilever), 3 + 50);
        let gears = include_str!("../../../campaigns/quick.toml");
        assert_eq!(calls(gears), 5 + 50);
    }
}
