//! The requests to workers for the next steps.

use std::sync::Arc;

use ledger::{StreamDemand, StreamId};
use problem::formulation::Problem;
use problem::task::{Inputs, Source};

use crate::constraints;
use crate::plan::Next;
use crate::state::OpenDesign;

/// Requests to workers.
#[derive(Debug, Clone, Default)]
pub struct Requests {
    /// The streams, each with its missing units.
    pub streams: Vec<StreamDemand<Arc<Source>>>,
    /// The generations of runs and points: the store accepts no others.
    pub generations: Vec<(StreamId, u64)>,
}

/// The requests of `next`; `open` are the designs that lack samples. The runs of an external
/// simulator are not among them: those are [asked for by generations](crate::searching).
#[must_use]
pub fn requests(problem: &Problem, inputs: &Inputs, next: &Next, open: &[OpenDesign]) -> Requests {
    let mut requests = Requests::default();
    let whole_runs = (!problem.campaign().is_external()).then_some(&next.runs);
    for run in whole_runs.into_iter().flatten() {
        let wanted = inputs.wanted(run.stream(), Source::Run(run.clone()), 1);
        requests.add(wanted);
    }
    if let Some(base) = &next.sampling {
        for design in open {
            let at = problem.design(&design.x, base);
            let source = match &design.responses {
                Some(responses) => Source::Analysed {
                    design: at,
                    responses: responses.clone(),
                },
                None => Source::Design(at),
            };
            // Missing criteria are computed together with samples, so an open design always has samples to request.
            let stream = StreamId::design(design.design);
            let mut wanted = inputs.wanted(stream, source, design.samples);
            wanted.missing.clone_from(&design.missing);
            // There is nothing to analyse, or the campaign file has the responses.
            let own = problem.own_responses(design.design.into());
            wanted.is_analysed |= problem.responses().is_empty() || own.is_some();
            requests.streams.push(wanted);
        }
    }
    for point in &next.points {
        let stream = StreamId::point(point.number);
        let wanted = if point.asks_criteria {
            constraints::request(inputs, point)
        } else {
            let source = Source::Point(point.design.clone());
            let missing = ledger::gaps(&point.stored, point.wanted);
            StreamDemand {
                missing,
                ..inputs.wanted(stream, source, point.wanted)
            }
        };
        requests.add(wanted);
    }
    requests
}

impl Requests {
    /// Adds a stream whose results depend on its generation.
    pub fn add(&mut self, wanted: StreamDemand<Arc<Source>>) {
        self.generations.push((wanted.stream, wanted.generation.0));
        self.streams.push(wanted);
    }
}
