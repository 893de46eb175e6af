//! The simulators of workers: the first stored result decides which one a campaign has.

use std::collections::BTreeMap;

/// The digests of the simulators that workers registered with.
#[derive(Debug, Default)]
pub(super) struct Models {
    /// The digest on record, if it is known.
    pinned: Option<String>,
    /// The digest of each worker's simulator. Once a digest is on record, only workers with another one are kept.
    offered: BTreeMap<String, String>,
}

impl Models {
    /// Records the digest that the store has. Workers with another one are refused from then on.
    pub(super) fn pin(&mut self, digest: &str) {
        self.offered.retain(|_, offered| offered != digest);
        self.pinned = Some(digest.to_owned());
    }

    /// Whether a digest is on record.
    pub(super) const fn is_pinned(&self) -> bool {
        self.pinned.is_some()
    }

    /// Records the digest of a worker's simulator. Returns the digest on record if it is another one.
    pub(super) fn offer(&mut self, worker: &str, digest: &str) -> Result<(), String> {
        match &self.pinned {
            Some(pinned) if pinned != digest => Err(pinned.clone()),
            Some(_) => {
                self.offered.remove(worker);
                Ok(())
            }
            None => {
                self.offered.insert(worker.to_owned(), digest.to_owned());
                Ok(())
            }
        }
    }

    /// The digest that a worker registered with, unless it is the one on record.
    pub(super) fn offered(&self, worker: &str) -> Option<&str> {
        self.offered.get(worker).map(String::as_str)
    }

    /// Whether a worker has another simulator than the one on record.
    pub(super) fn is_foreign(&self, worker: &str) -> bool {
        self.is_pinned() && self.offered.contains_key(worker)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_digest_on_record_decides_and_until_then_none() {
        let mut models = Models::default();
        for (worker, digest) in [("a", "one"), ("b", "two"), ("c", "two")] {
            models.offer(worker, digest).unwrap();
            assert!(!models.is_foreign(worker));
        }
        models.pin("two");
        let foreign = |models: &Models| ["a", "b", "c"].map(|worker| models.is_foreign(worker));
        assert_eq!(foreign(&models), [true, false, false]);
        assert_eq!(models.offer("d", "one"), Err("two".to_owned()));
        // The worker was started again with the right program.
        models.offer("a", "two").unwrap();
        assert_eq!(foreign(&models), [false; 3]);
    }
}
