//! The handle for reading, and for storing the results of the stages.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use ledger::{History, Kind, StreamId};
use stats::Samples;

use crate::Error;
use crate::blocks::{SampleBlock, Streams};
use crate::campaign::{self, CampaignRow};
use crate::change::Change;
use crate::connection::{Connection, Readers};
use crate::criteria::{self, CriteriaRow};
use crate::derived::{self, Derivation, DerivedResult};
use crate::designs::{self, DesignRow};
use crate::discard::{Discard, RemovedRows};
use crate::evaluations::{self, EvaluationRow};
use crate::failures::{self, FailureGroup, FailureRow};
use crate::generations;
use crate::infill::{self, InfillRow};
use crate::integrity::Integrity;
use crate::missing::{self, MissingWork};
use crate::models::{self, ModelRow};
use crate::optima::{self, OptimumRow};
use crate::origins::{self, OriginRow};
use crate::progress::{self, Progress};
use crate::receipt::Receipt;
use crate::responses::{self, ResponseRow};
use crate::rounds::{self, NewRound, RoundRow};
use crate::runs::{self, OptimiserRunRow};
use crate::samples;
use crate::tally::{self, SampleTally};
use crate::times::{self, JobTimeRow, StageTimeRow};
use crate::writer::Writer;

/// A campaign's store, open for reading or for reading and writing. Clones share one writer and one
/// lock.
///
/// Every list is in ascending order of its table's key, so no result depends on the order of
/// writing. Reads fail with [`Error::Sqlite`], [`Error::Damaged`] or, after [`Store::close`],
/// [`Error::Closed`]. Writes can also fail as described at [`Writer::submit`].
#[derive(Debug, Clone)]
pub struct Store {
    pub(crate) path: Arc<Path>,
    pub(crate) readers: Readers,
    /// `None` when opened for reading.
    pub(crate) writer: Option<Writer>,
    pub(crate) integrity: Integrity,
}

impl Store {
    /// The path of the store's file, with links resolved.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// A handle for storing results. It is cheap to clone and can be sent to other tasks.
    ///
    /// # Errors
    ///
    /// [`Error::ReadOnly`].
    pub fn writer(&self) -> Result<Writer, Error> {
        self.writer.clone().ok_or(Error::ReadOnly)
    }

    /// A handle for reading whose reads all see the store as it is at the first of them, whatever is written
    /// meanwhile. It holds one of the reading connections until it is dropped.
    ///
    /// # Errors
    ///
    /// [`Error::Sqlite`] or [`Error::Closed`].
    pub async fn snapshot(&self) -> Result<Self, Error> {
        Ok(Self {
            path: Arc::clone(&self.path),
            readers: self.readers.snapshot(&self.path).await?,
            writer: None,
            integrity: self.integrity.clone(),
        })
    }

    /// Waits for the check of the file's pages and rows. A small file was checked when it was
    /// opened. After an error nothing more is written: stop. A large store that was opened for
    /// reading is checked by the first call.
    ///
    /// # Errors
    ///
    /// [`Error::Damaged`], [`Error::DamagedRows`] or [`Error::Lost`], or [`Error::Sqlite`] when the
    /// check could not be made.
    pub fn checked(&self) -> impl Future<Output = Result<(), Error>> + Send + use<> {
        self.integrity.clone().checked()
    }

    /// Whether the rows that the file had when it was opened have been compared with their digests
    /// without a difference. Rows stored since then are not read again.
    pub fn is_checked(&self) -> bool {
        self.integrity.is_sound()
    }

    /// Waits for an error that [`checked`](Store::checked) would return, or for the removal of the
    /// file or its log, which the writer notices at its next commit or within a second. Does not
    /// return while there is no error.
    pub fn damaged(&self) -> impl Future<Output = Error> + Send + use<> {
        self.integrity.clone().damaged()
    }

