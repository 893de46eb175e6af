//! The outcome of an entry.

use std::fmt::{Debug, Display};

use results::report::{Axis, Chart, Mark, NamedValue, Scale, Series};

/// An error that ends an entry early.
pub(crate) type EntryError = Box<dyn std::error::Error>;

/// A warning, a refusal or a reason that the library returned.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Detection {
    /// Name of the type or variant in the code.
    pub name: String,
    /// Message to the user; empty for a state without one.
    pub message: String,
}

/// A promise of an entry, and whether the library kept it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Promise {
    pub sentence: String,
    pub is_kept: bool,
}

/// The outcome of an entry: detections, measured figures, charts and promises.
#[derive(Debug, Clone, Default)]
pub struct Outcome {
    detections: Vec<Detection>,
    figures: Vec<NamedValue>,
    promises: Vec<Promise>,
    charts: Vec<Chart>,
}

impl Outcome {
    /// Detections, each once.
    #[must_use]
    pub fn detections(&self) -> &[Detection] {
        &self.detections
    }

    #[must_use]
    pub fn figures(&self) -> &[NamedValue] {
        &self.figures
    }

    #[must_use]
    pub fn promises(&self) -> &[Promise] {
        &self.promises
    }

    #[must_use]
    pub fn charts(&self) -> &[Chart] {
        &self.charts
    }

    /// Whether every promise was kept.
    #[must_use]
    pub fn is_kept(&self) -> bool {
        self.promises.iter().all(|promise| promise.is_kept)
    }

    pub(crate) fn figure(&mut self, name: &str, value: f64, unit: &str) {
        self.figures.push(NamedValue {
            name: name.to_owned(),
            unit: unit.to_owned(),
            value,
        });
    }

    /// Records a promise. A promise recorded more than once is kept if it was kept every time.
    pub(crate) fn holds(&mut self, sentence: &str, is_kept: bool) {
        let mut known = self.promises.iter_mut();
        match known.find(|promise| promise.sentence == sentence) {
            Some(promise) => promise.is_kept &= is_kept,
            None => self.promises.push(Promise {
                sentence: sentence.to_owned(),
                is_kept,
            }),
        }
    }

    /// Records a figure with the promise that it is at most `limit`. NaN breaks the promise.
    pub(crate) fn at_most(&mut self, name: &str, value: f64, unit: &str, limit: f64) {
        self.figure(name, value, unit);
        let limit_text = with_unit(limit, unit);
        self.holds(&format!("{name} is at most {limit_text}"), value <= limit);
    }

    /// Records a figure with the promise that it is at least `limit`. NaN breaks the promise.
    pub(crate) fn at_least(&mut self, name: &str, value: f64, unit: &str, limit: f64) {
        self.figure(name, value, unit);
        let limit_text = with_unit(limit, unit);
        self.holds(&format!("{name} is at least {limit_text}"), value >= limit);
    }

    /// Records a figure with the promise that it is from `low` to `high`. NaN breaks the promise.
    pub(crate) fn between(&mut self, name: &str, value: f64, unit: &str, [low, high]: [f64; 2]) {
        self.figure(name, value, unit);
        let limits = format!("{} to {}", with_unit(low, ""), with_unit(high, unit));
        self.holds(
            &format!("{name} is from {limits}"),
            low <= value && value <= high,
        );
    }

    /// Records a detection.
    pub(crate) fn detected(&mut self, name: impl Into<String>, message: impl Display) {
        let detection = Detection {
            name: name.into(),
            message: message.to_string(),
        };
        if !self.detections.contains(&detection) {
            self.detections.push(detection);
        }
    }

    /// Records a detection without a message.
    pub(crate) fn named(&mut self, name: impl Into<String>) {
        self.detected(name, "");
    }

