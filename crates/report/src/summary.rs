//! What stands at the head of every report: what was put in, what is missing, what is recommended.

use crate::data::Percentile;
use crate::number::{count, percent, seconds, significant};
use crate::problem::NamedValue;

/// The head of a report, of any problem.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Summary {
    /// What an unfinished campaign lacks, a clause each; empty once it is finished. Nothing is recommended
    /// before that.
    pub missing: Vec<String>,
    /// What was put in, as (label, value with unit).
    pub inputs: Vec<(String, String)>,
    /// Where and when the report was made, as (label, value).
    pub made: Vec<(String, String)>,
    /// The design with the lowest verified percentile.
    pub recommended: Option<Recommended>,
    /// What the recommended number does not include, in sentences.
    pub left_out: String,
}

/// The recommended design.
#[derive(Debug, Clone, PartialEq)]
pub struct Recommended {
    /// The approach that found it.
    pub approach: String,
    /// The percentile's name and the response: "P90 of ΔSTE".
    pub what: String,
    /// The unit of the percentile; empty for a number without one.
    pub unit: String,
    /// The percentile, verified with samples of its own.
    pub percentile: Percentile,
    /// The values of its variables.
    pub variables: Vec<NamedValue>,
    /// Every constraint.
    pub margins: Vec<Margin>,
    /// Calls of the simulator that the approach took.
    pub simulator_calls: u64,
    /// CPU time that the approach took, seconds.
    pub cpu_seconds: f64,
    /// The approaches that were not ranked, because they moved other variables.
    pub not_ranked: Vec<String>,
    /// The other ranked approaches.
    pub behind: Vec<Behind>,
}

/// An approach whose design is not the recommended one.
#[derive(Debug, Clone, PartialEq)]
pub struct Behind {
    /// The approach.
    pub approach: String,
    /// How much worse its verified percentile is, with the 95 % interval of the difference.
    pub difference: Percentile,
}

/// A constraint at the recommended design.
#[derive(Debug, Clone, PartialEq)]
pub struct Margin {
    /// The constrained quantity.
    pub value: NamedValue,
    /// The relation to the limit: "<", "≤", ">" or "≥".
    pub relation: String,
    /// The limit, in the quantity's unit.
    pub limit: f64,
    /// How far the value lies on the good side of the limit, in its unit.
    pub margin: f64,
}

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
    pub(crate) fn new(summary: &Summary, fallback: &str) -> Self {
        let made = summary.made.iter();
        let made = made.map(|(label, value)| format!("{label}: {value}"));
        let mut view = Self {
            missing: summary.missing.join("; "),
            inputs: summary.inputs.clone(),
            headline: fallback.to_owned(),
            others: String::new(),
            cost: String::new(),
            variables: Vec::new(),
            margins: Vec::new(),
            left_out: String::new(),
            made: made.collect::<Vec<_>>().join(". "),
        };
        if !summary.missing.is_empty() {
            view.headline =
                "The campaign is unfinished, so this report recommends nothing.".to_owned();
            return view;
        }
        let Some(best) = &summary.recommended else {
            return view;
        };
        view.headline = headline(best);
        view.others = others(best);
        view.cost = cost(best);
        view.variables = best
            .variables
            .iter()
            .map(|v| (v.name.clone(), with_unit(v.value, DIGITS, &v.unit)))
            .collect();
        view.margins = best.margins.iter().map(Margin::row).collect();
        view.left_out.clone_from(&summary.left_out);
        view
    }
}

impl Margin {
    /// Quantity, value, limit, margin.
    fn row(&self) -> [String; 4] {
        let unit = &self.value.unit;
        let share = match self.limit {
            0.0 => String::new(),
            limit => format!(" ({})", percent(self.margin / limit.abs())),
        };
        [
            self.value.name.clone(),
            with_unit(self.value.value, 4, unit),
            format!("{} {}", self.relation, with_unit(self.limit, 4, unit)),
            format!("{}{share}", with_unit(self.margin, 3, unit)),
        ]
    }
}

/// A number with its unit, if it has one.
pub(crate) fn with_unit(value: f64, digits: usize, unit: &str) -> String {
    format!("{} {unit}", significant(value, digits))
        .trim_end()
        .to_owned()
}

/// The digits with which both ends of an interval differ from its middle, at least three.
pub(crate) fn digits_of(percentile: &Percentile) -> usize {
    let shown = |digits| {
        [percentile.low, percentile.value, percentile.high].map(|value| significant(value, digits))
    };
    let distinct = |digits: &usize| {
        let [low, value, high] = shown(*digits);
        low != value && value != high
    };
    (3..7).find(distinct).unwrap_or(3)
}

