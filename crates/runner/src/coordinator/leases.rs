//! The expiry of leases.

use std::time::Duration;

use crate::console::service::Watchdog;
use ledger::Crash;
use stages::names;
use store::{Batch, FailureKind, FailureRow};
use tokio::time::{Instant, MissedTickBehavior};
use tracing::{error, warn};

use crate::coordinator::board::Board;
use crate::coordinator::recorder::Recorder;

/// Interval between checks for expired leases.
const EXPIRY_PERIOD: Duration = Duration::from_millis(200);

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
            // This process was suspended: the workers' heartbeats of the meantime are still to be
            // read.
            patient_until = now + half_a_lease;
        }
        last = now;
        if now >= patient_until {
            for vanished in board.expire() {
                let batch = Batch {
                    failures: vec![failure(vanished)],
                    ..Batch::default()
                };
                recorder.record(batch).await?;
            }
        }
        // This line is reached only while the board's lock is available and the writer makes
        // progress.
        watchdog.feed();
    }
}

fn failure(vanished: Crash) -> FailureRow {
    let Crash {
        lease,
        worker,
        stream,
        is_split,
        quarantined,
    } = vanished;
    let job = names::job_name(stream, &(0..0));
    let (kind, error) = if quarantined {
        error!(%job, %worker, "too many workers vanished: quarantined");
        (
            FailureKind::Quarantine,
            "its workers vanished while they computed it",
        )
    } else {
        warn!(%job, %worker, "a worker vanished while it computed");
        (
            FailureKind::Crash,
            "its worker vanished while it computed it",
        )
    };
    FailureRow {
        stream,
        shared: is_split,
        lease: u32::try_from(lease.number).unwrap_or(u32::MAX),
        worker: worker.to_string(),
        serial: None,
        kind,
        error: error.to_owned(),
        at_unix_ms: None,
    }
}