    /// Records warnings, notes or reasons, with the promise that the `expected` ones are among them.
    pub(crate) fn warned<'a, W: Debug + Display + 'a>(
        &mut self,
        warnings: impl IntoIterator<Item = &'a W>,
        expected: &[&str],
    ) {
        let mut names = Vec::new();
        for warning in warnings {
            let name = variant(warning);
            self.detected(name.clone(), warning);
            names.push(name);
        }
        for expected in expected {
            let is_there = names.iter().any(|name| name == expected);
            self.holds(&format!("{expected} is named"), is_there);
        }
    }

    /// Records an error, with the promise that it is the `expected` variant.
    pub(crate) fn refused<T, E: Debug + Display>(&mut self, result: Result<T, E>, expected: &str) {
        let is_expected = match result {
            Ok(_) => false,
            Err(error) => {
                let name = variant(&error);
                self.detected(name.clone(), &error);
                name == expected
            }
        };
        self.holds(&format!("it is refused as {expected}"), is_expected);
    }

    /// Like [`Self::refused`], with the further promise that the message has the text `values`.
    pub(crate) fn refused_with<T, E: Debug + Display>(
        &mut self,
        result: Result<T, E>,
        expected: &str,
        values: &str,
    ) {
        let message = result.as_ref().err().map(ToString::to_string);
        let has_values = message.is_some_and(|message| message.contains(values));
        self.holds("every message has the values at fault", has_values);
        self.refused(result, expected);
    }

    /// Adds a chart of named curves.
    pub(crate) fn chart(
        &mut self,
        title: &str,
        x: (&str, Scale),
        y: (&str, Scale),
        curves: Vec<(&str, Vec<[f64; 2]>)>,
    ) {
        // Curves differ in dashes as well as in colour.
        const DASHES: [&str; 5] = ["", "7 3", "2 3", "9 3 2 3", "4 2"];
        let series = (0..).zip(curves).map(|(colour, (name, points))| Series {
            name: Some(name.to_owned()),
            mark: Mark::Curve(DASHES[colour % DASHES.len()]),
            colour,
            points,
        });
        self.charts.push(Chart {
            title: title.to_owned(),
            x: Axis::new(x.0, x.1),
            y: Axis::new(y.0, y.1),
            series: series.collect(),
            size: [480.0, 340.0],
        });
    }
}

/// The name of an enum's variant or of a structure, from its `Debug` text.
pub(crate) fn variant(value: &impl Debug) -> String {
    let text = format!("{value:?}");
    let is_name = |c: char| c.is_alphanumeric() || c == '_';
    text.split(|c| !is_name(c))
        .next()
        .unwrap_or_default()
        .to_owned()
}

/// The text of a limit, to three digits.
fn with_unit(value: f64, unit: &str) -> String {
    let value = format!("{value:.2e}").parse().unwrap_or(value);
    let is_plain = value == 0.0 || (1e-3..1e6).contains(&value.abs());
    let number = if is_plain {
        format!("{value}")
    } else {
        format!("{value:e}")
    };
    format!("{number} {unit}").trim_end().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_come_from_the_code() {
        let mut outcome = Outcome::default();
        outcome.refused(doe::random_lhs(1, 3, 0), "Points");
        outcome.refused(doe::random_lhs(5, 3, 0), "Points");
        assert_eq!(outcome.detections()[0].name, "Points");
        assert!(outcome.detections()[0].message.contains("1 points"));
        // One sentence, which did not hold both times.
        let kept: Vec<bool> = outcome.promises().iter().map(|p| p.is_kept).collect();
        assert_eq!(kept, [false]);
        outcome.warned(&[kriging::Warning::ConstantResponse], &["Jitter"]);
        assert_eq!(outcome.detections()[1].name, "ConstantResponse");
        assert!(!outcome.promises()[1].is_kept);
    }

    #[test]
    fn limits_are_short() {
        assert_eq!(with_unit(0.02, "µm"), "0.02 µm");
        assert_eq!(with_unit(1e-9, ""), "1e-9");
        assert_eq!(with_unit(0.114_089_849, ""), "0.114");
    }
}
