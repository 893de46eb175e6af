//! One constraint of one design.

use std::borrow::Cow;

/// One constraint at one design.
#[derive(Debug, Clone, PartialEq)]
pub struct Constraint {
    /// The constrained quantity.
    pub name: Cow<'static, str>,
    /// Its unit with a space before it, or nothing.
    pub unit: Cow<'static, str>,
    /// Its value.
    pub value: f64,
    /// Its limit.
    pub limit: f64,
    /// How far the value lies beyond the limit, in its unit; negative on the good side.
    pub excess: f64,
    /// What the paper's (5) divides the excess by: the limit, or the module for a length. Of an external
    /// problem the limit's size, or 1 where the limit is 0.
    pub scale: f64,
    /// On which side of the limit the value must be.
    pub bound: Bound,
}

/// On which side of its limit a value must be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Bound {
    /// Below the limit.
    Below,
    /// Below the limit or on it.
    AtMost,
    /// Above the limit.
    Above,
    /// Above the limit or on it.
    AtLeast,
}

impl Bound {
    /// The relation between value and limit, as a sign.
    #[must_use]
    pub const fn sign(self) -> &'static str {
        match self {
            Self::Below => "<",
            Self::AtMost => "≤",
            Self::Above => ">",
            Self::AtLeast => "≥",
        }
    }
}

impl Constraint {
    /// A value that must be below its limit.
    #[must_use]
    pub fn below(
        name: impl Into<Cow<'static, str>>,
        unit: impl Into<Cow<'static, str>>,
        value: f64,
        limit: f64,
    ) -> Self {
        Self {
            name: name.into(),
            unit: unit.into(),
            value,
            limit,
            excess: value - limit,
            scale: limit,
            bound: Bound::Below,
        }
    }

    /// A value that must not exceed its limit.
    #[must_use]
    pub fn at_most(
        name: impl Into<Cow<'static, str>>,
        unit: impl Into<Cow<'static, str>>,
        value: f64,
        limit: f64,
    ) -> Self {
        Self {
            bound: Bound::AtMost,
            ..Self::below(name, unit, value, limit)
        }
    }

    /// A value that must be above its limit.
    #[must_use]
    pub fn above(
        name: impl Into<Cow<'static, str>>,
        unit: impl Into<Cow<'static, str>>,
        value: f64,
        limit: f64,
    ) -> Self {
        Self {
            excess: limit - value,
            bound: Bound::Above,
            ..Self::below(name, unit, value, limit)
        }
    }

    /// A value that must reach its limit.
    #[must_use]
    pub fn at_least(
        name: impl Into<Cow<'static, str>>,
        unit: impl Into<Cow<'static, str>>,
        value: f64,
        limit: f64,
    ) -> Self {
        Self {
            bound: Bound::AtLeast,
            ..Self::above(name, unit, value, limit)
        }
    }

    /// Whether the design satisfies the constraint; false for a value that is no number.
    #[must_use]
    pub fn holds(&self) -> bool {
        match self.bound {
            Bound::Below | Bound::Above => self.excess < 0.0,
            Bound::AtMost | Bound::AtLeast => self.excess <= 0.0,
        }
    }
}

impl std::fmt::Display for Constraint {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self {
            name,
            unit,
            value,
            limit,
            excess,
            ..
        } = self;
        // A limit in modules becomes one in mm with all its digits.
        let limit = (limit * 1e4).round() / 1e4;
        // An optimum sits on a constraint: by how little it misses is what matters.
        if excess.abs() < 1e-3 {
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
