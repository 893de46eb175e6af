//! The simulation of a scenario: a queue of events by time.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::sync::Arc;
use std::time::Duration;

use ledger::{
    Delivery, Generation, HEARTBEATS_PER_LEASE, History, LeaseId, Ledger, Options, StreamDemand,
    StreamId, Unit,
};
use problem::Design;
use problem::task::{Output, Source};
use prost::Message as _;
use rand::RngExt as _;
use rand_distr::{Distribution as _, Exp1, LogNormal};
use runner::cpu::thread_seconds;
use runner::protocol::v1::{LeaseResponse, LeaseResult, ReportRequest};
use stats::streams::{Purpose, StreamRng, stream};

use crate::rehearsal::result::{Calls, Rehearsal};
use crate::rehearsal::scenario::Scenario;
use crate::rehearsal::worker::{HeldLease, Worker};

/// Time that a lease request waits at the coordinator, in seconds.
const LEASE_WAIT: f64 = 5.0;
/// Scatter of the time of a lease: standard deviation of its logarithm.
const SCATTER: f64 = 0.2;
/// Interval between checks for expired leases, in seconds.
const EXPIRY: f64 = 1.0;
/// Minimum time of a sample of an external program, in seconds. Faster simulators are built in.
const EXTERNAL: f64 = 1e-2;
/// Time until a failed worker is replaced, in seconds.
const REPLACED: f64 = 60.0;
/// Number of designs that are added at a time.
const PLANNED: u32 = 10_000;

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Event {
    Start(u32),
    Ask(u32, u32),
    Heartbeat(u32, u32),
    Done(u32, u32, LeaseId),
    Fail(u32, u32),
    Wave,
    Expiry,
}

/// Runs a scenario to its end.
#[must_use]
pub fn rehearse(scenario: &Scenario) -> Rehearsal {
    let mut simulation = Simulation::new(scenario);
    while simulation.step() {}
    simulation.finish()
}

struct Simulation<'a> {
    scenario: &'a Scenario,
    ledger: Ledger<Arc<Source>>,
    workers: Vec<Worker>,
    events: BinaryHeap<Reverse<(u64, u64, Event)>>,
    /// Number of the last event. Events of the same time occur in the order of their numbers.
    scheduled: u64,
    now: f64,
    rng: StreamRng,
    scatter: LogNormal<f64>,
    source: Arc<Source>,
    /// Number of designs added.
    planned: u32,
    outcome: Rehearsal,
    busy_seconds: f64,
}

impl<'a> Simulation<'a> {
    fn new(scenario: &'a Scenario) -> Self {
        let options = Options {
            lease: Duration::from_secs_f64(scenario.lease_seconds),
            // Slow simulators are external programs, whose jobs are single samples until one has come back.
            long_samples: scenario.sample_seconds >= EXTERNAL,
            ..Options::default()
        };
        let workers = (0..scenario.workers).map(|number| Worker::new(number, 0));
        let mut simulation = Self {
            scenario,
            ledger: Ledger::new(options, 1),
            workers: workers.collect(),
            events: BinaryHeap::new(),
            scheduled: 0,
            now: 0.0,
            rng: stream(scenario.seed, Purpose::Test, 7, 0),
            scatter: LogNormal::new(-0.5 * SCATTER * SCATTER, SCATTER)
                .expect("finite and positive"),
            source: Arc::new(Source::Design(Design::new(vec![0.5; 6]))),
            planned: 0,
            outcome: Rehearsal {
                seconds: scenario.seconds,
                samples: 0,
                lost_samples: 0,
                busy: 0.0,
                calls: Calls::default(),
                message_bytes: 0,
                most_leases: 0,
                quarantined: 0,
                ledger_cpu_seconds: 0.0,
            },
            busy_seconds: 0.0,
        };
        for number in 0..scenario.workers {
            // Schedulers start many workers at once, but not in the same instant.
            let at = simulation.rng.random::<f64>();
            simulation.schedule(at, Event::Start(number));
        }
        simulation.schedule(EXPIRY, Event::Expiry);
        if let Some(wave) = scenario.wave {
            simulation.schedule(wave.every_seconds, Event::Wave);
        }
        simulation
    }

    fn schedule(&mut self, after: f64, event: Event) {
        let at = ((self.now + after) * 1e9) as u64;
        self.scheduled += 1;
        self.events.push(Reverse((at, self.scheduled, event)));
    }

