//! The conversion of reported results to rows of the store.

use crate::outside;
use crate::protocol::v1::UnitResult;
use ledger::{StreamId, Unit};
use problem::formulation::Problem;
use problem::task::{Evaluation, Output};
use stages::names::{stream_name, time_part};
use stages::{derived, searching};
use stats::Samples;
use store::{Batch, CriteriaRow, JobTimeRow, OptimiserRunRow, SampleBlock};

/// The result of one unit, read and checked.
#[derive(Debug, Clone, PartialEq)]
pub struct CheckedResult {
    pub unit: Unit,
    /// The rows to store, or the error of a failed job.
    pub rows: Result<Batch, String>,
    /// Whether the design gets no samples: it is not simulable, or was ruled out.
    pub is_refused: bool,
    /// The worker's number of the failure, if the worker gave one.
    pub serial: Option<u64>,
}

/// Reads the result of a unit and converts it to rows. Numbers that are not plausible are a
/// failure.
///
/// # Errors
///
/// The message names no valid unit. The error is a phrase without its subject.
pub fn read(
    problem: &Problem,
    result: &UnitResult,
) -> Result<CheckedResult, crate::protocol::MalformedMessage> {
    let named = |stream, why: &str| format!("{}: {why}", stream_name(stream));
    let (unit, output) = match crate::protocol::output(result, problem.sampled().len()) {
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
        let rows = rows(problem, &unit, output, cpu_seconds);
        rows.map_err(|why| named(unit.stream, &why))
    });
    Ok(CheckedResult {
        unit,
        rows,
        is_refused,
        serial: (result.serial > 0).then_some(result.serial),
    })
}

/// The rows of a unit's output.
pub(crate) fn rows(
    problem: &Problem,
    unit: &Unit,
    output: Output,
    cpu_seconds: f64,
) -> Result<Batch, String> {
    let mut batch = Batch::default();
    let stream = unit.stream;
    let block = |samples: Samples| {
        let first_sample = u64::from(unit.samples.start);
        for (sample, values) in (first_sample..).zip(samples.rows()) {
            let checked = problem.check_sample(values);
            checked.map_err(|(name, why)| format!("{name} of sample {sample} {why}"))?;
        }
        Ok::<_, String>(SampleBlock {
            stream,
            first_sample,
            samples,
        })
    };
    match output {
        Output::Refused(reason) => batch.criteria.push(CriteriaRow {
            design: stream.index,
            simulable: false,
            reason: Some(outside::reason(&reason)),
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
                reason: ruled_out.map(|reason| outside::reason(&reason)),
                responses: Some(responses),
            });
            batch.samples.push(block(samples)?);
        }
        Output::Samples(samples) => {
            batch.only_for = Some((stream, unit.generation.0));
            batch.samples.push(block(samples)?);
        }
        Output::Run(run) => {
            if StreamId::run(run.approach.number() as u32, run.start) != stream {
                return Err("the result belongs to another run".to_owned());
            }
            batch.only_for = Some((stream, unit.generation.0));
            let row = OptimiserRunRow {
                stream,
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
            batch.only_for = Some((stream, unit.generation.0));
            for (evaluation, mut evaluated) in unit.samples.clone().zip(evaluated) {
                evaluated.answer = evaluated.answer.map_err(|reason| outside::reason(&reason));
                let checked = check_evaluation(problem, &evaluated);
                checked.map_err(|why| format!("evaluation {evaluation} {why}"))?;
                let row = searching::row(stream, evaluation, evaluated);
                batch.evaluations.push(row);
            }
        }
    }
    batch.times.push(JobTimeRow {
        stream,
        part: time_part(unit),
        cpu_seconds,
    });
    Ok(batch)
}

/// Checks the numbers of a candidate. The error is a phrase without its subject.
fn check_evaluation(problem: &Problem, evaluated: &Evaluation) -> Result<(), String> {
    let Ok(answer) = &evaluated.answer else {
        return Ok(());
    };
    let expected = problem.deterministic().len();
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
    if problem.has_baseline() {
        let checked = problem.check_baseline(answer.analysis.value);
        let name = &problem.objective().response.name;
        checked.map_err(|why| format!("has a {name} that {why}"))?;
    }
    let mut samples = answer.samples.iter().flat_map(Samples::rows);
    samples.try_for_each(|values| {
        let checked = problem.check_sample(values);
        checked.map_err(|(name, why)| format!("has a {name} that {why}"))
    })
}

#[cfg(test)]
mod tests {
    use ledger::Generation;
    use problem::optimise::Answer;
    use problem::simulator::Analysis;
    use problem::{Campaign, Criteria};

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

    fn of(unit: &Unit, outcome: Result<Output, String>) -> CheckedResult {
        let sent = crate::protocol::result(unit, &outcome.map(Some), f64::NAN);
        read(&problem(), &sent).unwrap()
    }

