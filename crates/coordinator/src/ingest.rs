//! From what workers hand in to rows of the store.

use campaign::batches::{self, StreamId};
use campaign::enrichment;
use campaign::plan::{JobKind, run_parts};
use campaign::task::{DesignOutcome, SampleRange, Task, TaskResult};
use store::{
    Batch, CriteriaRow, FailureKind, FailureRow, JobTimeRow, OptimiserRunRow, SampleRow, VerifyRow,
};

use crate::board::Covered;

/// A result as rows, with what they settle.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Parsed {
    /// The rows.
    pub batch: Batch,
    /// What they settle once they are stored.
    pub covered: Vec<Covered>,
}

/// Reads a result and turns it into rows, after checking that it answers `task`, or a part of it,
/// and nothing else.
///
/// `task` is none for a job that the board does not know, as when it was done twice or given out
/// before a restart. Samples of the DoE are then taken all the same, because they are what they
/// are whoever asks; runs and fresh samples depend on a model or an optimum that may have been
/// replaced, so nothing is made of them.
///
/// # Errors
///
/// A sentence: the result cannot be read or answers another question.
pub fn rows(
    job: u64,
    task: Option<&Task>,
    payload: &[u8],
    cpu_seconds: f64,
) -> Result<Parsed, String> {
    let result: TaskResult = serde_json::from_slice(payload)
        .map_err(|error| format!("the result cannot be read: {error}"))?;
    if let Some(task) = task
        && !answers(&result, task)
    {
        return Err("the result answers another task than the one leased".to_owned());
    }
    let cpu_seconds = if cpu_seconds.is_finite() && cpu_seconds >= 0.0 {
        cpu_seconds
    } else {
        0.0
    };
    let mut batch = Batch::default();
    let mut covered = Vec::new();
    let mut cover = |stream, first: u32, samples: usize| {
        // More samples than that do not fit into a message.
        let count = u32::try_from(samples).unwrap_or(u32::MAX);
        covered.push(Covered::Samples(stream, SampleRange { first, count }));
    };
    match result {
        TaskResult::Sample { designs } => {
            let mut refused = Vec::new();
            for result in designs {
                let design = u64::from(result.design);
                match result.outcome {
                    DesignOutcome::Refused { reason } => {
                        refused.push(Covered::Refused(result.design));
                        batch.criteria.push(CriteriaRow {
                            design,
                            feasible: false,
                            reason: Some(reason),
                            ..CriteriaRow::default()
                        });
                    }
                    DesignOutcome::Simulated {
                        criteria,
                        hertz_pressure_worn_mpa,
                        delta_ste_um,
                        delta_ste_archard_um,
                        first,
                        samples_um,
                        ruled_out,
                    } => {
                        if ruled_out.is_some() {
                            refused.push(Covered::Refused(result.design));
                        } else {
                            cover(StreamId::Design(result.design), first, samples_um.len());
                        }
                        batch.criteria.push(CriteriaRow {
                            design,
                            feasible: true,
                            reason: ruled_out,
                            contact_ratio: Some(criteria.contact_ratio),
                            specific_sliding: Some(criteria.specific_sliding),
                            hertz_pressure_mpa: Some(criteria.hertz_pressure_mpa),
                            hertz_pressure_worn_mpa: Some(hertz_pressure_worn_mpa),
                            root_stress_mpa: Some(criteria.root_stress_mpa),
                            clearance_p_mm: Some(criteria.clearance_mm[0]),
                            clearance_r_mm: Some(criteria.clearance_mm[1]),
                            flank_margin_p_mm: Some(criteria.flank_margin_mm[0]),
                            flank_margin_r_mm: Some(criteria.flank_margin_mm[1]),
                            delta_ste_um: Some(delta_ste_um),
                            delta_ste_archard_um: Some(delta_ste_archard_um),
                        });
                        batch
                            .samples
                            .extend(samples_um.iter().zip(u64::from(first)..).map(
                                |(&delta_ste_um, sample)| SampleRow {
                                    design,
                                    sample,
                                    delta_ste_um,
                                },
                            ));
                    }
                }
            }
            covered.extend(refused);
        }
        _ if task.is_none() => return Ok(Parsed::default()),
        TaskResult::Optimise { run } => batch.runs.push(OptimiserRunRow {
            approach: run.approach.name().to_owned(),
            start: u64::from(run.start),
            result_json: serde_json::to_string(&run)
                .map_err(|error| format!("the run cannot be written: {error}"))?,
            simulator_calls: run.simulator_calls,
            cpu_seconds,
        }),
        TaskResult::Verify {
            point,
            first,
            samples_um,
        } => {
            if let Some(Task::Verify { number, .. }) = task {
                cover(StreamId::Point(*number), first, samples_um.len());
            }
            batch
                .verify
                .extend(samples_um.iter().zip(u64::from(first)..).map(
                    |(&delta_ste_um, sample)| VerifyRow {
                        approach: point.clone(),
                        sample,
                        delta_ste_um,
                    },
                ));
        }
    }
    batch.times.push(JobTimeRow { job, cpu_seconds });
    Ok(Parsed { batch, covered })
}

