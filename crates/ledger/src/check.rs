//! Checks of the crate's invariants, for its tests.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use crate::ledger::Ledger;
use crate::ranges::subtract;
use crate::types::{Group, LeaseId, StreamId, WorkerId};

impl<P: Clone> Ledger<P> {
    /// Panics unless the collections of the ledger agree with each other.
    #[doc(hidden)]
    pub fn check(&self) {
        let mut open: BTreeMap<Group, usize> = BTreeMap::new();
        for (&id, stream) in &self.streams {
            assert!(!stream.missing.is_empty(), "{id} is settled");
            assert!(!self.settled.contains_key(&id), "{id} is settled and open");
            let mut free = stream.missing.clone();
            for holder in &stream.leases {
                let units = &self.leases[holder].units;
                for unit in units.iter().filter(|unit| unit.stream == id) {
                    assert_eq!(unit.generation, stream.generation, "{id}");
                    subtract(&mut free, &unit.samples);
                }
            }
            for sample in stream.waiting() {
                subtract(&mut free, &sample);
            }
            assert_eq!(
                stream.free, free,
                "{id}: free is what is missing, not leased and not waiting"
            );
            assert_eq!(self.free.contains(&id), stream.has_free(), "{id}");
            assert_eq!(
                self.quarantined.contains(&id),
                stream.quarantined.is_some(),
                "{id}"
            );
            for (sample, failing) in &stream.failing {
                let is_kept = |until| self.waiting.contains(&(until, id, *sample));
                assert!(failing.waits_until.is_none_or(is_kept), "{id}");
                let is_missing = |sample| stream.missing.iter().any(|r| r.contains(&sample));
                assert!(sample.is_none_or(is_missing), "{id}, sample {sample:?}");
            }
            if stream.quarantined.is_none() {
                *open.entry(id.group()).or_default() += 1;
            }
        }
        assert_eq!(open, self.open);
        let known = |id: &StreamId| self.streams.contains_key(id);
        assert!(self.free.iter().chain(&self.quarantined).all(known));
        let waits = |(until, id, sample): &(Duration, StreamId, Option<u32>)| {
            self.streams[id].failing[sample].waits_until == Some(*until)
        };
        assert!(self.waiting.iter().all(waits));
        for (id, lease) in &self.leases {
            assert_eq!(lease.units.is_empty(), lease.is_control, "{id}");
            assert!(!self.lapsed.contains_key(id), "{id} ran out and did not");
            assert!(self.expiries.contains(&(lease.expires, *id)));
            for unit in &lease.units {
                assert!(self.streams[&unit.stream].leases.contains(id), "{id}");
                let rivals = self.rivals(unit);
                for sample in unit.samples.clone() {
                    let has = |rival: &&LeaseId| {
                        let mut units = self.leases[rival].units.iter();
                        units.any(|u| u.stream == unit.stream && u.samples.contains(&sample))
                    };
                    let having: Vec<&LeaseId> = rivals.iter().filter(has).collect();
                    assert!(having.len() <= 2, "{having:?} have sample {sample}");
                    let workers = having.iter().map(|id| &self.leases[id].worker);
                    let workers: BTreeSet<&WorkerId> = workers.collect();
                    assert_eq!(workers.len(), having.len(), "{having:?}: one worker");
                }
            }
        }
        assert_eq!(self.expiries.len(), self.leases.len());
        let is_out = |(_, id): &(Duration, LeaseId)| self.leases.contains_key(id);
        assert!(self.alone.iter().all(is_out));
    }
}
