//! The recorder of results and source of the status of a coordinator.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use results::status::{self, Status};
use store::{Batch, Receipt, Store, Writer};
use tokio::sync::watch;

use crate::coordinator::models::Models;

/// The recorder of results and source of the status: the store, or a substitute for it in tests.
#[tonic::async_trait]
pub trait Recorder: Clone + Send + Sync + 'static {
    /// Stores a batch as a whole or not at all, and returns once it is durable.
    async fn record(&self, batch: Batch) -> Result<Receipt, store::Error>;

    /// Whether the failure of this worker with this serial number is recorded.
    async fn knows_failure(&self, worker: &str, serial: u64) -> Result<bool, store::Error>;

    /// Compares the digest of a worker's simulator with the recorded one, and remembers it until one is
    /// recorded.
    async fn offer_model(&self, worker: &str, offered: &str) -> Result<(), store::Error>;

    /// Records the digest that a worker has offered, before its first result is stored. Refuses it if another one is
    /// recorded.
    async fn pin_model(&self, worker: &str) -> Result<(), store::Error>;

    /// Whether a digest is recorded and the worker has offered another one.
    fn has_other_model(&self, worker: &str) -> bool;

    /// The status of the campaign.
    async fn status(&self) -> anyhow::Result<Status>;
}

#[derive(Debug, Clone)]
pub struct StoreRecorder {
    store: Store,
    writer: Writer,
    /// The first write error not caused by the rows themselves.
    broken: Arc<watch::Sender<Option<store::Error>>>,
    models: Arc<Mutex<Models>>,
}

impl StoreRecorder {
    /// Creates a recorder of this store.
    pub fn new(store: &Store) -> Result<Self, store::Error> {
        Ok(Self {
            store: store.clone(),
            writer: store.writer()?,
            broken: Arc::new(watch::Sender::new(None)),
            models: Arc::default(),
        })
    }

    fn models(&self) -> MutexGuard<'_, Models> {
        self.models.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits until the store cannot be written any more, for example because the disk is full, and
    /// returns the error.
    pub async fn broken(&self) -> store::Error {
        let mut watched = self.broken.subscribe();
        loop {
            if let Some(error) = watched.borrow_and_update().clone() {
                return error;
            }
            if watched.changed().await.is_err() {
                // The channel stays open because this recorder holds a sender.
                std::future::pending::<()>().await;
            }
        }
    }
}

#[tonic::async_trait]
impl Recorder for StoreRecorder {
    async fn record(&self, batch: Batch) -> Result<Receipt, store::Error> {
        let outcome = self.writer.submit(batch).await;
        if let Err(error) = &outcome
            && !error.is_refusal()
        {
            self.broken.send_if_modified(|first| match first {
                Some(_) => false,
                None => {
                    *first = Some(error.clone());
                    true
                }
            });
        }
        outcome
    }

    async fn knows_failure(&self, worker: &str, serial: u64) -> Result<bool, store::Error> {
        self.store.knows_failure(worker, serial).await
    }

    async fn offer_model(&self, worker: &str, offered: &str) -> Result<(), store::Error> {
        if !self.models().is_pinned()
            && let Some(stored) = self.store.campaign().await?.model_digest
        {
            self.models().pin(&stored);
        }
        let compared = self.models().offer(worker, offered);
        compared.map_err(|stored| store::Error::ModelDigestConflict {
            stored,
            offered: offered.to_owned(),
        })
    }

    async fn pin_model(&self, worker: &str) -> Result<(), store::Error> {
        let offered: Option<String> = self.models().offered(worker).map(str::to_owned);
        // If the worker has offered none, its digest is the one on record.
        let Some(offered) = offered else {
            return Ok(());
        };
        let pinned = self.store.pin_model_digest(&offered).await;
        match &pinned {
            Ok(()) => self.models().pin(&offered),
            Err(store::Error::ModelDigestConflict { stored, .. }) => self.models().pin(stored),
            Err(_) => {}
        }
        pinned
    }

    fn has_other_model(&self, worker: &str) -> bool {
        self.models().is_foreign(worker)
    }

    async fn status(&self) -> anyhow::Result<Status> {
        status::read(&self.store).await
    }
}