/// The record of a failed attempt.
#[must_use]
pub fn failure(job: u64, attempt: u32, worker: &str, kind: FailureKind, error: &str) -> FailureRow {
    FailureRow {
        job: job_name(job),
        attempt,
        worker: worker.to_owned(),
        serial: None,
        kind,
        error: error.to_owned(),
        at_unix_ms: None,
    }
}

/// A job's number as people see it.
#[must_use]
pub fn job_name(job: u64) -> String {
    let (index, first) = batches::parts(job);
    match JobKind::of(job) {
        Some(JobKind::Sample) => format!("sample-{index}-{first}"),
        Some(JobKind::Verify) if enrichment::is_infill(index) => {
            format!("infill-{}-{first}", enrichment::mark(index))
        }
        Some(JobKind::Verify) => format!("verify-{index}-{first}"),
        Some(JobKind::Optimise) => {
            let (approach, start) = run_parts(job);
            format!("optimise-{approach}-{start}")
        }
        None => format!("unknown-{job:016x}"),
    }
}

/// Whether a result answers a task, or the beginning of it.
fn answers(result: &TaskResult, task: &Task) -> bool {
    match (result, task) {
        (TaskResult::Sample { designs: results }, Task::Sample { designs, .. }) => {
            results.len() <= designs.len()
                && results.iter().zip(designs).all(|(result, request)| {
                    result.design == request.design
                        && match &result.outcome {
                            DesignOutcome::Refused { .. } => true,
                            DesignOutcome::Simulated {
                                first, samples_um, ..
                            } => {
                                *first == request.samples.first
                                    && samples_um.len() <= request.samples.count as usize
                            }
                        }
                })
        }
        (
            TaskResult::Optimise { run },
            Task::Optimise {
                approach, start, ..
            },
        ) => run.approach == *approach && run.start == *start,
        (
            TaskResult::Verify {
                point,
                first,
                samples_um,
            },
            Task::Verify {
                point: asked,
                samples,
                ..
            },
        ) => {
            point == asked && *first == samples.first && samples_um.len() <= samples.count as usize
        }
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use campaign::Frozen;
    use campaign::task::SampleRequest;

    use super::*;

    fn task() -> Task {
        Task::Sample {
            frozen: Frozen {
                tip_radius_mm: [0.0; 2],
                root_radius_mm: [0.1; 2],
                helix_angle_deg: 0.0,
            },
            designs: vec![SampleRequest {
                design: 7,
                x: [0.0; 6],
                samples: SampleRange {
                    first: 0,
                    count: 30,
                },
            }],
        }
    }

    #[test]
    fn an_answer_to_another_question_is_refused() {
        let answer = br#"{"sample":{"designs":
            [{"design":8,"outcome":{"refused":{"reason":"contact-gap: no"}}}]}}"#;
        let error = rows(0, Some(&task()), answer, 0.0).unwrap_err();
        assert!(error.contains("another task"), "{error}");
    }

    #[test]
    fn garbage_is_refused() {
        assert!(rows(0, Some(&task()), b"\xff\x00", 0.0).is_err());
        assert!(rows(0, Some(&task()), br#"{"sample":{}}"#, 0.0).is_err());
    }

    #[test]
    fn a_refused_design_becomes_a_row_with_its_reason() {
        let answer = br#"{"sample":{"designs":
            [{"design":7,"outcome":{"refused":{"reason":"contact-gap: no"}}}]}}"#;
        let Parsed { batch, covered } = rows(0, Some(&task()), answer, f64::NAN).unwrap();
        assert_eq!(covered, [Covered::Refused(7)]);
        assert_eq!(batch.criteria.len(), 1);
        assert!(!batch.criteria[0].feasible);
        assert_eq!(batch.criteria[0].reason.as_deref(), Some("contact-gap: no"));
        assert_eq!(batch.times[0].cpu_seconds, 0.0);
    }

    #[test]
    fn a_result_that_nobody_waits_for_is_kept_only_if_it_cannot_be_stale() {
        let sample = br#"{"sample":{"designs":
            [{"design":8,"outcome":{"refused":{"reason":"contact-gap: no"}}}]}}"#;
        assert_eq!(rows(0, None, sample, 0.0).unwrap().batch.criteria.len(), 1);
        let verify = br#"{"verify":{"point":"archard","first":0,"samples_um":[1.5]}}"#;
        assert_eq!(rows(0, None, verify, 0.0).unwrap(), Parsed::default());
    }
}
