//! What stands at the head of every report: what was put in, what is missing, what is recommended.

use campaign::formulation::{Constraint, Problem};
use stats::OrderStatistic;

use crate::optima::{VerifiedOptimum, is_ranked};
use crate::report::data::ReportData;
use crate::report::number::{MISSING, count, percent, seconds, significant};
use crate::report::quantity::{approach_name, variables};

/// The summary as text.
pub(crate) struct SummaryView {
    pub(crate) missing: String,
    pub(crate) inputs: Vec<(String, String)>,
    pub(crate) headline: String,
    pub(crate) others: String,
    pub(crate) cost: String,
    pub(crate) variables: Vec<(String, String)>,
    pub(crate) margins: Vec<[String; 4]>,
    pub(crate) left_out: String,
    pub(crate) made: String,
}

/// Digits of variables.
const DIGITS: usize = 5;

impl SummaryView {
    /// The summary of a report; `fallback` is what it says where nothing can be recommended.
    pub(crate) fn new(data: &ReportData, fallback: &str) -> Self {
        let made = data.made.iter();
        let made = made.map(|(label, value)| format!("{label}: {value}"));
        let mut view = Self {
            missing: data.missing.join("; "),
            inputs: data.inputs.clone(),
            headline: fallback.to_owned(),
            others: String::new(),
            cost: String::new(),
            variables: Vec::new(),
            margins: Vec::new(),
            left_out: String::new(),
            made: made.collect::<Vec<_>>().join(". "),
        };
        if !data.missing.is_empty() {
            view.headline =
                "The campaign is unfinished, so this report recommends nothing.".to_owned();
            return view;
        }
        let Some(best) = data.optima.recommended() else {
            return view;
        };
        view.headline = headline(data, best);
        view.others = others(data);
        view.cost = cost(data, best);
        if let Some(found) = best.optimum.feasible() {
            let variables = variables(&data.problem, &found.design).into_iter();
            view.variables = variables
                .map(|v| (v.name, with_unit(v.value, DIGITS, &v.unit)))
                .collect();
        }
        view.margins = best.constraints.iter().map(margin).collect();
        view.left_out.clone_from(&data.left_out);
        view
    }
}

/// Quantity, value, limit, margin.
fn margin(constraint: &Constraint) -> [String; 4] {
    let unit = &constraint.unit;
    // No zero with a sign.
    let margin = 0.0 - constraint.excess;
    let share = match constraint.limit {
        0.0 => String::new(),
        limit => format!(" ({})", percent(margin / limit.abs())),
    };
    [
        constraint.name.to_string(),
        with_unit(constraint.value, 4, unit),
        format!(
            "{} {}",
            constraint.bound.sign(),
            with_unit(constraint.limit, 4, unit)
        ),
        format!("{}{share}", with_unit(margin, 3, unit)),
    ]
}

/// A number with its unit, if it has one.
pub(crate) fn with_unit(value: f64, digits: usize, unit: &str) -> String {
    format!("{} {unit}", significant(value, digits))
        .trim_end()
        .to_owned()
}

/// The digits with which both ends of an interval differ from its middle, at least three.
pub(crate) fn digits_of(percentile: &OrderStatistic) -> usize {
    let Some((low, high)) = percentile.interval else {
        return 3;
    };
    let distinct = |digits: &usize| {
        let [low, value, high] =
            [low, percentile.value, high].map(|value| significant(value, *digits));
        low != value && value != high
    };
    (3..7).find(distinct).unwrap_or(3)
}

/// A percentile with its unit, and its interval; of one that is not known, dashes.
pub(crate) fn percentile_and_interval(
    percentile: Option<OrderStatistic>,
    digits: usize,
    unit: &str,
) -> [String; 2] {
    let Some(percentile) = percentile else {
        return [MISSING, MISSING].map(str::to_owned);
    };
    let digits = digits_of(&percentile).max(digits);
    let interval = match percentile.interval {
        None => "none: too few samples".to_owned(),
        Some((low, high)) => {
            let [low, high] = [low, high].map(|end| significant(end, digits));
            format!("{low} to {high}")
        }
    };
    [with_unit(percentile.value, digits, unit), interval]
}

