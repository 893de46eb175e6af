//! Optimiser runs on an external simulator: the coordinator holds the search, and workers evaluate a
//! generation of candidates at a time.
//!
//! The store keeps every evaluation, so a search is a function of its inputs and of what is stored.
//! The searches are kept in memory only so that they need not be computed again for each
//! generation.

use std::collections::BTreeMap;
use std::sync::Arc;

use ledger::{Generation, StreamDemand, StreamId};
use problem::Criteria;
use problem::formulation::Problem;
use problem::optimise::{Answer, Candidate, RunResult, Search};
use problem::simulator::Analysis;
use problem::task::{self, Inputs, Run, Source};
use stats::Samples;
use store::{EvaluationRow, Store};

/// The searches of a campaign.
#[derive(Default)]
pub struct Searches {
    held: BTreeMap<StreamId, RunningSearch>,
}

/// The progress of a search.
#[derive(Debug, Clone, PartialEq)]
pub struct Progress {
    /// The run.
    pub stream: StreamId,
    /// Evaluations so far.
    pub evaluations: u64,
    /// Number of evaluations at which the run ends, unless its optimum is infeasible then and the run continues.
    pub budget: u64,
    /// The improvements so far, as in [`RunResult`].
    pub history: Vec<(u64, f64)>,
}

/// The next step of a run.
pub enum Turn {
    /// Candidates are to be evaluated.
    Asks(StreamDemand<Arc<Source>>),
    /// The run is finished.
    Finished(Box<RunResult>),
    /// The store holds evaluations of another search, for example of another build, which are to be
    /// removed.
    Foreign,
}

struct RunningSearch {
    /// The digest of the run's inputs.
    of: Generation,
    search: Search,
    /// The current generation, whose first evaluation has this number.
    candidates: Vec<Candidate>,
    first: u32,
}

impl RunningSearch {
    fn new(problem: &Problem, run: &Run, of: Generation) -> Result<Self, String> {
        let mut search = Search::new(problem, run)?;
        Ok(Self {
            of,
            candidates: search.ask(problem),
            search,
            first: 0,
        })
    }

    /// The candidates that workers are to evaluate, with their evaluations' numbers.
    fn asked(&self) -> impl Iterator<Item = (u32, &Candidate)> {
        let numbered = (self.first..).zip(&self.candidates);
        numbered.filter(|(_, one)| one.is_asked && one.design.is_some())
    }
}

impl Searches {
    /// The progress of the running searches.
    pub fn progress(&self) -> impl Iterator<Item = Progress> {
        self.held.iter().map(|(stream, held)| Progress {
            stream: *stream,
            evaluations: held.search.evaluations(),
            budget: held.search.budget(),
            history: held.search.history(),
        })
    }

    /// Advances a run as far as the stored evaluations go.
    pub async fn turn(
        &mut self,
        store: &Store,
        problem: &Problem,
        inputs: &Inputs,
        run: &Run,
    ) -> anyhow::Result<Turn> {
        let stream = run.stream();
        let of = inputs.generation(stream, &Source::Run(run.clone()));
        let mut held = match self.held.remove(&stream) {
            Some(held) if held.of == of => held,
            _ => RunningSearch::new(problem, run, of).map_err(anyhow::Error::msg)?,
        };
        let rows = store.evaluations(stream, held.first.into()).await?;
        let mut rows: BTreeMap<u64, EvaluationRow> =
            rows.into_iter().map(|row| (row.evaluation, row)).collect();
        loop {
            let mut missing = Vec::new();
            for (evaluation, candidate) in held.asked() {
                match rows.get(&evaluation.into()) {
                    Some(row) => {
                        let design = candidate.design.as_ref();
                        if design.is_none_or(|design| design.values() != row.x) {
                            return Ok(Turn::Foreign);
                        }
                    }
                    None => missing.push(evaluation..evaluation + 1),
                }
            }
            if !missing.is_empty() {
                let wanted = wanted(inputs, stream, &held, missing);
                self.held.insert(stream, held);
                return Ok(Turn::Asks(wanted));
            }
            let numbers = u64::from(held.first)..;
            let answers = numbers.zip(&held.candidates);
            let answers = answers.map(|(number, _)| {
                let row = rows.remove(&number)?;
                answer(problem, row)
            });
            let answers: Vec<Option<Answer>> = answers.collect();
            let goes_on = held.search.answered(problem, &held.candidates, answers);
            if !goes_on.map_err(anyhow::Error::msg)? {
                return Ok(Turn::Finished(Box::new(held.search.result())));
            }
            held.first += held.candidates.len() as u32;
            held.candidates = held.search.ask(problem);
        }
    }
}

/// The request to workers: the candidates without a stored evaluation.
fn wanted(
    inputs: &Inputs,
    stream: StreamId,
    held: &RunningSearch,
    missing: Vec<std::ops::Range<u32>>,
) -> StreamDemand<Arc<Source>> {
    let candidates = held.asked().filter_map(|(evaluation, candidate)| {
        Some(task::Candidate {
            evaluation,
            design: candidate.design.clone()?,
            may_improve: candidate.may_improve,
        })
    });
    let source = Source::Candidates(candidates.collect());
    let end = held.first + held.candidates.len() as u32;
    StreamDemand {
        missing,
        ..inputs.wanted(stream, source, end)
    }
}

/// The answer in a row; `None` for a design that cannot be simulated.
fn answer(problem: &Problem, row: EvaluationRow) -> Option<Answer> {
    let criteria = Criteria::new(row.criteria?);
    Some(Answer {
        analysis: Analysis {
            value: row.value.unwrap_or(f64::NAN),
            criteria,
        },
        worn: row.worn_criteria.map(Criteria::new),
        samples: row
            .samples
            .and_then(|values| Samples::new(problem.sampled().len(), values)),
    })
}

/// The row of an evaluation, of a run or an infill point.
#[must_use]
pub fn row(stream: StreamId, evaluation: u32, evaluated: task::Evaluation) -> EvaluationRow {
    let mut row = EvaluationRow {
        stream,
        evaluation: evaluation.into(),
        x: evaluated.design.values().to_vec(),
        refused: None,
        value: None,
        criteria: None,
        worn_criteria: None,
        samples: None,
    };
    match evaluated.answer {
        Ok(answer) => {
            row.value = Some(answer.analysis.value).filter(|value| value.is_finite());
            row.criteria = Some(answer.analysis.criteria.values().to_vec());
            row.worn_criteria = answer.worn.map(|worn| worn.values().to_vec());
            row.samples = answer.samples.map(Samples::into_values);
        }
        Err(reason) => row.refused = Some(reason),
    }
    row
}
