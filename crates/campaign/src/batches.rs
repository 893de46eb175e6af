//! Samples cut into jobs whose size follows what they cost.
//!
//! A sample may take microseconds or hours. [`Batches`] knows which samples are missing, hands them
//! out in jobs that should take about [`TARGET_SECONDS`], and takes back what a job left undone. It
//! decides nothing that could change a result: every sample has a random stream of its own, so how
//! they are cut only matters for the time they take.
//!
//! A job that brings its workers down is split into jobs of one design each before anything is
//! given up, so that one poisonous design does not take its neighbours with it.

mod ranges;
#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use ranges::{gaps, join, overlap, subtract};

use crate::formulation::{Frozen, ROBUST_VARIABLES, Variables};
use crate::plan::{JobKind, OpenDesign, VerifyPoint};
use crate::task::{SampleRange, SampleRequest, Task};

/// How long a job should take: much longer than a round trip, short enough that losing a worker
/// loses little.
pub const TARGET_SECONDS: f64 = 1.0;

/// A job gets at most this part of what is left per slot, so that all slots end together.
const PARTS_PER_SLOT: u64 = 3;

/// The criteria of a design cost about as much as this many samples of the built-in simulator.
const DESIGN_WEIGHT: u64 = 20;

/// The most samples of a job, whatever they cost: its result must stay far below the largest message.
const SAMPLES_MAX: u64 = 200_000;

/// The weight of the first jobs, before anything is known about what a sample costs.
const FIRST_WEIGHT: u64 = DESIGN_WEIGHT + 10;

/// How long a job of one sample is taken to last where samples may be long, in seconds, before one
/// has come back: so long that nobody holds a second one.
const UNKNOWN_SECONDS: f64 = 2.0;

/// How much a new measurement counts against the earlier ones.
const LEARNING_RATE: f64 = 0.3;

/// Bits of a job's number: kind 8, splits 4, design or point 28, first sample 24.
const INDEX_SHIFT: u32 = 24;
const SPLIT_SHIFT: u32 = 52;

/// A design of the DoE, or a point that gets fresh samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum StreamId {
    /// The index of a design.
    Design(u32),
    /// The number of a point.
    Point(u64),
}

impl StreamId {
    const fn kind(self) -> JobKind {
        match self {
            Self::Design(_) => JobKind::Sample,
            Self::Point(_) => JobKind::Verify,
        }
    }

    const fn index(self) -> u64 {
        match self {
            Self::Design(index) => index as u64,
            Self::Point(number) => number,
        }
    }
}

#[derive(Debug, Clone)]
enum Source {
    Design([f64; ROBUST_VARIABLES]),
    Point { name: String, variables: Variables },
}

/// The samples of one design or point.
#[derive(Debug, Clone)]
struct Stream {
    source: Source,
    /// Not stored: disjoint, ascending.
    missing: Vec<Range<u32>>,
    /// The part of them that no job holds.
    free: Vec<Range<u32>>,
    /// Whether a job with this among others was given up.
    is_suspect: bool,
    is_given_up: bool,
}

/// The part of one stream that a job holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Unit {
    stream: StreamId,
    samples: SampleRange,
}

/// What is known about the cost of samples, and which are missing, leased or stored.
#[derive(Debug, Clone, Default)]
pub struct Batches {
    frozen: Option<Frozen>,
    streams: BTreeMap<StreamId, Stream>,
    /// The streams with free samples.
    free: BTreeSet<StreamId>,
    jobs: BTreeMap<u64, Vec<Unit>>,
    /// Streams with missing samples that are not given up, by group.
    open_designs: usize,
    open_points: BTreeSet<u64>,
    /// Seconds per weight of the jobs of each kind that have come back.
    pace: BTreeMap<JobKind, f64>,
    /// Whether a sample may take hours.
    are_long: bool,
}