fn headline(data: &ReportData, best: &VerifiedOptimum) -> String {
    let problem = &data.problem;
    let response = match problem.gears() {
        Some(_) => "ΔSTE",
        None => &problem.sampled().name,
    };
    let [value, interval] = percentile_and_interval(best.percentile, 3, &problem.sampled().unit);
    let has_interval = best.percentile.is_some_and(|p| p.interval.is_some());
    let interval = match has_interval {
        false => "no 95 % interval".to_owned(),
        true => format!("95 % interval {interval}"),
    };
    let mut text = format!(
        "The recommended design has a verified {} of {response} of {value} ({interval}, {} samples). It was found \
         by the approach “{}”.",
        data.header.percentile,
        count(best.samples().len() as u64),
        approach_name(problem, best.optimum.approach),
    );
    if !has_interval {
        text += " The samples are too few for an interval at this level.";
    }
    let is_alike =
        |difference: OrderStatistic| difference.interval.is_some_and(|(low, _)| low <= 0.0);
    let alike: Vec<&str> = behind(data)
        .filter(|(_, difference)| is_alike(*difference))
        .map(|(name, _)| name)
        .collect();
    if !alike.is_empty() {
        text += &format!(
            " The samples do not tell it apart from: {}.",
            alike.join(", ")
        );
    }
    text
}

/// The other ranked approaches, with how much worse their percentiles are.
fn behind(data: &ReportData) -> impl Iterator<Item = (&'static str, OrderStatistic)> {
    let name = |other: &VerifiedOptimum| approach_name(&data.problem, other.optimum.approach);
    let ranked = data.optima.ranked();
    ranked.filter_map(move |other| Some((name(other), other.behind?)))
}

/// What the other approaches differ by, from samples with the same random numbers.
fn others(data: &ReportData) -> String {
    let unit = &data.problem.sampled().unit;
    let others: Vec<String> = behind(data)
        .filter_map(|(name, difference)| {
            let (low, high) = difference.interval?;
            let digits = digits_of(&difference);
            Some(format!(
                "{name} by {} [{}; {}]",
                with_unit(difference.value, digits, unit),
                significant(low, digits),
                significant(high, digits)
            ))
        })
        .collect();
    if others.is_empty() {
        return String::new();
    }
    format!(
        "Worse in the same random samples (95 % interval of the difference): {}.",
        others.join(", ")
    )
}

fn cost(data: &ReportData, best: &VerifiedOptimum) -> String {
    let cost = best.optimum.cost;
    let mut text = format!(
        "Finding it took {} calls of the simulator and {} s of CPU time.",
        count(cost.simulator_calls),
        seconds(cost.cpu_seconds),
    );
    let problem = &data.problem;
    let not_ranked: Vec<&str> = not_ranked(problem, data)
        .map(|approach| approach_name(problem, approach))
        .collect();
    if !not_ranked.is_empty() {
        text += &format!(
            " Not ranked, because it moved other variables: {}.",
            not_ranked.join(", ")
        );
    }
    text
}

fn not_ranked(problem: &Problem, data: &ReportData) -> impl Iterator<Item = campaign::Approach> {
    let approaches = data.optima.iter().map(|other| other.optimum.approach);
    approaches.filter(|approach| !is_ranked(problem, *approach))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_interval_never_vanishes_in_the_digits() {
        let percentile = |value: f64, half: f64| OrderStatistic {
            n: 6000,
            value,
            interval: Some((value - half, value + half)),
        };
        assert_eq!(digits_of(&percentile(1.49, 0.01)), 3);
        assert_eq!(digits_of(&percentile(1.49, 0.002)), 4);
        assert_eq!(digits_of(&percentile(f64::NAN, 0.1)), 3);
    }
}
