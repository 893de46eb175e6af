//! The chosen optima as the store keeps them.

use campaign::Approach;
use campaign::formulation::{VARIABLE_NAMES, Variables};
use serde_json::{Map, Value};
use store::{OptimumRow, Store};

/// The approach of that name.
#[must_use]
pub fn approach_of(name: &str) -> Option<Approach> {
    Approach::ALL
        .into_iter()
        .find(|approach| approach.name() == name)
}

/// All variables by name, as the store keeps them; `null` for an approach that found nothing.
#[must_use]
pub fn variables_to_json(variables: Option<&Variables>) -> String {
    let Some(variables) = variables else {
        return Value::Null.to_string();
    };
    let object: Map<String, Value> = VARIABLE_NAMES
        .iter()
        .zip(variables.values())
        .map(|(name, value)| ((*name).to_owned(), Value::from(value)))
        .collect();
    Value::Object(object).to_string()
}

/// Reads what [`variables_to_json`] wrote.
#[must_use]
pub fn variables_from_json(json: &str) -> Option<Variables> {
    let object: Map<String, Value> = serde_json::from_str(json).ok()?;
    let value = |index: usize| object.get(VARIABLE_NAMES[index]).and_then(Value::as_f64);
    let pair = |index: usize| Some([value(index)?, value(index + 1)?]);
    Some(Variables {
        profile_shift: pair(0)?,
        tool_addendum: pair(2)?,
        tool_dedendum: pair(4)?,
        tip_radius_mm: pair(6)?,
        root_radius_mm: pair(8)?,
        helix_angle_deg: value(10)?,
    })
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

/// The design of an optimum's row; none when the approach found no feasible one.
#[must_use]
pub fn optimum_variables(row: &OptimumRow) -> Option<Variables> {
    variables_from_json(&row.x_json)
}
