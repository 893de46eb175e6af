//! A store and workers in memory, whose results are digests of their inputs.

use std::collections::BTreeMap;

use sha2::{Digest as _, Sha256};

use problem::task::FIRST_INFILL;

use super::super::*;
use crate::derived::generation_inputs;
use crate::names;
use crate::state::{OpenDesign, Progress};

/// Number of infill points of a round.
const POINTS: u64 = 2;
/// Number of rounds before the one that stops.
const ROUNDS: usize = 3;
/// Number of designs that a fit needs.
const FITTED: usize = 3;

/// A point of a round.
#[derive(Debug, Clone, PartialEq)]
struct Infill {
    number: u64,
    is_sampled: bool,
    has_failed: bool,
}

/// A campaign in memory.
pub(super) struct World {
    pub(super) problem: Problem,
    inputs: Inputs,
    pub(super) state: State,
    /// The designs with samples, and the base that these were computed for.
    sampled: BTreeMap<u32, String>,
    rounds: Vec<Vec<Infill>>,
    /// The design and the number of the verification samples of each approach.
    pub(super) verified: BTreeMap<Approach, (Design, u32)>,
    /// The streams that fail.
    pub(super) down: fn(StreamId) -> bool,
    /// The share of streams that fail, besides, in percent.
    share: u64,
    pub(super) seed: u64,
    turn: u64,
    pub(super) steps: Vec<LocalStep>,
    pub(super) stages: Vec<Stage>,
    /// Number of results delivered.
    pub(super) delivered: usize,
}

fn hash(of: &str) -> u64 {
    let digest = Sha256::digest(of);
    u64::from_le_bytes(*digest.first_chunk().unwrap())
}

impl World {
    pub(super) fn new(campaign: Campaign) -> Self {
        Self {
            inputs: Inputs::new(&campaign, None),
            problem: Problem::new(campaign),
            state: State::default(),
            sampled: BTreeMap::new(),
            rounds: Vec::new(),
            verified: BTreeMap::new(),
            down: |_| false,
            share: 0,
            seed: 0,
            turn: 0,
            steps: Vec::new(),
            stages: Vec::new(),
            delivered: 0,
        }
    }

    pub(super) fn next(&self) -> Next {
        next(&self.problem, &self.inputs, &self.state)
    }

    fn draw(&mut self, below: u64) -> u64 {
        self.turn += 1;
        hash(&format!("{} {}", self.seed, self.turn)) % below
    }

    /// Updates the state as it would be read from the store.
    pub(super) fn load(&mut self) {
        let missing = (0..self.state.designs as u32).filter(|d| !self.sampled.contains_key(d));
        let open = |design| OpenDesign {
            design,
            x: vec![0.5; 6],
            samples: 30,
            missing: std::iter::once(0..30).collect(),
            responses: None,
        };
        self.state.open = missing.map(open).collect();
        self.state.samples = format!("{:?}", self.sampled);
        self.state.criteria = format!("{} criteria", self.sampled.len());
        let mut progress = Progress {
            is_stopped: self.rounds.last().is_some_and(Vec::is_empty),
            ..Progress::default()
        };
        for points in &self.rounds {
            let known = points.iter().map(|point| (point.number, point.is_sampled));
            progress
                .rounds
                .push(format!("{:?}", known.collect::<Vec<_>>()));
            for point in points {
                progress.numbers.insert(point.number);
                if !point.is_sampled {
                    progress.points.push(VerifyPoint {
                        number: point.number,
                        design: self.problem.base().clone(),
                        wanted: 30,
                        stored: BTreeSet::new(),
                        asks_criteria: false,
                    });
                }
            }
        }
        self.state.enrichment = progress;
        (self.state.verified, self.state.stale) = Default::default();
        let wanted = self.problem.campaign().verify.first();
        for (&approach, (design, count)) in &self.verified {
            match self.state.optima.get(&approach) {
                Some(Some(chosen)) if chosen == design => {
                    let sizes = (wanted, (0..*count).collect());
                    self.state.verified.insert(approach, sizes);
                }
                Some(_) => {
                    self.state.stale.insert(approach);
                }
                None => {}
            }
        }
    }

