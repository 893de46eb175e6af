//! What the store holds, as far as decisions need it.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::sync::Arc;

use campaign::formulation::{Approach, Design};
use ledger::StreamId;

/// A point that gets verification samples.
#[derive(Debug, Clone, PartialEq)]
pub struct VerifyPoint {
    /// Its name in the store.
    pub name: String,
    /// The number that names its random streams.
    pub number: u64,
    /// The design.
    pub design: Design,
    /// How many samples it gets.
    pub wanted: u32,
    /// Which of its samples are stored.
    pub stored: BTreeSet<u32>,
    /// Whether the simulator is asked for its constraints first: of an infill point that may break some.
    pub asks_criteria: bool,
}

impl VerifyPoint {
    /// Whether nothing is missing.
    #[must_use]
    pub fn is_complete(&self) -> bool {
        !self.asks_criteria && (0..self.wanted).all(|sample| self.stored.contains(&sample))
    }
}

/// A design of the DoE that lacks samples.
#[derive(Debug, Clone, PartialEq)]
pub struct OpenDesign {
    /// Its index in the DoE.
    pub design: u32,
    /// The variables that the DoE moves.
    pub x: Vec<f64>,
    /// How many samples it is to have.
    pub samples: u32,
    /// Those of them that are missing, disjoint and ascending.
    pub missing: Vec<Range<u32>>,
}

/// What the store holds, as far as decisions need it.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct State {
    /// How many designs of the DoE are made.
    pub designs: usize,
    /// Those of them that lack samples, ascending.
    pub open: Vec<OpenDesign>,
    /// Whether the responses of all designs are stored.
    pub has_responses: bool,
    /// Samples have come since responses were computed, as of a design that had been quarantined.
    pub has_outdated_responses: bool,
    /// The kriging model as JSON, once fitted.
    pub model: Option<Arc<str>>,
    /// The fit failed for good; approach 3 is then left out.
    pub fit_failed: bool,
    /// Finished optimiser runs.
    pub runs: BTreeSet<(Approach, u32)>,
    /// The chosen designs; `None` for an approach that found no feasible one.
    pub optima: BTreeMap<Approach, Option<Design>>,
    /// Points that get verification samples, without those of the optima.
    pub reference_points: Vec<VerifyPoint>,
    /// Stored verification samples of the optima.
    pub verified: BTreeMap<Approach, BTreeSet<u32>>,
    /// The rounds of infill.
    pub enrichment: Progress,
    /// What was quarantined.
    pub quarantined: BTreeSet<StreamId>,
}

/// The enrichment as far as the store holds it.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Progress {
    /// How many rounds were decided.
    pub rounds: u32,
    /// The points of the last one.
    pub points: Vec<VerifyPoint>,
    /// Whether the last one decided to stop.
    pub is_stopped: bool,
}

impl State {
    /// Whether nothing is to be waited for of a run.
    pub(crate) fn is_settled(&self, approach: Approach, start: u32) -> bool {
        let stream = StreamId::run(approach.number() as u32, start);
        self.runs.contains(&(approach, start)) || self.quarantined.contains(&stream)
    }

    /// Whether a design lacks samples that were not quarantined.
    pub(crate) fn lacks_samples(&self) -> bool {
        let is_wanted =
            |open: &OpenDesign| !self.quarantined.contains(&StreamId::design(open.design));
        self.open.iter().any(is_wanted)
    }
}

impl Progress {
    /// Whether every point of the last round has its samples or was quarantined.
    #[must_use]
    pub fn is_settled(&self, is_given_up: impl Fn(StreamId) -> bool) -> bool {
        let settled =
            |point: &VerifyPoint| point.is_complete() || is_given_up(StreamId::point(point.number));
        self.points.iter().all(settled)
    }
}
