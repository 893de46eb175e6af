//! The constraints of a pair, in the form for programs.

use campaign::formulation::Constraint;
use serde::{Serialize, Serializer};

/// A constraint in the form for programs.
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
