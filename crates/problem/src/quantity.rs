//! A named number.

use std::borrow::Cow;

/// A quantity that is an input or an output of a simulator.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Quantity {
    /// The name, as in exported columns.
    pub name: Cow<'static, str>,
    /// The unit, if the name does not contain it; empty for a number without one.
    pub unit: Cow<'static, str>,
}

impl Quantity {
    pub(crate) fn new(name: &str, unit: &str) -> Self {
        Self {
            name: name.to_owned().into(),
            unit: unit.to_owned().into(),
        }
    }

    pub(crate) const fn of(name: &'static str, unit: &'static str) -> Self {
        Self {
            name: Cow::Borrowed(name),
            unit: Cow::Borrowed(unit),
        }
    }
}