    /// Commits the queued submissions, copies the log to the file and releases the lock.
    ///
    /// After a `SIGKILL`, the log is replayed the next time the store is opened.
    ///
    /// # Errors
    ///
    /// [`Error::Sqlite`] or [`Error::DiskFull`] if the log could not be copied. Nothing is lost:
    /// the log is replayed later. The lock is released in any case.
    pub async fn close(&self) -> Result<(), Error> {
        // The readers are closed first, because the last connection to close removes the log.
        self.readers.close().await;
        match &self.writer {
            Some(writer) => writer.close().await,
            None => Ok(()),
        }
    }

    /// The campaign of the store.
    pub async fn campaign(&self) -> Result<CampaignRow, Error> {
        campaign::read(&mut self.reader().await?).await
    }

    /// Records the digest of the gear model that fills the store. The first call decides it.
    ///
    /// # Errors
    ///
    /// [`Error::ModelDigestConflict`] if another digest is stored.
    pub async fn pin_model_digest(&self, digest: &str) -> Result<(), Error> {
        // The usual case at a restart, which need not wait for the check of a large file.
        if self.writer.is_some() && self.campaign().await?.model_digest.as_deref() == Some(digest) {
            return Ok(());
        }
        self.put(Change::ModelDigest(digest.to_owned()))
            .await
            .map(drop)
    }

    /// All designs.
    pub async fn designs(&self) -> Result<Vec<DesignRow>, Error> {
        designs::all(&mut self.reader().await?).await
    }

    /// Stores all of these designs or none. The first write wins.
    ///
    /// # Errors
    ///
    /// [`Error::Conflict`] if one is stored with other variables.
    pub async fn put_designs(&self, rows: &[DesignRow]) -> Result<Receipt, Error> {
        self.put(Change::Designs(rows.to_vec())).await
    }

    /// The criteria of all designs that have them.
    pub async fn criteria(&self) -> Result<Vec<CriteriaRow>, Error> {
        criteria::all(&mut self.reader().await?).await
    }

    /// The number of samples of each design, as (design, samples), including designs without any.
    pub async fn sampled_counts(&self) -> Result<Vec<(u64, u64)>, Error> {
        progress::sampled_counts(&mut self.reader().await?).await
    }

    /// The work missing until every design has its criteria and every simulable design its samples
    /// `0..samples_per_design`, or the larger number that `more` gives for the design. A simulable
    /// design with a reason against sampling gets none. Empty when nothing is missing.
    pub async fn missing_work(
        &self,
        samples_per_design: u64,
        more: &BTreeMap<u64, u64>,
    ) -> Result<Vec<MissingWork>, Error> {
        missing::work(&mut self.reader().await?, samples_per_design, more).await
    }

    /// The blocks of samples of a design, an optimum or an infill point, in order.
    pub async fn blocks_of(&self, stream: StreamId) -> Result<Vec<SampleBlock>, Error> {
        samples::of(&mut self.reader().await?, stream).await
    }

    /// The samples of a design, an optimum or an infill point before the first missing one. Each has as many values as
    /// there are `responses`.
    pub async fn first_samples_of(
        &self,
        stream: StreamId,
        responses: usize,
    ) -> Result<Samples, Error> {
        let mut first = Samples::none(responses);
        for block in self.blocks_of(stream).await? {
            if block.first_sample != first.len() as u64 {
                break;
            }
            first.extend(&block.samples);
        }
        Ok(first)
    }

    /// Counts and digest of the samples of each stream that has any, known without reading the samples.
    pub async fn sample_tallies(&self) -> Result<BTreeMap<StreamId, SampleTally>, Error> {
        tally::all(&mut self.reader().await?, Streams::All).await
    }

    /// Passes the samples of all designs to `visit`, ordered by design and sample, without holding all of them in
    /// memory. The samples are those of one moment, whatever is written meanwhile.
    ///
    /// # Errors
    ///
    /// The first error of `visit`, which ends the visit, or the store's own.
    pub async fn visit_samples<E: From<Error>>(
        &self,
        visit: impl FnMut(&SampleBlock) -> Result<(), E>,
    ) -> Result<(), E> {
        let mut reader = self.reader().await?;
        samples::visit(&mut reader, Streams::Designs, visit).await
    }

