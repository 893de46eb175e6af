//! Conversions between the protocol's messages and the types of the programs.
//!
//! Everything that arrives is checked here: a [`Unit`], a [`Source`] or an [`Output`] read from a
//! message is valid.

use std::fmt;
use std::sync::Arc;

use ledger::{Generation, Grant, Kind, LeaseId, StreamId, Unit};
use problem::optimise::Answer;
use problem::simulator::Analysis;
use problem::task::{Candidate, Evaluation, Failure, Outcome, Output, Run, Source};
use problem::{Approach, Criteria, Design};
use stats::Samples;

use crate::protocol::v1;

/// The fault of a malformed message, as a sentence without its subject.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MalformedMessage(pub String);

impl fmt::Display for MalformedMessage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

fn malformed<T>(why: &str) -> Result<T, MalformedMessage> {
    Err(MalformedMessage(why.to_owned()))
}

impl From<LeaseId> for v1::LeaseId {
    fn from(LeaseId { epoch, number }: LeaseId) -> Self {
        Self { epoch, number }
    }
}

impl From<v1::LeaseId> for LeaseId {
    fn from(v1::LeaseId { epoch, number }: v1::LeaseId) -> Self {
        Self { epoch, number }
    }
}

impl From<&Unit> for v1::Unit {
    fn from(unit: &Unit) -> Self {
        let kind = match unit.stream.kind {
            Kind::Run => Self::kind_of(v1::Kind::Run),
            Kind::Design => Self::kind_of(v1::Kind::Design),
            Kind::Point => Self::kind_of(v1::Kind::Point),
        };
        Self {
            kind,
            index: unit.stream.index,
            generation: unit.generation.0,
            first: unit.samples.start,
            count: unit.samples.len() as u32,
        }
    }
}

impl v1::Unit {
    const fn kind_of(kind: v1::Kind) -> i32 {
        kind as i32
    }
}

impl TryFrom<&v1::Unit> for Unit {
    type Error = MalformedMessage;

    fn try_from(unit: &v1::Unit) -> Result<Self, MalformedMessage> {
        let kind = match unit.kind() {
            v1::Kind::Run => Kind::Run,
            v1::Kind::Design => Kind::Design,
            v1::Kind::Point => Kind::Point,
            v1::Kind::Unspecified => return malformed("has a unit without a kind"),
        };
        let Some(end) = unit.first.checked_add(unit.count) else {
            return malformed("has a sample index above 2³² − 1");
        };
        Ok(Self {
            stream: StreamId {
                kind,
                index: unit.index,
            },
            generation: Generation(unit.generation),
            samples: unit.first..end,
        })
    }
}

fn design_message(design: &Design) -> v1::Design {
    v1::Design {
        values: design.values().to_vec(),
        responses: Vec::new(),
    }
}

/// The message of a lease.
#[must_use]
pub fn lease(grant: &Grant<Arc<Source>>) -> v1::Lease {
    let mut lease = v1::Lease {
        id: Some(grant.lease.into()),
        seconds: grant.seconds,
        ..v1::Lease::default()
    };
    for (number, (unit, source)) in (0..).zip(&grant.units) {
        lease.units.push(unit.into());
        match &**source {
            Source::Design(design) | Source::Point(design) => {
                lease.designs.push(design_message(design));
            }
            Source::Analysed { design, responses } => lease.designs.push(v1::Design {
                responses: responses.clone(),
                ..design_message(design)
            }),
            Source::Run(run) => {
                lease.base = Some(design_message(&run.base));
                lease.from = run.from.as_ref().map(design_message);
                lease.models_json = run.models.iter().map(ToString::to_string).collect();
            }
            Source::Candidates(candidates) => {
                let wanted = candidates.iter();
                let wanted = wanted.filter(|one| unit.samples.contains(&one.evaluation));
                lease.candidates.extend(wanted.map(|one| v1::Candidate {
                    evaluation: one.evaluation,
                    design: Some(design_message(&one.design)),
                    may_improve: one.may_improve,
                    unit: number,
                }));
            }
        }
    }
    lease
}

