//! The optima that the approaches ended with, as the store keeps them.

use anyhow::Context as _;
use campaign::formulation::{Design, Problem, Quantity};
use campaign::optimise::Solution;
use campaign::{Approach, Criteria};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};
use store::{OptimumRow, Store};

use crate::cost::Cost;
use crate::state::State;
use crate::{names, plan};

/// What an approach ended with: a design, or the reason why there is none.
#[derive(Debug, Clone, PartialEq)]
pub struct Optimum {
    /// The approach.
    pub approach: Approach,
    /// The design.
    pub found: Result<Solution, NoOptimum>,
    /// The cost of the search and of what it rests on.
    pub cost: Cost,
    /// A remark; without a model, the reason.
    pub note: String,
}

impl Optimum {
    /// The row of the store.
    ///
    /// # Errors
    ///
    /// The criteria cannot be written.
    pub fn row(&self, problem: &Problem) -> serde_json::Result<OptimumRow> {
        let found = self.found.as_ref();
        Ok(OptimumRow {
            stream: names::verification(self.approach),
            x_json: design_to_json(
                problem,
                found.map(|found| &found.design).map_err(|none| *none),
            ),
            // The paper gives designs that cannot be simulated the value 100; here there is no design.
            criterion: found.map_or(0.0, |found| found.criterion),
            feasible: found.is_ok_and(|found| found.feasible),
            criteria_json: serde_json::to_string(&found.ok().map(|found| &found.criteria))?,
            simulator_calls: self.cost.simulator_calls,
            cpu_seconds: self.cost.cpu_seconds,
            note: self.note.clone(),
        })
    }

    /// Reads what [`row`](Self::row) wrote.
    ///
    /// # Errors
    ///
    /// The row is not of this problem, or not what this version writes.
    pub fn read(problem: &Problem, row: OptimumRow) -> anyhow::Result<Self> {
        let of = || format!("the stored optimum of {}", row.stream);
        let approach = Approach::numbered(row.stream.index).with_context(of)?;
        let criteria: Option<Criteria> =
            serde_json::from_str(&row.criteria_json).with_context(of)?;
        Ok(Self {
            approach,
            found: match (
                design_from_json(problem, &row.x_json).with_context(of)?,
                criteria,
            ) {
                (Ok(design), Some(criteria)) => Ok(Solution {
                    design,
                    criterion: row.criterion,
                    criteria,
                    feasible: row.feasible,
                }),
                (Ok(_), None) => anyhow::bail!("{} has no criteria", of()),
                (Err(none), _) => Err(none),
            },
            cost: Cost {
                simulator_calls: row.simulator_calls,
                cpu_seconds: row.cpu_seconds,
            },
            note: row.note,
        })
    }

    /// The design, if it keeps all constraints.
    #[must_use]
    pub fn feasible(&self) -> Option<&Solution> {
        self.found.as_ref().ok().filter(|found| found.feasible)
    }

    /// The design or, for people, why there is none.
    ///
    /// # Errors
    ///
    /// A sentence: there is none.
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

/// All variables by name, as the store keeps them, or why there is no design.
fn design_to_json(problem: &Problem, design: Result<&Design, NoOptimum>) -> String {
    let design = match design {
        Ok(design) => design,
        Err(none) => return json!({ "none": none }).to_string(),
    };
    let values = problem.variables().iter().zip(design.values());
    let object: Map<String, Value> = values
        .map(|(variable, value)| (variable.name.to_string(), Value::from(*value)))
        .collect();
    Value::Object(object).to_string()
}

/// Reads what [`design_to_json`] wrote.
fn design_from_json(problem: &Problem, json: &str) -> anyhow::Result<Result<Design, NoOptimum>> {
    let mut object: Map<String, Value> = serde_json::from_str(json)?;
    if let Some(none) = object.remove("none") {
        return Ok(Err(serde_json::from_value(none)?));
    }
    let value = |variable: &Quantity| {
        let value = object.get(&*variable.name).and_then(Value::as_f64);
        value.with_context(|| format!("it has no value of {}", variable.name))
    };
    let values: anyhow::Result<Vec<f64>> = problem.variables().iter().map(value).collect();
    Ok(Ok(Design::new(values?)))
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
    plan::base(problem, &state)
}

/// The optima in the order of the paper's Table 5.
///
/// # Errors
///
/// The store cannot be read, or its optima are not of this problem.
pub async fn stored(store: &Store, problem: &Problem) -> anyhow::Result<Vec<Optimum>> {
    let rows = store.optima().await?.into_iter();
    let mut optima: Vec<Optimum> = rows
        .map(|row| Optimum::read(problem, row))
        .collect::<anyhow::Result<_>>()?;
    optima.sort_by_key(|optimum| optimum.approach.number());
    Ok(optima)
}