    /// One pass of a coordinator. Returns whether the campaign is finished.
    pub(super) fn pass(&mut self) -> bool {
        self.load();
        let next = self.next();
        if !next.outdated.is_empty() {
            next.outdated.iter().for_each(|result| self.remove(result));
            self.load();
            return false;
        }
        self.state.quarantined.retain(|stream| next.needs(*stream));
        let stage = Some(next.stage());
        self.stages
            .extend(stage.filter(|stage| *stage != Stage::Done));
        if let Some(samples) = &next.samples {
            let name = samples.name.clone();
            self.state.derivations.insert(name, samples.clone());
        }
        if let Some(step) = next.local {
            self.steps.push(step);
            self.perform(step, &next.inputs);
            self.load();
            return false;
        }
        let runs = next.runs.iter().map(Run::stream);
        let designs = self
            .state
            .open
            .iter()
            .map(|open| StreamId::design(open.design));
        let designs = designs.filter(|_| next.sampling.is_some());
        let points = next
            .points
            .iter()
            .map(|point| StreamId::point(point.number));
        let open: Vec<StreamId> = runs.chain(designs).chain(points).collect();
        let open: Vec<StreamId> = open
            .into_iter()
            .filter(|stream| !self.state.quarantined.contains(stream))
            .collect();
        if open.is_empty() {
            assert!(next.is_finished(), "{next:?}");
            return true;
        }
        let stream = open[self.draw(open.len() as u64) as usize];
        let fails = hash(&format!("{} {stream}", self.seed)) % 100 < self.share;
        if fails || (self.down)(stream) {
            self.state.quarantined.insert(stream);
        } else {
            self.deliver(stream, &next);
        }
        self.load();
        false
    }

    pub(super) fn pass_until(&mut self, is_there: impl Fn(&Next) -> bool) {
        while !is_there(&self.next()) {
            assert!(!self.pass(), "the campaign is finished");
        }
    }

    pub(super) fn finish(&mut self) {
        for _ in 0..2000 {
            if self.pass() {
                return;
            }
        }
        panic!("no end: {:?}", self.next());
    }

    /// Retries the quarantined streams.
    pub(super) fn retry(&mut self, down: fn(StreamId) -> bool) {
        self.down = down;
        self.state.quarantined.clear();
    }

    /// Runs the campaign through outages and repairs, the last of which repairs everything.
    pub(super) fn disturb(&mut self) {
        for share in [[100, 30, 60, 5][self.seed as usize % 4], 20, 10, 0] {
            self.share = share;
            for _ in 0..self.draw(200) {
                self.pass();
            }
            if self.draw(3) > 0 || share == 0 {
                self.finish();
            }
            self.state.quarantined.clear();
            // Other streams fail the next time.
            self.seed += 1 << 32;
        }
        self.finish();
    }

    pub(super) fn extend(&mut self, larger: Campaign) {
        self.problem = Problem::new(larger);
        self.remove(&DerivedResult::Responses);
        self.load();
    }

    /// Checks that nothing differs from a campaign without failures.
    pub(super) fn assert_undisturbed(&self) {
        let mut undisturbed = Self::new(self.problem.campaign().clone());
        undisturbed.finish();
        assert_eq!(self.state, undisturbed.state, "seed {:#x}", self.seed);
        assert_eq!(self.rounds, undisturbed.rounds, "seed {:#x}", self.seed);
    }

    fn remove(&mut self, result: &DerivedResult) {
        self.state.derivations.remove(&result.name());
        match result {
            DerivedResult::Samples => self.sampled.clear(),
            DerivedResult::Responses => {}
            DerivedResult::Model => self.state.models.clear(),
            DerivedResult::Run(stream) => {
                let run = names::approach_and_start(*stream).unwrap();
                self.state.runs.remove(&run);
            }
            DerivedResult::Round(round) => {
                assert_eq!(self.rounds.len() as u64, round + 1, "the last round first");
                self.rounds.pop();
                for point in self.rounds.last_mut().into_iter().flatten() {
                    point.has_failed = false;
                }
            }
            DerivedResult::Optimum(stream) => {
                let is_it = |approach: &Approach| names::verification(*approach) == *stream;
                self.state.optima.retain(|held, _| !is_it(held));
            }
            DerivedResult::Verification(stream) => {
                let is_it = |approach: &Approach| names::verification(*approach) == *stream;
                self.verified.retain(|held, _| !is_it(held));
            }
        }
    }

