//! Columns about the sampled response.

use problem::formulation::Problem;

use crate::cell::Column;

/// The name of a column about the sampled response: with µm for a gear pair, otherwise without a unit, like the user's
/// own names. `{p}` in `what` stands for the measure's name.
pub(crate) fn column(problem: &Problem, what: &str) -> String {
    let sampling = &problem.campaign().sampling;
    let name = what.replace("{p}", &sampling.measure_column());
    let square = if is_squared(what) { "2" } else { "" };
    match problem.gears() {
        Some(_) => format!("{name}_um{square}"),
        None => name,
    }
}

/// Whether a column has probabilities, and not values of the response.
fn is_probability(problem: &Problem, what: &str) -> bool {
    what.contains("{p}") && problem.campaign().sampling.objective.is_probability()
}

fn is_squared(what: &str) -> bool {
    what.ends_with("variance")
}

/// A column about the sampled response, as [`column`] names it.
pub(crate) fn statistic(problem: &Problem, what: &str) -> Column {
    let unit = match is_probability(problem, what) {
        true => "",
        false => &*problem.objective().response.unit,
    };
    let unit = match is_squared(what) {
        true => squared(unit),
        false => unit.to_owned(),
    };
    Column::number(column(problem, what)).in_unit(unit)
}

/// The unit of a variance.
pub(crate) fn squared(unit: &str) -> String {
    match unit {
        "" => String::new(),
        unit => format!("{unit}²"),
    }
}
