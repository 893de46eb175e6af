//! Why nothing, or nothing more, is being leased.

use std::collections::BTreeSet;
use std::fmt;
use std::time::Duration;

use crate::scheduler::Scheduler;
use crate::types::WorkerId;

/// How many workers a sentence names.
const NAMED: usize = 3;

/// One reason why nothing, or nothing more, is being leased, or that all is well. As text it is a
/// sentence that says what is the matter and what to do.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Explanation {
    /// No job was ever added.
    NothingAdded,
    /// Every job is done.
    AllDone {
        /// How many.
        done: usize,
    },
    /// Granting was stopped.
    Draining {
        /// Jobs that are still held.
        leased: usize,
        /// Jobs that wait for it to go on.
        queued: usize,
    },
    /// There is work, but no worker has called for the length of a lease.
    NoWorkers {
        /// Workers that ever called.
        known: usize,
        /// How long ago the last of them did.
        silent_for: Option<Duration>,
        /// Jobs that wait or are held by silent workers.
        open: usize,
    },
    /// Jobs wait, and workers that failed several in a row are kept from them.
    SetAside {
        /// Workers set aside.
        set_aside: usize,
        /// Workers that called recently, those included.
        present: usize,
        /// How long until the first of them gets jobs again.
        next_in: Duration,
        /// Jobs that wait.
        queued: usize,
    },
    /// Nothing waits any more, but some jobs are still held.
    LastLeases {
        /// Jobs that are held.
        leased: usize,
        /// Who holds them.
        workers: Vec<WorkerId>,
        /// For how long the oldest lease has been held.
        oldest_for: Duration,
    },
    /// Nothing is left but jobs that were given up.
    OnlyQuarantined {
        /// How many.
        quarantined: usize,
        /// The error of the first of them.
        error: String,
    },
    /// Jobs wait and workers are there, but none of them has asked for one yet.
    NotAsked {
        /// Jobs that wait.
        queued: usize,
        /// Workers that called recently and are not set aside.
        workers: usize,
    },
    /// All is well.
    Running {
        /// Jobs that are held.
        leased: usize,
        /// Workers that hold them.
        workers: usize,
        /// Jobs that wait.
        queued: usize,
    },
}

impl<J: Clone> Scheduler<J> {
    /// Why nothing, or nothing more, is being leased at `now`: never empty, the weightiest reason
    /// first. A worker is taken to be there if it has called within the length of a lease.
    pub fn explain(&self, now: Duration) -> Vec<Explanation> {
        let counts = self.counts();
        let (queued, leased) = (counts.queued, counts.leased);
        let mut reasons = Vec::new();
        if queued + leased == 0 {
            reasons.push(match self.quarantined().first() {
                Some((_, error)) => Explanation::OnlyQuarantined {
                    quarantined: counts.quarantined,
                    error: (*error).to_owned(),
                },
                None if counts.done > 0 => Explanation::AllDone { done: counts.done },
                None => Explanation::NothingAdded,
            });
        }
        if self.draining {
            reasons.push(Explanation::Draining { leased, queued });
        }
        if queued + leased == 0 {
            return reasons;
        }

        let silence = |seen: Duration| now.saturating_sub(seen);
        let present = self.workers.values();
        let present = present.filter(|worker| silence(worker.last_seen) <= self.options.lease);
        let present: Vec<_> = present.collect();
        let waits = present.iter().filter_map(|worker| worker.set_aside_until);
        let waits: Vec<Duration> = waits
            .filter_map(|until| until.checked_sub(now))
            .filter(|wait| !wait.is_zero())
            .collect();
        if present.is_empty() {
            let seen = self.workers.values().map(|worker| worker.last_seen).max();
            reasons.push(Explanation::NoWorkers {
                known: self.workers.len(),
                silent_for: seen.map(silence),
                open: queued + leased,
            });
            return reasons;
        }
        if let Some(&next_in) = waits.iter().min()
            && queued > 0
        {
            reasons.push(Explanation::SetAside {
                set_aside: waits.len(),
                present: present.len(),
                next_in,
                queued,
            });
        }
        if leased > 0 {
            let leases = || self.expiries.iter().flat_map(|&(_, id)| self.leases(id));
            let workers: BTreeSet<&WorkerId> = leases().map(|lease| &lease.worker).collect();
            reasons.push(if queued > 0 {
                let workers = workers.len();
                Explanation::Running {
                    leased,
                    workers,
                    queued,
                }
            } else {
                let oldest = leases().map(|lease| lease.granted).min();
                Explanation::LastLeases {
                    leased,
                    workers: workers.into_iter().cloned().collect(),
                    oldest_for: oldest.map_or(Duration::ZERO, silence),
                }
            });
        } else if waits.len() < present.len() && !self.draining {
            reasons.push(Explanation::NotAsked {
                queued,
                workers: present.len() - waits.len(),
            });
        }
        reasons
    }
}

