//! The head of every report: the inputs, the missing parts, and the recommended design.

use problem::Approach;
use problem::formulation::Constraint;
use stats::{IntervalEstimate, Samples};

use super::contents::Report;
use super::head;
use super::quantity::{approach_name, capitalised, limits, response_name, values, variables};
use crate::doubts;
use crate::number::{count, digits_of, estimate, interval, percent, seconds, with_unit};
use crate::optima::{VerifiedLimit, VerifiedOptimum, is_ranked};

/// The summary as text.
pub(crate) struct SummaryView<'a> {
    pub(crate) report: &'a Report,
    /// Label and value.
    pub(crate) inputs: Vec<(String, String)>,
    pub(crate) headline: String,
    pub(crate) recommended: Option<RecommendedView>,
}

/// The recommended design.
pub(crate) struct RecommendedView {
    /// Name and value.
    pub(crate) variables: Vec<(String, String)>,
    /// Quantity, margin, value, limit.
    pub(crate) margins: Vec<[String; 4]>,
    /// Reasons to doubt it, a sentence each.
    pub(crate) doubts: Vec<String>,
    /// The differences of the other approaches, and the cost.
    pub(crate) sentences: Vec<String>,
    /// Effects that its measure leaves out.
    pub(crate) left_out: String,
}

impl<'a> SummaryView<'a> {
    pub(crate) fn new(report: &'a Report) -> Self {
        let is_finished = report.missing.is_empty();
        let best = report.snapshot.optima.recommended().filter(|_| is_finished);
        Self {
            report,
            inputs: head::inputs(&report.snapshot),
            headline: match best {
                _ if !is_finished => {
                    "The campaign is unfinished, so this report recommends nothing.".to_owned()
                }
                None => format!(
                    "No approach ended on a feasible design with a verified {}.",
                    report.snapshot.measure_name()
                ),
                Some(best) => headline(report, best),
            },
            recommended: best.map(|best| RecommendedView::new(report, best)),
        }
    }

    /// Where and when the report was made.
    pub(crate) fn made(&self) -> String {
        let made = self.report.made.iter();
        let made = made.map(|(label, value)| format!("{label}: {value}"));
        made.collect::<Vec<_>>().join(". ")
    }
}

impl RecommendedView {
    fn new(report: &Report, best: &VerifiedOptimum) -> Self {
        let problem = report.problem();
        let found = best.optimum.feasible();
        let sentences = [others(report), cost(report, best)];
        let variables = found.map_or_else(Vec::new, |found| variables(problem, &found.design));
        let texts = values(&variables);
        let names = variables.into_iter().map(|one| one.name);
        Self {
            variables: names.zip(texts).collect(),
            margins: margins(&best.constraints)
                .chain(best.limits.iter().map(limit))
                .collect(),
            doubts: doubts(report),
            sentences: sentences.into_iter().filter(|s| !s.is_empty()).collect(),
            left_out: head::left_out(problem),
        }
    }
}

/// The doubts about the recommended design: those that the campaign's rows show, and those of its pair of gears.
fn doubts(report: &Report) -> Vec<String> {
    let of_pair = report.gears.iter().flat_map(|gears| &gears.doubts);
    let of_pair = of_pair.map(|doubt| format!("{}.", capitalised(doubt)));
    let of_rows = doubts::recommended::of(&report.snapshot);
    of_rows.into_iter().chain(of_pair).collect()
}

/// Quantity, margin, value and limit of each constraint.
fn margins(constraints: &[Constraint]) -> impl Iterator<Item = [String; 4]> {
    let rows = constraints.iter().zip(limits(constraints));
    rows.map(|(constraint, [value, limit, margin])| {
        let share = match constraint.limit {
            0.0 => String::new(),
            limit => format!(" ({})", percent(-constraint.excess / limit.abs())),
        };
        [
            constraint.name.to_string(),
            format!("{margin}{share}"),
            value,
            format!("{} {limit}", constraint.bound),
        ]
    })
}

/// Quantity, margin, value and limit of a constraint on samples. Its margin is the confidence that it holds.
fn limit(limit: &VerifiedLimit) -> [String; 4] {
    let VerifiedLimit {
        constraint,
        measure,
        unit,
        value,
        ..
    } = limit;
    let ends = value.low.zip(value.high);
    let ends = ends.map_or_else(String::new, |ends| format!(" ({})", interval(ends, 3)));
    [
        format!("{constraint}: {measure}"),
        limit.confidence_in_words(),
        format!("{}{ends}", with_unit(value.value, 3, unit)),
        limit.relation_to_limit(),
    ]
}

fn headline(report: &Report, best: &VerifiedOptimum) -> String {
    let problem = report.problem();
    let response = response_name(problem);
    let unit = &problem.measured().unit;
    let ends = best.measure.and_then(|measure| measure.interval);
    let value = best.measure.map_or(f64::NAN, |measure| measure.value);
    let digits = digits_of(value, ends);
    let value = with_unit(value, digits, unit);
    let interval = match ends {
        None => "no 95 % interval".to_owned(),
        Some(ends) => format!("95 % interval {}", interval(ends, digits)),
    };
    let mut text = format!(
        "The recommended design has a verified {} of {response} of {value} ({interval}, {} samples). It was found \
         by the approach “{}”.",
        report.snapshot.measure_name(),
        count(best.samples().map_or(0, Samples::len) as u64),
        approach_name(problem, best.optimum.approach),
    );
    if ends.is_none() {
        text += " The samples are too few for an interval at this level.";
    }
    let is_alike =
        |difference: IntervalEstimate| difference.interval.is_some_and(|(low, _)| low <= 0.0);
    let alike: Vec<&str> = behind(report)
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

/// The other ranked approaches, with how much worse their measures are.
fn behind(report: &Report) -> impl Iterator<Item = (&'static str, IntervalEstimate)> {
    let name = |other: &VerifiedOptimum| approach_name(report.problem(), other.optimum.approach);
    let ranked = report.snapshot.optima.ranked();
    ranked.filter_map(move |other| Some((name(other), other.behind?)))
}

/// The differences of the other approaches, from samples with the same random numbers.
fn others(report: &Report) -> String {
    let unit = &report.problem().measured().unit;
    let others: Vec<String> = behind(report)
        .filter_map(|(name, difference)| {
            let ends = difference.interval?;
            Some(format!(
                "{name} by {}",
                estimate(difference.value, Some(ends), unit)
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

fn cost(report: &Report, best: &VerifiedOptimum) -> String {
    let cost = best.optimum.cost;
    let mut text = format!(
        "Finding it took {} calls of the simulator and {} s of CPU time.",
        count(cost.simulator_calls),
        seconds(cost.cpu_seconds),
    );
    let problem = report.problem();
    let not_ranked: Vec<&str> = not_ranked(report)
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

fn not_ranked(report: &Report) -> impl Iterator<Item = Approach> {
    let approaches = report
        .snapshot
        .optima
        .iter()
        .map(|other| other.optimum.approach);
    approaches.filter(|approach| !is_ranked(report.problem(), *approach))
}
