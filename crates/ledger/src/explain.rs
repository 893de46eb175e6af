//! Reasons why no work, or no more work, is being leased.

use std::fmt;
use std::time::Duration;

use crate::ledger::Ledger;
use crate::types::{StreamId, WorkerId};

/// Maximum number of workers named in a sentence.
const NAMED: usize = 3;

/// One reason why no work, or no more work, is being leased, or the statement that work is in
/// progress. `Display` gives a sentence with the problem and the remedy.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Explanation {
    /// No stream is wanted, and none is quarantined.
    NothingWanted,
    /// Leasing was stopped by [`Ledger::set_draining`].
    Draining {
        /// Number of leases not yet delivered.
        leased: usize,
    },
    /// There is work, but no worker has called for the length of a lease.
    NoWorkers {
        /// Number of registered workers.
        known: usize,
        /// Time since the last call of any worker.
        silent_for: Option<Duration>,
        /// Number of streams with missing samples.
        open: usize,
    },
    /// Streams are free, but workers are suspended after failing several in a row.
    Suspended {
        /// Number of suspended workers.
        suspended: usize,
        /// Number of workers that called recently, including suspended ones.
        present: usize,
        /// Time until the first suspension ends.
        next_in: Duration,
        /// Number of free streams.
        free: usize,
    },
    /// Everything has failed for a while.
    Outage {
        /// Time since the first failure.
        since: Duration,
        /// Time until failures are final; see [`Options::retry_for`](crate::Options::retry_for).
        left: Duration,
        /// Failed attempts of a job after which it is quarantined.
        max_failures: u32,
    },
    /// Streams wait after a failure.
    Waiting {
        /// Number of such streams.
        waiting: usize,
        /// Time until the first of them is tried again.
        next_in: Duration,
    },
    /// Nothing is free any more, but some leases are not yet delivered.
    LastLeases {
        /// Number of those leases.
        leased: usize,
        /// The workers that hold them.
        workers: Vec<WorkerId>,
        /// Age of the oldest of them.
        oldest_for: Duration,
    },
    /// Streams were quarantined.
    Quarantined {
        /// Number of quarantined streams.
        quarantined: usize,
        /// The name of the first of them.
        stream: String,
        /// The error of that stream.
        error: String,
    },
    /// Streams are free and workers are present, but none has asked for a lease yet.
    NotAsked {
        /// Number of free streams.
        free: usize,
        /// Number of workers that called recently and are not suspended.
        workers: usize,
    },
    /// Work is being computed, and more is free.
    Running {
        /// Number of leases not yet delivered.
        leased: usize,
        /// Number of workers that hold them.
        workers: usize,
        /// Number of free streams.
        free: usize,
    },
}

impl<P: Clone> Ledger<P> {
    /// The reasons why no work, or no more work, is being leased at `now`. Never empty; the most important comes first.
    /// A worker counts as present if it called within the length of a lease. `name` names a stream for users.
    pub fn explain(&self, now: Duration, name: impl Fn(StreamId) -> String) -> Vec<Explanation> {
        // A coordinator that drains leases nothing more, so that nothing is free.
        let free = if self.is_draining { 0 } else { self.free.len() };
        let leased = self.leases.len();
        let open = self.streams.len() - self.quarantined.len();
        let mut reasons = Vec::new();
        if self.is_draining {
            reasons.push(Explanation::Draining { leased });
        }
        let silence = |seen: Duration| now.saturating_sub(seen);
        let present: Vec<_> = self.workers.present(self.options.lease, now).collect();
        let waits = present.iter().filter_map(|worker| worker.suspended_until);
        let waits: Vec<Duration> = waits
            .filter_map(|until| until.checked_sub(now))
            .filter(|wait| !wait.is_zero())
            .collect();
        if open > 0 && present.is_empty() {
            let seen = self.workers.known.values().map(|worker| worker.last_seen);
            reasons.push(Explanation::NoWorkers {
                known: self.workers.known.len(),
                silent_for: seen.max().map(silence),
                open,
            });
        } else if open > 0 {
            if let Some(&next_in) = waits.iter().min()
                && free > 0
            {
                reasons.push(Explanation::Suspended {
                    suspended: waits.len(),
                    present: present.len(),
                    next_in,
                    free,
                });
            }
            if leased > 0 && free > 0 {
                let workers = self.holders_of_leases().len();
                reasons.push(Explanation::Running {
                    leased,
                    workers,
                    free,
                });
            } else if leased > 0 {
                let oldest = self.leases.values().map(|lease| lease.granted).min();
                reasons.push(Explanation::LastLeases {
                    leased,
                    workers: self.holders_of_leases().into_iter().cloned().collect(),
                    oldest_for: oldest.map_or(Duration::ZERO, silence),
                });
            } else if free > 0 && waits.len() < present.len() {
                reasons.push(Explanation::NotAsked {
                    free,
                    workers: present.len() - waits.len(),
                });
            }
        }
        if let Some(failed) = self.fails_since
            && open > 0
        {
            let since = silence(failed);
            let left = self.options.retry_for.saturating_sub(since);
            reasons.push(Explanation::Outage {
                since,
                left,
                max_failures: self.options.max_failures.max(1),
            });
        }
        if let Some(&(until, ..)) = self.waiting.first() {
            reasons.push(Explanation::Waiting {
                waiting: self.waiting_streams(),
                next_in: until.saturating_sub(now),
            });
        }
        let first = self.quarantined().next();
        if let Some((stream, error)) = first {
            reasons.push(Explanation::Quarantined {
                quarantined: self.quarantined.len(),
                stream: name(stream),
                error: error.to_owned(),
            });
        } else if open == 0 {
            reasons.push(Explanation::NothingWanted);
        }
        reasons
    }
}

