//! The expiry of leases, and the record of crashes.

use std::time::Duration;

use crate::console::service::Watchdog;
use ledger::Crash;
use stages::names;
use store::{Batch, FailureKind, FailureRow};
use tokio::time::{Instant, MissedTickBehavior};
use tracing::{error, warn};

use crate::coordinator::board::Board;
use crate::coordinator::provenance;
use crate::coordinator::recorder::Recorder;

/// Interval between checks for expired leases.
const EXPIRY_PERIOD: Duration = Duration::from_millis(200);
/// Maximum number of jobs that the log names for a worker that crashed.
const NAMED: usize = 8;

/// Ends expired leases until it is dropped, and records the possible crashes.
pub(crate) async fn watch<R: Recorder>(board: &Board, recorder: &R) -> Result<(), store::Error> {
    let mut period = tokio::time::interval(EXPIRY_PERIOD);
    period.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let mut watchdog = Watchdog::from_environment();
    let mut last = Instant::now();
    let mut patient_until = last;
    loop {
        period.tick().await;
        let now = Instant::now();
        let half_a_lease = board.lease_time() / 2;
        if now.duration_since(last) > half_a_lease {
            // This process was suspended, and the heartbeats that arrived meanwhile have not been read yet.
            patient_until = now + half_a_lease;
        }
        last = now;
        if now >= patient_until {
            record(board.expire(), false, recorder).await?;
        }
        // This line is reached only while the board's lock is available and the writer makes
        // progress.
        watchdog.feed();
    }
}

/// Records crashes with the streams that the workers held. If `is_known`, the workers were computing these streams.
/// Otherwise the streams are all that each worker held, perhaps hundreds: only the first gets a row, and the board
/// remembers the others.
pub(crate) async fn record<R: Recorder>(
    mut crashes: Vec<Crash>,
    is_known: bool,
    recorder: &R,
) -> Result<(), store::Error> {
    if crashes.is_empty() {
        return Ok(());
    }
    for of_one in crashes.chunk_by(|a, b| a.worker == b.worker) {
        let jobs: Vec<String> = of_one.iter().take(NAMED).map(job).collect();
        let more = of_one.len() - jobs.len();
        warn!(worker = %of_one[0].worker, jobs = %jobs.join(", "), more, "a worker crashed with these leases");
    }
    if !is_known {
        crashes.dedup_by(|b, a| a.worker == b.worker);
    }
    let batch = Batch {
        failures: crashes.into_iter().map(failure).collect(),
        ..Batch::default()
    };
    recorder.record(batch).await.map(drop)
}

fn job(crash: &Crash) -> String {
    names::job_name(crash.stream, &(0..0))
}

fn failure(crash: Crash) -> FailureRow {
    let (kind, error) = match (crash.quarantined, crash.record.is_alone) {
        (true, _) => {
            error!(job = %job(&crash), worker = %crash.worker, "too many workers crashed on this job: quarantined");
            (
                FailureKind::Quarantine,
                "too many workers crashed while computing this job",
            )
        }
        (false, true) => (
            FailureKind::Crash,
            "the worker crashed while computing this job",
        ),
        (false, false) => (
            FailureKind::Crash,
            "the worker crashed while it had leases of this and other jobs, any of which may be the cause",
        ),
    };
    FailureRow {
        stream: crash.stream,
        sample: Some(crash.record.first),
        shared: !crash.record.is_alone,
        lease: u32::try_from(crash.lease.number).unwrap_or(u32::MAX),
        worker: crash.worker.to_string(),
        serial: None,
        kind,
        error: error.to_owned(),
        at_unix_ms: provenance::unix_ms(),
    }
}
