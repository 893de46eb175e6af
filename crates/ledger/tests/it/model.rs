//! Random sequences of calls, checked against a model that knows only the stored samples and the
//! leases that each worker claims.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use ledger::{
    Crash, Delivery, Failure, Generation, Grant, LeaseId, Ledger, Options, StreamId, Unit, Verdict,
    WorkerId,
};
use proptest::prelude::*;

use crate::{LEASE, units, wanted, worker};

const WORKERS: usize = 3;
const STREAMS: u32 = 5;
const SAMPLES: u32 = 12;

/// A call on the ledger. An index of a grant counts those of its worker from the newest.
#[derive(Debug, Clone)]
enum Call {
    Lease(usize),
    Heartbeat {
        who: usize,
        started: bool,
    },
    /// Delivers the first part of a lease's samples, in tenths.
    Deliver {
        who: usize,
        which: usize,
        part: u32,
    },
    /// Delivers a lease of one worker by another.
    DeliverForeign {
        who: usize,
        which: usize,
    },
    Fail {
        who: usize,
        which: usize,
    },
    Release {
        who: usize,
        which: usize,
    },
    Leave(usize),
    MarkCrashed(usize),
    RecordCrash(usize),
    /// Time passes, in lease times.
    Pass(f64),
    Drain(bool),
    Retry,
    /// Changes the generation of a stream.
    Change(u32),
    Restart,
}

fn call() -> impl Strategy<Value = Call> {
    let who = 0..WORKERS;
    let which = 0..4_usize;
    prop_oneof![
        8 => who.clone().prop_map(Call::Lease),
        4 => (who.clone(), any::<bool>()).prop_map(|(who, started)| Call::Heartbeat { who, started }),
        6 => (who.clone(), which.clone(), 0..=10_u32)
            .prop_map(|(who, which, part)| Call::Deliver { who, which, part }),
        1 => (who.clone(), which.clone())
            .prop_map(|(who, which)| Call::DeliverForeign { who, which }),
        3 => (who.clone(), which.clone()).prop_map(|(who, which)| Call::Fail { who, which }),
        2 => (who.clone(), which).prop_map(|(who, which)| Call::Release { who, which }),
        1 => who.clone().prop_map(Call::Leave),
        2 => who.clone().prop_map(Call::MarkCrashed),
        1 => who.prop_map(Call::RecordCrash),
        4 => (0.0..1.5).prop_map(Call::Pass),
        1 => any::<bool>().prop_map(Call::Drain),
        1 => Just(Call::Retry),
        1 => (0..STREAMS).prop_map(Call::Change),
        1 => Just(Call::Restart),
    ]
}

struct World {
    ledger: Ledger<()>,
    epoch: u64,
    now: Duration,
    generations: BTreeMap<StreamId, u64>,
    /// The stored samples, by stream and generation.
    stored: BTreeMap<(StreamId, Generation), BTreeSet<u32>>,
    /// Grants that the worker has neither delivered nor released, whatever their state in the
    /// ledger.
    held: Vec<Vec<Grant<()>>>,
    /// Every lease ever granted.
    names: BTreeSet<LeaseId>,
    crashed_alone: BTreeMap<StreamId, BTreeSet<WorkerId>>,
    log: Vec<String>,
}

fn id(stream: u32) -> StreamId {
    if stream < 3 {
        StreamId::design(stream)
    } else {
        StreamId::point(u64::from(stream))
    }
}

fn name(who: usize) -> WorkerId {
    worker(["a", "b", "c"][who])
}

impl World {
    fn new() -> Self {
        let mut world = Self {
            ledger: Ledger::new(Options::default(), 0),
            epoch: 0,
            now: Duration::ZERO,
            generations: (0..STREAMS).map(|stream| (id(stream), 1)).collect(),
            stored: BTreeMap::new(),
            held: vec![Vec::new(); WORKERS],
            names: BTreeSet::new(),
            crashed_alone: BTreeMap::new(),
            log: Vec::new(),
        };
        world.restart();
        world
    }

    fn restart(&mut self) {
        self.epoch += 1;
        self.ledger = Ledger::new(Options::default(), self.epoch);
        self.crashed_alone.clear();
        for stream in 0..STREAMS {
            self.want(id(stream));
        }
        for who in 0..WORKERS {
            self.ledger.register(&name(who), "here", 2, self.now);
            for grant in &self.held[who] {
                self.ledger
                    .adopt(&name(who), grant.lease, &units(grant), self.now);
            }
        }
    }

