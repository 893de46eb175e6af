//! A constraint evaluated at a design.

use std::borrow::Cow;

use serde::{Deserialize, Serialize, Serializer};

/// A constraint evaluated at a design.
#[derive(Debug, Clone, PartialEq)]
pub struct Constraint {
    /// The constrained quantity.
    pub name: Cow<'static, str>,
    /// The unit; empty for a number without one.
    pub unit: Cow<'static, str>,
    /// Its value.
    pub value: f64,
    /// Its limit.
    pub limit: f64,
    /// The distance by which the value exceeds the limit, in its unit; negative if the constraint
    /// holds.
    pub excess: f64,
    /// The divisor of the excess in the paper's (5): the limit, or the module for a length. For an
    /// external problem, the limit's absolute value, or 1 if the limit is 0.
    pub scale: f64,
    /// The side of the limit on which the value must lie.
    pub bound: Bound,
}

/// The side of its limit on which a value must lie.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Bound {
    /// Below the limit.
    #[serde(rename = "<")]
    Below,
    /// Below the limit or on it.
    #[serde(rename = "≤")]
    AtMost,
    /// Above the limit.
    #[serde(rename = ">")]
    Above,
    /// Above the limit or on it.
    #[serde(rename = "≥")]
    AtLeast,
}

impl std::fmt::Display for Bound {
    /// The relation between value and limit, as a symbol.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.serialize(f)
    }
}

impl Constraint {
    /// A constraint on a value, with the limit as the scale of its excess.
    #[must_use]
    pub fn new(
        name: impl Into<Cow<'static, str>>,
        unit: impl Into<Cow<'static, str>>,
        value: f64,
        bound: Bound,
        limit: f64,
    ) -> Self {
        Self {
            name: name.into(),
            unit: unit.into(),
            value,
            limit,
            excess: match bound {
                Bound::Below | Bound::AtMost => value - limit,
                Bound::Above | Bound::AtLeast => limit - value,
            },
            scale: limit,
            bound,
        }
    }

    /// The constraint with an excess relative to the limit's absolute value, or to 1 if the limit is 0.
    pub(super) fn relative(self) -> Self {
        let scale = match self.limit.abs() {
            0.0 => 1.0,
            limit => limit,
        };
        Self { scale, ..self }
    }

    /// The excess in multiples of the scale; 0 if there is none.
    pub(super) const fn violation(&self) -> f64 {
        self.excess.max(0.0) / self.scale
    }

    /// Whether the constraint holds; false if the value is NaN.
    #[must_use]
    pub fn holds(&self) -> bool {
        match self.bound {
            Bound::Below | Bound::Above => self.excess < 0.0,
            Bound::AtMost | Bound::AtLeast => self.excess <= 0.0,
        }
    }
}

/// For programs: name, unit, value, relation, limit, and whether the constraint holds.
impl Serialize for Constraint {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        #[derive(Serialize)]
        struct Row<'a> {
            name: &'a str,
            unit: &'a str,
            value: f64,
            relation: Bound,
            limit: f64,
            holds: bool,
        }
        let row = Row {
            name: &self.name,
            unit: &self.unit,
            value: self.value,
            relation: self.bound,
            limit: self.limit,
            holds: self.holds(),
        };
        row.serialize(to)
    }
}

impl std::fmt::Display for Constraint {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self {
            name,
            value,
            limit,
            excess,
            ..
        } = self;
        let unit = match &*self.unit {
            "" => String::new(),
            unit => format!(" {unit}"),
        };
        // A limit in modules has many digits when converted to mm.
        let limit = (limit * 1e4).round() / 1e4;
        // An optimum lies on a constraint, where only the size of a small violation matters.
        if *excess < 1e-6 * self.scale {
            write!(
                f,
                "{name} on its limit of {limit}{unit}, and {excess:.0e}{unit} beyond it, which no measurement shows"
            )
        } else if excess.abs() < 1e-3 {
            write!(
                f,
                "{name} {excess:.0e}{unit} beyond its limit of {limit}{unit}"
            )
        } else {
            write!(
                f,
                "{name} = {value:.4}{unit} beyond its limit of {limit}{unit}"
            )
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_violation_is_told_as_large_as_it_is() {
        for (value, says) in [
            (-0.25, "margin = -0.2500 mm beyond its limit of 0 mm"),
            (-2e-4, "margin 2e-4 mm beyond its limit of 0 mm"),
            (
                -7e-8,
                "margin on its limit of 0 mm, and 7e-8 mm beyond it, which no measurement shows",
            ),
        ] {
            let constraint = Constraint {
                scale: 3.0,
                ..Constraint::new("margin", "mm", value, Bound::AtLeast, 0.0)
            };
            assert!(!constraint.holds());
            assert_eq!(constraint.to_string(), says);
        }
    }
}