impl v1::Lease {
    #[must_use]
    pub fn name(&self) -> LeaseId {
        self.id.unwrap_or_default().into()
    }

    /// The units to compute, each with the data that this takes.
    pub fn units(&self) -> Result<Vec<(Unit, Source)>, MalformedMessage> {
        let mut designs = self.designs.iter();
        let models: Vec<Arc<str>> = self
            .models_json
            .iter()
            .map(|json| (**json).into())
            .collect();
        let source = |(number, unit): (u32, &v1::Unit)| {
            let unit = Unit::try_from(unit)?;
            if self.candidates.iter().any(|one| one.unit == number) {
                let candidates = self.candidates(number, &unit)?;
                return Ok((unit, Source::Candidates(candidates)));
            }
            let mut design = || match designs.next() {
                Some(design) => Ok((Design::new(design.values.clone()), &design.responses)),
                None => malformed("lacks the design of a unit"),
            };
            let source = match unit.stream.kind {
                Kind::Design => match design()? {
                    (design, responses) if responses.is_empty() => Source::Design(design),
                    (design, responses) => Source::Analysed {
                        design,
                        responses: responses.clone(),
                    },
                },
                Kind::Point => Source::Point(design()?.0),
                Kind::Run => {
                    let (approach, start) = unit.stream.run_parts();
                    let Some(approach) = Approach::numbered(approach.into()) else {
                        return malformed("names an unknown approach");
                    };
                    let Some(base) = &self.base else {
                        return malformed("lacks the base of its run");
                    };
                    Source::Run(Run {
                        approach,
                        start,
                        base: Design::new(base.values.clone()),
                        models: models.clone(),
                        from: self
                            .from
                            .as_ref()
                            .map(|from| Design::new(from.values.clone())),
                    })
                }
            };
            Ok((unit, source))
        };
        (0..).zip(&self.units).map(source).collect()
    }

    /// The candidates of the unit with this number, one for each of its samples.
    fn candidates(&self, number: u32, unit: &Unit) -> Result<Vec<Candidate>, MalformedMessage> {
        let of_unit = || self.candidates.iter().filter(|one| one.unit == number);
        let evaluations = of_unit().map(|one| one.evaluation);
        if !evaluations.eq(unit.samples.clone()) {
            return malformed("lacks the candidate of a sample");
        }
        let candidates = of_unit().map(|one| {
            let Some(design) = &one.design else {
                return malformed("has a candidate without a design");
            };
            Ok(Candidate {
                evaluation: one.evaluation,
                design: Design::new(design.values.clone()),
                may_improve: one.may_improve,
            })
        });
        candidates.collect()
    }
}

/// The message of a unit's output, or of the failure of the unit as a whole. Its serial is zero.
#[must_use]
pub fn result(
    unit: &Unit,
    outcome: &Result<Option<Output>, String>,
    cpu_seconds: f64,
) -> v1::UnitResult {
    let mut result = v1::UnitResult {
        unit: Some(v1::Unit {
            count: 0,
            ..unit.into()
        }),
        cpu_seconds,
        ..v1::UnitResult::default()
    };
    match outcome {
        Ok(Some(Output::Design {
            responses,
            ruled_out,
            samples,
        })) => {
            result.responses.clone_from(responses);
            result.ruled_out.clone_from(ruled_out);
            result.samples = samples.values().to_vec();
            result.samples_count(samples.len() as u32);
        }
        Ok(Some(Output::Refused(reason))) => result.refused = Some(reason.clone()),
        Ok(Some(Output::Samples(samples))) => {
            result.samples = samples.values().to_vec();
            result.samples_count(samples.len() as u32);
        }
        Ok(Some(Output::Run(run))) => match serde_json::to_string(run) {
            Ok(json) => {
                result.run_json = Some(json);
                result.samples_count(1);
            }
            Err(error) => result.error = Some(format!("the run cannot be written: {error}")),
        },
        Ok(Some(Output::Evaluations(evaluated))) => {
            result.evaluated = evaluated.iter().map(evaluated_message).collect();
            result.samples_count(evaluated.len() as u32);
        }
        Ok(None) => {}
        Err(error) => result.error = Some(error.clone()),
    }
    result
}

