//! Direct searches beside the runs of a campaign: CMA-ES on the percentile itself, without a model.
//!
//! The searches are those of [`problem::optimise`] with [`Approach::Direct`]. The objective is P90 of ΔSTE
//! from as many samples as a design of the campaign gets, with the same random numbers at every
//! design: only the designs make a difference, and the search sees a smooth function. Constraints
//! are exact (the simulator's own, with the contact pressure under Archard's wear) and ranked
//! feasibility first, without a weight; designs that violate one are not sampled. The percentile of
//! the winner is biased low, because the search chose it by its samples: [`verification`] draws
//! other ones.
//!
//! [`verification`]: crate::samples::verification

use problem::formulation::Problem;
use problem::optimise::{self, Answer, Candidate, Solution, answer};
use problem::simulator::NoAnswer;
use problem::task::Run;
use problem::{Approach, Design};
use rayon::prelude::*;
use stats::Samples;

/// The result of one search.
#[derive(Debug, Clone, PartialEq)]
pub struct Search {
    /// The best feasible design, if the search met one. Its criterion is its P90 with the search's
    /// own random numbers, µm.
    pub best: Option<Solution>,
    /// Number of designs tried.
    pub evaluations: u64,
    /// Number of analyses without random wear: two per design that can be simulated, the second
    /// with Archard's wear.
    pub plain_calls: u64,
    /// Number of analyses with random wear.
    pub worn_calls: u64,
}

/// The start of a search.
#[derive(Debug, Clone, Copy)]
pub struct Start<'a> {
    /// The number that distinguishes the searches of one campaign.
    pub number: u64,
    /// The number of the start of that search.
    pub start: u32,
    /// The values of the variables that the DoE does not vary.
    pub base: &'a Design,
    /// A good design to begin at, with a third of the step; without one, a random point.
    pub from: Option<&'a Design>,
}

/// Searches to the end of the campaign's budget (`optimise.evaluations`), with its settings of
/// CMA-ES. The designs of a generation are evaluated on all threads.
///
/// # Errors
///
/// The search cannot begin or continue, or the simulator failed.
pub fn search(problem: &Problem, start: Start<'_>) -> anyhow::Result<Search> {
    let run = Run {
        approach: Approach::Direct,
        start: start.start,
        base: start.base.clone(),
        models: Vec::new(),
        from: start.from.cloned(),
    };
    let search = optimise::Search::beside(problem, &run, start.number);
    let mut search = search.map_err(anyhow::Error::msg)?;
    let (mut plain_calls, mut worn_calls) = (0, 0);
    loop {
        let candidates = search.ask(problem);
        let answers: anyhow::Result<Vec<Option<Answer>>> = candidates
            .par_iter()
            .map(|candidate| evaluate(problem, candidate))
            .collect();
        let answers = answers?;
        for answer in answers.iter().flatten() {
            plain_calls += 2;
            worn_calls += answer.samples.as_ref().map_or(0, Samples::len) as u64;
        }
        let goes_on = search.answered(problem, &candidates, answers);
        if !goes_on.map_err(anyhow::Error::msg)? {
            break;
        }
    }
    let result = search.result();
    Ok(Search {
        best: result.best,
        evaluations: result.evaluations,
        plain_calls,
        worn_calls,
    })
}

/// The evaluation of a candidate; `None` if it is not simulable.
fn evaluate(problem: &Problem, candidate: &Candidate) -> anyhow::Result<Option<Answer>> {
    let Some(design) = &candidate.design else {
        return Ok(None);
    };
    match answer(problem, Approach::Direct, design, candidate.may_improve) {
        Ok(answer) => Ok(Some(answer)),
        Err(NoAnswer::Refused(_)) => Ok(None),
        Err(NoAnswer::Failed(error) | NoAnswer::Machine(error)) => Err(anyhow::Error::msg(error)),
    }
}

#[cfg(test)]
mod tests {
    use problem::Campaign;
    use problem::optimise::COMMON;
    use stats::streams::stream;

