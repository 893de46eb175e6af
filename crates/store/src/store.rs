//! The handle through which everyone reads, and through which the stages store their results.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use sha2::{Digest as _, Sha256};
use sqlx::sqlite::SqlitePool;
use tokio_stream::StreamExt as _;

use crate::Error;
use crate::query;
use crate::rows::{
    CampaignRow, CriteriaRow, DesignRow, FailureRow, JobTimeRow, MissingWork, ModelRow,
    OptimiserRunRow, OptimumRow, Progress, Receipt, ResponseRow, SampleRow, VerifyRow,
};
use crate::writer::{Rows, Writer};

/// A campaign's store, open for reading or for both. Clones share one writer and one lock.
///
/// Every list is in ascending order of its table's key, so no result depends on who wrote first.
/// Reads fail with [`Error::Sqlite`], [`Error::Damaged`] or, after [`Store::close`],
/// [`Error::Closed`]; writes also as described at [`Writer::submit`].
#[derive(Debug, Clone)]
pub struct Store {
    pub(crate) path: PathBuf,
    pub(crate) readers: SqlitePool,
    /// `None` when opened for reading.
    pub(crate) writer: Option<Writer>,
}

impl Store {
    /// The store's file, with links resolved.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// A handle for storing results; cheap to clone and to send to other tasks.
    ///
    /// # Errors
    ///
    /// [`Error::ReadOnly`].
    pub fn writer(&self) -> Result<Writer, Error> {
        self.writer.clone().ok_or(Error::ReadOnly)
    }

    /// Commits what was submitted, moves the log into the file and gives the lock back.
    ///
    /// After a `SIGKILL` instead, the log is replayed when the store is opened next.
    ///
    /// # Errors
    ///
    /// [`Error::Sqlite`] or [`Error::DiskFull`] when the log could not be moved: nothing is lost,
    /// it is replayed later. The lock is given back in any case.
    pub async fn close(&self) -> Result<(), Error> {
        // First, since the last connection to go removes the log.
        self.readers.close().await;
        match &self.writer {
            Some(writer) => writer.close().await,
            None => Ok(()),
        }
    }

    /// The campaign that the store belongs to.
    pub async fn campaign(&self) -> Result<CampaignRow, Error> {
        query::campaign(&self.readers, &self.path).await
    }

    /// Records which gear model fills the store; the first call decides.
    ///
    /// # Errors
    ///
    /// [`Error::ModelDigestConflict`] when another digest is held.
    pub async fn pin_model_digest(&self, digest: &str) -> Result<(), Error> {
        self.put(Rows::ModelDigest(digest.to_owned()))
            .await
            .map(drop)
    }

    /// All designs.
    pub async fn designs(&self) -> Result<Vec<DesignRow>, Error> {
        query::designs(&self.readers, &self.path).await
    }

    /// Stores designs, all or none; first write wins.
    ///
    /// # Errors
    ///
    /// [`Error::DesignConflict`] when one is held with other variables.
    pub async fn put_designs(&self, rows: &[DesignRow]) -> Result<Receipt, Error> {
        self.put(Rows::Designs(rows.to_vec())).await
    }

    /// The criteria of all designs that have them.
    pub async fn criteria(&self) -> Result<Vec<CriteriaRow>, Error> {
        query::criteria(&self.readers, &self.path).await
    }

    /// How many samples each design has, as (design, samples), designs without any included.
    pub async fn sampled_counts(&self) -> Result<Vec<(u64, u64)>, Error> {
        query::sampled_counts(&self.readers, &self.path).await
    }

    /// What is missing until every design has its criteria and every feasible design its samples
    /// `0..samples_per_design`. Empty when nothing is.
    pub async fn missing_work(&self, samples_per_design: u64) -> Result<Vec<MissingWork>, Error> {
        query::missing_work(&self.readers, &self.path, samples_per_design).await
    }

    /// The samples of one design, as (sample, ΔSTE in µm).
    pub async fn samples_of(&self, design: u64) -> Result<Vec<(u64, f64)>, Error> {
        query::samples_of(&self.readers, &self.path, design).await
    }

