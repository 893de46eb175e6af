//! The calls of an external program that a campaign plans.

use problem::Approach;
use problem::formulation::Problem;

use crate::stage::Stage;

/// The most calls of a stage, if nothing fails and no search has to go on for want of a feasible design.
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
        evaluations: designs,
        samples: designs * of_design,
    };
    let searched = problem
        .approaches()
        .filter(|one| Approach::OPTIMISED.contains(one));
    let evaluations =
        u64::from(campaign.optimise.evaluations) * u64::from(campaign.optimise.starts);
    let mut search = Calls {
        stage: Stage::Optimise,
        evaluations: 0,
        samples: 0,
    };
    for approach in searched {
        search.evaluations += evaluations;
        if approach == Approach::Direct {
            search.samples += evaluations * u64::from(campaign.sampling.samples_per_design);
        }
    }
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
}
