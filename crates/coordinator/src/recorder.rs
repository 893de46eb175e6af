//! Where results are stored and status is read.

use std::sync::Arc;

use results::status::{self, Status};
use store::{Batch, Receipt, Store, Writer};
use tokio::sync::watch;

/// Where results go and where status comes from: the store, or a stand-in for it in tests whose
/// clock is not the system's.
#[tonic::async_trait]
pub trait Recorder: Clone + Send + Sync + 'static {
    /// Stores a batch, all of it or nothing, and returns when it is safe.
    async fn record(&self, batch: Batch) -> Result<Receipt, store::Error>;

    /// Whether the failure to which its worker gave this number is recorded.
    async fn knows_failure(&self, worker: &str, serial: u64) -> Result<bool, store::Error>;

    /// The digest of the simulator whose samples are held, which becomes `offered` if there is none.
    async fn pin_model(&self, offered: &str) -> Result<(), store::Error>;

    /// How far the campaign is; none of a study, which is no campaign.
    async fn status(&self) -> anyhow::Result<Option<Status>>;
}

/// The real thing.
#[derive(Debug, Clone)]
pub struct StoreRecorder {
    store: Store,
    writer: Writer,
    /// The first failure to write that is not the rows' fault.
    broken: Arc<watch::Sender<Option<store::Error>>>,
}

impl StoreRecorder {
    /// A recorder of this store.
    ///
    /// # Errors
    ///
    /// The store was opened for reading.
    pub fn new(store: &Store) -> Result<Self, store::Error> {
        Ok(Self {
            store: store.clone(),
            writer: store.writer()?,
            broken: Arc::new(watch::Sender::new(None)),
        })
    }

    /// Ends when the store cannot be written any more, as when the disk is full, with the reason.
    pub async fn broken(&self) -> store::Error {
        let mut watched = self.broken.subscribe();
        loop {
            if let Some(error) = watched.borrow_and_update().clone() {
                return error;
            }
            if watched.changed().await.is_err() {
                // This recorder is a sender, so there is one.
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

    async fn status(&self) -> anyhow::Result<Option<Status>> {
        status::read(&self.store).await.map(Some)
    }
}
