//! Detection of steps without effect.
//!
//! A step's result is stored, and the next decision sees it. If the store does not return the result, for example
//! because a page was damaged, the coordinator would repeat the step for ever.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use ledger::StreamId;

/// Maximum number of times that a step is done with the same inputs.
const MOST: u32 = 2;

/// The steps done since anything else changed.
#[derive(Debug, Default)]
pub(crate) struct Repeats {
    quarantined: BTreeSet<StreamId>,
    more: BTreeMap<u64, u64>,
    /// How often each step was done, with its inputs.
    done: BTreeMap<(String, String), u32>,
}

impl Repeats {
    /// Forgets the steps: workers may have delivered something.
    pub(crate) fn forget(&mut self) {
        self.done.clear();
    }

    /// Forgets the steps if the quarantined streams or the additional samples have changed: steps depend on them, too.
    pub(crate) fn see(&mut self, quarantined: &BTreeSet<StreamId>, more: &BTreeMap<u64, u64>) {
        if (&self.quarantined, &self.more) != (quarantined, more) {
            self.forget();
            self.quarantined.clone_from(quarantined);
            self.more.clone_from(more);
        }
    }

    /// Counts a step of the coordinator on the store at `path`.
    ///
    /// # Errors
    ///
    /// [`store::Error::Damaged`] if the step was done before without effect.
    pub(crate) fn count(
        &mut self,
        step: &str,
        inputs: &str,
        path: &Path,
    ) -> Result<(), store::Error> {
        let done = self
            .done
            .entry((step.to_owned(), inputs.to_owned()))
            .or_default();
        if *done >= MOST {
            return Err(store::Error::Damaged {
                path: path.to_owned(),
                detail: format!(
                    "{step} was done {MOST} times with the same inputs, and its result is missing from the store"
                ),
            });
        }
        *done += 1;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_without_effect_is_not_done_a_third_time() {
        let path = Path::new("campaign.db");
        let (none, more) = (BTreeSet::new(), BTreeMap::new());
        let mut repeats = Repeats::default();
        let mut pass = |quarantined: &BTreeSet<StreamId>, step: &str, inputs: &str| {
            repeats.see(quarantined, &more);
            repeats.count(step, inputs, path).is_ok()
        };
        // Two steps in turn are noticed, too.
        assert!(pass(&none, "fit", "a") && pass(&none, "choice", "a"));
        assert!(pass(&none, "fit", "a") && pass(&none, "choice", "a"));
        assert!(pass(&none, "fit", "b"), "its inputs have changed");
        assert!(!pass(&none, "fit", "a") && !pass(&none, "choice", "a"));
        let quarantined = BTreeSet::from([StreamId::design(3)]);
        assert!(pass(&quarantined, "fit", "a"), "a design is quarantined");
        repeats.forget();
        assert_eq!(
            (0..3)
                .filter(|_| repeats.count("fit", "a", path).is_ok())
                .count(),
            2
        );
        let error = repeats.count("fit", "a", path).unwrap_err().to_string();
        assert!(
            error.contains("campaign.db is damaged (fit was done"),
            "{error}"
        );
    }
}