    fn missing(&self, stream: StreamId) -> BTreeSet<u32> {
        let generation = Generation(self.generations[&stream]);
        let stored = self.stored.get(&(stream, generation));
        let is_missing = |sample: &u32| stored.is_none_or(|stored| !stored.contains(sample));
        (0..SAMPLES).filter(is_missing).collect()
    }

    fn want(&mut self, stream: StreamId) {
        let mut new = wanted(stream, self.generations[&stream], 0..SAMPLES);
        let stored: BTreeSet<u32> = (0..SAMPLES)
            .filter(|sample| !self.missing(stream).contains(sample))
            .collect();
        new.missing = ledger::gaps(&stored, SAMPLES);
        new.is_tolerant = stream.kind == ledger::Kind::Point;
        self.ledger.want(new);
    }

    fn take(&mut self, who: usize, which: usize) -> Option<Grant<()>> {
        let held = &mut self.held[who];
        let place = held.len().checked_sub(1 + which)?;
        Some(held.remove(place))
    }

    /// Delivers as the coordinator does: accepted results are stored before the ledger is told.
    fn deliver(&mut self, who: usize, lease: LeaseId, brought: &[Unit]) {
        let mut delivery = Delivery {
            seconds: 0.2,
            ..Delivery::default()
        };
        for unit in brought.iter().filter(|unit| !unit.samples.is_empty()) {
            let expected = unit.generation.0 == self.generations[&unit.stream];
            let accepted = self.ledger.accept(unit);
            // Samples stored before a restart may be unknown after it, and are not needed.
            let missing = self.missing(unit.stream);
            let is_needless = !unit.samples.clone().any(|sample| missing.contains(&sample));
            assert!(expected || accepted == Verdict::Stale, "{unit:?}");
            assert!(
                !expected || is_needless || accepted == Verdict::Yes,
                "{unit:?}"
            );
            if accepted == Verdict::Yes {
                let stored = self
                    .stored
                    .entry((unit.stream, unit.generation))
                    .or_default();
                stored.extend(unit.samples.clone());
                delivery.stored.push(unit.clone());
            }
        }
        let answer = self.ledger.deliver(&name(who), lease, &delivery, self.now);
        self.log.push(format!("{answer:?}"));
    }

    fn check_crashes(&mut self, crashes: Vec<Crash>) {
        for crash in crashes {
            if crash.record.is_alone {
                let crashed = self.crashed_alone.entry(crash.stream).or_default();
                crashed.insert(crash.worker.clone());
                let enough = Options::default().max_crashes;
                assert!(!crash.quarantined || crashed.len() >= enough, "{crash:?}");
            }
            assert!(crash.record.is_alone || !crash.quarantined, "{crash:?}");
            self.log.push(format!("{crash:?}"));
        }
    }