impl Batches {
    /// Cuts jobs of one sample until one of their kind has come back: it may take hours.
    pub const fn expect_long_samples(&mut self) {
        self.are_long = true;
    }

    /// Makes the missing samples of the DoE available; what is known already stays as it is.
    pub fn add_designs(&mut self, frozen: Frozen, designs: &[OpenDesign]) {
        self.frozen = Some(frozen);
        for design in designs {
            let id = StreamId::Design(design.design);
            if design.missing.is_empty() || self.streams.contains_key(&id) {
                continue;
            }
            self.open_designs += 1;
            self.add(id, Source::Design(design.x), design.missing.clone());
        }
    }

    /// Makes the missing samples of a point available; one that is known already stays as it is.
    pub fn add_point(&mut self, point: &VerifyPoint) {
        let id = StreamId::Point(point.number);
        if self.streams.contains_key(&id) {
            return;
        }
        let missing = gaps(&point.stored, point.wanted);
        if missing.is_empty() {
            return;
        }
        self.open_points.insert(point.number);
        let source = Source::Point {
            name: point.name.clone(),
            variables: point.variables,
        };
        self.add(id, source, missing);
    }

    /// Forgets these points, as when what they were chosen by is learned anew: the same or others may
    /// come in their place, and none of their samples is stored any more. Returns their jobs.
    pub fn forget_points(&mut self, which: impl Fn(u64) -> bool) -> Vec<u64> {
        let is_gone = |id: &StreamId| matches!(id, StreamId::Point(number) if which(*number));
        self.streams.retain(|id, _| !is_gone(id));
        self.free.retain(|id| !is_gone(id));
        self.open_points.retain(|number| !which(*number));
        let is_gone = |units: &Vec<Unit>| units.iter().any(|unit| is_gone(&unit.stream));
        let jobs = self.jobs.extract_if(.., |_, units| is_gone(units));
        jobs.map(|(job, _)| job).collect()
    }

    fn add(&mut self, id: StreamId, source: Source, missing: Vec<Range<u32>>) {
        let stream = Stream {
            source,
            free: missing.clone(),
            missing,
            is_suspect: false,
            is_given_up: false,
        };
        self.streams.insert(id, stream);
        self.free.insert(id);
    }

    /// The next job for workers of `slots` slots in all; none when nothing is free.
    pub fn draw(&mut self, slots: usize) -> Option<(u64, Task)> {
        let first = *self.free.first()?;
        let kind = first.kind();
        let target = self.target(kind, slots);
        let splits = u64::from(self.streams.get(&first)?.is_suspect);
        let mut units: Vec<Unit> = Vec::new();
        let (mut weight, mut samples) = (0, 0);
        while let Some(&id) = self.free.first()
            && id.kind() == kind
        {
            let stream = self.streams.get(&id)?;
            let is_alone = stream.is_suspect || kind == JobKind::Verify;
            if !units.is_empty() && is_alone {
                break;
            }
            let range = stream.free.first()?.clone();
            let count = u64::from(range.end - range.start);
            let room = target.saturating_sub(weight + DESIGN_WEIGHT);
            // A design is computed anew by every job that samples it, so it is cut only when it is
            // too much for one job.
            let take = if units.is_empty() {
                count.min(room.max(1))
            } else if count <= room {
                count
            } else {
                break;
            };
            if samples + take > SAMPLES_MAX && !units.is_empty() {
                break;
            }
            let take = take.min(SAMPLES_MAX);
            let taken = SampleRange {
                first: range.start,
                count: take as u32,
            };
            self.take(id, taken);
            units.push(Unit {
                stream: id,
                samples: taken,
            });
            weight += take + DESIGN_WEIGHT;
            samples += take;
            if is_alone || weight >= target {
                break;
            }
        }
        let start = units.first()?;
        let job = number(kind, splits, start.stream.index(), start.samples.first);
        let task = self.task(&units)?;
        self.jobs.insert(job, units);
        Some((job, task))
    }