    /// Shows every sample to `visit`, by design and then by sample, never holding all of them in
    /// memory. The samples are those of one moment, whatever is written meanwhile.
    ///
    /// # Errors
    ///
    /// The first error of `visit`, at which the visit ends, or the store's own.
    pub async fn visit_samples<E: From<Error>>(
        &self,
        mut visit: impl FnMut(SampleRow) -> Result<(), E>,
    ) -> Result<(), E> {
        let mut rows =
            sqlx::query!("SELECT design, sample, delta_ste_um FROM sample ORDER BY design, sample")
                .fetch(&self.readers);
        while let Some(row) = rows.next().await {
            let row = row.map_err(|e| Error::sqlite("read samples", &self.path, e))?;
            visit(SampleRow {
                design: query::index(row.design),
                sample: query::index(row.sample),
                delta_ste_um: row.delta_ste_um,
            })?;
        }
        Ok(())
    }

    /// SHA-256, in hex, over all samples in the order of their keys: design and sample as 64-bit
    /// little-endian integers, then the bits of ΔSTE in µm, little-endian.
    ///
    /// Equal for every run of one campaign file with one version of the program.
    pub async fn samples_digest(&self) -> Result<String, Error> {
        let mut hash = Sha256::new();
        self.visit_samples(|row| {
            hash.update(row.design.to_le_bytes());
            hash.update(row.sample.to_le_bytes());
            hash.update(row.delta_ste_um.to_bits().to_le_bytes());
            Ok::<(), Error>(())
        })
        .await?;
        let mut hex = String::with_capacity(64);
        for byte in hash.finalize() {
            // Writing to a string cannot fail.
            let _ = write!(hex, "{byte:02x}");
        }
        Ok(hex)
    }

    /// The responses of all designs that have one.
    pub async fn responses(&self) -> Result<Vec<ResponseRow>, Error> {
        query::responses(&self.readers, &self.path).await
    }

    /// Stores responses, all or none, replacing those held.
    pub async fn put_responses(&self, rows: &[ResponseRow]) -> Result<Receipt, Error> {
        self.put(Rows::Responses(rows.to_vec())).await
    }

    /// The model of this name, if there is one.
    pub async fn model(&self, name: &str) -> Result<Option<ModelRow>, Error> {
        query::model(&self.readers, &self.path, name).await
    }

    /// All models.
    pub async fn models(&self) -> Result<Vec<ModelRow>, Error> {
        query::models(&self.readers, &self.path).await
    }

    /// Stores a model, replacing the one of its name.
    pub async fn put_model(&self, row: &ModelRow) -> Result<(), Error> {
        self.put(Rows::Model(row.clone())).await.map(drop)
    }

    /// All optimiser runs, by approach and then by start.
    pub async fn optimiser_runs(&self) -> Result<Vec<OptimiserRunRow>, Error> {
        query::optimiser_runs(&self.readers, &self.path).await
    }

    /// All optima.
    pub async fn optima(&self) -> Result<Vec<OptimumRow>, Error> {
        query::optima(&self.readers, &self.path).await
    }

    /// Stores an optimum, replacing the one of its approach.
    pub async fn put_optimum(&self, row: &OptimumRow) -> Result<(), Error> {
        self.put(Rows::Optimum(row.clone())).await.map(drop)
    }

    /// The samples at the optimum of one approach.
    pub async fn verify_samples(&self, approach: &str) -> Result<Vec<VerifyRow>, Error> {
        query::verify_samples(&self.readers, &self.path, approach).await
    }

    /// What the finished jobs cost, by number.
    pub async fn job_times(&self) -> Result<Vec<JobTimeRow>, Error> {
        query::job_times(&self.readers, &self.path).await
    }

    /// Everything that went wrong, in the order in which it was stored.
    pub async fn failures(&self) -> Result<Vec<FailureRow>, Error> {
        query::failures(&self.readers, &self.path).await
    }

    /// How far the campaign is.
    pub async fn progress(&self) -> Result<Progress, Error> {
        query::progress(&self.readers, &self.path).await
    }

    async fn put(&self, rows: Rows) -> Result<Receipt, Error> {
        self.writer.as_ref().ok_or(Error::ReadOnly)?.put(rows).await
    }
}
