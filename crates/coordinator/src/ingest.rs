//! The conversion of reported results to rows of the store.

use campaign::formulation::Problem;
use campaign::task::{Evaluated, Output};
use ledger::{Kind, StreamId, Unit};
use protocol::v1::UnitResult;
use stages::names::{run_name, run_stream_name, stream_name, time_key};
use stages::{derived, searching};
use store::{Batch, CriteriaRow, JobTimeRow, OptimiserRunRow, PointSampleRow, SampleRow};

/// The result of one unit, read and checked.
#[derive(Debug, Clone, PartialEq)]
pub struct Read {
    /// The unit.
    pub unit: Unit,
    /// The rows to store, or the error of a failed job.
    pub rows: Result<Batch, String>,
    /// Whether the design gets no samples: it is not simulable, or was ruled out.
    pub is_refused: bool,
    /// The worker's number of the failure, if the worker gave one.
    pub serial: Option<u64>,
}

/// Reason for refusing the result of an unknown point.
const UNKNOWN_POINT: &str = "is of a point that was not asked for";

/// Reads the result of a unit and converts it to rows. Numbers that are not plausible are a
/// failure. `point` returns the name of a point in the store.
///
/// # Errors
///
/// The message does not say which unit it is about. The error is a phrase without its subject.
pub fn read(
    problem: &Problem,
    result: &UnitResult,
    point: impl Fn(StreamId) -> Option<String>,
) -> Result<Read, protocol::Malformed> {
    let named = |stream, why: &str| format!("{}: {why}", stream_name(stream));
    let (unit, output) = match protocol::output(result) {
        Ok(read) => read,
        Err(malformed) => {
            // A malformed result counts as a failure of its stream.
            let unit = result.unit.as_ref().map(Unit::try_from);
            match unit {
                Some(Ok(unit)) => {
                    let why = format!("the worker's result {malformed}");
                    let error = named(unit.stream, &why);
                    (unit, Err(error))
                }
                _ => return Err(malformed),
            }
        }
    };
    let is_refused = matches!(
        &output,
        Ok(Output::Refused(_)
            | Output::Design {
                ruled_out: Some(_),
                ..
            })
    );
    let is_time = result.cpu_seconds.is_finite() && result.cpu_seconds >= 0.0;
    let cpu_seconds = if is_time { result.cpu_seconds } else { 0.0 };
    let rows = output.and_then(|output| {
        let rows = rows(problem, &unit, output, cpu_seconds, &point);
        rows.map_err(|why| named(unit.stream, &why))
    });
    Ok(Read {
        unit,
        rows,
        is_refused,
        serial: (result.serial > 0).then_some(result.serial),
    })
}

/// The rows of a unit's output.
///
/// # Errors
///
/// The output is implausible, or not what the unit asks for.
pub(crate) fn rows(
    problem: &Problem,
    unit: &Unit,
    output: Output,
    cpu_seconds: f64,
    point: impl Fn(StreamId) -> Option<String>,
) -> Result<Batch, String> {
    let mut batch = Batch::default();
    let stream = unit.stream;
    let numbered = |samples: &[f64]| {
        let numbered: Vec<(u64, f64)> = (u64::from(unit.samples.start)..)
            .zip(samples.iter().copied())
            .collect();
        let name = &problem.sampled().name;
        for (sample, value) in &numbered {
            let checked = problem.check_sample(*value);
            checked.map_err(|why| format!("{name} of sample {sample} {why}"))?;
        }
        Ok::<_, String>(numbered)
    };
    match output {
        Output::Refused(reason) => batch.criteria.push(CriteriaRow {
            design: stream.index,
            simulable: false,
            reason: Some(reason),
            ..CriteriaRow::default()
        }),
        Output::Design {
            responses,
            ruled_out,
            samples,
        } => {
            problem.check_responses(&responses)?;
            batch.criteria.push(CriteriaRow {
                design: stream.index,
                simulable: true,
                reason: ruled_out,
                responses: Some(responses),
            });
            let row = |(sample, delta_ste_um)| SampleRow {
                design: stream.index,
                sample,
                value: delta_ste_um,
            };
            batch.samples = numbered(&samples)?.into_iter().map(row).collect();
        }
        Output::Samples(samples) => {
            let point = point(stream).ok_or(UNKNOWN_POINT)?;
            batch.only_for = Some((point.clone(), unit.generation.0));
            let row = |(sample, delta_ste_um)| PointSampleRow {
                point: point.clone(),
                sample,
                value: delta_ste_um,
            };
            batch.points = numbered(&samples)?.into_iter().map(row).collect();
        }
        Output::Run(run) => {
            if StreamId::run(run.approach.number() as u32, run.start) != stream {
                return Err("the worker's result is another run's".to_owned());
            }
            let name = run_name(run.approach, run.start);
            batch.only_for = Some((name, unit.generation.0));
            let row = OptimiserRunRow {
                approach: run.approach.name().to_owned(),
                start: u64::from(run.start),
                result_json: serde_json::to_string(&run)
                    .map_err(|error| format!("the run cannot be written: {error}"))?,
                simulator_calls: run.simulator_calls,
                cpu_seconds,
            };
            let inputs = derived::generation_inputs(unit.generation);
            batch.derivations.push(derived::of_run(inputs, &row));
            batch.runs.push(row);
        }
        Output::Evaluations(evaluated) => {
            let name = match stream.kind {
                Kind::Point => point(stream).ok_or(UNKNOWN_POINT)?,
                _ => run_stream_name(stream).ok_or("is of an approach that there is not")?,
            };
            batch.only_for = Some((name.clone(), unit.generation.0));
            for (evaluation, evaluated) in unit.samples.clone().zip(evaluated) {
                let checked = check_evaluation(problem, &evaluated);
                checked.map_err(|why| format!("evaluation {evaluation} {why}"))?;
                let row = searching::row(name.clone(), evaluation, evaluated);
                batch.evaluations.push(row);
            }
        }
    }
    batch.times.push(JobTimeRow {
        job: time_key(unit),
        cpu_seconds,
    });
    Ok(batch)
}

