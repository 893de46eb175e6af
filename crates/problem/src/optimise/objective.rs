//! The objective of a run, and its record of evaluated designs.

use cmaes::Evaluation;
use stats::streams::{Purpose, stream};

use super::{Run, Solution};
use crate::formulation::{Approach, Criteria, Design, Problem};
use crate::simulator::{Analysis, NoAnswer, Prepared, Simulator, State};

/// The violation of a design that is not simulable in feasibility-first ranking: larger than that
/// of any simulable design.
const FAILURE_VIOLATION: f64 = 1e300;

/// The random streams common to all designs of a direct search, so that two designs differ only in
/// their variables and not by chance. The designs of a campaign have numbers below 2³².
pub const COMMON: (Purpose, u64) = (Purpose::Wear, 1 << 40);

/// A design that a search wants evaluated.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    /// The design; `None` if no design exists at the point of the search space.
    pub design: Option<Design>,
    /// Whether the simulator is needed.
    pub is_asked: bool,
    /// Whether it may be the best design so far, as far as is known without the simulator.
    pub may_improve: bool,
    /// The model's mean, in a search on a model.
    predicted: Option<f64>,
}

/// The simulator's evaluation of a candidate.
#[derive(Debug, Clone, PartialEq)]
pub struct Answer {
    /// The analysis on which the approach's search is based.
    pub analysis: Analysis,
    /// The criteria in the baseline state, if a gear pair that was searched without wear must
    /// satisfy them with wear, too.
    pub worn: Option<Criteria>,
    /// The samples of a feasible design, in a direct search.
    pub samples: Vec<f64>,
}

/// Evaluates a design that an approach may end at. `may_improve` says whether it may be the best
/// design so far.
///
/// # Errors
///
/// The design is not simulable, or the simulator failed.
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
        samples: Vec::new(),
    };
    if !is_feasible {
        return Ok(answer);
    }
    if approach == Approach::Kriging && may_improve && problem.gears().is_some() {
        // The search uses the pressure of the unworn pair, one call as in the paper. A design that
        // is kept as an optimum must also satisfy the limit with wear, which costs an occasional
        // call.
        answer.worn = Some(prepared.analyse(State::Baseline)?.criteria);
    }
    if approach == Approach::Direct {
        answer.samples = draw(problem, prepared.as_mut())?;
    }
    Ok(answer)
}

/// The samples of a design in a direct search. A failed sample is tried again, after a sample that succeeded
/// before is computed once more to show that the simulator works. If it then fails at every attempt, it counts as
/// failed, provided that the campaign tolerates failures.
fn draw(problem: &Problem, design: &mut dyn Prepared) -> Result<Vec<f64>, NoAnswer> {
    let campaign = problem.campaign();
    let (purpose, number) = COMMON;
    let mut one = |sample: usize| {
        let mut rng = stream(campaign.seed, purpose, number, sample as u64);
        let drawn = problem.sample_of(design.sample(&mut rng)?);
        let name = &problem.sampled().name;
        let checked = problem.check_sample(drawn);
        checked.map_err(|why| NoAnswer::Failed(format!("{name} of sample {sample} {why}")))?;
        Ok(drawn)
    };
    let is_result = campaign.is_external() && campaign.sampling.tolerates_failures();
    let mut samples =
        vec![campaign.sampling.failed_sample(); campaign.sampling.samples_per_design as usize];
    let mut failed = Vec::new();
    for (sample, value) in samples.iter_mut().enumerate() {
        match one(sample) {
            Ok(drawn) => *value = drawn,
            Err(error @ NoAnswer::Failed(_)) if is_result => failed.push((sample, error)),
            Err(error) => return Err(error),
        }
    }
    if failed.len() == samples.len()
        && let Some((_, error)) = failed.pop()
    {
        return Err(error);
    }
    for _ in 1..campaign.simulator.attempts() {
        let Some((_, error)) = failed.first() else {
            break;
        };
        let has_failed = |sample: &usize| failed.iter().any(|(other, _)| other == sample);
        let control = (0..samples.len()).find(|sample| !has_failed(sample));
        if control.is_none_or(|sample| one(sample).is_err()) {
            return Err(error.clone());
        }
        for (sample, error) in std::mem::take(&mut failed) {
            match one(sample) {
                Ok(drawn) => samples[sample] = drawn,
                Err(NoAnswer::Failed(_)) => failed.push((sample, error)),
                Err(machine) => return Err(machine),
            }
        }
    }
    Ok(samples)
}

/// The objective of one approach.
pub(super) struct Objective {
    approach: Approach,
    base: Design,
    model: Option<kriging::Surrogate>,
}

/// A run's record of the designs that it has evaluated.
#[derive(Debug, Clone, Default)]
pub(super) struct Record {
    pub(super) simulator_calls: u64,
    /// The best design by the penalised objective, or the one with the smallest violation if there
    /// is no penalty, with its value.
    pub(super) printed: Option<(f64, Solution)>,
    /// The best feasible design.
    pub(super) best: Option<Solution>,
}

/// An evaluated design.
struct Assessment {
    found: Solution,
    violation: f64,
}