    fn act(&mut self, call: &Call) {
        match *call {
            Call::Lease(who) => {
                let Some(grant) = self.ledger.lease(&name(who), self.now) else {
                    return;
                };
                self.log.push(format!("{grant:?}"));
                assert!(self.names.insert(grant.lease), "a lease number came again");
                assert_eq!(self.names.last(), Some(&grant.lease), "lease numbers grow");
                assert!(!self.ledger.is_draining());
                // Only a control is computed again.
                for unit in units(&grant).iter().filter(|_| !grant.is_control) {
                    let missing = self.missing(unit.stream);
                    assert!(unit.samples.clone().all(|sample| missing.contains(&sample)));
                    assert_eq!(unit.generation.0, self.generations[&unit.stream]);
                }
                self.held[who].push(grant);
            }
            Call::Heartbeat { who, started } => {
                let held: Vec<(LeaseId, bool)> = self.held[who]
                    .iter()
                    .map(|grant| (grant.lease, started))
                    .collect();
                let cancelled = self.ledger.heartbeat(&name(who), &held, self.now);
                self.held[who].retain(|grant| !cancelled.contains(&grant.lease));
                self.log.push(format!("{cancelled:?}"));
            }
            Call::Deliver { who, which, part } => {
                let Some(grant) = self.take(who, which) else {
                    return;
                };
                let mut brought = units(&grant);
                for unit in &mut brought {
                    let count = unit.samples.len() as u32 * part / 10;
                    unit.samples.end = unit.samples.start + count;
                }
                self.deliver(who, grant.lease, &brought);
            }
            Call::DeliverForeign { who, which } => {
                let Some(grant) = self.take(who, which) else {
                    return;
                };
                self.deliver((who + 1) % WORKERS, grant.lease, &units(&grant));
            }
            Call::Fail { who, which } => {
                let Some(grant) = self.take(who, which) else {
                    return;
                };
                let delivery = crate::failure_of(&grant);
                let answer = self
                    .ledger
                    .deliver(&name(who), grant.lease, &delivery, self.now);
                self.log.push(format!("{answer:?}"));
                if answer.0 == [Failure::Conclusive] {
                    let mut unit = units(&grant)[0].clone();
                    unit.samples.end = unit.samples.start + 1;
                    assert_eq!(unit.stream.kind, ledger::Kind::Point);
                    let stored = (unit.stream, unit.generation);
                    let stored = self.stored.entry(stored).or_default();
                    stored.insert(unit.samples.start);
                    self.ledger.conclude(&unit);
                }
            }
            Call::Release { who, which } => {
                let Some(grant) = self.take(who, which) else {
                    return;
                };
                self.ledger.release(&name(who), &[grant.lease], self.now);
            }
            Call::Leave(who) => self.ledger.leaves(&name(who), self.now),
            Call::Pass(leases) => {
                self.now += LEASE.mul_f64(leases);
                let crashes = self.ledger.expire(self.now);
                self.check_crashes(crashes);
            }
            Call::MarkCrashed(who) => {
                let crashes = self.ledger.mark_crashed(&name(who), self.now);
                self.check_crashes(crashes);
            }
            Call::RecordCrash(who) => {
                let held = self.held[who].iter();
                let begun =
                    held.flat_map(|grant| units(grant).into_iter().map(|unit| (grant.lease, unit)));
                let begun: Vec<(LeaseId, Unit)> = begun.take(1).collect();
                let crashes = self.ledger.record_crash(&name(who), &begun);
                self.check_crashes(crashes);
                self.held[who].clear();
                self.ledger.register(&name(who), "here", 2, self.now);
            }
            Call::Drain(is_draining) => self.ledger.set_draining(is_draining),
            Call::Retry => {
                let retried = self.ledger.retry();
                self.log.push(format!("{retried:?}"));
            }
            Call::Change(stream) => {
                *self.generations.get_mut(&id(stream)).expect("it is there") += 1;
                self.crashed_alone.remove(&id(stream));
                self.want(id(stream));
            }
            Call::Restart => self.restart(),
        }
    }

    /// Whatever happened before, one healthy worker finishes all streams.
    fn finish(&mut self) {
        self.now += 100 * LEASE;
        self.ledger.expire(self.now);
        self.ledger.set_draining(false);
        self.ledger.retry();
        let healthy = worker("healthy");
        self.ledger.register(&healthy, "here", 1, self.now);
        let mut turns = 0;
        while let Some(grant) = self.ledger.lease(&healthy, self.now) {
            let brought = units(&grant);
            for unit in brought.iter().filter(|_| !grant.is_control) {
                let stored = self
                    .stored
                    .entry((unit.stream, unit.generation))
                    .or_default();
                let before = stored.len();
                stored.extend(unit.samples.clone());
                assert_eq!(stored.len(), before + unit.samples.len(), "nothing twice");
            }
            let delivery = crate::all_of(&grant);
            self.ledger
                .deliver(&healthy, grant.lease, &delivery, self.now);
            turns += 1;
            assert!(turns < 1000);
        }
        for stream in 0..STREAMS {
            assert!(self.missing(id(stream)).is_empty(), "{}", id(stream));
        }
        let counts = self.ledger.counts();
        assert_eq!(
            (
                counts.free,
                counts.waiting,
                counts.leased,
                counts.quarantined
            ),
            (0, 0, 0, 0)
        );
    }
}

fn play(calls: &[Call]) -> World {
    let mut world = World::new();
    for call in calls {
        world.act(call);
        world.ledger.check();
    }
    world
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_sequence_of_calls_keeps_the_books_and_can_be_finished(
        calls in prop::collection::vec(call(), 0..120)
    ) {
        play(&calls).finish();
    }

    #[test]
    fn the_same_calls_give_the_same_answers(calls in prop::collection::vec(call(), 0..60)) {
        prop_assert_eq!(play(&calls).log, play(&calls).log);
    }
}
