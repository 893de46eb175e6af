//! The direct robust search: CMA-ES on the percentile itself, without a model.
//!
//! The objective is P90 of ΔSTE from as many samples as a design of the campaign gets, with the
//! same random numbers at every design: only the designs make a difference, and the search sees a
//! smooth function. Constraints are exact (the simulator's own, with the contact pressure under
//! Archard's wear) and ranked feasibility first, without a weight; designs that break one are not
//! sampled. The percentile of the winner is biased low, because the search chose it by its samples:
//! [`verification`] asks for verification samples.
//!
//! A search asks the workers for a generation of designs at a time.
//!
//! The six robust variables move; profile corrections move with them as far as [`Space`] says.

use campaign::Variant;
use campaign::file::CorrectionsSection;
use campaign::formulation::{Criteria, Design, GearCriteria, GearVariables, Problem};
use campaign::optimise::COMMON;
use campaign::task::VERIFICATION;
use cmaes::{Bounds, Evaluation, Run};
use gear::{Corrections, Member, TipRelief};
use rand::RngExt as _;
use stats::streams::{Purpose, stream};

use crate::simulations::{Answer, Request, Simulations};

/// Random streams of direct searches; approaches and printed designs are numbered far below.
const STREAMS: u64 = 1 << 20;

/// The profile corrections that a search may use.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Space {
    section: Option<CorrectionsSection>,
}

impl Space {
    /// Flanks as they are.
    #[must_use]
    pub const fn plain() -> Self {
        Self { section: None }
    }

    /// Tip relief alone, within the bounds of a campaign; `None` if it has no bounds for it.
    #[must_use]
    pub fn relieved(section: &CorrectionsSection) -> Option<Self> {
        section.tip_relief_um?;
        Some(Self {
            section: Some(CorrectionsSection {
                crowning_um: None,
                ..section.clone()
            }),
        })
    }

    /// Every correction that a campaign has bounds for, if crowning is one of them.
    #[must_use]
    pub fn crowned(section: &CorrectionsSection) -> Option<Self> {
        section.crowning_um?;
        Some(Self {
            section: Some(section.clone()),
        })
    }

    /// The corrections of the space, in words.
    #[must_use]
    pub fn name(&self) -> &'static str {
        let has = |section: &CorrectionsSection| {
            (
                section.tip_relief_um.is_some(),
                section.crowning_um.is_some(),
            )
        };
        match self.section.as_ref().map(has) {
            Some((true, true)) => "tip relief and crowning",
            Some((true, false)) => "tip relief",
            Some((false, true)) => "crowning",
            _ => "none",
        }
    }

    /// The number of variables of a search.
    #[must_use]
    pub fn dimension(&self, problem: &Problem) -> usize {
        let section = self.section.as_ref();
        let relief = section.is_some_and(|section| section.tip_relief_um.is_some());
        let crowning = section.is_some_and(|section| section.crowning_um.is_some());
        problem.dimension() + 4 * usize::from(relief) + usize::from(crowning)
    }

    /// The corrections at a point of their unit cube: amount and length of the relief of pinion and
    /// mate, then the crowning.
    #[must_use]
    pub fn corrections(&self, unit: &[f64]) -> Corrections {
        let Some(section) = &self.section else {
            return Corrections::default();
        };
        let mut rest = unit.iter().copied();
        let mut next = |[low, high]: [f64; 2]| low + (high - low) * rest.next().unwrap_or(0.0);
        let mut corrections = Corrections::default();
        if let (Some(amount), Some(length)) = (section.tip_relief_um, section.tip_relief_length_mm)
        {
            for member in Member::BOTH {
                let relief = TipRelief {
                    amount: 1e-3 * next(amount),
                    length: next(length),
                    shape: section.shape(),
                };
                corrections = corrections.with_tip_relief(member, relief);
            }
        }
        if let Some(crowning) = section.crowning_um {
            corrections = corrections.with_crowning(1e-3 * next(crowning));
        }
        corrections
    }
}

/// A design with its corrections.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Corrected {
    /// The design.
    pub variables: GearVariables,
    /// Tip relief and crowning.
    pub corrections: Corrections,
}

/// The best design of a search.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Found {
    /// The design.
    pub design: Corrected,
    /// P90 of the design with the search's own random numbers, µm.
    pub p90_um: f64,
    /// Criteria of the design, with the pressure under Archard's wear.
    pub criteria: GearCriteria,
}

/// The result of one search.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Search {
    /// The best design that satisfies every constraint, if any was met.
    pub found: Option<Found>,
    /// Designs tried.
    pub evaluations: u64,
    /// Analyses without random wear: two per design that can be simulated, the second with
    /// Archard's wear.
    pub plain_calls: u64,
    /// Analyses with random wear.
    pub worn_calls: u64,
}

