//! Numbers in the cells of tables.

use problem::formulation::Constraint;
use stats::IntervalEstimate;

use crate::number::{self, MISSING, with_unit};
use crate::optima::VerifiedLimit;
use crate::report::quantity::{NamedValue, limits, values};

/// A number that may deserve a mark.
pub(super) struct Value {
    pub(super) text: String,
    pub(super) marked: bool,
}

impl From<String> for Value {
    fn from(text: String) -> Self {
        Self {
            text,
            marked: false,
        }
    }
}

/// Quantities with their names: `tip land = 0.62 mm`.
pub(super) fn named(list: &[NamedValue]) -> Vec<String> {
    let both = list.iter().zip(values(list));
    both.map(|(one, value)| format!("{} = {value}", one.name))
        .collect()
}

/// Limited quantities with their names, marked where they break their limits.
pub(super) fn limited<'a>(constraints: impl Iterator<Item = &'a Constraint>) -> Vec<Value> {
    let constraints: Vec<Constraint> = constraints.cloned().collect();
    let both = constraints.iter().zip(limits(&constraints));
    both.map(|(one, [value, ..])| Value {
        text: format!("{} = {value}", one.name),
        marked: !one.holds(),
    })
    .collect()
}

/// A measure of samples with its constraint's name, marked where it breaks its limit.
pub(super) fn limited_measure(limit: &VerifiedLimit) -> Value {
    Value {
        text: format!(
            "{} = {}",
            limit.constraint,
            with_unit(limit.value.value, 5, &limit.unit)
        ),
        marked: !limit.holds,
    }
}

/// The formatters of [`number`] as methods, for templates.
pub(super) trait Show {
    fn fixed(&self, decimals: usize) -> String;
    fn significant(&self, digits: usize) -> String;
    fn seconds(&self) -> String;
    fn signed_percent(&self) -> String;
    /// A coefficient of a gear, with two or three decimals.
    fn coefficient(&self) -> String;
}

impl Show for f64 {
    fn fixed(&self, decimals: usize) -> String {
        number::fixed(*self, decimals)
    }

    fn significant(&self, digits: usize) -> String {
        number::significant(*self, digits)
    }

    fn seconds(&self) -> String {
        number::seconds(*self)
    }

    fn signed_percent(&self) -> String {
        number::signed_percent(*self)
    }

    fn coefficient(&self) -> String {
        number::shortest(*self, 2..=3)
    }
}

/// [`number::count`] as a method, for templates.
pub(super) trait ShowCount {
    fn grouped(&self) -> String;
}

impl ShowCount for u64 {
    fn grouped(&self) -> String {
        number::count(*self)
    }
}

/// A measure and its interval in cells of their own, for templates.
pub(super) trait ShowPercentile {
    fn estimate(&self) -> String;
    fn interval(&self) -> String;
}

impl ShowPercentile for Option<IntervalEstimate> {
    fn estimate(&self) -> String {
        self.map_or_else(
            || MISSING.to_owned(),
            |p| number::significant(p.value, number::digits_of(p.value, p.interval)),
        )
    }

    fn interval(&self) -> String {
        let ends = self.and_then(|p| Some((p.value, p.interval?)));
        ends.map_or_else(
            || MISSING.to_owned(),
            |(value, ends)| number::interval(ends, number::digits_of(value, Some(ends))),
        )
    }
}
