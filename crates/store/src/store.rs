//! The handle through which everyone reads, and through which the stages store their results.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use sqlx::sqlite::SqlitePool;

use crate::Error;
use crate::check::Verdict;
use crate::connection::Connection;
use crate::keyed::{self, Value};
use crate::query;
use crate::rounds::{InfillRow, NewRound, RoundRow};
use crate::rows::{
    CampaignRow, CriteriaRow, DesignRow, EvaluationRow, FailureGroup, FailureRow, JobHistory,
    JobTimeRow, MissingWork, ModelRow, OptimiserRunRow, OptimumRow, Progress, Receipt, ResponseRow,
    SampleRow, StageTimeRow, VerifyRow,
};
use crate::samples;
use crate::tally;
use crate::writer::{Rows, Writer};

/// A campaign's store, open for reading or for both. Clones share one writer and one lock.
///
/// Every list is in ascending order of its table's key, so no result depends on who wrote first.
/// Reads fail with [`Error::Sqlite`], [`Error::Damaged`] or, after [`Store::close`],
/// [`Error::Closed`]; writes also as described at [`Writer::submit`].
#[derive(Debug, Clone)]
pub struct Store {
    pub(crate) path: Arc<Path>,
    pub(crate) readers: SqlitePool,
    /// `None` when opened for reading.
    pub(crate) writer: Option<Writer>,
    pub(crate) verdict: Verdict,
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

    /// Waits until the file is known to be sound, which a small one is when it is open: its pages,
    /// and that its rows are what was stored. Stop at an error: if pages are damaged, nothing has been
    /// written. A large store that was opened for reading is checked by the first call.
    ///
    /// # Errors
    ///
    /// [`Error::Damaged`], [`Error::DamagedRows`] or [`Error::Lost`], or [`Error::Sqlite`] when the
    /// check could not be made.
    pub fn checked(&self) -> impl Future<Output = Result<(), Error>> + Send + use<> {
        self.verdict.clone().on_everything()
    }

    /// Whether everything in the file has been compared with its digests since it was opened, without
    /// a difference: of what was found there, that is; what is stored meanwhile is not read again.
    pub fn is_checked(&self) -> bool {
        self.verdict.is_sound()
    }

    /// Waits for what [`checked`](Store::checked) would find, and for the file or its log to go away,
    /// which the writer notices at its next commit or within a second. Never ends while all is well.
    pub fn damaged(&self) -> impl Future<Output = Error> + Send + use<> {
        self.verdict.clone().on_damage()
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
        query::campaign(&mut self.reader().await?).await
    }

    /// Records which gear model fills the store; the first call decides.
    ///
    /// # Errors
    ///
    /// [`Error::ModelDigestConflict`] when another digest is held.
    pub async fn pin_model_digest(&self, digest: &str) -> Result<(), Error> {
        // The usual case at a restart, and no reason to wait for the check of a large file.
        if self.writer.is_some() && self.campaign().await?.model_digest.as_deref() == Some(digest) {
            return Ok(());
        }
        self.put(Rows::ModelDigest(digest.to_owned()))
            .await
            .map(drop)
    }

    /// All designs.
    pub async fn designs(&self) -> Result<Vec<DesignRow>, Error> {
        keyed::all(&mut self.reader().await?).await
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
        keyed::all(&mut self.reader().await?).await
    }

    /// How many samples each design has, as (design, samples), designs without any included.
    pub async fn sampled_counts(&self) -> Result<Vec<(u64, u64)>, Error> {
        query::sampled_counts(&mut self.reader().await?).await
    }

    /// What is missing until every design has its criteria and every feasible design its samples
    /// `0..samples_per_design`, or as many as `more` says of the design: a larger number, of a
    /// feasible design. A feasible design with a reason beside it gets none. Empty when nothing is
    /// missing.
    pub async fn missing_work(
        &self,
        samples_per_design: u64,
        more: &BTreeMap<u64, u64>,
    ) -> Result<Vec<MissingWork>, Error> {
        query::missing_work(&mut self.reader().await?, samples_per_design, more).await
    }

    /// The samples of one design, as (sample, ΔSTE in µm).
    pub async fn samples_of(&self, design: u64) -> Result<Vec<(u64, f64)>, Error> {
        samples::of_design(&mut self.reader().await?, design).await
    }

    /// Shows every sample to `visit`, by design and then by sample, never holding all of them in
    /// memory. The samples are those of one moment, whatever is written meanwhile.
    ///
    /// # Errors
    ///
    /// The first error of `visit`, at which the visit ends, or the store's own.
    pub async fn visit_samples<E: From<Error>>(
        &self,
        visit: impl FnMut(SampleRow) -> Result<(), E>,
    ) -> Result<(), E> {
        let mut reader = self.reader().await?;
        samples::visit(&mut reader, visit).await
    }

