//! The objective of a run, and its record of evaluated designs.

use std::sync::Arc;

use cmaes::Evaluation;
use stats::Samples;
use stats::streams::{Purpose, stream};

use super::{Run, Solution};
use crate::formulation::{Approach, Criteria, Design, Problem, ResponseMeasure};
use crate::simulator::{Analysis, NoAnswer, PreparedDesign, Simulator, State};

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
    /// The predictions, in a search on models.
    predicted: Option<Prediction>,
}

/// The models' predictions for a design.
#[derive(Debug, Clone, PartialEq)]
struct Prediction {
    /// The mean of the objective's model.
    criterion: f64,
    /// The means of the modelled quantities.
    modelled: Vec<f64>,
    /// The bounds of the measures that constraints limit.
    limited: Vec<f64>,
}

impl Prediction {
    /// The predicted criteria; `None` if the simulator is needed for them.
    fn criteria(&self, problem: &Problem) -> Option<Criteria> {
        let modelled = Criteria::new(self.modelled.clone());
        let is_complete = self.modelled.len() == problem.deterministic().len();
        is_complete.then(|| problem.with_limited(&modelled, &self.limited))
    }
}

/// The simulator's evaluation of a candidate.
#[derive(Debug, Clone, PartialEq)]
pub struct Answer {
    /// The analysis on which the approach's search is based.
    pub analysis: Analysis,
    /// The criteria in the baseline state, if a gear pair that was searched without wear must
    /// satisfy them with wear, too.
    pub worn: Option<Criteria>,
    /// The samples of a design that satisfies the deterministic constraints, in a direct search.
    pub samples: Option<Samples>,
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
    // An optimiser would take an implausible number for an optimum.
    problem
        .check_analysis(&analysis)
        .map_err(NoAnswer::Failed)?;
    let is_feasible = problem.is_feasible(&analysis.criteria);
    let mut answer = Answer {
        analysis,
        worn: None,
        samples: None,
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
        answer.samples = Some(draw(problem, prepared.as_mut())?);
    }
    Ok(answer)
}

/// The samples of a design in a direct search. A failed sample is tried again, after a sample that succeeded
/// before is computed once more to show that the simulator works. If it then fails at every attempt, it counts as
/// failed, provided that the campaign tolerates failures.
fn draw(problem: &Problem, design: &mut dyn PreparedDesign) -> Result<Samples, NoAnswer> {
    let campaign = problem.campaign();
    let (purpose, number) = COMMON;
    let mut one = |sample: usize| {
        let mut rng = stream(campaign.seed, purpose, number, sample as u64);
        let drawn = problem.sample_of(design.sample(&mut rng)?);
        let checked = problem.check_sample(&drawn);
        checked
            .map_err(|(name, why)| NoAnswer::Failed(format!("{name} of sample {sample} {why}")))?;
        Ok(drawn)
    };
    let is_result = campaign.is_external() && campaign.sampling.tolerates_failures();
    let mut samples = vec![problem.failed_sample(); campaign.sampling.samples_per_design as usize];
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
    let mut all = Samples::none(problem.sampled().len());
    samples.iter().for_each(|row| all.push(row));
    Ok(all)
}