    /// Draws the time of a message one way, in seconds.
    fn delay(&mut self) -> f64 {
        let delay: f64 = Exp1.sample(&mut self.rng);
        delay * self.scenario.network_seconds
    }

    /// Does the coordinator's work at an event and measures its CPU time.
    fn coordinate<T>(&mut self, act: impl FnOnce(&mut Ledger<Arc<Source>>, Duration) -> T) -> T {
        let before = thread_seconds();
        let result = act(&mut self.ledger, Duration::from_secs_f64(self.now));
        self.outcome.ledger_cpu_seconds += thread_seconds() - before;
        result
    }

    /// Handles the next event. Returns false at the end.
    fn step(&mut self) -> bool {
        let Some(Reverse((at, _, event))) = self.events.pop() else {
            return false;
        };
        self.now = at as f64 * 1e-9;
        if self.now > self.scenario.seconds {
            return false;
        }
        match event {
            Event::Start(worker) => self.start(worker),
            Event::Ask(worker, life) if self.is_alive(worker, life) => self.ask(worker),
            Event::Heartbeat(worker, life) if self.is_alive(worker, life) => self.heartbeat(worker),
            Event::Done(worker, life, lease) if self.is_alive(worker, life) => {
                self.report(worker, lease);
            }
            Event::Fail(worker, life) if self.is_alive(worker, life) => {
                self.lose(worker, REPLACED);
            }
            Event::Wave => self.wave(),
            Event::Expiry => {
                self.coordinate(|ledger, now| ledger.expire(now));
                self.schedule(EXPIRY, Event::Expiry);
            }
            // An event of a worker process that no longer exists.
            _ => {}
        }
        true
    }

    fn is_alive(&self, worker: u32, life: u32) -> bool {
        let worker = &self.workers[worker as usize];
        worker.is_up && worker.life == life
    }

    fn start(&mut self, number: u32) {
        let worker = &mut self.workers[number as usize];
        worker.is_up = true;
        let (name, life) = (worker.name.clone(), worker.life);
        self.outcome.calls.register += 1;
        let slots = self.scenario.slots as usize;
        self.coordinate(|ledger, now| ledger.register(&name, "simulated", slots, now));
        let beat = self.beat();
        let first = beat * self.rng.random::<f64>();
        self.schedule(first, Event::Heartbeat(number, life));
        if let Some(mean) = self.scenario.failure_seconds {
            let until: f64 = Exp1.sample(&mut self.rng);
            self.schedule(mean * until, Event::Fail(number, life));
        }
        self.consider(number);
    }

    fn beat(&self) -> f64 {
        self.ledger.lease_time().as_secs_f64() / f64::from(HEARTBEATS_PER_LEASE)
    }

    /// Schedules a lease request if the worker needs leases and has no request under way.
    fn consider(&mut self, number: u32) {
        let slots = self.scenario.slots as usize;
        let worker = &mut self.workers[number as usize];
        if worker.asks || worker.wanted(slots).is_none() {
            return;
        }
        worker.asks = true;
        let life = worker.life;
        let delay = self.delay();
        self.schedule(delay, Event::Ask(number, life));
    }

    fn ask(&mut self, number: u32) {
        self.outcome.calls.lease += 1;
        let slots = self.scenario.slots as usize;
        let worker = &mut self.workers[number as usize];
        worker.asks = false;
        let Some(demand) = worker.wanted(slots) else {
            return;
        };
        let (name, life) = (worker.name.clone(), worker.life);
        self.plan();
        let (grants, bytes) = self.coordinate(|ledger, now| {
            let (mut grants, mut worth) = (Vec::new(), 0.0);
            while grants.len() < demand.leases && (grants.is_empty() || worth < demand.seconds) {
                let Some(grant) = ledger.lease(&name, now) else {
                    break;
                };
                worth += grant.seconds;
                grants.push(grant);
            }
            let answer = LeaseResponse {
                leases: grants.iter().map(runner::protocol::lease).collect(),
                directive: 0,
            };
            (grants, answer.encode_to_vec().len())
        });
        self.outcome.message_bytes += bytes as u64;
        if grants.is_empty() {
            let worker = &mut self.workers[number as usize];
            worker.asks = true;
            self.schedule(LEASE_WAIT, Event::Ask(number, life));
            return;
        }
        for grant in grants {
            let units = grant.units.into_iter().map(|(unit, _)| unit);
            self.workers[number as usize].waiting.push_back(HeldLease {
                id: grant.lease,
                units: units.collect(),
                seconds: grant.seconds,
            });
        }
        let delay = self.delay();
        self.compute(number, delay);
        self.consider(number);
        let out = self.ledger.counts().leased as u64;
        self.outcome.most_leases = self.outcome.most_leases.max(out);
    }