    /// The digest of all samples, as 64 hex digits; read, not computed.
    ///
    /// Equal for every run of one campaign file with one version of the program, in whatever order
    /// the samples came: it is the sum modulo 2²⁵⁶ over all samples of the SHA-256 of design and
    /// sample as 64-bit little-endian integers and of the bits of ΔSTE in µm, little-endian. A
    /// hash is read as a little-endian number, and the sum is shown by its bytes in the same
    /// order, so that the digest of a single sample is its SHA-256 and that of none is all zeros.
    ///
    /// The sum is carried on by the transactions that store samples. It is a checksum against
    /// accidents, such as samples that differ, are lost or are there twice. It is not a signature:
    /// somebody who may choose samples freely can make two tables with one sum.
    pub async fn samples_digest(&self) -> Result<String, Error> {
        let (_, digest) = tally::samples(&mut self.reader().await?).await?;
        Ok(digest.to_hex())
    }

    /// [`samples_digest`](Store::samples_digest) as the samples themselves have it, which takes a
    /// reading of all of them. A difference says that the store's file was changed by something
    /// else than this program.
    pub async fn recompute_samples_digest(&self) -> Result<String, Error> {
        let digest = samples::recompute(&mut self.reader().await?).await?;
        Ok(digest.to_hex())
    }

    /// The digest of all verification and infill samples, as 64 hex digits; read, not computed.
    ///
    /// A sum like [`samples_digest`](Store::samples_digest), in whatever order the samples came, over
    /// the SHA-256 of the length of the point's name as a 64-bit little-endian integer, the name, the
    /// sample and the bits of ΔSTE in µm. It is that of the samples which are there: those of an
    /// optimum that is chosen anew leave it when they are removed.
    pub async fn verify_samples_digest(&self) -> Result<String, Error> {
        let digest = tally::verify_digest(&mut self.reader().await?).await?;
        Ok(digest.to_hex())
    }

    /// [`verify_samples_digest`](Store::verify_samples_digest) as the samples themselves have it.
    pub async fn recompute_verify_samples_digest(&self) -> Result<String, Error> {
        let digest = tally::recompute_verify(&mut self.reader().await?).await?;
        Ok(digest.to_hex())
    }

    /// The responses of all designs that have one.
    pub async fn responses(&self) -> Result<Vec<ResponseRow>, Error> {
        keyed::all(&mut self.reader().await?).await
    }

    /// Stores responses, all or none, replacing those held. They were computed from so many samples:
    /// [`Progress::samples_of_responses`].
    pub async fn put_responses(
        &self,
        rows: &[ResponseRow],
        samples: u64,
    ) -> Result<Receipt, Error> {
        self.put(Rows::Responses(rows.to_vec(), samples)).await
    }

    /// The model of this name, if there is one.
    pub async fn model(&self, name: &str) -> Result<Option<ModelRow>, Error> {
        let mut reader = self.reader().await?;
        let models = keyed::all_where(&mut reader, "WHERE name = ?", &[Value::Text(name)]).await?;
        Ok(models.into_iter().next())
    }

    /// All models.
    pub async fn models(&self) -> Result<Vec<ModelRow>, Error> {
        keyed::all(&mut self.reader().await?).await
    }

    /// Stores a model, replacing the one of its name.
    pub async fn put_model(&self, row: &ModelRow) -> Result<(), Error> {
        self.put(Rows::Model(row.clone())).await.map(drop)
    }

    /// All optimiser runs, by approach and then by start.
    pub async fn optimiser_runs(&self) -> Result<Vec<OptimiserRunRow>, Error> {
        keyed::all(&mut self.reader().await?).await
    }

    /// The evaluations of a run, by what it is called where generations are, from the `first` one on.
    pub async fn evaluations(&self, stream: &str, first: u64) -> Result<Vec<EvaluationRow>, Error> {
        let mut reader = self.reader().await?;
        let of_run = "WHERE stream = ? AND evaluation >= ?";
        let parameters = [Value::Text(stream), Value::Count(first)];
        keyed::all_where(&mut reader, of_run, &parameters).await
    }

    /// Removes the evaluations of a run, which another search asked for.
    pub async fn clear_evaluations(&self, stream: &str) -> Result<(), Error> {
        self.put(Rows::NoEvaluations(stream.to_owned()))
            .await
            .map(drop)
    }

    /// All optima.
    pub async fn optima(&self) -> Result<Vec<OptimumRow>, Error> {
        keyed::all(&mut self.reader().await?).await
    }

    /// Stores an optimum, replacing the one of its approach.
    pub async fn put_optimum(&self, row: &OptimumRow) -> Result<(), Error> {
        self.put(Rows::Optimum(row.clone())).await.map(drop)
    }

    /// All rounds of infill.
    pub async fn rounds(&self) -> Result<Vec<RoundRow>, Error> {
        keyed::all(&mut self.reader().await?).await
    }

    /// The points of all rounds.
    pub async fn infill(&self) -> Result<Vec<InfillRow>, Error> {
        keyed::all(&mut self.reader().await?).await
    }