/// The messages of a unit's outcome: one of its output, and one of the failure that ended it.
#[must_use]
pub fn results(unit: &Unit, computed: &Outcome, cpu_seconds: f64) -> Vec<v1::UnitResult> {
    let output = computed.output.clone().map(Some);
    let output = output.map(|output| result(unit, &Ok(output), cpu_seconds));
    let failure = computed
        .failure
        .as_ref()
        .map(|Failure { sample, error, .. }| {
            // A failure has the range of the sample that failed, or an empty one.
            let first = sample.unwrap_or(unit.samples.start);
            let of = Unit {
                samples: first..first + u32::from(sample.is_some()),
                ..unit.clone()
            };
            v1::UnitResult {
                unit: Some((&of).into()),
                error: Some(error.clone()),
                cpu_seconds: if output.is_some() { 0.0 } else { cpu_seconds },
                ..v1::UnitResult::default()
            }
        });
    output.into_iter().chain(failure).collect()
}

fn evaluated_message(evaluated: &Evaluation) -> v1::Evaluated {
    let mut message = v1::Evaluated {
        design: Some(design_message(&evaluated.design)),
        ..v1::Evaluated::default()
    };
    match &evaluated.answer {
        Ok(answer) => {
            message.value = answer.analysis.value;
            message.criteria = answer.analysis.criteria.values().to_vec();
            let worn = answer.worn.as_ref();
            message.worn_criteria = worn.map_or_else(Vec::new, |worn| worn.values().to_vec());
            let samples = answer.samples.as_ref();
            message.samples = samples.map_or_else(Vec::new, |samples| samples.values().to_vec());
        }
        Err(reason) => message.refused = Some(reason.clone()),
    }
    message
}

fn evaluated(message: &v1::Evaluated, width: usize) -> Result<Evaluation, MalformedMessage> {
    let Some(design) = &message.design else {
        return malformed("has an evaluation without a design");
    };
    let worn = &message.worn_criteria;
    let samples = match message.samples.is_empty() {
        true => None,
        false => Some(samples(&message.samples, width)?),
    };
    let answer = || Answer {
        analysis: Analysis {
            value: message.value,
            criteria: Criteria::new(message.criteria.clone()),
        },
        worn: (!worn.is_empty()).then(|| Criteria::new(worn.clone())),
        samples,
    };
    Ok(Evaluation {
        design: Design::new(design.values.clone()),
        answer: message.refused.clone().map_or_else(|| Ok(answer()), Err),
    })
}

impl v1::UnitResult {
    fn samples_count(&mut self, count: u32) {
        if let Some(unit) = &mut self.unit {
            unit.count = count;
        }
    }
}

/// Samples of `width` responses.
fn samples(values: &[f64], width: usize) -> Result<Samples, MalformedMessage> {
    match Samples::new(width, values.to_vec()) {
        Some(samples) => Ok(samples),
        None => malformed("has a sample without a value for each response"),
    }
}