    use super::*;
    use crate::samples;

    fn problem(change: impl FnOnce(&mut Campaign)) -> Problem {
        let mut campaign = Campaign::parse("paper.toml", Campaign::PAPER).unwrap();
        campaign.optimise.evaluations = 600;
        campaign.optimise.restart_at = Some(300);
        campaign.sampling.samples_per_design = 10;
        change(&mut campaign);
        Problem::new(campaign)
    }

    fn search_from(problem: &Problem, start: u32) -> Search {
        let start = Start {
            number: 0,
            start,
            base: problem.base(),
            from: None,
        };
        search(problem, start).unwrap()
    }

    #[test]
    fn a_search_ends_feasible_and_is_a_function_of_campaign_number_and_start() {
        let problem = problem(|_| {});
        let first = search_from(&problem, 0);
        assert_eq!(first, search_from(&problem, 0));
        let other = search_from(&problem, 1);
        assert_ne!(first.best, other.best);
        let best = first.best.expect("600 designs reach the feasible region");
        assert!(best.feasible && problem.is_feasible(&best.criteria));
        assert_eq!(first.evaluations, 600);
        assert!(first.worn_calls.is_multiple_of(10) && first.worn_calls <= 6000);
        // The winner's own percentile again, from the same random numbers.
        let gears = problem.gears().unwrap();
        let mut sampler = gears.sampler(&gears.pair(&best.design).unwrap());
        let (purpose, number) = COMMON;
        let seed = problem.campaign().seed;
        let again: Vec<f64> = (0..10)
            .map(|index| sampler.draw(&mut stream(seed, purpose, number, index)))
            .collect();
        let estimate = problem.campaign().sampling.estimate(&again).unwrap();
        assert_eq!(estimate.chosen.value, best.criterion);
        let verified = samples::verification(&problem, &best.design).unwrap();
        assert_eq!(verified.len(), problem.campaign().verify.first() as usize);
        assert_ne!(verified[..10], again[..]);
    }

    #[test]
    fn a_search_does_not_depend_on_the_number_of_threads() {
        let problem = problem(|campaign| campaign.optimise.evaluations = 200);
        let on = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            pool.unwrap().install(|| search_from(&problem, 0))
        };
        assert_eq!(on(1), on(3));
    }

    /// The optimum with Archard's wear has 1071 MPa. Under a limit next to it little is feasible,
    /// and the search gets there only if the pressure counts from the beginning.
    #[test]
    fn a_tight_limit_of_the_pressure_is_reached() {
        let problem = problem(|campaign| {
            campaign
                .gears_mut()
                .unwrap()
                .material
                .pinion
                .contact_limit_mpa = 1080.0;
            campaign.optimise.evaluations = 3000;
            campaign.optimise.restart_at = Some(1500);
        });
        let best = search_from(&problem, 0)
            .best
            .expect("there are such designs");
        assert!(best.criteria.gears().hertz_pressure_mpa < 1080.0);
        assert!(problem.is_feasible(&best.criteria));
    }

    #[test]
    fn limits_that_nothing_satisfies_end_without_a_design_and_without_a_sample() {
        let problem = problem(|campaign| {
            campaign.gears_mut().unwrap().constraints.contact_ratio_min = Some(50.0)
        });
        let search = search_from(&problem, 0);
        assert_eq!((search.best, search.worn_calls), (None, 0));
        assert_eq!(search.evaluations, 600);
    }

    #[test]
    fn designs_that_cannot_be_simulated_anywhere_end_without_a_design() {
        // Shifts this negative leave the involute equation without a solution.
        let problem = problem(|campaign| {
            campaign.gears_mut().unwrap().bounds.profile_shift =
                problem::file::OfGears::Both(problem::file::Setting::Free([-9.0, -8.0]))
        });
        let search = search_from(&problem, 0);
        assert_eq!((search.best, search.plain_calls), (None, 0));
    }
}
