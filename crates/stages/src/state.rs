//! The content of the store, as far as decisions need it.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::sync::Arc;

use ledger::StreamId;
use problem::formulation::{Approach, Design, Problem};
use store::Derivation;

/// A point that gets verification or infill samples.
#[derive(Debug, Clone, PartialEq)]
pub struct VerifyPoint {
    /// Its number as a stream and as the source of its random numbers.
    pub number: u64,
    pub design: Design,
    /// Number of samples that it gets.
    pub wanted: u32,
    /// The indices of its stored samples.
    pub stored: BTreeSet<u32>,
    /// Whether the simulator evaluates its constraints first, as for an infill point that may break
    /// some.
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
    /// Index of the design in the DoE.
    pub design: u32,
    /// The variables that the DoE moves.
    pub x: Vec<f64>,
    /// Number of samples that it is to have.
    pub samples: u32,
    /// The missing ones of them, disjoint and ascending.
    pub missing: Vec<Range<u32>>,
    /// Its responses without random effects, if an external program has given them.
    pub responses: Option<Vec<f64>>,
}

/// The content of the store, as far as decisions need it.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct State {
    /// Number of designs of the DoE that are made.
    pub designs: usize,
    /// The designs of the DoE that lack samples, ascending.
    pub open: Vec<OpenDesign>,
    /// The digest of all samples of the DoE.
    pub samples: String,
    /// The digest of all criteria of the DoE.
    pub criteria: String,
    /// The derivations of the stored results, by [`store::DerivedResult::name`].
    pub derivations: BTreeMap<String, Derivation>,
    /// The kriging models as JSON, once fitted, in the order of [`fit_all`](crate::fitting::fit_all).
    pub models: Vec<Arc<str>>,
    /// The variables of the DoE's best feasible design under the first of them.
    pub best_of_doe: Option<Vec<f64>>,
    /// Finished optimiser runs.
    pub runs: BTreeSet<(Approach, u32)>,
    /// The chosen designs; `None` for an approach that found no feasible one.
    pub optima: BTreeMap<Approach, Option<Design>>,
    /// Points that get verification samples, without those of the optima.
    pub reference_points: Vec<VerifyPoint>,
    /// The verification samples of the optima: how many there will be, and the indices of the stored ones.
    pub verified: BTreeMap<Approach, (u32, BTreeSet<u32>)>,
    /// The approaches whose verification samples are of another design than the chosen one.
    pub stale: BTreeSet<Approach>,
    /// The rounds of infill.
    pub enrichment: Progress,
    pub quarantined: BTreeSet<StreamId>,
}

/// The enrichment as far as the store holds it.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Progress {
    /// For every decided round, the digest of the results of its points.
    pub rounds: Vec<String>,
    /// The points of all rounds that lack samples or an evaluation.
    pub points: Vec<VerifyPoint>,
    /// The numbers of the points of all rounds.
    pub numbers: BTreeSet<u64>,
    /// Whether the last round decided to stop.
    pub is_stopped: bool,
}

impl State {
    /// The values of the variables that the DoE does not move, once they are known.
    ///
    /// If the approach without wear found no feasible design, the printed values are used.
    #[must_use]
    pub fn base(&self, problem: &Problem) -> Option<Design> {
        let printed = || problem.base().clone();
        let Some(approach) = problem.base_from() else {
            return Some(printed());
        };
        let optimum = self.optima.get(&approach)?.as_ref();
        Some(optimum.map_or_else(printed, |design| problem.base_of(design)))
    }

    /// Whether a run is finished or quarantined.
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

    /// Whether every infill point has its samples or was quarantined.
    pub(crate) fn has_settled_infill(&self) -> bool {
        let mut points = self.enrichment.points.iter();
        points.all(|point| self.quarantined.contains(&StreamId::point(point.number)))
    }
}