impl fmt::Display for Explanation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NothingWanted => f.write_str(
                "no samples are wanted at the moment: the campaign is between two stages or has \
                 just started; wait a moment",
            ),
            Self::Draining { leased } => write!(
                f,
                "draining: workers finish {} and get no more; `coordinator drain --resume` leases \
                 again",
                leases(*leased)
            ),
            Self::NoWorkers { known: 0, open, .. } => write!(
                f,
                "samples of {} are missing, but no worker has connected: start one with `worker \
                 --access` and the access file of this coordinator",
                streams(*open)
            ),
            Self::NoWorkers {
                known,
                silent_for,
                open,
            } => write!(
                f,
                "samples of {} are missing, but none of {known} known workers has called for {}: \
                 start workers, or check that they run and reach this coordinator",
                streams(*open),
                seconds(silent_for.unwrap_or_default())
            ),
            Self::Suspended {
                suspended,
                present,
                next_in,
                free,
            } => write!(
                f,
                "{} could be computed, but {suspended} of {present} workers are suspended after \
                 several failures in a row, the first for another {}: look at the failures and fix \
                 the cause, then run `coordinator retry`, or start other workers",
                streams(*free),
                seconds(*next_in)
            ),
            Self::Outage {
                since,
                left,
                max_failures,
            } if left.is_zero() => write!(
                f,
                "nothing has succeeded since a failure {} ago: a job is now quarantined after {}",
                seconds(*since),
                if *max_failures == 1 {
                    "1 failed attempt".to_owned()
                } else {
                    format!("{max_failures} failed attempts")
                }
            ),
            Self::Outage { since, left, .. } => write!(
                f,
                "nothing has succeeded since a failure {} ago, so that it counts against no \
                 design yet: failed jobs are tried again for another {}",
                seconds(*since),
                seconds(*left)
            ),
            Self::Waiting { waiting, next_in } => write!(
                f,
                "{} failed and will be tried again, the first in {}",
                streams(*waiting),
                seconds(*next_in)
            ),
            Self::LastLeases {
                leased,
                workers,
                oldest_for,
            } => {
                let named: Vec<&str> = workers.iter().take(NAMED).map(WorkerId::as_str).collect();
                let more = workers.len() - named.len();
                write!(f, "no work is left to lease; {} held by ", leases(*leased))?;
                f.write_str(&named.join(", "))?;
                if more > 0 {
                    write!(f, " and {more} more")?;
                }
                write!(
                    f,
                    ", the oldest for {}: wait, or stop a worker that hangs, and others get its \
                     leases",
                    seconds(*oldest_for)
                )
            }
            Self::Quarantined {
                quarantined,
                stream,
                error,
            } => write!(
                f,
                "{} quarantined, the first ({stream}) because of {error:?}: fix the cause, then run \
                 `coordinator retry`",
                if *quarantined == 1 {
                    "1 was".to_owned()
                } else {
                    format!("{quarantined} were")
                }
            ),
            Self::NotAsked { free, workers } => write!(
                f,
                "{} could be computed and {workers} workers are connected, but none has asked yet: \
                 wait a moment; if this persists, read the workers' logs",
                streams(*free)
            ),
            Self::Running {
                leased,
                workers,
                free,
            } => write!(
                f,
                "running: {} with {}, and {} wait; more workers would finish them sooner",
                if *workers == 1 {
                    "1 worker".to_owned()
                } else {
                    format!("{workers} workers")
                },
                leases(*leased),
                streams(*free)
            ),
        }
    }
}

fn leases(count: usize) -> String {
    if count == 1 {
        "1 lease".to_owned()
    } else {
        format!("{count} leases")
    }
}

/// A count of streams, in the user's words.
fn streams(count: usize) -> String {
    if count == 1 {
        "1 design or run".to_owned()
    } else {
        format!("{count} designs or runs")
    }
}

/// A duration rounded up to whole seconds.
fn seconds(time: Duration) -> String {
    format!("{} s", time.as_secs_f64().ceil())
}
