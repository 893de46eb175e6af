//! Other names of keys in the JSON Schema, which serde's `alias` does not reach.

use schemars::Schema;
use serde_json::{Value, json};

/// Adds the name that `sampling.precision_um` has in other units.
pub(super) fn of_precision(schema: &mut Schema) {
    add(schema, "precision_um", "precision");
}

/// Adds the name that `enrichment.tolerance_um` has in other units.
pub(super) fn of_tolerance(schema: &mut Schema) {
    add(schema, "tolerance_um", "tolerance");
}

fn add(schema: &mut Schema, key: &str, alias: &str) {
    let Some(properties) = schema.get_mut("properties") else {
        return;
    };
    let mut property = properties[key].clone();
    property["description"] = json!(format!(
        "Another name of `{key}`, for a response in another unit than µm."
    ));
    properties[alias] = property;
    if let Some(required) = schema.get_mut("required").and_then(Value::as_array_mut) {
        required.retain(|one| one != key);
    }
}