    /// Starts waiting leases in free slots.
    fn compute(&mut self, number: u32, delay: f64) {
        loop {
            let worker = &mut self.workers[number as usize];
            if worker.computing.len() >= self.scenario.slots as usize {
                return;
            }
            let Some(held) = worker.waiting.pop_front() else {
                return;
            };
            let (id, life, samples) = (held.id, worker.life, held.samples());
            worker.computing.push(held);
            let scatter = self.scatter.sample(&mut self.rng);
            let seconds = samples as f64 * self.scenario.sample_seconds * scatter;
            self.schedule(delay + seconds, Event::Done(number, life, id));
        }
    }

    fn report(&mut self, number: u32, lease: LeaseId) {
        self.outcome.calls.report += 1;
        let worker = &mut self.workers[number as usize];
        let name = worker.name.clone();
        let place = worker.computing.iter().position(|held| held.id == lease);
        let Some(place) = place else { return };
        let held = worker.computing.swap_remove(place);
        let seconds = held.samples() as f64 * self.scenario.sample_seconds;
        let request = report(&name, &held, seconds);
        self.outcome.message_bytes += request.len() as u64;
        let stored = self.coordinate(|ledger, now| {
            let units = decoded(&request);
            let units: Vec<Unit> = units
                .into_iter()
                .filter(|unit| ledger.accept(unit) == ledger::Verdict::Yes)
                .collect();
            let stored: u64 = units.iter().map(|unit| unit.samples.len() as u64).sum();
            let delivery = Delivery {
                stored: units,
                seconds,
                ..Delivery::default()
            };
            ledger.deliver(&name, lease, &delivery, now);
            stored
        });
        self.outcome.samples += stored;
        self.busy_seconds += seconds;
        self.compute(number, 0.0);
        self.consider(number);
    }

    fn heartbeat(&mut self, number: u32) {
        self.outcome.calls.heartbeat += 1;
        let worker = &self.workers[number as usize];
        let (name, life, held) = (worker.name.clone(), worker.life, worker.states());
        let cancelled = self.coordinate(|ledger, now| ledger.heartbeat(&name, &held, now));
        let worker = &mut self.workers[number as usize];
        worker.waiting.retain(|held| !cancelled.contains(&held.id));
        let beat = self.beat();
        self.schedule(beat, Event::Heartbeat(number, life));
    }

    /// Ends a worker without notice; another process takes its place after `away` seconds.
    fn lose(&mut self, number: u32, away: f64) {
        let worker = &mut self.workers[number as usize];
        self.outcome.lost_samples += worker.computing.iter().map(HeldLease::samples).sum::<u64>();
        *worker = Worker::new(number, worker.life + 1);
        worker.is_up = false;
        self.schedule(away, Event::Start(number));
    }

    /// Preempts a share of the workers, which release their leases.
    fn wave(&mut self) {
        let Some(wave) = self.scenario.wave else {
            return;
        };
        for number in 0..self.scenario.workers {
            let worker = &self.workers[number as usize];
            if !worker.is_up || self.rng.random::<f64>() >= wave.share {
                continue;
            }
            let (name, held) = (worker.name.clone(), worker.states());
            let held: Vec<LeaseId> = held.into_iter().map(|(id, _)| id).collect();
            self.outcome.calls.release += 1;
            self.coordinate(|ledger, now| {
                ledger.release(&name, &held, now);
                ledger.leaves(&name, now);
            });
            self.lose(number, wave.away_seconds);
        }
        self.schedule(wave.every_seconds, Event::Wave);
    }

    /// Adds designs when few are left.
    fn plan(&mut self) {
        let few = PLANNED.max(2 * self.scenario.workers * self.scenario.slots) as usize;
        while self.ledger.counts().free < few {
            let (source, samples) = (Arc::clone(&self.source), self.scenario.samples_per_design);
            let first = self.planned;
            self.planned += PLANNED;
            self.coordinate(|ledger, _| {
                for design in first..first + PLANNED {
                    ledger.want(StreamDemand {
                        stream: StreamId::design(design),
                        generation: Generation(1),
                        source: Arc::clone(&source),
                        samples,
                        missing: std::iter::once(0..samples).collect(),
                        history: History::default(),
                        is_tolerant: false,
                        is_analysed: true,
                    });
                }
            });
        }
    }