    /// The digest of all samples, as 64 hex digits. It is read, not computed.
    ///
    /// It is equal for every run of one campaign file with one version of the program, whatever the order of the
    /// samples. It is the sum modulo 2²⁵⁶ of the SHA-256 hashes of all samples, each read as a little-endian number.
    /// The hashed bytes are the indices of design and sample as 64-bit little-endian integers and the bits of the
    /// values, little-endian. The sum is written by its bytes in the same order, so that the digest of a single sample
    /// is its SHA-256 and that of none is all zeros.
    ///
    /// The sum is updated in the transactions that store samples. It is a checksum against
    /// accidents, such as samples that differ, are lost or are stored twice. It is not a signature:
    /// anybody who can choose samples freely can construct two tables with the same sum.
    pub async fn samples_digest(&self) -> Result<String, Error> {
        let tallies = tally::all(&mut self.reader().await?, Streams::Designs).await?;
        Ok(tally::sum(tallies.values()).to_hex())
    }

    /// The digest of all verification and infill samples, as 64 hex digits. It is read, not
    /// computed.
    ///
    /// It is a sum like [`samples_digest`](Store::samples_digest), with the point's number instead of the
    /// design. It covers the samples stored at present: the samples of an optimum that is replaced are removed from it.
    pub async fn point_samples_digest(&self) -> Result<String, Error> {
        let mut tallies = self.sample_tallies().await?;
        tallies.retain(|stream, _| stream.kind == Kind::Point);
        Ok(tally::sum(tallies.values()).to_hex())
    }

    /// The measure that is optimised, of all designs that have it.
    pub async fn responses(&self) -> Result<Vec<ResponseRow>, Error> {
        let mut rows = responses::all(&mut self.reader().await?).await?;
        rows.retain(|row| row.number == 0);
        Ok(rows)
    }

    /// The measures that constraints limit, of all designs that have them.
    pub async fn limited_responses(&self) -> Result<Vec<ResponseRow>, Error> {
        let mut rows = responses::all(&mut self.reader().await?).await?;
        rows.retain(|row| row.number > 0);
        Ok(rows)
    }

    /// The digest of the criteria of all designs. It does not depend on their order.
    pub async fn criteria_digest(&self) -> Result<String, Error> {
        criteria::digest(&mut self.reader().await?).await
    }

    /// The derivation of each derived result, by the result's name.
    pub async fn derivations(&self) -> Result<BTreeMap<String, Derivation>, Error> {
        let rows = derived::all(&mut self.reader().await?).await?;
        let named = |row: Derivation| (row.name.clone(), row);
        Ok(rows.into_iter().map(named).collect())
    }

    /// Stores the derivation of [`DerivedResult::Samples`], before there are any samples.
    pub async fn put_derivation(&self, derivation: &Derivation) -> Result<(), Error> {
        self.put(Change::Derivation(derivation.clone()))
            .await
            .map(drop)
    }

    /// Removes derived results, all or nothing, with the workers' results for them: the evaluations of runs and the
    /// samples of infill points. The samples of an optimum stay, in case the same design is chosen again; those of
    /// another design are removed when their generation changes.
    pub async fn remove(&self, results: &[DerivedResult]) -> Result<(), Error> {
        self.put(Change::Removal(results.to_vec())).await.map(drop)
    }

    /// Removes results that stand for failures, so that they are computed again: infinite samples, criteria whose
    /// reason begins with `reason`, and evaluations with an infinite response or such a reason. A run continues from its
    /// first removed evaluation. Returns the number of rows removed.
    pub async fn remove_failures(&self, reason: &str) -> Result<u64, Error> {
        let receipt = self.put(Change::NoFailures(reason.to_owned())).await?;
        Ok(receipt.new_rows)
    }

    /// Removes results that are not trusted, all or nothing, or only counts them if `is_trial`. They are computed again
    /// like any missing results, and results derived from them are found to be outdated.
    pub async fn discard(&self, what: &Discard, is_trial: bool) -> Result<RemovedRows, Error> {
        let told = Arc::default();
        self.put(Change::Discard(what.clone(), is_trial, Arc::clone(&told)))
            .await?;
        Ok(told.get().copied().unwrap_or_default())
    }