/// Checks the numbers of a candidate. The error is a phrase without its subject.
fn check_evaluation(problem: &Problem, evaluated: &Evaluated) -> Result<(), String> {
    let Ok(answer) = &evaluated.answer else {
        return Ok(());
    };
    let expected = problem.criteria().len();
    let all = [Some(&answer.analysis.criteria), answer.worn.as_ref()];
    for criteria in all.into_iter().flatten() {
        let values = criteria.values();
        if values.len() != expected {
            return Err(format!("has {} criteria, not {expected}", values.len()));
        }
        if let Some(value) = values.iter().find(|value| !value.is_finite()) {
            return Err(format!("has a criterion that is {value}"));
        }
    }
    let mut samples = answer.samples.iter();
    samples.try_for_each(|sample| problem.check_sample(*sample))
}

#[cfg(test)]
mod tests {
    use campaign::optimise::Answer;
    use campaign::simulator::Analysis;
    use campaign::{Approach, Campaign, Criteria};
    use ledger::Generation;
    use stages::names::{is_time_of_run, timed};

    use super::*;

    fn problem() -> Problem {
        Problem::new(Campaign::parse("paper.toml", Campaign::PAPER).unwrap())
    }

    fn unit(stream: StreamId, samples: std::ops::Range<u32>) -> Unit {
        Unit {
            stream,
            generation: Generation(0xabcd_0000_1234),
            samples,
        }
    }

    fn of(unit: &Unit, outcome: Result<Output, String>) -> Read {
        let sent = protocol::result(unit, &outcome.map(Some), f64::NAN);
        read(&problem(), &sent, |_| Some("kriging".to_owned())).unwrap()
    }

    #[test]
    fn a_refused_design_becomes_a_row_with_its_reason() {
        let design = unit(StreamId::design(7), 0..30);
        let read = of(&design, Ok(Output::Refused("contact-gap: no".to_owned())));
        assert!(read.is_refused && read.unit.samples.is_empty());
        let batch = read.rows.unwrap();
        assert!(!batch.criteria[0].simulable);
        assert_eq!(batch.criteria[0].reason.as_deref(), Some("contact-gap: no"));
        assert_eq!(batch.times[0].cpu_seconds, 0.0);
        assert_eq!(timed(batch.times[0].job), Some((Kind::Design, 7)));
    }

    #[test]
    fn evaluations_of_a_run_are_stored_for_its_generation_and_checked() {
        let run = unit(StreamId::run(2, 1), 30..32);
        let problem = problem();
        let answer = |criteria: usize| Answer {
            analysis: Analysis {
                value: 1.5,
                criteria: Criteria::new(vec![1.0; criteria]),
            },
            worn: None,
            samples: Vec::new(),
        };
        let of_answers = |answers: [Result<Answer, String>; 2]| {
            let evaluated = answers.map(|answer| Evaluated {
                design: problem.base().clone(),
                answer,
            });
            of(&run, Ok(Output::Evaluations(evaluated.to_vec()))).rows
        };
        let refused = Err("involute: no".to_owned());
        let batch = of_answers([Ok(answer(problem.criteria().len())), refused.clone()]).unwrap();
        let name = "run archard 1".to_owned();
        assert_eq!(batch.only_for, Some((name, 0xabcd_0000_1234)));
        let numbers: Vec<u64> = batch.evaluations.iter().map(|row| row.evaluation).collect();
        assert_eq!(numbers, [30, 31]);
        assert_eq!(batch.evaluations[0].value, Some(1.5));
        assert_eq!(
            batch.evaluations[1].refused.as_deref(),
            Some("involute: no")
        );
        assert!(is_time_of_run(batch.times[0].job, Approach::Baseline, 1));
        let error = of_answers([Ok(answer(3)), refused]).unwrap_err();
        assert!(error.contains("evaluation 30 has 3 criteria"), "{error}");
    }

    #[test]
    fn samples_of_a_point_are_stored_for_their_generation_only() {
        let point = unit(StreamId::point(3), 5..7);
        let batch = of(&point, Ok(Output::Samples(vec![1.0, 2.0])))
            .rows
            .unwrap();
        assert_eq!(
            batch.only_for,
            Some(("kriging".to_owned(), 0xabcd_0000_1234))
        );
        let samples: Vec<u64> = batch.points.iter().map(|row| row.sample).collect();
        assert_eq!(samples, [5, 6]);
        assert_eq!(timed(batch.times[0].job), Some((Kind::Point, 3)));
    }

    #[test]
    fn numbers_that_cannot_be_are_a_failure_of_their_stream() {
        let point = unit(StreamId::point(3), 5..7);
        for (absurd, shown) in [(-5.0, "-5e0"), (1e308, "1e308"), (f64::NAN, "NaN")] {
            let read = of(&point, Ok(Output::Samples(vec![1.0, absurd])));
            let error = read.rows.unwrap_err();
            let expected = format!("verify-kriging: delta_ste_um of sample 6 is {shown} µm");
            assert!(error.starts_with(&expected), "{error}");
        }
        let mut nonsense = protocol::result(&point, &Ok(None), 0.0);
        let error = read(&problem(), &nonsense, |_| None)
            .unwrap()
            .rows
            .unwrap_err();
        assert!(error.contains("the worker's result must be"), "{error}");
        nonsense.unit = None;
        assert!(read(&problem(), &nonsense, |_| None).is_err());
    }
}
