//! Designs and deterministic criteria, as lists of numbers whose names the problem gives.

use serde::{Deserialize, Serialize};

/// One design: the value of every variable of its problem, in the order of
/// [`Problem::variables`](super::Problem::variables).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Design(Vec<f64>);

/// The criteria of a design in one state, in the order of
/// [`Problem::criteria`](super::Problem::criteria).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Criteria(Vec<f64>);

impl Design {
    /// The design with these values.
    #[must_use]
    pub const fn new(values: Vec<f64>) -> Self {
        Self(values)
    }

    /// The values.
    #[must_use]
    pub fn values(&self) -> &[f64] {
        &self.0
    }
}

impl Criteria {
    /// The criteria with these values.
    #[must_use]
    pub const fn new(values: Vec<f64>) -> Self {
        Self(values)
    }

    /// The values.
    #[must_use]
    pub fn values(&self) -> &[f64] {
        &self.0
    }
}
