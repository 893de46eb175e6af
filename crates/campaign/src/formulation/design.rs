//! Designs and deterministic criteria, as lists of numbers whose names the problem gives.

use serde::{Deserialize, Deserializer, Serialize};

use super::gears::{GearCriteria, GearVariables};

/// One design: the value of every variable of its problem, in the order of
/// [`Problem::variables`](super::Problem::variables).
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(transparent)]
pub struct Design(Vec<f64>);

/// The deterministic criteria of a design in one state, in the order of
/// [`Problem::criteria`](super::Problem::criteria).
#[derive(Debug, Clone, PartialEq, Serialize)]
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

    /// The design as a gear pair.
    ///
    /// # Panics
    ///
    /// The design is not one of a gear problem.
    #[must_use]
    pub fn gears(&self) -> GearVariables {
        let values = self.0.as_slice().try_into();
        GearVariables::of_values(values.expect("a gear pair has eleven variables"))
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

/// A list of numbers or, in stores before schema 9, an object of a gear pair.
#[derive(Deserialize)]
#[serde(untagged)]
enum Written<G> {
    Values(Vec<f64>),
    Gears(G),
}

impl<'de> Deserialize<'de> for Design {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        Ok(match Written::<GearVariables>::deserialize(from)? {
            Written::Values(values) => Self(values),
            Written::Gears(variables) => variables.into(),
        })
    }
}

impl<'de> Deserialize<'de> for Criteria {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        Ok(match Written::<GearCriteria>::deserialize(from)? {
            Written::Values(values) => Self(values),
            Written::Gears(criteria) => criteria.into(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// JSON of earlier versions has objects in place of lists.
    #[test]
    fn objects_of_earlier_versions_are_read() {
        let old = r#"{"profile_shift":[0.1,0.2],"tool_addendum":[1.0,1.1],
            "tool_dedendum":[1.2,1.3],"tip_radius_mm":[0.01,0.02],
            "root_radius_mm":[0.3,0.4],"helix_angle_deg":30.0}"#;
        let design: Design = serde_json::from_str(old).unwrap();
        let values = [0.1, 0.2, 1.0, 1.1, 1.2, 1.3, 0.01, 0.02, 0.3, 0.4, 30.0];
        assert_eq!(design.values(), values);
        let again = serde_json::to_string(&design).unwrap();
        assert_eq!(serde_json::from_str::<Design>(&again).unwrap(), design);
        let old = r#"{"contact_ratio":1.5,"specific_sliding":1.2,"hertz_pressure_mpa":900.0,
            "root_stress_mpa":300.0,"clearance_mm":[0.5,0.6],"flank_margin_mm":[0.1,0.2],
            "normal_module_mm":4.0}"#;
        let criteria: Criteria = serde_json::from_str(old).unwrap();
        assert_eq!(criteria.values().len(), 9);
        assert_eq!(criteria.gears().clearance_mm, [0.5, 0.6]);
        assert!(serde_json::from_str::<Criteria>("{\"contact_ratio\":1.5}").is_err());
    }
}
