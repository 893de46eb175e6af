//! What a design has to satisfy.

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
    /// What the paper's (5) divides the excess by: the limit, or the module for a length.
    pub scale: f64,
    /// Whether the limit itself is not allowed.
    pub strict: bool,
}

impl Constraint {
    /// Whether the design satisfies the constraint; false for a value that is no number.
    #[must_use]
    pub fn holds(&self) -> bool {
        if self.strict {
            self.excess < 0.0
        } else {
            self.excess <= 0.0
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