    /// Passes the stream, the samples and the origin of each stored block to `visit`, ordered by stream and sample.
    ///
    /// # Errors
    ///
    /// The first error of `visit`, which ends the visit, or the store's own.
    pub async fn visit_blocks<E: From<Error>>(
        &self,
        mut visit: impl FnMut(&SampleBlock, Option<&OriginRow>) -> Result<(), E>,
    ) -> Result<(), E> {
        let mut reader = self.reader().await?;
        let origins: BTreeMap<i64, OriginRow> =
            origins::all(&mut reader).await?.into_iter().collect();
        samples::visit_stored(&mut reader, Streams::All, |stored| {
            let origin = stored.origin.and_then(|origin| origins.get(&origin));
            visit(&stored.block, origin)
        })
        .await
    }

    /// Replaces all responses by these, all or nothing.
    pub async fn put_responses(
        &self,
        rows: &[ResponseRow],
        derivation: &Derivation,
    ) -> Result<Receipt, Error> {
        let change = Change::Responses(rows.to_vec(), derivation.clone());
        self.put(change).await
    }

    /// The model with this name of the measure that is optimised, if it is stored.
    pub async fn model(&self, name: &str) -> Result<Option<ModelRow>, Error> {
        Ok(self.models_named(name).await?.into_iter().next())
    }

    /// The models with this name, of the measure that is optimised first.
    pub async fn models_named(&self, name: &str) -> Result<Vec<ModelRow>, Error> {
        models::named(&mut self.reader().await?, Some(name)).await
    }

    /// All models.
    pub async fn models(&self) -> Result<Vec<ModelRow>, Error> {
        models::named(&mut self.reader().await?, None).await
    }

    /// Replaces the models of the DoE. If `rows` is empty, the derivation says why the fit has failed.
    pub async fn put_models(
        &self,
        rows: &[ModelRow],
        derivation: &Derivation,
    ) -> Result<(), Error> {
        let change = Change::Models(rows.to_vec(), derivation.clone());
        self.put(change).await.map(drop)
    }

    /// All optimiser runs.
    pub async fn optimiser_runs(&self) -> Result<Vec<OptimiserRunRow>, Error> {
        runs::all(&mut self.reader().await?).await
    }

    /// The evaluations of a run or an infill point, from the `first` one on.
    pub async fn evaluations(
        &self,
        stream: StreamId,
        first: u64,
    ) -> Result<Vec<EvaluationRow>, Error> {
        evaluations::of(&mut self.reader().await?, stream, first).await
    }

    /// Removes the evaluations of a run that belong to another search.
    pub async fn clear_evaluations(&self, stream: StreamId) -> Result<(), Error> {
        self.put(Change::NoEvaluations(stream)).await.map(drop)
    }

    /// All optima.
    pub async fn optima(&self) -> Result<Vec<OptimumRow>, Error> {
        optima::all(&mut self.reader().await?).await
    }

    /// Stores an optimum, replacing the one of its approach.
    pub async fn put_optimum(
        &self,
        row: &OptimumRow,
        derivation: &Derivation,
    ) -> Result<(), Error> {
        let change = Change::Optimum(Box::new(row.clone()), derivation.clone());
        self.put(change).await.map(drop)
    }

    /// All rounds of infill.
    pub async fn rounds(&self) -> Result<Vec<RoundRow>, Error> {
        rounds::all(&mut self.reader().await?).await
    }

    /// The points of all rounds.
    pub async fn infill(&self) -> Result<Vec<InfillRow>, Error> {
        infill::all(&mut self.reader().await?).await
    }

    /// Stores a round with its points and marks the earlier points that it found to have failed,
    /// all or nothing.
    ///
    /// # Errors
    ///
    /// [`Error::Constraint`] if the round or one of its points is stored already: a round is
    /// decided once.
    pub async fn put_round(&self, new: &NewRound, derivation: &Derivation) -> Result<(), Error> {
        let change = Change::Round(new.clone(), derivation.clone());
        self.put(change).await.map(drop)
    }