impl fmt::Display for Explanation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NothingAdded => f.write_str(
                "no job has been added yet: the campaign is between two stages or has just \
                 started; wait a moment",
            ),
            Self::AllDone { done } => write!(f, "{} done: nothing is left to do", jobs(*done)),
            Self::Draining { leased, queued } => write!(
                f,
                "draining: {} still held will finish, {queued} queued will not be given out; stop \
                 draining to go on",
                jobs(*leased)
            ),
            Self::NoWorkers { known: 0, open, .. } => write!(
                f,
                "{} left, but no worker has ever connected: start one with `worker --connect` and \
                 this coordinator's address",
                jobs(*open)
            ),
            Self::NoWorkers {
                known,
                silent_for,
                open,
            } => write!(
                f,
                "{} left, but none of {known} known workers has called for {}: start workers, or \
                 check that they run and reach this coordinator",
                jobs(*open),
                seconds(silent_for.unwrap_or_default())
            ),
            Self::SetAside {
                set_aside,
                present,
                next_in,
                queued,
            } => write!(
                f,
                "{} queued, but {set_aside} of {present} workers are set aside, having failed \
                 several jobs in a row; the first gets jobs again in {}: look at the failures and \
                 mend their cause, or start other workers",
                jobs(*queued),
                seconds(*next_in)
            ),
            Self::LastLeases {
                leased,
                workers,
                oldest_for,
            } => {
                let named: Vec<&str> = workers.iter().take(NAMED).map(|w| w.0.as_str()).collect();
                let more = workers.len() - named.len();
                write!(f, "nothing is queued; {} still held by ", jobs(*leased))?;
                f.write_str(&named.join(", "))?;
                if more > 0 {
                    write!(f, " and {more} more")?;
                }
                write!(
                    f,
                    ", the oldest for {}: wait, or stop a worker that hangs, and its jobs go to others",
                    seconds(*oldest_for)
                )
            }
            Self::OnlyQuarantined { quarantined, error } => write!(
                f,
                "nothing is left but {} that {} given up, the first because of {error:?}: mend the \
                 cause, then run `coordinator retry --quarantined`",
                jobs(*quarantined),
                if *quarantined == 1 { "was" } else { "were" }
            ),
            Self::NotAsked { queued, workers } => write!(
                f,
                "{} queued and {workers} workers connected, but none has asked for a job yet: wait \
                 a moment; if it stays so, look at the workers' logs",
                jobs(*queued)
            ),
            Self::Running {
                leased,
                workers,
                queued,
            } => write!(
                f,
                "all is well: {} held by {workers} workers, {queued} queued; more workers would \
                 finish them sooner",
                jobs(*leased)
            ),
        }
    }
}

fn jobs(count: usize) -> String {
    if count == 1 {
        "1 job".to_owned()
    } else {
        format!("{count} jobs")
    }
}

/// A time for people: whole seconds are exact enough.
fn seconds(time: Duration) -> String {
    format!("{} s", time.as_secs_f64().ceil())
}
