//! The recorder of results and source of the status of a coordinator.

use std::sync::Arc;

use results::status::{self, Status};
use store::{Batch, Receipt, Store, Writer};
use tokio::sync::watch;

/// The recorder of results and source of the status: the store, or a substitute for it in tests.
#[tonic::async_trait]
pub trait Recorder: Clone + Send + Sync + 'static {
    /// Stores a batch as a whole or not at all, and returns once it is durable.
    async fn record(&self, batch: Batch) -> Result<Receipt, store::Error>;

    /// Whether the failure of this worker with this serial number is recorded.
    async fn knows_failure(&self, worker: &str, serial: u64) -> Result<bool, store::Error>;

    /// Compares `offered` with the recorded digest of the simulator, and records it if there is
    /// none.
    async fn pin_model(&self, offered: &str) -> Result<(), store::Error>;

    /// The status of the campaign.
    async fn status(&self) -> anyhow::Result<Status>;
}

#[derive(Debug, Clone)]
pub struct StoreRecorder {
    store: Store,
    writer: Writer,
    /// The first write error not caused by the rows themselves.
    broken: Arc<watch::Sender<Option<store::Error>>>,
}

impl StoreRecorder {
    /// Creates a recorder of this store.
    pub fn new(store: &Store) -> Result<Self, store::Error> {
        Ok(Self {
            store: store.clone(),
            writer: store.writer()?,
            broken: Arc::new(watch::Sender::new(None)),
        })
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

    async fn pin_model(&self, offered: &str) -> Result<(), store::Error> {
        self.store.pin_model_digest(offered).await
    }

    async fn status(&self) -> anyhow::Result<Status> {
        status::read(&self.store).await
    }
}
