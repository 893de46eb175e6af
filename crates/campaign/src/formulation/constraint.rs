//! One constraint of one design.

/// One constraint at one design.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Constraint {
    /// The constrained quantity.
    pub name: &'static str,
    /// Its unit with a space before it, or nothing.
    pub unit: &'static str,
    /// Its value.
    pub value: f64,
    /// Its limit.
    pub limit: f64,
    /// How far the value lies beyond the limit, in its unit; negative on the good side.
    pub excess: f64,
    /// What the paper's (5) divides the excess by: the limit, or the module for a length.
    pub scale: f64,
    /// On which side of the limit the value must be.
    pub bound: Bound,
}

/// On which side of its limit a value must be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Bound {
    /// Below the limit.
    Below,
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
            Self::Above => ">",
            Self::AtLeast => "≥",
        }
    }
}

impl Constraint {
    /// A value that must be below its limit.
    #[must_use]
    pub fn below(name: &'static str, unit: &'static str, value: f64, limit: f64) -> Self {
        Self {
            name,
            unit,
            value,
            limit,
            excess: value - limit,
            scale: limit,
            bound: Bound::Below,
        }
    }

    /// A value that must be above its limit.
    #[must_use]
    pub fn above(name: &'static str, unit: &'static str, value: f64, limit: f64) -> Self {
        Self {
            excess: limit - value,
            bound: Bound::Above,
            ..Self::below(name, unit, value, limit)
        }
    }

    /// A value that must reach its limit.
    #[must_use]
    pub fn at_least(name: &'static str, unit: &'static str, value: f64, limit: f64) -> Self {
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
            Bound::AtLeast => self.excess <= 0.0,
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