/// The content of a result: the unit that it covers, and its output or the error. A sample has `width` responses.
pub fn output(
    result: &v1::UnitResult,
    width: usize,
) -> Result<(Unit, Result<Output, String>), MalformedMessage> {
    let Some(unit) = &result.unit else {
        return malformed("names no unit");
    };
    let unit = Unit::try_from(unit)?;
    let said = [&result.refused, &result.run_json, &result.error];
    let said = said.iter().filter(|text| text.is_some()).count();
    let said = said + usize::from(!result.evaluated.is_empty());
    let has_samples = !result.responses.is_empty() || !result.samples.is_empty();
    if said + usize::from(has_samples) != 1 {
        return malformed(
            "must hold exactly one of samples, a refusal, a run, evaluations and an error",
        );
    }
    if let Some(error) = &result.error {
        return Ok((unit, Err(error.clone())));
    }
    let output = match (unit.stream.kind, &result.run_json, &result.refused) {
        (Kind::Run | Kind::Point, None, None) if !result.evaluated.is_empty() => {
            let evaluated = result.evaluated.iter().map(|one| evaluated(one, width));
            Output::Evaluations(evaluated.collect::<Result<_, _>>()?)
        }
        (Kind::Run, Some(json), None) => match serde_json::from_str(json) {
            Ok(run) => Output::Run(run),
            Err(error) => return malformed(&format!("has a run that cannot be read: {error}")),
        },
        (Kind::Design, None, Some(reason)) => Output::Refused(reason.clone()),
        (Kind::Design, None, None) => Output::Design {
            responses: finite(&result.responses)?,
            ruled_out: result.ruled_out.clone(),
            samples: samples(&result.samples, width)?,
        },
        (Kind::Point, None, None) if result.responses.is_empty() => {
            Output::Samples(samples(&result.samples, width)?)
        }
        _ => return malformed("does not match its unit"),
    };
    let count = match &output {
        Output::Design { samples, .. } | Output::Samples(samples) => samples.len(),
        Output::Refused(_) => 0,
        Output::Run(_) => 1,
        Output::Evaluations(evaluated) => evaluated.len(),
    };
    if count != unit.samples.len() {
        return malformed("has a sample count that differs from its range");
    }
    Ok((unit, Ok(output)))
}

/// The responses of a design, if all are finite.
fn finite(responses: &[f64]) -> Result<Vec<f64>, MalformedMessage> {
    if responses.iter().all(|response| response.is_finite()) {
        return Ok(responses.to_vec());
    }
    malformed("has a response that is not a number")
}

#[cfg(test)]
mod tests {
    use ledger::{History, Ledger, Options, StreamDemand, WorkerId};
    use problem::Campaign;
    use problem::formulation::Problem;
    use problem::task::{Inputs, compute};

    use super::*;

    /// Leases of every kind are converted to messages and back, computed, and their results
    /// returned unchanged.
    #[test]
    fn leases_and_results_survive_bit_for_bit() {
        let mut campaign = Campaign::parse("paper.toml", Campaign::PAPER).unwrap();
        campaign.optimise.starts = 1;
        let problem = Problem::new(campaign);
        let base = problem.base().clone();
        let inputs = Inputs::new(problem.campaign(), None);
        let good = problem.design(&[0.25, 1.37, 1.37, 0.85, 1.31, 0.80], &base);
        let bad = problem.design(&[-1.0, -1.0, 1.0, 1.0, 1.0, 1.0], &base);
        let run = Run {
            approach: Approach::Kriging,
            start: 3,
            base,
            models: vec!["{}".into(), "[]".into()],
            from: Some(problem.design(&[0.1, 1.2, 1.3, 0.9, 1.0, 0.7], problem.base())),
        };
        let unit = Unit {
            stream: StreamId::design(2),
            generation: Generation(0),
            samples: 0..1,
        };
        let analysed = Source::Analysed {
            design: good.clone(),
            responses: match compute(&problem, &unit, &Source::Design(good.clone())) {
                Ok(Output::Design { responses, .. }) => responses,
                other => panic!("{other:?}"),
            },
        };
        let designs = [
            (StreamId::design(0), Source::Design(good.clone())),
            (StreamId::design(1), Source::Design(bad.clone())),
            (StreamId::design(2), analysed),
            (StreamId::point(2), Source::Point(good.clone())),
            (run.stream(), Source::Run(run)),
        ];
        travel(&problem, &inputs, &designs);
        // One candidate that may improve, and one that is not simulable.
        let candidates = [good.clone(), bad.clone()].map(|design| Candidate {
            evaluation: 0,
            design,
            may_improve: true,
        });
        for candidate in candidates {
            for approach in [Approach::Nominal, Approach::Kriging, Approach::Direct] {
                let stream = StreamId::run(approach.number() as u32, 1);
                let source = Source::Candidates(vec![candidate.clone()]);
                travel(&problem, &inputs, &[(stream, source)]);
            }
        }
        // Points, one of which is also an infill point that is analysed first.
        let asked = Candidate {
            evaluation: 0,
            design: good.clone(),
            may_improve: true,
        };
        let points = [
            (StreamId::point(7), Source::Point(good.clone())),
            (StreamId::point(8), Source::Candidates(vec![asked])),
            (StreamId::point(9), Source::Point(good.clone())),
        ];
        travel(&problem, &inputs, &points);
    }

