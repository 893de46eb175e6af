//! Designs and deterministic criteria, as lists of numbers whose names the problem gives.

use serde::{Deserialize, Serialize};

use super::gears::{GearCriteria, GearVariables};

/// One design: the value of every variable of its problem, in the order of
/// [`Problem::variables`](super::Problem::variables).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Design(Vec<f64>);

/// The deterministic criteria of a design in one state, in the order of
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

    /// The design as a gear pair, without profile corrections.
    ///
    /// # Panics
    ///
    /// The design is not one of a gear problem.
    #[must_use]
    pub fn gears(&self) -> GearVariables {
        let values = self.0.first_chunk();
        GearVariables::of_values(*values.expect("a gear pair has eleven variables"))
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

    /// The criteria of a gear pair.
    ///
    /// # Panics
    ///
    /// The criteria are not those of a gear problem.
    #[must_use]
    pub fn gears(&self) -> GearCriteria {
        GearCriteria::of_values(&self.0)
            .expect("a gear pair has nine criteria, or with details seventeen")
    }
}

impl From<GearVariables> for Design {
    fn from(variables: GearVariables) -> Self {
        Self(variables.values().to_vec())
    }
}

impl From<GearCriteria> for Criteria {
    fn from(criteria: GearCriteria) -> Self {
        Self(criteria.values().to_vec())
    }
}