impl Record {
    /// Records a design of the printed part of a run, if its value is the best.
    fn keep(&mut self, value: f64, found: Solution) {
        if self.printed.as_ref().is_none_or(|(best, _)| value < *best) {
            self.printed = Some((value, found));
        }
    }

    /// Whether a design with this criterion would be the best feasible one so far.
    fn improves(&self, problem: &Problem, criterion: f64) -> bool {
        let best = self.best.as_ref();
        best.is_none_or(|best| problem.cost(criterion) < problem.cost(best.criterion))
    }
}

/// The evaluation of a design for feasibility-first ranking; `None` stands for a design that is not
/// simulable.
fn ranked(problem: &Problem, evaluated: Option<&Assessment>) -> Evaluation {
    evaluated.map_or(
        Evaluation {
            value: 0.0,
            violation: FAILURE_VIOLATION,
        },
        |Assessment { found, violation }| Evaluation {
            value: problem.cost(found.criterion),
            // On the boundary the violation is zero, but the inequalities are strict.
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

    /// The candidate at the point `unit` of the search space.
    pub(super) fn candidate(&self, problem: &Problem, seen: &Record, unit: &[f64]) -> Candidate {
        let design = problem.point(self.approach, unit, &self.base);
        let model = self.model.as_ref();
        let predicted = design
            .as_ref()
            .and_then(|design| Some(model?.mean(&problem.free_values(design))));
        let may_improve = predicted.is_none_or(|criterion| seen.improves(problem, criterion));
        // Without constraints a design that is no improvement need not be evaluated.
        let is_settled = predicted.is_some() && problem.criteria().is_empty() && !may_improve;
        Candidate {
            is_asked: design.is_some() && !is_settled,
            design,
            may_improve,
            predicted,
        }
    }

    /// The evaluation of a candidate. `answer` is `None` if it is not simulable or need not be
    /// evaluated.
    ///
    /// The printed part of a run minimises the penalised objective (5), in which designs that are
    /// not simulable get the failure value. Without a penalty, in a direct search, and after the
    /// printed part, designs are ranked feasibility first.
    pub(super) fn evaluation(
        &self,
        problem: &Problem,
        seen: &mut Record,
        candidate: &Candidate,
        answer: Option<Answer>,
        is_printed: bool,
    ) -> Evaluation {
        let evaluated = self.evaluated(problem, seen, candidate, answer);
        if !is_printed {
            return ranked(problem, evaluated.as_ref());
        }
        // An infeasible design has no samples, so a direct search cannot use the penalty.
        let penalty = problem.penalty();
        let Some(penalty) = penalty.filter(|_| self.approach != Approach::Direct) else {
            let ranked = ranked(problem, evaluated.as_ref());
            if let Some(evaluated) = evaluated {
                seen.keep(evaluated.violation, evaluated.found);
            }
            return ranked;
        };
        let Some(evaluated) = evaluated else {
            return penalty.failure_value.into();
        };
        let value = penalty.objective(problem.cost(evaluated.found.criterion), evaluated.violation);
        if !value.is_finite() {
            return penalty.failure_value.into();
        }
        seen.keep(value, evaluated.found);
        value.into()
    }

    /// The evaluated design of an answer, which is recorded if it is the best feasible one so far;
    /// `None` if it is not simulable.
    fn evaluated(
        &self,
        problem: &Problem,
        seen: &mut Record,
        candidate: &Candidate,
        answer: Option<Answer>,
    ) -> Option<Assessment> {
        let design = candidate.design.clone()?;
        if !candidate.is_asked {
            return Some(Assessment {
                found: Solution {
                    design,
                    criterion: candidate.predicted?,
                    criteria: Criteria::new(Vec::new()),
                    feasible: true,
                },
                violation: 0.0,
            });
        }
        seen.simulator_calls += 1;
        let answer = answer?;
        let is_worn = matches!(self.approach, Approach::Baseline | Approach::Direct);
        // The analysis with Archard's wear also takes the one without.
        seen.simulator_calls += u64::from(is_worn && problem.gears().is_some());
        seen.simulator_calls += u64::from(answer.worn.is_some()) + answer.samples.len() as u64;
        let analysis = answer.analysis;
        let violation = problem.violation(&analysis.criteria);
        let mut feasible = problem.is_feasible(&analysis.criteria);
        let criterion = match self.approach {
            // An infeasible design is ranked by its violation alone.
            Approach::Direct if !feasible => 0.0,
            Approach::Direct => {
                let estimate = problem.campaign().sampling.estimate(&answer.samples);
                estimate.map_or(f64::NAN, |estimate| estimate.chosen.value)
            }
            _ => candidate.predicted.unwrap_or(analysis.value),
        };
        if !(criterion.is_finite() && violation.is_finite()) {
            return None;
        }
        let mut criteria = analysis.criteria;
        if let Some(worn) = answer.worn {
            feasible = problem.is_feasible(&worn);
            criteria = worn;
        }
        let found = Solution {
            design,
            criterion,
            criteria,
            feasible,
        };
        if feasible && seen.improves(problem, criterion) {
            seen.best = Some(found.clone());
        }
        Some(Assessment { found, violation })
    }
}
