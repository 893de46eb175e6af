//! One entry of the table.

use crate::stability::outcome::{Failed, Outcome};

/// The methods, in the order of the page.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Method {
    /// Kriging: covariance, likelihood, data.
    Kriging,
    /// Percentiles, their intervals, normality tests.
    Statistics,
    /// Designs of experiments.
    Designs,
    /// CMA-ES and the penalised objective.
    Search,
    /// Enrichment of a model near an optimum.
    Enrichment,
    /// Gear pairs.
    Gears,
    /// Leases of samples to workers.
    Leases,
}

impl Method {
    /// All methods.
    pub const ALL: [Self; 7] = [
        Self::Kriging,
        Self::Statistics,
        Self::Designs,
        Self::Search,
        Self::Enrichment,
        Self::Gears,
        Self::Leases,
    ];

    /// The name, which begins with a capital letter.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Kriging => "Kriging",
            Self::Statistics => "Percentiles",
            Self::Designs => "Designs of experiments",
            Self::Search => "CMA-ES",
            Self::Enrichment => "Enrichment",
            Self::Gears => "Gear pairs",
            Self::Leases => "Leases",
        }
    }
}

/// An input on which a method breaks or nearly does.
#[derive(Debug, Clone, Copy)]
pub struct Entry {
    /// A short stable name.
    pub id: &'static str,
    /// The method.
    pub method: Method,
    /// The effect of the input, in a few words.
    pub title: &'static str,
    /// The input.
    pub input: &'static str,
    /// The library's behaviour instead of a failure.
    pub instead: &'static str,
    pub(crate) check: fn(&mut Outcome) -> Result<(), Failed>,
}

impl Entry {
    /// An entry without a text, which promises nothing and so is never kept.
    pub(crate) const fn blank(method: Method) -> Self {
        Self {
            id: "",
            method,
            title: "",
            input: "",
            instead: "",
            check: |_| Ok(()),
        }
    }

    /// Runs the library on the input and measures. An error that the entry does not expect is a broken
    /// promise, as is an entry that promises nothing.
    #[must_use]
    pub fn run(&self) -> Outcome {
        let mut outcome = Outcome::default();
        if let Err(error) = (self.check)(&mut outcome) {
            outcome.holds(&format!("the entry runs to its end ({error})"), false);
        }
        if outcome.promises().is_empty() {
            outcome.holds("the entry promises something", false);
        }
        outcome
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry(check: fn(&mut Outcome) -> Result<(), Failed>) -> Entry {
        Entry {
            id: "id",
            method: Method::Kriging,
            title: "title",
            input: "input",
            instead: "instead",
            check,
        }
    }

    #[test]
    fn a_broken_promise_an_error_and_silence_are_not_kept() {
        let kept = entry(|outcome| {
            outcome.at_most("error", 1.0, "µm", 2.0);
            Ok(())
        });
        assert!(kept.run().is_kept());
        let broken = entry(|outcome| {
            outcome.at_most("error", 3.0, "µm", 2.0);
            outcome.holds("this holds", true);
            Ok(())
        });
        let outcome = broken.run();
        assert!(!outcome.is_kept());
        assert_eq!(outcome.promises()[0].sentence, "error is at most 2 µm");
        let nan = entry(|outcome| {
            outcome.at_most("error", f64::NAN, "", 2.0);
            Ok(())
        });
        assert!(!nan.run().is_kept());
        assert!(!entry(|_| Err("no model".into())).run().is_kept());
        assert!(!entry(|_| Ok(())).run().is_kept());
    }
}