fn headline(best: &Recommended) -> String {
    let digits = digits_of(&best.percentile);
    let interval = match best.percentile.low.is_nan() {
        true => "no 95 % interval".to_owned(),
        false => format!(
            "95 % interval {} to {}",
            significant(best.percentile.low, digits),
            significant(best.percentile.high, digits)
        ),
    };
    let mut text = format!(
        "The recommended design has a verified {} of {} ({interval}, {} samples). It was found by the \
         approach “{}”.",
        best.what,
        with_unit(best.percentile.value, digits, &best.unit),
        count(best.percentile.samples as u64),
        best.approach,
    );
    if best.percentile.low.is_nan() {
        text += " The samples are too few for an interval at this level.";
    }
    let alike: Vec<&str> = best
        .behind
        .iter()
        .filter(|other| other.difference.low <= 0.0)
        .map(|other| &*other.approach)
        .collect();
    if !alike.is_empty() {
        text += &format!(
            " The samples do not tell it apart from: {}.",
            alike.join(", ")
        );
    }
    text
}

/// What the other approaches differ by, from samples with the same random numbers.
fn others(best: &Recommended) -> String {
    let others: Vec<String> = best
        .behind
        .iter()
        .map(
            |Behind {
                 approach,
                 difference,
             }| {
                let digits = digits_of(difference);
                let [low, high] = [difference.low, difference.high];
                format!(
                    "{approach} by {} [{}; {}]",
                    with_unit(difference.value, digits, &best.unit),
                    significant(low, digits),
                    significant(high, digits)
                )
            },
        )
        .collect();
    if others.is_empty() {
        return String::new();
    }
    format!(
        "Worse in the same random samples (95 % interval of the difference): {}.",
        others.join(", ")
    )
}

fn cost(best: &Recommended) -> String {
    let mut text = format!(
        "Finding it took {} calls of the simulator and {} s of CPU time.",
        count(best.simulator_calls),
        seconds(best.cpu_seconds),
    );
    if !best.not_ranked.is_empty() {
        text += &format!(
            " Not ranked, because it moved other variables: {}.",
            best.not_ranked.join(", ")
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn percentile(value: f64, half: f64) -> Percentile {
        Percentile {
            value,
            low: value - half,
            high: value + half,
            samples: 6000,
        }
    }

    #[test]
    fn an_interval_never_vanishes_in_the_digits() {
        assert_eq!(digits_of(&percentile(1.49, 0.01)), 3);
        assert_eq!(digits_of(&percentile(1.49, 0.002)), 4);
        assert_eq!(digits_of(&percentile(f64::NAN, 0.1)), 3);
    }

    #[test]
    fn an_unfinished_campaign_recommends_nothing() {
        let best = Recommended {
            approach: "Kriging".into(),
            what: "P90 of ΔSTE".into(),
            unit: "µm".into(),
            percentile: percentile(1.49, 0.01),
            variables: Vec::new(),
            margins: vec![Margin {
                value: NamedValue {
                    name: "root stress".into(),
                    unit: "MPa".into(),
                    value: 900.0,
                },
                relation: "<".into(),
                limit: 1000.0,
                margin: 100.0,
            }],
            simulator_calls: 5,
            cpu_seconds: 2.0,
            not_ranked: vec!["Without wear".into()],
            behind: vec![
                Behind {
                    approach: "Enriched".into(),
                    difference: percentile(0.01, 0.02),
                },
                Behind {
                    approach: "Archard".into(),
                    difference: percentile(0.5, 0.02),
                },
            ],
        };
        let mut summary = Summary {
            recommended: Some(best),
            left_out: "No dynamics.".into(),
            ..Summary::default()
        };
        let view = SummaryView::new(&summary, "");
        assert!(
            view.headline
                .contains("1.49 µm (95 % interval 1.48 to 1.50")
        );
        assert!(
            view.headline
                .contains("do not tell it apart from: Enriched.")
        );
        assert!(
            view.others.contains("Archard by 0.500 µm [0.480; 0.520]"),
            "{}",
            view.others
        );
        assert!(view.cost.contains("Without wear"));
        assert_eq!(view.margins[0][2..], ["< 1000 MPa", "100 MPa (10.0 %)"]);
        summary.missing = vec!["75 of 120 designs sampled".into()];
        let view = SummaryView::new(&summary, "");
        assert!(view.headline.contains("recommends nothing"));
        assert!(view.margins.is_empty() && view.left_out.is_empty());
    }
}