    fn travel(problem: &Problem, inputs: &Inputs, sources: &[(StreamId, Source)]) {
        let mut ledger = Ledger::new(Options::default(), 5);
        let worker = WorkerId::from("a");
        ledger.register(&worker, "here", 4, std::time::Duration::ZERO);
        for (stream, source) in sources {
            ledger.want(StreamDemand {
                stream: *stream,
                generation: inputs.generation(*stream, source),
                source: Arc::new(source.clone()),
                samples: 1,
                missing: std::iter::once(0..1).collect(),
                history: History::default(),
                is_tolerant: false,
                is_analysed: true,
            });
        }
        let mut seen = 0;
        while let Some(grant) = ledger.lease(&worker, std::time::Duration::ZERO) {
            let message = lease(&grant);
            assert_eq!(message.name(), grant.lease);
            let units = message.units().unwrap();
            assert_eq!(units.len(), grant.units.len());
            for ((unit, source), (sent, sent_source)) in units.iter().zip(&grant.units) {
                assert_eq!((unit, source), (sent, &**sent_source));
                let computed = compute(problem, unit, source);
                let result = result(unit, &computed.clone().map(Some), 0.5);
                let (covered, read) = output(&result, 1).unwrap();
                assert_eq!(read, computed);
                // A design that is refused or ruled out has no samples.
                let count = match &computed {
                    Ok(Output::Design { samples, .. } | Output::Samples(samples)) => samples.len(),
                    Ok(Output::Run(_)) => 1,
                    Ok(Output::Evaluations(evaluated)) => evaluated.len(),
                    Ok(Output::Refused(_)) | Err(_) => 0,
                };
                assert_eq!(covered.samples.len(), count);
                seen += 1;
            }
        }
        assert_eq!(seen, sources.len());
    }

    #[test]
    fn nonsense_is_refused() {
        let unit = v1::Unit {
            kind: v1::Kind::Design.into(),
            count: 2,
            ..v1::Unit::default()
        };
        let good = v1::UnitResult {
            unit: Some(unit),
            responses: vec![1.0; 11],
            samples: vec![1.0; 2],
            ..v1::UnitResult::default()
        };
        assert!(output(&good, 1).is_ok());
        type Change = fn(&mut v1::UnitResult);
        let changes: [(Change, &str); 7] = [
            (|result| result.unit = None, "names no unit"),
            (
                |result| result.unit.as_mut().unwrap().kind = 9,
                "without a kind",
            ),
            (
                |result| result.unit.as_mut().unwrap().first = u32::MAX,
                "sample index",
            ),
            (|result| result.samples.push(1.0), "sample count"),
            (|result| result.responses[3] = f64::NAN, "not a number"),
            (|result| result.error = Some(String::new()), "exactly one"),
            (
                |result| result.unit.as_mut().unwrap().kind = v1::Kind::Point.into(),
                "does not match",
            ),
        ];
        for (change, why) in changes {
            let mut result = good.clone();
            change(&mut result);
            let refused = output(&result, 1).unwrap_err().to_string();
            assert!(refused.contains(why), "{refused:?} has no {why:?}");
        }
    }
}
