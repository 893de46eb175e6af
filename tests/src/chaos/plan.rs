//! The faults of a round and their times, all determined by a seed.

use std::time::Duration;

use rand::rngs::ChaCha8Rng;
use rand::{RngExt as _, SeedableRng as _};

use super::proxy::Fault;

/// Number of workers in a round.
pub(crate) const WORKERS: usize = 2;

/// Index of an additional worker, which computes while the others are disconnected.
pub(crate) const RELIEF: usize = WORKERS;

/// Longer than the lease of three seconds.
const LONG: Duration = Duration::from_millis(3600);

/// A process of the cluster.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Who {
    /// The coordinator.
    Coordinator,
    /// A worker.
    Worker(usize),
}

/// An action on the cluster.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Act {
    /// SIGKILL.
    Kill(Who),
    /// SIGTERM.
    Terminate(Who),
    /// SIGSTOP.
    Stop(Who),
    /// SIGCONT.
    Continue(Who),
    /// Starts a process that is not running.
    Start(Who),
    /// Sets the fault of a worker's network.
    Network {
        /// The worker.
        worker: usize,
        /// The fault.
        fault: Fault,
        /// Whether existing connections are closed.
        cut: bool,
    },
    /// Starts another coordinator on the same store, which must be refused.
    Intrude,
    /// A worker on a machine that cannot run the simulator.
    Broken,
    /// Connections to the live page that never finish their request.
    Strangers,
    /// `coordinator drain`.
    Drain,
    /// `coordinator drain --resume`.
    Resume,
    /// `coordinator retry`.
    Retry,
    /// From now on the external simulator fails for this share of its designs, in percent.
    Outage(u64),
    /// Ends an outage; what was quarantined is retried at once, or waits for the coordinator's next start.
    Repair {
        /// Whether it is retried.
        retries: bool,
    },
}

/// The random numbers of a round, with a stream for each purpose.
#[must_use]
pub(crate) fn random(seed: u64, round: u64, purpose: Purpose) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(round * 8 + purpose as u64);
    rng
}

/// The purposes of a round's random numbers.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Purpose {
    /// The acts and their times.
    Acts,
    /// The kind of campaign.
    Kind,
    /// The turn that the campaign takes.
    Course,
    /// The failures of the external simulator.
    Simulator,
    /// The bits that are flipped in copies of its store.
    Bits,
}

/// The acts with their times since the start of the round, in order. Faults begin within `span`.
#[must_use]
pub(crate) fn plan(seed: u64, round: u64, span: Duration) -> Vec<(Duration, Act)> {
    let mut rng = random(seed, round, Purpose::Acts);
    let mut acts = Vec::new();
    for _ in 0..rng.random_range(3..8) {
        let at = span.mul_f64(rng.random_range(0.05..0.95));
        let mut spell = |low: u64, high: u64| Duration::from_millis(rng.random_range(low..high));
        let (short, pause) = (spell(100, 1500), spell(50, 800));
        let worker = rng.random_range(0..WORKERS);
        let whom = Who::Worker(worker);
        let coordinator = Who::Coordinator;
        match rng.random_range(0..30) {
            0..4 => acts.extend([
                (at, Act::Kill(coordinator)),
                (at + pause, Act::Start(coordinator)),
            ]),
            4 => acts.extend([
                (at, Act::Terminate(coordinator)),
                (at + pause, Act::Start(coordinator)),
            ]),
            5..7 => acts.extend([
                (at, Act::Stop(coordinator)),
                (at + short, Act::Continue(coordinator)),
            ]),
            7..10 => acts.extend([(at, Act::Kill(whom)), (at + pause, Act::Start(whom))]),
            10 => acts.extend([(at, Act::Terminate(whom)), (at + pause, Act::Start(whom))]),
            11 => acts.extend([(at, Act::Stop(whom)), (at + short, Act::Continue(whom))]),
            12 if rng.random_bool(0.5) => {
                acts.extend([(at, Act::Stop(whom)), (at + LONG, Act::Continue(whom))]);
            }
            13 => acts.push((at, Act::Intrude)),
            14..16 => {
                acts.push((at, Act::Drain));
                if rng.random_bool(0.3) {
                    acts.push((at + pause, Act::Resume));
                } else {
                    let workers = (0..WORKERS).map(Who::Worker);
                    let all = std::iter::once(coordinator).chain(workers);
                    acts.extend(all.map(|who| (at + short, Act::Start(who))));
                }
            }
            16 => acts.push((at, Act::Retry)),
            17 => acts.push((at, Act::Broken)),
            18 => acts.push((at, Act::Strangers)),
            24.. => {
                // Three failures of a job take five seconds.
                let end = at + Duration::from_millis(rng.random_range(500..9000));
                let share = [100, 100, 50, 10][rng.random_range(0..4)];
                let retries = rng.random_bool(0.7);
                acts.extend([(at, Act::Outage(share)), (end, Act::Repair { retries })]);
            }
            _ => {
                let fault = match rng.random_range(0..7) {
                    0 => Fault::Refuse,
                    1 => Fault::Mute,
                    2 => Fault::Deaf,
                    3 => Fault::Partition,
                    4 => Fault::HalfOpenAtWorker,
                    5 => Fault::HalfOpenAtCoordinator,
                    _ => Fault::Delay(Duration::from_millis(rng.random_range(20..300))),
                };
                let network = |fault, cut| Act::Network { worker, fault, cut };
                let long = rng.random_bool(0.1);
                acts.push((at, network(fault, false)));
                let end = at + if long { LONG } else { short };
                acts.push((end, network(Fault::None, rng.random_bool(0.5))));
            }
        }
    }
    acts.sort_by_key(|(at, _)| *at);
    acts
}

#[cfg(test)]
mod tests {
    use super::*;

    const SPAN: Duration = Duration::from_secs(4);

    #[test]
    fn a_plan_follows_from_its_seed_and_round() {
        assert_eq!(plan(1, 2, SPAN), plan(1, 2, SPAN));
        assert_ne!(plan(1, 2, SPAN), plan(1, 3, SPAN));
        assert_ne!(plan(1, 2, SPAN), plan(2, 2, SPAN));
    }

    #[test]
    fn two_hundred_rounds_have_everything_in_them() {
        let acts: Vec<Act> = (0..200)
            .flat_map(|n| plan(1, n, SPAN))
            .map(|(_, act)| act)
            .collect();
        let faults = [
            Fault::Refuse,
            Fault::Mute,
            Fault::Deaf,
            Fault::Partition,
            Fault::HalfOpenAtWorker,
            Fault::HalfOpenAtCoordinator,
        ];
        for fault in faults {
            let has = |act: &Act| matches!(act, Act::Network { fault: f, .. } if *f == fault);
            assert!(acts.iter().any(has), "{fault:?}");
        }
        let coordinator = Who::Coordinator;
        let mut wanted = vec![Act::Intrude, Act::Drain, Act::Resume, Act::Retry];
        wanted.extend([Act::Broken, Act::Strangers]);
        wanted.extend([100, 50, 10].map(Act::Outage));
        wanted.extend([true, false].map(|retries| Act::Repair { retries }));
        for who in [coordinator, Who::Worker(0), Who::Worker(1)] {
            wanted.extend([Act::Kill(who), Act::Terminate(who), Act::Stop(who)]);
        }
        for act in wanted {
            assert!(acts.contains(&act), "{act:?}");
        }
    }
}
