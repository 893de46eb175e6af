//! A view of one cost against one error: a chart and a recommendation.

use results::number::short_time;
use results::report::charts::{TradeoffChart, TradeoffSeries};

use crate::tradeoff::front::{PowerLaw, Reason, Rule, front, recommend};
use crate::tradeoff::table::{Row, Table};

/// A cost and an error of a study.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pair {
    /// The column of the cost.
    pub cost: usize,
    /// The column of the error.
    pub error: usize,
    pub reading: Reading,
}

/// The conclusion that a cost and an error allow.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Reading {
    /// The rule chooses a setting.
    Choice(Rule),
    /// The task sets the cost, for example the time of a program's sample. The rule says from which cost on the error is
    /// small.
    Given(Rule),
    /// The cost is the size of a task. The error is a time, which grows with a power of it.
    Growth,
}

/// One panel of a study, as cost against error.
#[derive(Debug, Clone, PartialEq)]
pub struct View<'a> {
    /// The name of the chart's files, without extension.
    pub file: String,
    pub table: &'a Table,
    pub panel: &'a str,
    pub pair: Pair,
}

impl<'a> View<'a> {
    fn rows(&self) -> Vec<&'a Row> {
        let rows = self.table.rows.iter();
        rows.filter(|row| row.panel == self.panel).collect()
    }

    fn point(&self, row: &Row) -> [f64; 2] {
        [row.values[self.pair.cost], row.values[self.pair.error]]
    }

    #[must_use]
    pub fn recommended(&self) -> Option<&'a Row> {
        let Reading::Choice(rule) = self.pair.reading else {
            return None;
        };
        let rows = self.rows();
        let points: Vec<[f64; 2]> = rows.iter().map(|row| self.point(row)).collect();
        recommend(&points, rule).map(|(place, _)| rows[place])
    }

    /// A sentence that recommends a setting, with the reason, or that says from which given cost on the error is small.
    #[must_use]
    pub fn sentence(&self) -> String {
        let rows = self.rows();
        let points: Vec<[f64; 2]> = rows.iter().map(|row| self.point(row)).collect();
        let (rule, is_given) = match self.pair.reading {
            Reading::Choice(rule) => (rule, false),
            Reading::Given(rule) => (rule, true),
            Reading::Growth => return self.growth(&rows, &points),
        };
        let Some((place, reason)) = recommend(&points, rule) else {
            return "There are no measurements.".to_owned();
        };
        let columns = [self.pair.cost, self.pair.error].map(|i| &*self.table.columns[i]);
        let [(cost, _), (error, error_unit)] = columns.map(name_and_unit);
        let why = match (reason, rule) {
            (Reason::CheapestWithin(limit), Rule::Within(_)) => {
                format!(
                    "the cheapest whose {error} is at most {}",
                    amount(limit, error_unit)
                )
            }
            (Reason::CheapestWithin(_), Rule::NearBest(share)) => format!(
                "the cheapest whose {error} is within {} % of the least measured",
                short(100.0 * share)
            ),
            (Reason::MostAccurate, Rule::Within(limit)) => format!(
                "the most accurate, since no measured {error} is at most {}",
                amount(limit, error_unit)
            ),
            (Reason::MostAccurate, Rule::NearBest(_)) => "the most accurate".to_owned(),
        };
        let amounts = |at: usize| {
            let units = columns.map(|column| name_and_unit(column).1);
            [0, 1].map(|i| amount(points[at][i], units[i]))
        };
        let figures = |at: usize| {
            let [x, y] = amounts(at);
            format!("{cost} {x}, {error} {y}")
        };
        if is_given {
            let (row, [x, y]) = (rows[place], amounts(place));
            let of = format!("{error} {y} ({}, {})", row.method, row.setting);
            return match reason {
                Reason::CheapestWithin(limit) => {
                    let limit = amount(limit, error_unit);
                    format!("The least {cost} whose {error} is at most {limit} is {x}, with {of}.")
                }
                Reason::MostAccurate => {
                    format!("The least {error} is that of {cost} {x}: {of}. It is above the limit.")
                }
            };
        }
        let mut text = format!(
            "Recommended: {}, {} ({}). It is {why}.",
            rows[place].method,
            rows[place].setting,
            figures(place)
        );
        // A campaign may have several settings, for example its approaches.
        let own: Vec<usize> = (0..rows.len()).filter(|&i| rows[i].is_campaign).collect();
        let best = own
            .iter()
            .copied()
            .min_by(|&a, &b| points[a][1].total_cmp(&points[b][1]));
        let whose = match own.len() {
            1 => "The campaign's",
            _ => "The most accurate of the campaign's own",
        };
        match best {
            Some(_) if rows[place].is_campaign => text.push_str(" The campaign has this setting."),
            Some(own) => {
                text += &format!(
                    " {whose} is {}, {} ({}).",
                    rows[own].method,
                    rows[own].setting,
                    figures(own)
                );
            }
            None => {}
        }
        text
    }

    /// A sentence with the exponent of the power law, and the times of the smallest and the largest size.
    fn growth(&self, rows: &[&Row], points: &[[f64; 2]]) -> String {
        let columns = [self.pair.cost, self.pair.error].map(|i| &*self.table.columns[i]);
        let [(size, _), (cost, unit)] = columns.map(name_and_unit);
        let (Some(law), Some(first), Some(last)) =
            (PowerLaw::fit(points), rows.first(), rows.last())
        else {
            return "There are too few measurements for a power law.".to_owned();
        };
        let verb = if law.exponent < 0.0 { "falls" } else { "grows" };
        let at = |row: &Row| {
            let cost = amount(row.values[self.pair.error], unit);
            format!("{cost} ({})", row.setting)
        };
        let exponent = format!("{:.2}", law.exponent).replace('-', "−");
        format!(
            "The {cost} {verb} as the power {exponent} of the {size}, from {} to {}.",
            at(first),
            at(last)
        )
    }

    /// The panel, if there are several, and the names of error and cost. The names are cut at the first comma, unless
    /// they would then be equal.
    fn title(&self) -> String {
        let columns = [self.pair.error, self.pair.cost].map(|i| &*self.table.columns[i]);
        let names = columns.map(|column| name_and_unit(column).0);
        let brief = names.map(|name| name.split(',').next().unwrap_or_default());
        let [error, cost] = if brief[0] == brief[1] { names } else { brief };
        match self.table.panels().len() {
            1 => format!("{error} over {cost}"),
            _ => format!("{}: {error} over {cost}", self.panel),
        }
    }

    /// The Pareto front, or the ends of the power law.
    fn line(&self, points: &[[f64; 2]]) -> TradeoffSeries {
        if self.pair.reading != Reading::Growth {
            return TradeoffSeries {
                name: "Pareto front".to_owned(),
                points: front(points).into_iter().map(|i| points[i]).collect(),
            };
        }
        let law = PowerLaw::fit(points);
        let ends = points.first().into_iter().chain(points.last());
        TradeoffSeries {
            name: law.map_or(String::new(), |law| {
                format!("power {:.2}", law.exponent).replace('-', "−")
            }),
            points: law.map_or(Vec::new(), |law| {
                ends.map(|[x, _]| [*x, law.at(*x)]).collect()
            }),
        }
    }

    #[must_use]
    pub fn chart(&self) -> TradeoffChart {
        let rows = self.rows();
        let points: Vec<[f64; 2]> = rows.iter().map(|row| self.point(row)).collect();
        // A method that is missing here keeps its place, so that all panels give a method the same colour.
        let mut series: Vec<TradeoffSeries> = Vec::new();
        for row in &self.table.rows {
            let at = series.iter().position(|one| one.name == row.method);
            let at = at.unwrap_or_else(|| {
                series.push(TradeoffSeries {
                    name: row.method.clone(),
                    points: Vec::new(),
                });
                series.len() - 1
            });
            if row.panel == self.panel {
                series[at].points.push(self.point(row));
            }
        }
        let columns = [self.pair.cost, self.pair.error].map(|i| self.table.columns[i].clone());
        let [cost, error] = columns;
        let own = rows.iter().zip(&points).filter(|(row, _)| row.is_campaign);
        TradeoffChart {
            file: self.file.clone(),
            title: self.title(),
            cost,
            error,
            series,
            line: self.line(&points),
            campaign: own.map(|(_, point)| *point).collect(),
            recommended: self.recommended().map(|row| self.point(row)),
            recommendation: self.sentence(),
        }
    }
}

