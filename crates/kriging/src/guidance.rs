//! Warnings and errors as texts that name the settings of a program that help.

use crate::{Error, Names, Nugget, Warning};

/// A program's words for the data, and the names of the settings that help.
pub struct Guidance<'a> {
    /// The names of coordinates and observations.
    pub names: Names<'a>,
    /// The name of the responses, in the plural, as in "percentiles".
    pub responses: &'a str,
    /// Unit of the response with a space before it, as in " µm"; empty if it has none.
    pub unit: &'a str,
    /// A setting and its value in the program's notation, as in `kriging.nugget = "estimated"`.
    pub setting: &'a dyn Fn(&str, &str) -> String,
    /// The setting that leaves out observations (indices from 0), as in `kriging.leave_out = [41]`; `None` if
    /// the program has none.
    pub without: &'a dyn Fn(&[usize]) -> Option<String>,
    /// Whether a nugget is estimated already.
    pub nugget: Nugget,
    /// The source of more points, as in "more designs (doe.designs)".
    pub more_points: &'a str,
    /// The source of less noise, as in "more samples (sampling.samples_per_design)".
    pub less_noise: &'a str,
}

impl Guidance<'_> {
    /// The text of the warning, with the settings that help.
    #[must_use]
    pub fn warning(&self, warning: &Warning) -> String {
        let text = warning.text(&self.names);
        let setting = self.setting;
        let advice = match warning {
            Warning::Outliers { worst, .. } => {
                let numbers: Vec<usize> = worst.iter().map(|o| o.observation).collect();
                let without = (self.without)(&numbers);
                let without = without.map(|how| format!("{how} fits without them"));
                let noise = (self.nugget == Nugget::Known)
                    .then(|| format!("{} takes them as noise", setting("nugget", "estimated")));
                let ways: Vec<String> = without.into_iter().chain(noise).collect();
                match ways.is_empty() {
                    true => "look at them".to_owned(),
                    false => format!("look at them; {}", ways.join(", ")),
                }
            }
            Warning::ContradictoryDuplicates { .. } | Warning::NuggetAtBound { upper: true } => {
                format!("{} help", self.less_noise)
            }
            Warning::FewPoints { .. } | Warning::SharedRange { .. } => format!(
                "{} help, or {}",
                self.more_points,
                setting("estimator", "posterior-mode")
            ),
            Warning::FlatRanges { .. } => format!(
                "{} settles it by a prior",
                setting("estimator", "posterior-mode")
            ),
            Warning::NuggetAtBound { upper: false } => {
                format!("{} is as good", setting("nugget", "known"))
            }
            _ => return text,
        };
        format!("{text}; {advice}")
    }

    /// The text of the error in these words, with the settings that help; `None` if the error names
    /// neither an observation nor a setting, so that its own text is enough.
    #[must_use]
    pub fn error(&self, error: &Error) -> Option<String> {
        let observation = |number: &usize| (self.names.observation)(*number);
        let (setting, unit) = (self.setting, self.unit);
        let without = |number: usize| {
            (self.without)(&[number]).map_or_else(String::new, |how| format!(" ({how})"))
        };
        match error {
            Error::Contradiction {
                first,
                second,
                difference,
                permitted,
            } => Some(format!(
                "{} and {} lie at the same place, and their {} differ by {difference:.3e}{unit} where their \
                 noise permits {permitted:.3e}: leave one of them out{}, or let {} explain it",
                observation(first),
                observation(second),
                self.responses,
                without(*second),
                setting("nugget", "estimated")
            )),
            Error::NotPositiveDefinite {
                observation: Some(number),
                jitter,
            } => Some(format!(
                "no covariance matrix is positive definite, even with {jitter:e} added to its diagonal: {} \
                 repeats others but for rounding; leave it out{}",
                observation(number),
                without(*number)
            )),
            Error::Logarithm { index, value } => Some(format!(
                "{} is {value}{unit}, which has no logarithm: choose {}",
                observation(index),
                setting("response", "plain")
            )),
            Error::ExactOnly { what } => Some(format!(
                "the approximate method, which \"auto\" selects for many observations, does not offer {what}: \
                 choose {}",
                setting("method", "exact")
            )),
            _ => None,
        }
    }
}
