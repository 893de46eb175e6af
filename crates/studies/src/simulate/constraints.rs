//! What a pair is held against, as programs read it.

use campaign::formulation::Constraint;
use serde::{Serialize, Serializer};

/// A constraint as programs read it.
#[derive(Serialize)]
struct Row<'a> {
    name: &'a str,
    value: f64,
    /// Empty for a ratio.
    unit: &'a str,
    limit: f64,
    holds: bool,
}

pub(super) fn serialize<S: Serializer>(all: &[Constraint], to: S) -> Result<S::Ok, S::Error> {
    to.collect_seq(all.iter().map(|constraint| Row {
        name: &constraint.name,
        value: constraint.value,
        unit: constraint.unit.trim_start(),
        limit: constraint.limit,
        holds: constraint.holds(),
    }))
}
