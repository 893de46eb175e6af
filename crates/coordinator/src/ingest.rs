//! From what workers hand in to rows of the store.

use campaign::task::{DesignOutcome, Task, TaskResult};
use store::{
    Batch, CriteriaRow, FailureKind, FailureRow, JobTimeRow, OptimiserRunRow, SampleRow, VerifyRow,
};

/// Reads a result and turns it into rows, after checking that it answers `task` and nothing else.
///
/// # Errors
///
/// A sentence: the result cannot be read or answers another question.
pub fn rows(
    job: u64,
    task: Option<&Task>,
    payload: &[u8],
    cpu_seconds: f64,
) -> Result<Batch, String> {
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
    match result {
        TaskResult::Sample { designs } => {
            for result in designs {
                let design = u64::from(result.design);
                match result.outcome {
                    DesignOutcome::Refused { reason } => batch.criteria.push(CriteriaRow {
                        design,
                        feasible: false,
                        reason: Some(reason),
                        ..CriteriaRow::default()
                    }),
                    DesignOutcome::Simulated {
                        criteria,
                        hertz_pressure_worn_mpa,
                        delta_ste_um,
                        delta_ste_archard_um,
                        first,
                        samples_um,
                    } => {
                        batch.criteria.push(CriteriaRow {
                            design,
                            feasible: true,
                            reason: None,
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
        }
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
    Ok(batch)
}

/// The record of a failed attempt.
#[must_use]
pub fn failure(job: u64, attempt: u32, worker: &str, kind: FailureKind, error: &str) -> FailureRow {
    FailureRow {
        job: job_name(job),
        attempt,
        worker: worker.to_owned(),
        kind,
        error: error.to_owned(),
        at_unix_ms: None,
    }
}

/// A job's number as people see it.
#[must_use]
pub fn job_name(job: u64) -> String {
    use campaign::plan::JobKind;
    let major = (job & 0x00ff_ffff_ffff_ffff) >> 28;
    let minor = job & 0x0fff_ffff;
    match JobKind::of(job) {
        Some(JobKind::Sample) => format!("sample-{minor}"),
        Some(JobKind::Optimise) => format!("optimise-{major}-{minor}"),
        Some(JobKind::Verify) => format!("verify-{major}-{minor}"),
        None => format!("unknown-{job:016x}"),
    }
}

fn answers(result: &TaskResult, task: &Task) -> bool {
    match (result, task) {
        (TaskResult::Sample { designs: results }, Task::Sample { designs, .. }) => {
            results.len() == designs.len()
                && results.iter().zip(designs).all(|(result, request)| {
                    result.design == request.design
                        && match &result.outcome {
                            DesignOutcome::Refused { .. } => true,
                            DesignOutcome::Simulated {
                                first, samples_um, ..
                            } => {
                                *first == request.samples.first
                                    && samples_um.len() == request.samples.count as usize
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
            point == asked && *first == samples.first && samples_um.len() == samples.count as usize
        }
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use campaign::Frozen;
    use campaign::task::{SampleRange, SampleRequest};

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
        let answer = br#"{"task":"sample","designs":
            [{"design":8,"outcome":{"outcome":"refused","reason":"contact-gap: no"}}]}"#;
        let error = rows(0, Some(&task()), answer, 0.0).unwrap_err();
        assert!(error.contains("another task"), "{error}");
    }

    #[test]
    fn garbage_is_refused() {
        assert!(rows(0, Some(&task()), b"\xff\x00", 0.0).is_err());
        assert!(rows(0, Some(&task()), br#"{"task":"sample"}"#, 0.0).is_err());
    }

    #[test]
    fn a_refused_design_becomes_a_row_with_its_reason() {
        let answer = br#"{"task":"sample","designs":
            [{"design":7,"outcome":{"outcome":"refused","reason":"contact-gap: no"}}]}"#;
        let batch = rows(0, Some(&task()), answer, f64::NAN).unwrap();
        assert_eq!(batch.criteria.len(), 1);
        assert!(!batch.criteria[0].feasible);
        assert_eq!(batch.criteria[0].reason.as_deref(), Some("contact-gap: no"));
        assert_eq!(batch.times[0].cpu_seconds, 0.0);
    }
}