    fn perform(&mut self, step: LocalStep, inputs: &str) {
        let mut derivation =
            |of: DerivedResult, output: Option<String>, failure: Option<String>| {
                let derivation = Derivation {
                    output,
                    failure,
                    ..Derivation::new(&of, inputs)
                };
                self.state.derivations.insert(of.name(), derivation);
            };
        match step {
            LocalStep::Doe => self.state.designs = self.problem.campaign().doe.designs as usize,
            LocalStep::Statistics => {
                derivation(
                    DerivedResult::Responses,
                    Some(format!("{:?}", self.sampled)),
                    None,
                );
            }
            LocalStep::Fit => {
                let failure = (self.sampled.len() < FITTED).then(|| "too few".to_owned());
                let model = failure
                    .is_none()
                    .then(|| format!("model of {inputs}").into());
                derivation(DerivedResult::Model, None, failure);
                self.state.models = model.into_iter().collect();
            }
            LocalStep::Enrich => {
                let round = self.rounds.len();
                derivation(DerivedResult::Round(round as u64), None, None);
                let mut has_failed = round > 1;
                for points in self.rounds.iter().rev().take(2) {
                    has_failed &= points.iter().all(|point| !point.is_sampled);
                }
                for point in self.rounds.iter_mut().flatten() {
                    point.has_failed |= !point.is_sampled;
                }
                let point = |index: u64| Infill {
                    // The last two digits are those of round and point.
                    number: FIRST_INFILL
                        + (hash(&format!("{inputs} {index}")) % 100_000 * 100 + 100
                            - FIRST_INFILL % 100)
                        + round as u64 * 10
                        + index,
                    is_sampled: false,
                    has_failed: false,
                };
                let stops = round == ROUNDS || has_failed;
                let points = if stops { 0..0 } else { 0..POINTS };
                self.rounds.push(points.map(point).collect());
            }
            LocalStep::Choose(approach) => {
                derivation(
                    DerivedResult::Optimum(names::verification(approach)),
                    None,
                    None,
                );
                let model = self.state.derivations.get(&DerivedResult::Model.name());
                let has_failed = model.is_some_and(|model| model.failure.is_some());
                let is_none = approach == Approach::Kriging && has_failed;
                let values = [(hash(inputs) % 1000) as f64 / 1000.0; 6];
                let design = self.problem.design(&values, self.problem.base());
                let mut values = design.values().to_vec();
                // The variables that the DoE does not move differ, too.
                values
                    .iter_mut()
                    .for_each(|value| *value += 1e-3 * values_of(inputs));
                let design = Design::new(values);
                self.state
                    .optima
                    .insert(approach, (!is_none).then_some(design));
            }
        }
    }

    fn deliver(&mut self, stream: StreamId, next: &Next) {
        self.delivered += 1;
        match stream.kind {
            Kind::Design => {
                let base = format!("{:?}", next.sampling);
                self.sampled.insert(stream.index as u32, base);
            }
            Kind::Run => {
                let run = next.runs.iter().find(|run| run.stream() == stream).unwrap();
                let source = problem::task::Source::Run(run.clone());
                let inputs = generation_inputs(self.inputs.generation(stream, &source));
                let of = DerivedResult::Run(run.stream());
                let derivation = Derivation {
                    output: Some(format!("result of {inputs}")),
                    ..Derivation::new(&of, inputs)
                };
                self.state.derivations.insert(of.name(), derivation);
                self.state.runs.insert((run.approach, run.start));
            }
            Kind::Point => {
                let points = self.rounds.iter_mut().flatten();
                for point in points.filter(|point| point.number == stream.index) {
                    point.is_sampled = true;
                }
                let wanted = self.problem.campaign().verify.first();
                if let Some(approach) = Approach::numbered(stream.index) {
                    let design = self.state.optima[&approach].clone().unwrap();
                    self.verified.insert(approach, (design, wanted));
                }
            }
        }
    }
}

fn values_of(inputs: &str) -> f64 {
    (hash(&format!("base {inputs}")) % 1000) as f64
}