impl Corrected {
    /// The design as a variant with these random streams.
    #[must_use]
    pub fn variant(&self, stream: (Purpose, u64)) -> Variant {
        Variant {
            corrections: self.corrections,
            ..Variant::new(self.variables.into(), stream)
        }
    }
}

/// Asks for as many verification samples as every optimum of the campaign gets.
#[must_use]
pub fn verification(problem: &Problem, design: &Corrected) -> Request {
    Request {
        variant: design.variant(VERIFICATION),
        samples: 0..problem.campaign().verify.first(),
    }
}

/// Searches from start number `start`; `number` distinguishes the searches of one campaign.
///
/// The budget of a start is the campaign's (`optimise.evaluations`), and so are the settings of
/// CMA-ES. With `from`, the first coordinates of a good point in the unit cube, the search begins
/// there with a third of the step, and with the least corrections; without, at a random point.
///
/// # Errors
///
/// The errors of the simulations.
pub fn search(
    simulations: &dyn Simulations,
    problem: &Problem,
    base: &Design,
    space: &Space,
    number: u64,
    start: u32,
    from: Option<&[f64]>,
) -> anyhow::Result<Search> {
    let campaign = problem.campaign();
    let dimension = space.dimension(problem);
    let bounds = Bounds::unit(dimension)?;
    let mut rng = stream(
        campaign.seed,
        Purpose::Optimise,
        STREAMS + number,
        u64::from(start),
    );
    let mut origin: Vec<f64> = (0..dimension).map(|_| rng.random()).collect();
    if let Some(from) = from {
        origin.fill(0.0);
        for (coordinate, given) in origin.iter_mut().zip(from) {
            *coordinate = *given;
        }
    }
    let mut result = Search {
        found: None,
        evaluations: 0,
        plain_calls: 0,
        worn_calls: 0,
    };
    let mut options = campaign.optimise.run(bounds);
    if from.is_some() {
        options.search.step /= 3.0;
    }
    let mut run = Run::new(&origin, options)?;
    while !run.is_finished() {
        let designs: Vec<Corrected> = run
            .ask(&mut rng)
            .iter()
            .map(|unit| Corrected {
                variables: problem.design(&problem.free_point(unit), base).gears(),
                corrections: space.corrections(&unit[problem.dimension()..]),
            })
            .collect();
        let request = |design: &Corrected| Request {
            variant: Variant {
                feasible_only: true,
                ..design.variant(COMMON)
            },
            samples: 0..campaign.sampling.samples_per_design,
        };
        let requests: Vec<Request> = designs.iter().map(request).collect();
        let answers = simulations.simulate(&requests)?;
        let evaluations: Vec<Evaluation> = designs
            .iter()
            .zip(answers)
            .map(|(design, answer)| result.note(problem, design, answer))
            .collect();
        run.tell(&evaluations, &mut rng)?;
    }
    Ok(result)
}

impl Search {
    fn note(&mut self, problem: &Problem, design: &Corrected, answer: Answer) -> Evaluation {
        self.evaluations += 1;
        let failed = Evaluation::from(f64::NAN);
        let Answer::Simulated { criteria, samples } = answer else {
            return failed;
        };
        self.plain_calls += 2;
        self.worn_calls += samples.len() as u64;
        // The pressure counts for designs that break another constraint, too. Otherwise the search
        // would be drawn to those designs, where the pressure would not count.
        let limited = Criteria::from(criteria);
        if !problem.is_feasible(&limited) {
            return Evaluation {
                value: 0.0,
                // On the edge itself the violation is zero, but the inequalities are strict.
                violation: problem.violation(&limited).max(f64::MIN_POSITIVE),
            };
        }
        let Ok(estimate) = problem.campaign().sampling.estimate(&samples) else {
            return failed;
        };
        let p90_um = estimate.chosen.p90;
        if self.found.is_none_or(|best| p90_um < best.p90_um) {
            self.found = Some(Found {
                design: *design,
                p90_um,
                criteria,
            });
        }
        Evaluation::from(p90_um)
    }
}

#[cfg(test)]
mod tests {
    use campaign::Campaign;

    use super::*;
    use crate::simulations::InProcess;

    const SECTION: CorrectionsSection = CorrectionsSection {
        tip_relief_um: Some([0.0, 20.0]),
        tip_relief_length_mm: Some([0.5, 2.5]),
        tip_relief_shape: None,
        crowning_um: Some([0.0, 8.0]),
    };

    fn problem(change: impl FnOnce(&mut Campaign)) -> Problem {
        let mut campaign = Campaign::parse("paper.toml", Campaign::PAPER).unwrap();
        campaign.optimise.evaluations = 600;
        campaign.optimise.restart_at = Some(300);
        campaign.sampling.samples_per_design = 10;
        change(&mut campaign);
        Problem::new(campaign)
    }