    /// Takes over a job that a worker holds since before a restart; false if its samples are not
    /// missing or somebody else has them.
    pub fn adopt(&mut self, job: u64, task: &Task) -> bool {
        let Some(units) = self.units(task) else {
            return false;
        };
        if self.jobs.contains_key(&job) || units.is_empty() {
            return false;
        }
        let is_free = |unit: &Unit| {
            let wanted = unit.range();
            self.streams
                .get(&unit.stream)
                .is_some_and(|stream| stream.free.iter().any(|range| overlap(range, &wanted)))
        };
        if !units.iter().any(is_free) {
            return false;
        }
        for unit in &units {
            self.take(unit.stream, unit.samples);
        }
        self.jobs.insert(job, units);
        true
    }

    /// Notes samples that are on disk, whoever computed them.
    pub fn stored(&mut self, stream: StreamId, samples: SampleRange) {
        let range = samples.first..samples.first.saturating_add(samples.count);
        if let Some(state) = self.streams.get_mut(&stream) {
            subtract(&mut state.missing, &range);
            subtract(&mut state.free, &range);
        }
        self.settle(stream);
    }

    /// Notes a design that cannot be simulated, or that its constraints rule out: it needs no samples.
    pub fn refused(&mut self, design: u32) {
        let id = StreamId::Design(design);
        if let Some(state) = self.streams.get_mut(&id) {
            state.missing.clear();
            state.free.clear();
        }
        self.settle(id);
    }

    /// Ends a job whose results are stored: what it did not bring is free again.
    ///
    /// `seconds` is what it took, if that is known.
    pub fn close(&mut self, job: u64, seconds: Option<f64>) {
        let Some(units) = self.jobs.remove(&job) else {
            return;
        };
        if let Some(seconds) = seconds.filter(|seconds| seconds.is_finite() && *seconds > 0.0)
            && let Some(kind) = units.first().map(|unit| unit.stream.kind())
        {
            let measured = seconds / weight(&units) as f64;
            self.pace
                .entry(kind)
                .and_modify(|pace| *pace += LEARNING_RATE * (measured - *pace))
                .or_insert(measured);
        }
        for unit in units {
            self.free_again(unit);
        }
    }

    /// Notes a job that was given up. One of several designs is split: it ends, and its designs
    /// become jobs of their own. Only a job of one design, or of a point, gives that up; it stays
    /// known for [`Self::retry`], and this returns what it samples.
    pub fn give_up(&mut self, job: u64) -> Option<StreamId> {
        let units = self.jobs.get(&job)?;
        if let [unit] = units.as_slice() {
            let id = unit.stream;
            let state = self.streams.get_mut(&id)?;
            state.free.clear();
            self.free.remove(&id);
            if !std::mem::replace(&mut state.is_given_up, true) {
                self.no_longer_open(id);
            }
            return Some(id);
        }
        for unit in self.jobs.remove(&job)? {
            if let Some(state) = self.streams.get_mut(&unit.stream) {
                state.is_suspect = true;
            }
            self.free_again(unit);
        }
        None
    }

    /// Gives designs and points that were given up another chance. The jobs that failed on them
    /// are taken to be out again; the rest of their samples is free.
    pub fn retry(&mut self) {
        let given_up: Vec<StreamId> = self.given_up().collect();
        for id in given_up {
            let Some(state) = self.streams.get_mut(&id) else {
                continue;
            };
            state.is_given_up = false;
            state.free = state.missing.clone();
            let held = self.jobs.values().flatten();
            for unit in held.filter(|unit| unit.stream == id) {
                subtract(&mut state.free, &unit.range());
            }
            if !state.free.is_empty() {
                self.free.insert(id);
            }
            match id {
                StreamId::Design(_) => self.open_designs += 1,
                StreamId::Point(number) => {
                    self.open_points.insert(number);
                }
            }
        }
    }

