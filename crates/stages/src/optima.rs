//! The optima that the approaches ended with, as the store keeps them.

use anyhow::Context as _;
use problem::formulation::{Design, Problem};
use problem::optimise::Solution;
use problem::{Approach, Criteria};
use serde::{Deserialize, Serialize};
use store::{OptimumRow, Store};

use crate::cost::Cost;
use crate::names;
use crate::state::State;

/// The outcome of an approach: a design, or the reason why there is none.
#[derive(Debug, Clone, PartialEq)]
pub struct Optimum {
    pub approach: Approach,
    /// The design.
    pub found: Result<Solution, NoOptimum>,
    /// The cost of the search and of the results that it uses.
    pub cost: Cost,
    /// A remark; for an approach without a model, the reason.
    pub note: String,
}

impl Optimum {
    /// The row of the store.
    #[must_use]
    pub fn row(&self) -> OptimumRow {
        let found = self.found.as_ref().ok();
        OptimumRow {
            stream: names::verification(self.approach),
            reason: self.found.as_ref().err().map(ToString::to_string),
            x: found.map(|found| found.design.values().to_vec()),
            criterion: found.map(|found| found.criterion),
            criteria: found.map(|found| found.criteria.values().to_vec()),
            feasible: found.is_some_and(|found| found.feasible),
            simulator_calls: self.cost.simulator_calls,
            cpu_seconds: self.cost.cpu_seconds,
            note: self.note.clone(),
        }
    }

    /// Reads a row that [`row`](Self::row) made for an optimum of this problem; `None` if it was chosen before
    /// constraints were added or removed, which a campaign permits for measures of samples.
    pub fn read(problem: &Problem, row: OptimumRow) -> anyhow::Result<Option<Self>> {
        let of = || format!("the stored optimum of {}", row.stream);
        let found = match (row.x, row.criterion, row.criteria) {
            (Some(x), Some(criterion), Some(criteria)) => {
                let lengths = [x.len(), criteria.len()];
                let all = problem.criteria().len();
                let expected = [problem.variables().len(), all];
                // The optimum of a search without samples has only the deterministic ones.
                let is_deterministic = criteria.len() == problem.deterministic().len();
                if lengths != expected && !(is_deterministic && lengths[0] == expected[0]) {
                    return Ok(None);
                }
                Ok(Solution {
                    design: Design::new(x),
                    criterion,
                    criteria: Criteria::new(criteria),
                    feasible: row.feasible,
                })
            }
            _ => Err(NoOptimum::named(row.reason.as_deref()).with_context(of)?),
        };
        Ok(Some(Self {
            approach: Approach::numbered(row.stream.index).with_context(of)?,
            found,
            cost: Cost {
                simulator_calls: row.simulator_calls,
                cpu_seconds: row.cpu_seconds,
            },
            note: row.note,
        }))
    }

    /// The design, if it keeps all constraints.
    #[must_use]
    pub fn feasible(&self) -> Option<&Solution> {
        self.found.as_ref().ok().filter(|found| found.feasible)
    }

    /// The design, or a sentence that says why there is none.
    pub fn found_or_sentence(&self) -> Result<&Solution, String> {
        self.found.as_ref().map_err(|none| match none {
            NoOptimum::NoModel => format!("There is no kriging model: {}.", self.note),
            _ => self.note.clone(),
        })
    }
}

/// Why an approach has no optimum.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum NoOptimum {
    /// There is no model to search on. The row's note is the reason.
    NoModel,
    /// No design that was tried satisfies every constraint.
    NoneFeasible,
    /// No design that was tried can be simulated.
    NoneSimulable,
    /// The jobs that it would be chosen from were quarantined.
    NothingComputed,
}

impl std::fmt::Display for NoOptimum {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::NoModel => "no model",
            Self::NoneFeasible => "no feasible design",
            Self::NoneSimulable => "no simulable design",
            Self::NothingComputed => "nothing computed",
        })
    }
}

impl NoOptimum {
    /// The variant that [`Display`](std::fmt::Display) writes as `reason`.
    fn named(reason: Option<&str>) -> anyhow::Result<Self> {
        let all = [
            Self::NoModel,
            Self::NoneFeasible,
            Self::NoneSimulable,
            Self::NothingComputed,
        ];
        let found = all
            .into_iter()
            .find(|none| Some(none.to_string().as_str()) == reason);
        found.with_context(|| format!("{reason:?} is not a reason for which there is no optimum"))
    }
}

/// The values of the variables that the DoE does not move, once they are known, from the chosen
/// optima.
#[must_use]
pub fn base<'a>(
    problem: &Problem,
    optima: impl IntoIterator<Item = &'a Optimum>,
) -> Option<Design> {
    let known = |optimum: &Optimum| {
        let design = optimum
            .found
            .as_ref()
            .ok()
            .map(|found| found.design.clone());
        (optimum.approach, design)
    };
    let state = State {
        optima: optima.into_iter().map(known).collect(),
        ..State::default()
    };
    state.base(problem)
}

/// The optima in the order of the paper's Table 5, without those of earlier constraints.
pub async fn stored(store: &Store, problem: &Problem) -> anyhow::Result<Vec<Optimum>> {
    let rows = store.optima().await?.into_iter();
    let mut optima: Vec<Optimum> = rows
        .filter_map(|row| Optimum::read(problem, row).transpose())
        .collect::<anyhow::Result<_>>()?;
    optima.sort_by_key(|optimum| optimum.approach.number());
    Ok(optima)
}