/// The name and the unit in a column's head; the unit may be empty.
fn name_and_unit(column: &str) -> (&str, &str) {
    let both = column.strip_suffix(')').and_then(|c| c.rsplit_once(" ("));
    both.unwrap_or((column, ""))
}

/// A number with its unit; times below a second in ms or µs.
fn amount(value: f64, unit: &str) -> String {
    match unit {
        "s" => short_time(value),
        _ => format!("{} {unit}", short(value)).trim_end().to_owned(),
    }
}

/// A number with three significant digits.
fn short(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return value.to_string();
    }
    let digits = 2 - value.abs().log10().floor() as i32;
    let scale = 10_f64.powi(digits);
    let rounded = (value * scale).round() / scale;
    format!("{rounded:.*}", digits.max(0) as usize)
        .trim_end_matches(|c| digits > 0 && c == '0')
        .trim_end_matches('.')
        .to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        let of = |value: f64| short(value);
        assert_eq!(of(0.012_34), "0.0123");
        assert_eq!(of(2.0), "2");
        assert_eq!(of(123_456.0), "123000");
        assert_eq!(of(0.10), "0.1");
        assert_eq!(of(300.0), "300");
    }

    #[test]
    fn the_sentence_names_setting_reason_and_campaign() {
        let mut table = Table::new(&["time (µs)", "error (%)"]);
        for (panel, setting, is_campaign, values) in [
            ("a", "8 × 4", false, [1.0, 2.0]),
            ("a", "16 × 8", false, [2.0, 0.2]),
            ("a", "32 × 16", true, [4.0, 0.1]),
            ("b", "8 × 4", false, [0.5, 0.01]),
        ] {
            table.rows.push(Row {
                panel: panel.to_owned(),
                method: "prefix sums".to_owned(),
                setting: setting.to_owned(),
                is_campaign,
                values: values.to_vec(),
            });
        }
        let view = View {
            file: "x".to_owned(),
            table: &table,
            panel: "a",
            pair: Pair {
                cost: 0,
                error: 1,
                reading: Reading::Choice(Rule::Within(0.5)),
            },
        };
        assert_eq!(
            view.sentence(),
            "Recommended: prefix sums, 16 × 8 (time 2 µs, error 0.2 %). It is the cheapest whose error is at most \
             0.5 %. The campaign's is prefix sums, 32 × 16 (time 4 µs, error 0.1 %)."
        );
        let mut given = view.clone();
        given.pair.reading = Reading::Given(Rule::Within(0.5));
        assert_eq!(
            given.sentence(),
            "The least time whose error is at most 0.5 % is 2 µs, with error 0.2 % (prefix sums, 16 × 8)."
        );
        assert_eq!(given.recommended(), None);
        let mut growth = view.clone();
        growth.pair.reading = Reading::Growth;
        assert_eq!(
            growth.sentence(),
            "The error falls as the power −2.16 of the time, from 2 % (8 × 4) to 0.1 % (32 × 16)."
        );
        assert_eq!(growth.recommended(), None);
        assert_eq!(growth.chart().line.points.len(), 2);
        let chart = view.chart();
        assert_eq!(chart.series.len(), 1);
        assert_eq!(chart.title, "a: error over time");
        assert_eq!(
            chart.line.points.len(),
            3,
            "rows of another panel do not count"
        );
        assert_eq!(chart.campaign, [[4.0, 0.1]]);
        assert_eq!(chart.recommended, Some([2.0, 0.2]));
    }
}