    /// The number and the digest of the evaluations of each run or infill point that has any.
    pub async fn evaluated(&self) -> Result<BTreeMap<StreamId, (u64, String)>, Error> {
        evaluations::digests(&mut self.reader().await?).await
    }

    /// The wanted generation of each stream.
    pub async fn generations(&self) -> Result<BTreeMap<StreamId, u64>, Error> {
        generations::all(&mut self.reader().await?).await
    }

    /// Sets the wanted generations of these streams, all or nothing. If another generation was
    /// wanted before, the samples of that point are removed.
    pub async fn put_generations(&self, rows: &[(StreamId, u64)]) -> Result<(), Error> {
        self.put(Change::Generations(rows.to_vec())).await.map(drop)
    }

    /// Replaces the campaign by a larger one and removes the responses, all or nothing. Everything else is kept.
    /// Missing and outdated results are found as after any other start.
    ///
    /// The name, text and digest of `campaign` are stored; the versions of program and model remain
    /// those that filled the store. The caller decides whether the campaign is a valid extension,
    /// in [`create_or_open_with`](Store::create_or_open_with).
    ///
    /// # Errors
    ///
    /// [`Error::OtherSeed`] if the seed differs: the stored samples would not be samples of that
    /// campaign.
    pub async fn extend(&self, campaign: &CampaignRow) -> Result<(), Error> {
        self.put(Change::Extension(campaign.clone()))
            .await
            .map(drop)
    }

    /// The costs of the finished jobs.
    pub async fn job_times(&self) -> Result<Vec<JobTimeRow>, Error> {
        times::jobs(&mut self.reader().await?).await
    }

    /// The name of the stage that the campaign waits for, as the last coordinator saw it; `None` before the
    /// first one.
    ///
    /// # Errors
    ///
    /// The store cannot be read.
    pub async fn stage(&self) -> Result<Option<String>, Error> {
        times::stage(&mut self.reader().await?).await
    }

    /// Stores the name of the stage that the campaign waits for.
    ///
    /// # Errors
    ///
    /// The store is read-only, or cannot be written.
    pub async fn put_stage(&self, stage: &str) -> Result<(), Error> {
        self.put(Change::Stage(stage.to_owned())).await.map(drop)
    }

    /// Wall times of the stages, by name.
    pub async fn stage_times(&self) -> Result<Vec<StageTimeRow>, Error> {
        times::stages(&mut self.reader().await?).await
    }

    /// Stores the wall time of a stage, replacing the stored one.
    pub async fn put_stage_time(&self, row: &StageTimeRow) -> Result<(), Error> {
        self.put(Change::StageTime(row.clone())).await.map(drop)
    }

    /// All crashes, failures and quarantines, in the order in which they were stored.
    pub async fn failures(&self) -> Result<Vec<FailureRow>, Error> {
        failures::all(&mut self.reader().await?).await
    }

    /// Whether the failure with this number of its worker is stored.
    pub async fn knows_failure(&self, worker: &str, serial: u64) -> Result<bool, Error> {
        failures::is_known(&mut self.reader().await?, worker, serial).await
    }

    /// The crashes and failures of each stream since it was last quarantined.
    pub async fn stream_histories(&self) -> Result<BTreeMap<StreamId, History>, Error> {
        failures::histories(&mut self.reader().await?).await
    }

    /// The failures, grouped and ordered by kind and then by cause.
    pub async fn failure_groups(&self) -> Result<Vec<FailureGroup>, Error> {
        failures::groups(&mut self.reader().await?).await
    }

    /// The progress of the campaign. It counts designs, but takes the number of samples from the
    /// tallies.
    pub async fn progress(&self) -> Result<Progress, Error> {
        progress::read(&mut self.reader().await?).await
    }

    async fn reader(&self) -> Result<Connection<'static>, Error> {
        self.readers.acquire(&self.path).await
    }

    async fn put(&self, change: Change) -> Result<Receipt, Error> {
        self.writer
            .as_ref()
            .ok_or(Error::ReadOnly)?
            .put(change)
            .await
    }
}