    /// Stores a round with its points, and marks the earlier points that it found to have failed,
    /// all or nothing.
    ///
    /// # Errors
    ///
    /// [`Error::Constraint`] when the round or one of its points is held already: a round is
    /// decided once.
    pub async fn put_round(&self, new: &NewRound) -> Result<(), Error> {
        self.put(Rows::Round(new.clone())).await.map(drop)
    }

    /// The samples at the optimum of one approach.
    pub async fn verify_samples(&self, approach: &str) -> Result<Vec<VerifyRow>, Error> {
        tally::verify_samples(&mut self.reader().await?, approach).await
    }

    /// How many evaluations there are of each run on an external simulator that is not finished, by the
    /// run's name.
    pub async fn unfinished_runs(&self) -> Result<Vec<(String, u64)>, Error> {
        query::unfinished_runs(&mut self.reader().await?).await
    }

    /// How many samples there are at the optimum of each approach that has any, by approach.
    pub async fn verify_counts(&self) -> Result<Vec<(String, u64)>, Error> {
        query::verify_counts(&mut self.reader().await?).await
    }

    /// Of which generation results of a stream are wanted, by stream.
    pub async fn generations(&self) -> Result<BTreeMap<String, u64>, Error> {
        query::generations(&mut self.reader().await?).await
    }

    /// Says of which generation results of these streams are wanted from now on, all or nothing. If
    /// another one was wanted before, the samples of that point are removed; if none was, as in a
    /// store of an earlier schema, they stay.
    pub async fn put_generations(&self, rows: &[(String, u64)]) -> Result<(), Error> {
        self.put(Rows::Generations(rows.to_vec())).await.map(drop)
    }

    /// Puts a larger campaign in the place of the one held, and clears what
    /// [`clear_derived`](Store::clear_derived) does, all or nothing. Designs, criteria and samples
    /// stay: what is missing for the larger campaign is found as after any other start.
    ///
    /// Name, text and digest of `campaign` are taken; the versions of program and model stay those
    /// that filled the store. Whether the campaign is a legal extension is the caller's to decide,
    /// in [`create_or_open_with`](Store::create_or_open_with).
    ///
    /// # Errors
    ///
    /// [`Error::OtherSeed`]: the samples held would not be samples of that campaign.
    pub async fn extend(&self, campaign: &CampaignRow, derived: &[&str]) -> Result<(), Error> {
        self.put(Rows::Extension(campaign.clone(), owned(derived)))
            .await
            .map(drop)
    }

    /// Removes, all or nothing, what was derived from the samples: all responses and all models, all
    /// rounds of infill with their points' samples, and of the named approaches the optimiser runs,
    /// the optima and their verification samples.
    /// For fitting again when samples came late.
    pub async fn clear_derived(&self, approaches: &[&str]) -> Result<(), Error> {
        self.put(Rows::Clearing(owned(approaches))).await.map(drop)
    }

    /// What the finished jobs cost, by number.
    pub async fn job_times(&self) -> Result<Vec<JobTimeRow>, Error> {
        keyed::all(&mut self.reader().await?).await
    }

    /// How long the stages took, by name.
    pub async fn stage_times(&self) -> Result<Vec<StageTimeRow>, Error> {
        keyed::all(&mut self.reader().await?).await
    }

    /// Stores how long a stage took, replacing what was held of it.
    pub async fn put_stage_time(&self, row: &StageTimeRow) -> Result<(), Error> {
        self.put(Rows::StageTime(row.clone())).await.map(drop)
    }

    /// Everything that went wrong, in the order in which it was stored.
    pub async fn failures(&self) -> Result<Vec<FailureRow>, Error> {
        query::failures(&mut self.reader().await?).await
    }

    /// Whether the failure to which its worker gave this number is stored.
    pub async fn knows_failure(&self, worker: &str, serial: u64) -> Result<bool, Error> {
        query::knows_failure(&mut self.reader().await?, worker, serial).await
    }

    /// What went wrong, by job.
    pub async fn job_histories(&self) -> Result<Vec<JobHistory>, Error> {
        query::job_histories(&mut self.reader().await?).await
    }

    /// What went wrong, grouped by kind and cause: by kind, and then by the cause's text.
    pub async fn failure_groups(&self) -> Result<Vec<FailureGroup>, Error> {
        query::failure_groups(&mut self.reader().await?).await
    }

    /// How far the campaign is. Counts designs, but no samples: those are tallied.
    pub async fn progress(&self) -> Result<Progress, Error> {
        query::progress(&mut self.reader().await?).await
    }

    async fn reader(&self) -> Result<Connection<'static>, Error> {
        match self.readers.acquire().await {
            Ok(sql) => Ok(Connection::pooled(sql, &self.path)),
            Err(e) => Err(Error::sqlite("open its file for reading", &self.path, e)),
        }
    }

    async fn put(&self, rows: Rows) -> Result<Receipt, Error> {
        self.writer.as_ref().ok_or(Error::ReadOnly)?.put(rows).await
    }
}

fn owned(names: &[&str]) -> Vec<String> {
    names.iter().map(|name| (*name).to_owned()).collect()
}