    /// What was given up.
    pub fn given_up(&self) -> impl Iterator<Item = StreamId> + '_ {
        self.streams
            .iter()
            .filter(|(_, state)| state.is_given_up)
            .map(|(&id, _)| id)
    }

    /// The jobs all of whose designs and points were given up: those that were the last straw, which
    /// stay for [`Self::retry`], and others of the same designs, which nobody needs to do.
    #[must_use]
    pub fn needless(&self) -> Vec<u64> {
        let is_given_up = |unit: &Unit| {
            let stream = self.streams.get(&unit.stream);
            stream.is_some_and(|stream| stream.is_given_up)
        };
        let jobs = self.jobs.iter();
        jobs.filter(|(_, units)| units.iter().all(is_given_up))
            .map(|(job, _)| *job)
            .collect()
    }

    /// Whether every design has its samples or was given up.
    #[must_use]
    pub const fn designs_are_settled(&self) -> bool {
        self.open_designs == 0
    }

    /// Whether the point has its samples or was given up.
    #[must_use]
    pub fn point_is_settled(&self, number: u64) -> bool {
        !self.open_points.contains(&number)
    }

    /// Whether samples could be handed out.
    #[must_use]
    pub fn has_free(&self) -> bool {
        !self.free.is_empty()
    }

    /// The design, or the point's variables, that a job's results must belong to.
    #[must_use]
    pub fn variables_of(&self, point: u64) -> Option<&Variables> {
        match &self.streams.get(&StreamId::Point(point))?.source {
            Source::Point { variables, .. } => Some(variables),
            Source::Design(_) => None,
        }
    }

    /// How long a job is expected to take, in seconds; none for a job that is not cut here.
    #[must_use]
    pub fn expected(&self, job: u64) -> Option<f64> {
        let units = self.jobs.get(&job)?;
        let pace = self.pace.get(&units.first()?.stream.kind());
        Some(match pace {
            Some(pace) => pace * weight(units) as f64,
            None if self.are_long => UNKNOWN_SECONDS,
            None => TARGET_SECONDS,
        })
    }

    /// How long the longest of the jobs that are out is expected to take, in seconds.
    #[must_use]
    pub fn longest_expected(&self) -> Option<f64> {
        let expected = self.jobs.keys().filter_map(|job| self.expected(*job));
        expected.reduce(f64::max)
    }

    /// How much a job may weigh.
    fn target(&self, kind: JobKind, slots: usize) -> u64 {
        let affordable = match self.pace.get(&kind) {
            Some(pace) => (TARGET_SECONDS / pace).min(1e9) as u64,
            None if self.are_long => 0,
            None => FIRST_WEIGHT,
        };
        // Counting exactly would cost more than it is worth: what is free is taken to be whole.
        let streams = self.free.len() as u64;
        let per_stream = self
            .free
            .first()
            .and_then(|id| self.streams.get(id))
            .map_or(0, |stream| {
                stream
                    .free
                    .iter()
                    .map(|range| u64::from(range.end - range.start))
                    .sum()
            });
        let left = streams * (per_stream + DESIGN_WEIGHT);
        let share = left / (PARTS_PER_SLOT * slots.max(1) as u64);
        // Cutting a cheap design only to end at the same moment would compute its criteria twice.
        let whole = per_stream + DESIGN_WEIGHT;
        affordable.min(share.max(whole)).max(DESIGN_WEIGHT + 1)
    }

    fn task(&self, units: &[Unit]) -> Option<Task> {
        let first = units.first()?;
        match &self.streams.get(&first.stream)?.source {
            Source::Point { name, variables } => Some(Task::Verify {
                point: name.clone(),
                number: first.stream.index(),
                variables: *variables,
                samples: first.samples,
            }),
            Source::Design(_) => {
                let request = |unit: &Unit| match (&self.streams.get(&unit.stream)?.source, unit) {
                    (
                        Source::Design(x),
                        Unit {
                            stream: StreamId::Design(design),
                            samples,
                        },
                    ) => Some(SampleRequest {
                        design: *design,
                        x: *x,
                        samples: *samples,
                    }),
                    _ => None,
                };
                Some(Task::Sample {
                    frozen: self.frozen?,
                    designs: units.iter().filter_map(request).collect(),
                })
            }
        }
    }

    /// The units of a task, if it samples what is known here.
    fn units(&self, task: &Task) -> Option<Vec<Unit>> {
        match task {
            Task::Sample { frozen, designs } => {
                if self.frozen != Some(*frozen) {
                    return None;
                }
                let unit = |request: &SampleRequest| {
                    let stream = StreamId::Design(request.design);
                    match self.streams.get(&stream)?.source {
                        Source::Design(x) if x == request.x => Some(Unit {
                            stream,
                            samples: request.samples,
                        }),
                        _ => None,
                    }
                };
                designs.iter().map(unit).collect()
            }
            Task::Verify {
                number,
                variables,
                samples,
                ..
            } => (self.variables_of(*number) == Some(variables)).then(|| {
                vec![Unit {
                    stream: StreamId::Point(*number),
                    samples: *samples,
                }]
            }),
            Task::Optimise { .. } => None,
        }
    }

    fn take(&mut self, id: StreamId, samples: SampleRange) {
        if let Some(state) = self.streams.get_mut(&id) {
            subtract(
                &mut state.free,
                &(samples.first..samples.first.saturating_add(samples.count)),
            );
            if state.free.is_empty() {
                self.free.remove(&id);
            }
        }
    }

    fn free_again(&mut self, unit: Unit) {
        let Some(state) = self.streams.get_mut(&unit.stream) else {
            return;
        };
        if state.is_given_up {
            return;
        }
        let wanted = unit.range();
        for range in &state.missing {
            let (start, end) = (range.start.max(wanted.start), range.end.min(wanted.end));
            if start < end {
                subtract(&mut state.free, &(start..end));
                state.free.push(start..end);
            }
        }
        join(&mut state.free);
        if !state.free.is_empty() {
            self.free.insert(unit.stream);
        }
    }

    /// Keeps the books after samples of a stream were stored.
    fn settle(&mut self, id: StreamId) {
        let Some(state) = self.streams.get(&id) else {
            return;
        };
        if state.free.is_empty() {
            self.free.remove(&id);
        }
        if !state.missing.is_empty() {
            return;
        }
        if !state.is_given_up {
            self.no_longer_open(id);
        }
        // A point stays, since a worker may still ask whether its variables are the right ones.
        if matches!(id, StreamId::Design(_)) {
            self.streams.remove(&id);
        }
    }

    fn no_longer_open(&mut self, id: StreamId) {
        match id {
            StreamId::Design(_) => self.open_designs -= 1,
            StreamId::Point(number) => {
                self.open_points.remove(&number);
            }
        }
    }
}

fn weight(units: &[Unit]) -> u64 {
    let weight = |unit: &Unit| u64::from(unit.samples.count) + DESIGN_WEIGHT;
    units.iter().map(weight).sum()
}

impl Unit {
    const fn range(&self) -> Range<u32> {
        self.samples.first..self.samples.first.saturating_add(self.samples.count)
    }
}

const fn number(kind: JobKind, splits: u64, index: u64, first: u32) -> u64 {
    (kind.tag() << 56) | (splits << SPLIT_SHIFT) | (index << INDEX_SHIFT) | first as u64
}

/// A sampling job's number without its first sample and its splits.
pub(crate) const fn without_samples(job: u64) -> u64 {
    job & !((1 << INDEX_SHIFT) - 1) & !(0xf << SPLIT_SHIFT)
}

/// The design or point and the first sample of a sampling job's number.
#[must_use]
pub const fn parts(job: u64) -> (u64, u64) {
    let index = (job >> INDEX_SHIFT) & 0x0fff_ffff;
    (index, job & 0x00ff_ffff)
}
