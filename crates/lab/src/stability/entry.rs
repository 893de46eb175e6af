//! One entry of the table.

use crate::stability::outcome::{EntryError, Outcome};

/// The methods, in the order of the page.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Method {
    Kriging,
    Statistics,
    Designs,
    Search,
    Enrichment,
    Gears,
    Leases,
}

impl Method {
    pub const ALL: [Self; 7] = [
        Self::Kriging,
        Self::Statistics,
        Self::Designs,
        Self::Search,
        Self::Enrichment,
        Self::Gears,
        Self::Leases,
    ];

    /// The heading of the method's section.
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
    /// Stable name of the entry, also its anchor in the page.
    pub id: &'static str,
    pub method: Method,
    /// Heading of the entry: the input in a few words.
    pub title: &'static str,
    /// Description of the input.
    pub input: &'static str,
    /// The library's behaviour instead of a failure.
    pub instead: &'static str,
    pub(crate) check: fn(&mut Outcome) -> Result<(), EntryError>,
}

impl Entry {
    /// An empty entry, the base of all others. It makes no promise and so always fails.
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

    /// Runs the library on the input. An unexpected error breaks a promise, and so does an entry without
    /// promises.
    #[must_use]
    pub fn run(&self) -> Outcome {
        let mut outcome = Outcome::default();
        if let Err(error) = (self.check)(&mut outcome) {
            outcome.holds(&format!("the entry ends without an error ({error})"), false);
        }
        if outcome.promises().is_empty() {
            outcome.holds("the entry makes a promise", false);
        }
        outcome
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry(check: fn(&mut Outcome) -> Result<(), EntryError>) -> Entry {
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
    fn a_broken_promise_an_error_or_no_promise_fails_an_entry() {
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
