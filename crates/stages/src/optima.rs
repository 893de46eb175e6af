//! The chosen optima as the store keeps them.

use campaign::Approach;
use campaign::formulation::{Design, Problem, Quantity};
use ledger::StreamId;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};
use store::{OptimumRow, Store};

use crate::state::State;
use crate::{names, plan};

/// The approach of that name.
#[must_use]
pub fn approach_of(name: &str) -> Option<Approach> {
    Approach::ALL
        .into_iter()
        .find(|approach| approach.name() == name)
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

/// The stream of an optimum's verification samples.
#[must_use]
pub fn point_of(row: &OptimumRow) -> Option<StreamId> {
    approach_of(&row.approach).map(names::verification)
}

/// The values of an optimum's verification samples.
///
/// # Errors
///
/// The store cannot be read.
pub async fn verification_samples(
    store: &Store,
    row: &OptimumRow,
) -> Result<Vec<f64>, store::Error> {
    match point_of(row) {
        Some(point) => store.values_of(point).await,
        None => Ok(Vec::new()),
    }
}

/// Why an approach has no optimum; `None` if it has one.
#[must_use]
pub fn no_optimum(problem: &Problem, row: &OptimumRow) -> Option<NoOptimum> {
    if optimum_design(problem, row).is_some() {
        return None;
    }
    let read: Option<Map<String, Value>> = serde_json::from_str(&row.x_json).ok();
    let none = read.and_then(|mut read| serde_json::from_value(read.remove("none")?).ok());
    Some(none.unwrap_or(NoOptimum::NoneFeasible))
}

/// Why an approach has no optimum, as a sentence for the report.
#[must_use]
pub fn sentence(problem: &Problem, row: &OptimumRow) -> String {
    match no_optimum(problem, row) {
        Some(NoOptimum::NoModel) => format!("There is no kriging model: {}.", row.note),
        _ => row.note.clone(),
    }
}

/// All variables by name, as the store keeps them, or why there is no design.
#[must_use]
pub fn design_to_json(problem: &Problem, design: Result<&Design, NoOptimum>) -> String {
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
#[must_use]
pub fn design_from_json(problem: &Problem, json: &str) -> Option<Design> {
    let object: Map<String, Value> = serde_json::from_str(json).ok()?;
    let value = |variable: &Quantity| object.get(&*variable.name)?.as_f64();
    let values: Option<Vec<f64>> = problem.variables().iter().map(value).collect();
    values.map(Design::new)
}

/// The values of the variables that the DoE does not move, once they are known, from the chosen
/// optima.
#[must_use]
pub fn base(problem: &Problem, rows: &[OptimumRow]) -> Option<Design> {
    let known =
        |row: &OptimumRow| Some((approach_of(&row.approach)?, optimum_design(problem, row)));
    let state = State {
        optima: rows.iter().filter_map(known).collect(),
        ..State::default()
    };
    plan::base(problem, &state)
}

/// The optima in the order of the paper's Table 5.
///
/// # Errors
///
/// The store cannot be read.
pub async fn stored(store: &Store) -> Result<Vec<OptimumRow>, store::Error> {
    let mut rows = store.optima().await?;
    rows.sort_by_key(|row| approach_of(&row.approach).map(Approach::number));
    Ok(rows)
}

/// The design of an optimum's row; `None` when the approach found no feasible one.
#[must_use]
pub fn optimum_design(problem: &Problem, row: &OptimumRow) -> Option<Design> {
    design_from_json(problem, &row.x_json)
}
