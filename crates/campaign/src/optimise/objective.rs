//! The criterion of a run, and what it remembers of the designs that it has evaluated.

use cmaes::Evaluation;
use stats::streams::{Purpose, stream};

use super::Found;
use crate::formulation::{Approach, Criteria, Design, Problem};
use crate::simulator::{Analysis, NoAnswer, Simulator, State};
use crate::task::Run;

/// The violation of a design that cannot be simulated, when ranked feasibility first: more than any real
/// design's.
const FAILURE_VIOLATION: f64 = 1e300;

/// The random streams that all designs of a direct search share, so that two designs differ by what
/// they are and not by chance. A design of a campaign is numbered below 2³².
pub const COMMON: (Purpose, u64) = (Purpose::Wear, 1 << 40);

/// A design that a search wants to know of.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    /// The design; none where the point of the search's box stands for no design.
    pub design: Option<Design>,
    /// Whether the simulator is asked about it.
    pub is_asked: bool,
    /// Whether it may be the best design so far, by what is known without the simulator.
    pub may_improve: bool,
    /// The model's mean, of a search on a model.
    predicted: Option<f64>,
}

/// What the simulator says of a candidate.
#[derive(Debug, Clone, PartialEq)]
pub struct Answer {
    /// The analysis that the approach searches by.
    pub analysis: Analysis,
    /// The criteria in the baseline state, where a gear pair that was searched without wear must keep
    /// them worn, too.
    pub worn: Option<Criteria>,
    /// Of a direct search, the samples of a design that keeps all constraints.
    pub samples_um: Vec<f64>,
}

/// Asks the simulator about a design that an approach may end with. `may_improve` says that it may be the
/// best design so far.
///
/// # Errors
///
/// The design cannot be simulated, or the simulator failed.
pub fn answer(
    simulator: &dyn Simulator,
    approach: Approach,
    design: &Design,
    may_improve: bool,
) -> Result<Answer, NoAnswer> {
    let problem = simulator.problem();
    let mut prepared = simulator.prepare(design)?;
    let state = match approach {
        Approach::Baseline | Approach::Direct | Approach::EnrichedKriging => State::Baseline,
        _ => State::Nominal,
    };
    let analysis = prepared.analyse(state)?;
    let is_feasible = problem.is_feasible(&analysis.criteria);
    let mut answer = Answer {
        analysis,
        worn: None,
        samples_um: Vec::new(),
    };
    if !is_feasible {
        return Ok(answer);
    }
    if approach == Approach::Kriging && may_improve && problem.gears().is_some() {
        // The search takes the pressure of the unworn pair, one call as in the paper. What is kept as
        // an optimum must satisfy its limit worn, too; that costs a call now and then.
        answer.worn = Some(prepared.analyse(State::Baseline)?.criteria);
    }
    if approach == Approach::Direct {
        let campaign = problem.campaign();
        let (purpose, number) = COMMON;
        for sample in 0..campaign.sampling.samples_per_design {
            let mut rng = stream(campaign.seed, purpose, number, u64::from(sample));
            let drawn = prepared.sample(&mut rng).map_err(NoAnswer::Failed)?;
            problem.check_sample(drawn).map_err(|why| {
                let name = &problem.sampled().name;
                NoAnswer::Failed(format!("{name} of sample {sample} {why}"))
            })?;
            answer.samples_um.push(drawn);
        }
    }
    Ok(answer)
}

/// The criterion of one formulation.
pub(super) struct Objective {
    approach: Approach,
    base: Design,
    model: Option<kriging::Surrogate>,
}

/// What a run remembers of the designs that it has evaluated.
#[derive(Debug, Clone, Default)]
pub(super) struct Seen {
    pub(super) simulator_calls: u64,
    /// The best design by the penalised objective, or the nearest to feasible where there is no penalty,
    /// with its value.
    pub(super) printed: Option<(f64, Found)>,
    /// The best feasible design.
    pub(super) best: Option<Found>,
}

/// An evaluated design.
struct Evaluated {
    found: Found,
    violation: f64,
}

impl Seen {
    /// Keeps what the printed part of a run found, if it is the best by its value.
    fn keep(&mut self, value: f64, found: Found) {
        if self.printed.as_ref().is_none_or(|(best, _)| value < *best) {
            self.printed = Some((value, found));
        }
    }

    /// Whether a design with this criterion would be the best feasible one so far.
    fn improves(&self, criterion_um: f64) -> bool {
        let best = self.best.as_ref();
        best.is_none_or(|best| criterion_um < best.criterion_um)
    }
}

/// An evaluated design, to be ranked feasibility first; none cannot be simulated.
fn ranked(evaluated: Option<&Evaluated>) -> Evaluation {
    evaluated.map_or(
        Evaluation {
            value: 0.0,
            violation: FAILURE_VIOLATION,
        },
        |Evaluated { found, violation }| Evaluation {
            value: found.criterion_um,
            // On the edge itself the violation is zero, but the inequalities are strict.
            violation: if found.feasible {
                0.0
            } else {
                violation.max(f64::MIN_POSITIVE)
            },
        },
    )
}

