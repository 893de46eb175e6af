//! What a worker hands in becomes rows that answer what was asked, or is refused.

#![no_main]

use std::sync::OnceLock;

use campaign::Campaign;
use campaign::formulation::Problem;
use campaign::task::{SampleRange, SampleRequest, Task};
use coordinator::ingest::rows;
use libfuzzer_sys::fuzz_target;

/// Nine samples of design 3.
fn task() -> &'static Task {
    static TASK: OnceLock<Task> = OnceLock::new();
    TASK.get_or_init(|| {
        let text = acceptance::quick_campaign(&[]);
        let problem = Problem::new(Campaign::parse("quick.toml", &text).expect("it is shipped"));
        let request = SampleRequest {
            design: 3,
            x: [0.25, 1.37, 1.37, 0.85, 1.31, 0.80],
            samples: SampleRange { first: 5, count: 9 },
        };
        Task::Sample {
            frozen: problem.printed_frozen(),
            designs: vec![request],
        }
    })
}

// Whether the task is known, the kind and the number of the job, and what was handed in.
fuzz_target!(|input: (bool, u8, u64, f64, &[u8])| {
    let (known, kind, number, cpu_seconds, payload) = input;
    let job = u64::from(kind % 5) << 56 | number >> 8;
    let task = known.then(task);
    let Ok(parsed) = rows(job, task, payload, cpu_seconds) else {
        return;
    };
    assert!(
        parsed
            .batch
            .times
            .iter()
            .all(|time| time.cpu_seconds >= 0.0)
    );
    if known {
        let asked = |row: &store::SampleRow| row.design == 3 && (5..14).contains(&row.sample);
        assert!(parsed.batch.samples.iter().all(asked));
    }
});