/// The objective of one approach.
pub(super) struct Objective {
    approach: Approach,
    base: Design,
    /// In the order of [`Run::models`].
    models: Vec<kriging::Surrogate>,
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

/// The measure that is optimised, and the bounds of those that constraints limit, from a design's samples.
fn estimated(problem: &Problem, samples: &Samples) -> Option<(f64, Vec<f64>)> {
    let estimate = |measure: &ResponseMeasure| {
        let estimate = measure.sampling().estimate(&measure.values(samples)).ok()?;
        Some(estimate.chosen)
    };
    let bound = |measure: &ResponseMeasure| {
        let estimate = estimate(measure)?;
        Some(measure.bound(estimate.value, estimate.variance))
    };
    let criterion = estimate(problem.objective())?.value;
    let limited: Option<Vec<f64>> = problem.limited().iter().map(bound).collect();
    Some((criterion, limited?))
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
            // On a limit the violation is zero, but the constraint may be broken.
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
    /// A sentence: a model is missing or cannot be read, or the approach has no runs.
    pub(super) fn new(problem: &Problem, run: &Run) -> Result<Self, String> {
        if let Approach::BestOfDoe | Approach::EnrichedKriging = run.approach {
            return Err(format!("{} is chosen, not optimised", run.approach.name()));
        }
        let needed = match run.approach {
            Approach::Kriging => problem.measures().len() + problem.modelled().len(),
            _ => 0,
        };
        if run.models.len() != needed {
            let found = run.models.len();
            return Err(format!(
                "the task brings {found} kriging models, not {needed}"
            ));
        }
        let read = |json: &Arc<str>| {
            kriging::Surrogate::from_json(json)
                .map_err(|error| format!("the kriging model cannot be read: {error}"))
        };
        Ok(Self {
            approach: run.approach,
            base: run.base.clone(),
            models: run.models.iter().map(read).collect::<Result<_, _>>()?,
        })
    }

    pub(super) const fn approach(&self) -> Approach {
        self.approach
    }

    /// The candidate at the point `unit` of the search space.
    pub(super) fn candidate(&self, problem: &Problem, seen: &Record, unit: &[f64]) -> Candidate {
        let design = problem.point(self.approach, unit, &self.base);
        let predicted = design
            .as_ref()
            .and_then(|design| self.predicted(problem, design));
        let may_improve = predicted
            .as_ref()
            .is_none_or(|predicted| seen.improves(problem, predicted.criterion));
        // A design that is no improvement, or is predicted to violate a constraint, need not be evaluated.
        let is_settled = predicted.as_ref().is_some_and(|predicted| {
            let criteria = predicted.criteria(problem);
            criteria.is_some_and(|criteria| !may_improve || !problem.is_feasible(&criteria))
        });
        Candidate {
            is_asked: design.is_some() && !is_settled,
            design,
            may_improve,
            predicted,
        }
    }

    /// The predictions of the models; `None` without models.
    fn predicted(&self, problem: &Problem, design: &Design) -> Option<Prediction> {
        let (objective, others) = self.models.split_first()?;
        let x = problem.free_values(design);
        let (limited, modelled) = others.split_at_checked(problem.limited().len())?;
        let bound = |(measure, model): (&ResponseMeasure, &kriging::Surrogate)| {
            let predicted = model
                .predict_many(&x)
                .ok()
                .and_then(|all| all.first().copied());
            predicted.map_or(f64::NAN, |one| model.quantile(one, measure.safe_level()))
        };
        Some(Prediction {
            criterion: objective.mean(&x),
            modelled: modelled.iter().map(|model| model.mean(&x)).collect(),
            limited: problem.limited().iter().zip(limited).map(bound).collect(),
        })
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
        let predicted = candidate.predicted.as_ref();
        if !candidate.is_asked {
            let predicted = predicted?;
            let criteria = predicted.criteria(problem)?;
            let violation = problem.violation(&criteria);
            return Some(Assessment {
                found: Solution {
                    design,
                    criterion: predicted.criterion,
                    feasible: problem.is_feasible(&criteria),
                    criteria,
                },
                violation,
            });
        }
        seen.simulator_calls += 1;
        let answer = answer?;
        let is_worn = matches!(self.approach, Approach::Baseline | Approach::Direct);
        // The analysis with Archard's wear also takes the one without.
        seen.simulator_calls += u64::from(is_worn && problem.gears().is_some());
        let samples = answer.samples.as_ref();
        seen.simulator_calls += u64::from(answer.worn.is_some());
        seen.simulator_calls += samples.map_or(0, Samples::len) as u64;
        let analysis = answer.analysis;
        let (criterion, limited) = match (self.approach, samples, predicted) {
            // A design that violates a deterministic constraint is ranked by its violation alone.
            (Approach::Direct, None, _) => (0.0, Vec::new()),
            (Approach::Direct, Some(samples), _) => estimated(problem, samples)?,
            (_, _, Some(predicted)) => (predicted.criterion, predicted.limited.clone()),
            _ => (analysis.value, Vec::new()),
        };
        let mut criteria = problem.with_limited(&analysis.criteria, &limited);
        let violation = problem.violation(&criteria);
        let mut feasible = problem.is_feasible(&criteria);
        if !(criterion.is_finite() && violation.is_finite()) {
            return None;
        }
        if let Some(worn) = answer.worn {
            criteria = problem.with_limited(&worn, &limited);
            feasible = problem.is_feasible(&criteria);
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