    #[test]
    fn a_refused_design_becomes_a_row_with_its_reason() {
        let design = unit(StreamId::design(7), 0..30);
        let read = of(
            &design,
            Ok(Output::Refused("contact-gap: \u{1b}[1m\nno".to_owned())),
        );
        assert!(read.is_refused && read.unit.samples.is_empty());
        let batch = read.rows.unwrap();
        assert!(!batch.criteria[0].simulable);
        assert_eq!(
            batch.criteria[0].reason.as_deref(),
            Some("contact-gap: ␛[1m⏎no")
        );
        assert_eq!(batch.times[0].cpu_seconds, 0.0);
        assert_eq!(batch.times[0].stream, design.stream);
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
            samples: None,
        };
        let of_answers = |answers: [Result<Answer, String>; 2]| {
            let evaluated = answers.map(|answer| Evaluation {
                design: problem.base().clone(),
                answer,
            });
            of(&run, Ok(Output::Evaluations(evaluated.to_vec()))).rows
        };
        let refused = Err("involute:\tno".to_owned());
        let batch = of_answers([Ok(answer(problem.criteria().len())), refused.clone()]).unwrap();
        assert_eq!(batch.only_for, Some((run.stream, 0xabcd_0000_1234)));
        let numbers: Vec<u64> = batch.evaluations.iter().map(|row| row.evaluation).collect();
        assert_eq!(numbers, [30, 31]);
        assert_eq!(batch.evaluations[0].value, Some(1.5));
        assert_eq!(
            batch.evaluations[1].refused.as_deref(),
            Some("involute: no")
        );
        assert_eq!(batch.times[0].stream, run.stream);
        let error = of_answers([Ok(answer(3)), refused]).unwrap_err();
        assert!(error.contains("evaluation 30 has 3 criteria"), "{error}");
    }

    #[test]
    fn samples_of_a_point_are_stored_for_their_generation_only() {
        let point = unit(StreamId::point(3), 5..7);
        let batch = of(&point, Ok(Output::Samples(vec![1.0, 2.0].into())))
            .rows
            .unwrap();
        assert_eq!(batch.only_for, Some((point.stream, 0xabcd_0000_1234)));
        let samples: Vec<(u64, &[f64])> = batch.samples[0].indexed().collect();
        assert_eq!(samples, [(5, &[1.0][..]), (6, &[2.0])]);
        assert_eq!(
            (batch.times[0].stream, batch.times[0].part),
            (point.stream, 5)
        );
    }

    /// Results of workers, of shards and of files of undelivered results are all read here.
    #[test]
    fn samples_beyond_the_limits_of_the_campaign_are_a_failure() {
        let text = include_str!("../../../../campaigns/ishigami/campaign.toml");
        let text = text.replace("[[responses]]\n", "[[responses]]\nmax = 100.0\n");
        let problem = Problem::new(Campaign::parse("c.toml", &text).unwrap());
        let design = unit(StreamId::design(3), 5..7);
        let of_samples = |samples: [f64; 2], baseline: f64| {
            let output = Output::Design {
                responses: vec![baseline],
                ruled_out: None,
                samples: samples.to_vec().into(),
            };
            let sent = crate::protocol::result(&design, &Ok(Some(output)), 0.0);
            read(&problem, &sent).unwrap().rows
        };
        assert_eq!(of_samples([1.0, 100.0], 2.0).unwrap().samples.len(), 1);
        for (value, says) in [
            (
                1e50,
                "is 1e50, above the largest plausible value 100.0 (max of the response)",
            ),
            (1e160, "is 1e160, but numbers beyond ±1e100"),
        ] {
            let error = of_samples([1.0, value], 2.0).unwrap_err();
            let expected = format!("design-3: y of sample 6 {says}");
            assert!(error.starts_with(&expected), "{error}");
            let error = of_samples([1.0, 1.0], value).unwrap_err();
            assert!(error.starts_with(&format!("design-3: y {says}")), "{error}");
        }
    }

    #[test]
    fn numbers_that_cannot_be_are_a_failure_of_their_stream() {
        let point = unit(StreamId::point(3), 5..7);
        for (absurd, shown) in [(-5.0, "-5e0"), (1e308, "1e308"), (f64::NAN, "NaN")] {
            let read = of(&point, Ok(Output::Samples(vec![1.0, absurd].into())));
            let error = read.rows.unwrap_err();
            let expected = format!("verify-kriging: delta_ste_um of sample 6 is {shown} µm");
            assert!(error.starts_with(&expected), "{error}");
        }
        let mut nonsense = crate::protocol::result(&point, &Ok(None), 0.0);
        let error = read(&problem(), &nonsense).unwrap().rows.unwrap_err();
        assert!(error.contains("the worker's result must hold"), "{error}");
        nonsense.unit = None;
        assert!(read(&problem(), &nonsense).is_err());
    }
}