    #[test]
    fn the_cube_of_corrections_covers_their_bounds() {
        let problem = problem(|_| {});
        let relieved = Space::relieved(&SECTION).unwrap();
        let crowned = Space::crowned(&SECTION).unwrap();
        assert_eq!(
            [Space::plain(), relieved.clone(), crowned.clone()]
                .map(|space| space.dimension(&problem)),
            [6, 10, 11]
        );
        assert_eq!(crowned.name(), "tip relief and crowning");
        assert_eq!(relieved.corrections(&[1.0; 4]).crowning, 0.0);
        assert_eq!(Space::plain().corrections(&[]), Corrections::default());
        let unit = [0.5, 0.0, 1.0, 1.0, 0.25];
        let corrections = crowned.corrections(&unit);
        let [pinion, mate] = corrections.tip_relief.map(|relief| relief.unwrap());
        assert!((pinion.amount - 0.010).abs() < 1e-15 && pinion.length == 0.5);
        assert!((mate.amount - 0.020).abs() < 1e-15 && mate.length == 2.5);
        assert!((corrections.crowning - 0.002).abs() < 1e-15);
        let only = CorrectionsSection {
            tip_relief_um: None,
            tip_relief_length_mm: None,
            ..SECTION
        };
        assert_eq!(Space::relieved(&only), None);
        assert_eq!(Space::crowned(&only).unwrap().dimension(&problem), 7);
    }

    #[test]
    fn a_search_ends_feasible_and_is_a_function_of_campaign_number_and_start() {
        let problem = problem(|_| {});
        let base = problem.base().clone();
        let here = &InProcess(&problem);
        let search =
            |start| search(here, &problem, &base, &Space::plain(), 0, start, None).unwrap();
        let first = search(0);
        assert_eq!(first, search(0));
        let other = search(1);
        assert_ne!(first.found, other.found);
        let found = first.found.expect("600 designs reach the feasible region");
        assert!(problem.is_feasible(&found.criteria.into()));
        assert_eq!(first.evaluations, 600);
        assert!(first.worn_calls.is_multiple_of(10) && first.worn_calls <= 6000);
        // The winner's own percentile again, from the same random numbers.
        let samples = |request| {
            let answers = here.simulate(&[request]).unwrap();
            let answer = answers.into_iter().next().unwrap();
            answer.samples_of("it").unwrap()
        };
        let again = samples(Request {
            variant: found.design.variant(COMMON),
            samples: 0..10,
        });
        let estimate = problem.campaign().sampling.estimate(&again).unwrap();
        assert_eq!(estimate.chosen.p90, found.p90_um);
        let fresh = samples(verification(&problem, &found.design));
        assert_eq!(fresh.len(), problem.campaign().verify.first() as usize);
        assert_ne!(fresh[..10], again[..]);
    }

    /// The optimum with Archard's wear has 1071 MPa. Under a limit next to it little is feasible,
    /// and the search gets there only if the pressure counts from the beginning.
    #[test]
    fn a_tight_limit_of_the_pressure_is_reached() {
        let problem = problem(|campaign| {
            campaign.gears_mut().unwrap().material.hertz_limit_mpa = 1080.0;
            campaign.optimise.evaluations = 3000;
            campaign.optimise.restart_at = Some(1500);
        });
        let base = problem.base().clone();
        let here = &InProcess(&problem);
        let search = search(here, &problem, &base, &Space::plain(), 0, 0, None).unwrap();
        let found = search.found.expect("there are such designs");
        assert!(found.criteria.hertz_pressure_mpa < 1080.0);
        assert!(problem.is_feasible(&found.criteria.into()));
    }

    #[test]
    fn limits_that_nothing_satisfies_end_without_a_design_and_without_a_sample() {
        let problem = problem(|campaign| {
            campaign.gears_mut().unwrap().constraints.contact_ratio_min = Some(50.0)
        });
        let base = problem.base().clone();
        let here = &InProcess(&problem);
        let search = search(here, &problem, &base, &Space::plain(), 0, 0, None).unwrap();
        assert_eq!((search.found, search.worn_calls), (None, 0));
    }

    #[test]
    fn designs_that_cannot_be_simulated_anywhere_end_without_a_design() {
        // Shifts this negative leave the involute equation without a solution.
        let problem = problem(|campaign| {
            campaign.gears_mut().unwrap().bounds.profile_shift =
                campaign::file::OfGears::Both(campaign::file::Written::Free([-9.0, -8.0]))
        });
        let base = problem.base().clone();
        let here = &InProcess(&problem);
        let search = search(here, &problem, &base, &Space::plain(), 0, 0, None).unwrap();
        assert_eq!((search.found, search.plain_calls), (None, 0));
    }
}
