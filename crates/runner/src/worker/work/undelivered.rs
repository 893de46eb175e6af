//! Results that cannot be delivered because the coordinator is away. They go to a file once it has been silent for a
//! while, and the next worker delivers them.

use std::path::PathBuf;
use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::protocol::v1::{LeaseResult, Origin};
use crate::shards::{Kinship, OrphanFile, UndeliveredFile};
use tracing::{error, info, warn};

use super::registering::Registration;
use crate::worker::held::HeldLeases;

/// The files of undelivered results.
#[derive(Debug, Default)]
pub(super) struct Files {
    /// The folder of the files; none for a worker whose coordinator is in the same process.
    folder: Option<PathBuf>,
    state: Mutex<State>,
}

#[derive(Debug, Default)]
struct State {
    /// This worker's file, once there is one.
    own: Option<UndeliveredFile>,
    /// The files of former workers whose results this one delivers.
    found: Vec<OrphanFile>,
}

impl Files {
    pub(super) fn new(folder: Option<PathBuf>) -> Self {
        Self {
            folder,
            state: Mutex::default(),
        }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        // A panic cannot leave the state half changed.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes over the files of former workers of the same simulator and campaign, or of the campaign before it grew.
    pub(super) fn take_up(&self, registered: &Registration, held: &HeldLeases) {
        let Some(folder) = &self.folder else {
            return;
        };
        let mut state = self.state();
        for found in OrphanFile::all(folder) {
            let found = match found {
                Ok(found) => found,
                Err(error) => {
                    warn!(%error, "undelivered results of a former worker cannot be used");
                    continue;
                }
            };
            let OrphanFile { part, .. } = &found;
            let file = part.path.display();
            if !part.header.is_undelivered() {
                warn!(%file, "this is a part of a shard, which `coordinator merge` stores");
                continue;
            }
            if part.header.kinship(registered.problem.campaign()) == Kinship::Foreign {
                info!(%file, "undelivered results of another campaign are left where they are");
                continue;
            }
            if part.header.model_digest != registered.model_digest {
                warn!(%file, "undelivered results of another simulator are left where they are");
                continue;
            }
            info!(%file, leases = part.results.len(), "delivering the results of a former worker");
            held.restore(part.results.clone());
            state.found.push(found);
        }
        drop(state);
        self.settle(held);
    }

    /// Writes results of this worker that are not in the file yet. Returns false if there is no place for them.
    pub(super) fn keep(
        &self,
        registered: &Registration,
        worker: &Origin,
        mut results: Vec<LeaseResult>,
    ) -> bool {
        if results.is_empty() {
            return true;
        }
        let Some(folder) = &self.folder else {
            return false;
        };
        let mut state = self.state();
        let kept = match state.own.take() {
            Some(own) => Ok(own),
            None => {
                let campaign = registered.problem.campaign();
                let id = &worker.worker_id;
                UndeliveredFile::create(folder, id, campaign, &registered.model_digest)
            }
        };
        // Another process will deliver them.
        for result in &mut results {
            result.origin = Some(worker.clone());
        }
        let kept = kept.and_then(|mut own| {
            own.keep(results)?;
            Ok(own)
        });
        match kept {
            Ok(own) => {
                state.own = Some(own);
                true
            }
            Err(error) => {
                error!(%error, "undelivered results cannot be kept");
                false
            }
        }
    }

    /// Removes the files whose results are delivered.
    pub(super) fn settle(&self, held: &HeldLeases) {
        let mut state = self.state();
        let delivered = match held.unacknowledged() {
            0 => state.own.take(),
            _ => None,
        };
        let found = match held.has_restored() {
            true => Vec::new(),
            false => std::mem::take(&mut state.found),
        };
        let removed = found.into_iter().map(OrphanFile::remove);
        for removed in removed.chain(delivered.map(UndeliveredFile::remove)) {
            if let Err(error) = removed {
                warn!(%error, "cannot remove a file of delivered results");
            }
        }
    }

    /// Leaves the files for other workers, and says where they are.
    pub(super) fn leave(&self) {
        let state = std::mem::take(&mut *self.state());
        let found = state.found.iter().map(|found| &*found.part.path);
        let own = state.own.as_ref().map(UndeliveredFile::path);
        for path in found.chain(own) {
            warn!(
                file = %path.display(),
                "results that the coordinator did not take are in a file: the next worker delivers \
                 them, or `coordinator merge --db STORE FILE`"
            );
        }
    }
}