impl Objective {
    /// The objective of a run.
    ///
    /// # Errors
    ///
    /// A sentence: the model is missing or cannot be read, or the approach has no runs.
    pub(super) fn new(run: &Run) -> Result<Self, String> {
        let model = match (run.approach, run.model.as_deref()) {
            (Approach::Kriging, Some(json)) => Some(
                kriging::Surrogate::from_json(json)
                    .map_err(|error| format!("the kriging model cannot be read: {error}"))?,
            ),
            (Approach::Kriging, None) => return Err("the task brings no kriging model".to_owned()),
            (Approach::BestOfDoe | Approach::EnrichedKriging, _) => {
                return Err(format!("{} is chosen, not optimised", run.approach.name()));
            }
            _ => None,
        };
        Ok(Self {
            approach: run.approach,
            base: run.base.clone(),
            model,
        })
    }

    pub(super) const fn approach(&self) -> Approach {
        self.approach
    }

    /// The candidate at `unit` in the box of the search.
    pub(super) fn candidate(&self, problem: &Problem, seen: &Seen, unit: &[f64]) -> Candidate {
        let design = problem.point(self.approach, unit, &self.base);
        let model = self.model.as_ref();
        let predicted = design
            .as_ref()
            .and_then(|design| Some(model?.mean(&problem.free_values(design))));
        let may_improve = predicted.is_none_or(|criterion_um| seen.improves(criterion_um));
        // Without constraints there is nothing to ask about a design that is no improvement.
        let is_settled = predicted.is_some() && problem.criteria().is_empty() && !may_improve;
        Candidate {
            is_asked: design.is_some() && !is_settled,
            design,
            may_improve,
            predicted,
        }
    }

    /// The evaluation of a candidate; `answer` is none where it cannot be simulated or nothing was asked.
    ///
    /// The printed part of a run minimises the penalised objective (5), in which designs that cannot be
    /// simulated get the failure value. Without a penalty, in a direct search, and after the printed
    /// part, designs are ranked feasibility first.
    pub(super) fn evaluation(
        &self,
        problem: &Problem,
        seen: &mut Seen,
        candidate: &Candidate,
        answer: Option<Answer>,
        is_printed: bool,
    ) -> Evaluation {
        let evaluated = self.evaluated(problem, seen, candidate, answer);
        if !is_printed {
            return ranked(evaluated.as_ref());
        }
        // A design that breaks a constraint has no samples, so a direct search has nothing to penalise.
        let penalty = problem.penalty();
        let Some(penalty) = penalty.filter(|_| self.approach != Approach::Direct) else {
            let ranked = ranked(evaluated.as_ref());
            if let Some(evaluated) = evaluated {
                seen.keep(evaluated.violation, evaluated.found);
            }
            return ranked;
        };
        let Some(evaluated) = evaluated else {
            return penalty.failure_value.into();
        };
        let value = penalty.objective(evaluated.found.criterion_um, evaluated.violation);
        if !value.is_finite() {
            return penalty.failure_value.into();
        }
        seen.keep(value, evaluated.found);
        value.into()
    }

    /// What an answer says of a candidate, which is kept if it is the best feasible one so far; none when
    /// it cannot be simulated.
    fn evaluated(
        &self,
        problem: &Problem,
        seen: &mut Seen,
        candidate: &Candidate,
        answer: Option<Answer>,
    ) -> Option<Evaluated> {
        let design = candidate.design.clone()?;
        if !candidate.is_asked {
            return Some(Evaluated {
                found: Found {
                    design,
                    criterion_um: candidate.predicted?,
                    criteria: Criteria::new(Vec::new()),
                    feasible: true,
                },
                violation: 0.0,
            });
        }
        seen.simulator_calls += 1;
        let answer = answer?;
        let is_worn = matches!(self.approach, Approach::Baseline | Approach::Direct);
        // Archard's wear rests on the unworn analysis.
        seen.simulator_calls += u64::from(is_worn && problem.gears().is_some());
        seen.simulator_calls += u64::from(answer.worn.is_some()) + answer.samples_um.len() as u64;
        let analysis = answer.analysis;
        let violation = problem.violation(&analysis.criteria);
        let mut feasible = problem.is_feasible(&analysis.criteria);
        let criterion_um = match self.approach {
            // One that breaks a constraint is ranked by its violation alone.
            Approach::Direct if !feasible => 0.0,
            Approach::Direct => {
                let percentile = problem.campaign().sampling.verified(&answer.samples_um);
                percentile.map_or(f64::NAN, |percentile| percentile.p90)
            }
            _ => candidate.predicted.unwrap_or(analysis.value_um),
        };
        if !(criterion_um.is_finite() && violation.is_finite()) {
            return None;
        }
        let mut criteria = analysis.criteria;
        if let Some(worn) = answer.worn {
            feasible = problem.is_feasible(&worn);
            criteria = worn;
        }
        let found = Found {
            design,
            criterion_um,
            criteria,
            feasible,
        };
        if feasible && seen.improves(criterion_um) {
            seen.best = Some(found.clone());
        }
        Some(Evaluated { found, violation })
    }
}
