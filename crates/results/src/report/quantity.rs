//! Names of variables and approaches, as pages show them.

use problem::Approach;
use problem::formulation::{Constraint, Design, Problem};
use serde::Serialize;

use crate::number::column;
use crate::report::symbols::symbol;

/// A number with its name and unit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NamedValue {
    pub name: String,
    /// The unit, if the name does not contain it; empty for a number without one.
    pub unit: String,
    pub value: f64,
}

/// A quantity with its unit, if it has one: `depth (mm)`.
pub(crate) fn label(name: &str, unit: &str) -> String {
    match unit {
        "" => name.to_owned(),
        unit => format!("{name} ({unit})"),
    }
}

/// The name of a variable: its symbol for gears, its own name for other problems.
#[must_use]
pub fn variable_name(problem: &Problem, name: &str) -> String {
    match problem.gears() {
        Some(_) => symbol(name),
        None => name.to_owned(),
    }
}

/// The name of the sampled response: its symbol for gears, its own name for other problems.
#[must_use]
pub fn response_name(problem: &Problem) -> String {
    match problem.gears() {
        Some(_) => "ΔSTE".to_owned(),
        None => problem.objective().response.name.to_string(),
    }
}

/// The numbers of a list with their units, to a common precision.
pub(crate) fn values(list: &[NamedValue]) -> Vec<String> {
    // The name may contain the unit: `ρa₁ (mm)`.
    let in_name = |one: &NamedValue| one.name.rfind(" (").map(|at| one.name[at..].to_owned());
    let kind = |one: &NamedValue| match in_name(one) {
        Some(unit) if one.unit.is_empty() => unit,
        _ => one.unit.clone(),
    };
    let kinds: Vec<String> = list.iter().map(kind).collect();
    let numbers = list
        .iter()
        .zip(&kinds)
        .map(|(one, kind)| (one.value, &**kind));
    let texts = column(&numbers.collect::<Vec<_>>(), 5)
        .into_iter()
        .zip(list);
    texts
        .map(|(text, one)| match one.unit.is_empty() {
            true => text
                .split(" (")
                .next()
                .unwrap_or_default()
                .trim_end()
                .to_owned(),
            false => text,
        })
        .collect()
}

/// Value, limit and margin of each constraint with their units, to a common precision.
pub(crate) fn limits(constraints: &[Constraint]) -> Vec<[String; 3]> {
    let numbers = constraints.iter().flat_map(|one| {
        // The subtraction from zero avoids −0.
        let margin = 0.0 - one.excess;
        [one.value, one.limit, margin].map(|number| (number, &*one.unit))
    });
    let texts = column(&numbers.collect::<Vec<_>>(), 4);
    let (rows, _) = texts.as_chunks::<3>();
    rows.to_vec()
}

/// The name of an approach, as headings and table rows use it.
#[must_use]
pub fn approach_name(problem: &Problem, approach: Approach) -> &'static str {
    if problem.gears().is_none() {
        return problem.approach_name(approach);
    }
    match approach {
        Approach::Nominal => "Without wear",
        Approach::Baseline => "Archard’s wear",
        Approach::Kriging => "Kriging",
        Approach::BestOfDoe => "Best of the DoE",
        Approach::EnrichedKriging => "Enriched kriging",
        Approach::Direct => "Direct search",
    }
}

/// The criterion that an approach to the design of gears minimises; `measure` is the measure's name.
pub(crate) fn criterion_name(approach: Approach, measure: &str) -> String {
    match approach {
        Approach::Nominal => "ΔSTE without wear".to_owned(),
        Approach::Baseline => "ΔSTE with Archard’s wear".to_owned(),
        Approach::Kriging => format!("kriging mean of {measure}"),
        Approach::EnrichedKriging => format!("kriging prediction of {measure} after infill"),
        Approach::BestOfDoe => format!("{measure} estimated in the DoE"),
        Approach::Direct => format!("{measure} from the search’s own samples"),
    }
}

/// The variables of a design with their names and units.
#[must_use]
pub fn variables(problem: &Problem, design: &Design) -> Vec<NamedValue> {
    let variables = problem.variables().iter().zip(design.values());
    variables
        .map(|(variable, value)| NamedValue {
            name: variable_name(problem, &variable.name),
            unit: variable.unit.to_string(),
            value: *value,
        })
        .collect()
}

/// The text with its first letter in upper case.
pub(crate) fn capitalised(text: &str) -> String {
    let mut chars = text.chars();
    chars.next().map_or_else(String::new, |first| {
        first.to_uppercase().chain(chars).collect()
    })
}