    fn finish(mut self) -> Rehearsal {
        let slots = f64::from(self.scenario.workers) * f64::from(self.scenario.slots);
        self.outcome.busy = self.busy_seconds / (slots * self.scenario.seconds);
        self.outcome.quarantined = self.ledger.counts().quarantined as u64;
        self.outcome
    }
}

/// An encoded report.
fn report(name: &ledger::WorkerId, held: &HeldLease, seconds: f64) -> Vec<u8> {
    let result = |unit: &Unit| {
        let samples = vec![1.5; unit.samples.len()].into();
        let output = match unit.samples.start {
            0 => Output::Design {
                responses: vec![1.0; 10],
                ruled_out: None,
                samples,
            },
            _ => Output::Samples(samples),
        };
        runner::protocol::result(unit, &Ok(Some(output)), seconds)
    };
    let result = LeaseResult {
        id: Some(held.id.into()),
        results: held.units.iter().map(result).collect(),
        wall_seconds: seconds,
        origin: None,
    };
    let request = ReportRequest {
        worker_id: name.to_string(),
        results: vec![result],
    };
    request.encode_to_vec()
}

/// The units of an encoded report.
fn decoded(request: &[u8]) -> Vec<Unit> {
    let request = ReportRequest::decode(request).unwrap_or_default();
    let results = request.results.iter().flat_map(|result| &result.results);
    results
        .filter_map(|result| Some(runner::protocol::output(result, 1).ok()?.0))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rehearsal::Wave;

    fn scenario() -> Scenario {
        Scenario {
            slots: 4,
            seconds: 120.0,
            ..Scenario::new(50, 0.5)
        }
    }

    #[test]
    fn a_rehearsal_depends_on_its_seed_alone() {
        let of = |seed| Rehearsal {
            ledger_cpu_seconds: 0.0,
            ..rehearse(&Scenario { seed, ..scenario() })
        };
        assert_eq!(of(1), of(1));
        assert_ne!(of(1), of(2));
    }

    #[test]
    fn workers_without_failures_are_busy_and_lose_nothing() {
        let found = rehearse(&scenario());
        // 200 slots at 0.5 s a sample give 400 samples a second, less the start and the unfinished
        // samples at the end.
        assert!(
            found.samples <= 48_000 && found.samples > 40_000,
            "{found:?}"
        );
        assert!(found.busy > 0.85 && found.busy <= 1.05, "{found:?}");
        assert_eq!((found.lost_samples, found.quarantined), (0, 0));
        assert_eq!(found.calls.register, 50);
    }

    #[test]
    fn preemption_and_failures_cost_samples_and_quarantine_nothing() {
        let calm = rehearse(&scenario());
        let waves = Scenario {
            wave: Some(Wave {
                every_seconds: 20.0,
                share: 0.5,
                away_seconds: 5.0,
            }),
            ..scenario()
        };
        let waves = rehearse(&waves);
        assert!(
            waves.calls.release > 0 && waves.lost_samples > 0,
            "{waves:?}"
        );
        assert!(
            waves.samples < calm.samples && waves.samples > calm.samples / 3,
            "{waves:?}"
        );
        assert_eq!(waves.quarantined, 0);
        let failing = Scenario {
            failure_seconds: Some(300.0),
            ..scenario()
        };
        let failing = rehearse(&failing);
        assert!(
            failing.lost_samples > 0 && failing.calls.register > 50,
            "{failing:?}"
        );
        assert_eq!(failing.quarantined, 0);
    }

    #[test]
    fn heartbeats_of_many_workers_do_not_grow_with_their_number() {
        let many = Scenario {
            seconds: 60.0,
            ..Scenario::new(20_000, 60.0)
        };
        let found = rehearse(&many);
        // The first workers to register got the shorter interval once.
        let rate = found.calls.heartbeat as f64 / found.seconds;
        assert!(rate < 1000.0, "{rate} heartbeats a second");
        let few = rehearse(&scenario());
        assert!(
            (few.calls.heartbeat as f64 - 50.0 * 120.0 / 5.0).abs() < 60.0,
            "{few:?}"
        );
    }
}
