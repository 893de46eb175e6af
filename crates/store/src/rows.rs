//! The rows of the store's tables, one struct each, in the order in which a campaign fills them.

use std::ops::Range;

use ledger::StreamId;

use crate::derived::Derivation;
use crate::samples::SampleBlock;

/// The campaign that a store belongs to: its only row.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CampaignRow {
    /// The campaign's name.
    pub name: String,
    /// The text of the campaign file.
    pub file_text: String,
    /// Digest of the file's canonical content, in hex. Two files with the same digest are the same
    /// campaign.
    pub digest: String,
    /// The seed of every random stream.
    pub seed: u64,
    /// Version of the program that created the store.
    pub program_version: String,
    /// Digest of the gear model that filled the store; `None` until
    /// [`pin_model_digest`](crate::Store::pin_model_digest).
    pub model_digest: Option<String>,
}

/// One point of the design of experiments.
#[derive(Debug, Clone, PartialEq)]
pub struct DesignRow {
    /// Index in the design of experiments.
    pub design: u64,
    /// The variables of the design of experiments, in their problem's order.
    pub x: Vec<f64>,
}

impl DesignRow {
    /// The design at a point.
    #[must_use]
    pub fn new(design: u64, x: impl Into<Vec<f64>>) -> Self {
        Self {
            design,
            x: x.into(),
        }
    }
}

/// The deterministic results of a design.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct CriteriaRow {
    /// Index of the design.
    pub design: u64,
    /// Whether the simulator gives numbers for the design.
    pub simulable: bool,
    /// Why the design is not simulable, or why it gets no samples although it is: a code and a
    /// sentence.
    pub reason: Option<String>,
    /// The deterministic responses in their problem's order; `None` if the design is not simulable.
    pub responses: Option<Vec<f64>>,
}

/// The sampled response of a design, which kriging learns from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ResponseRow {
    /// Index of the design.
    pub design: u64,
    /// Mean of the samples.
    pub mean: f64,
    /// Standard deviation of the samples.
    pub standard_deviation: f64,
    /// Estimate of the percentile at the campaign's level.
    pub percentile: f64,
    /// Variance of that estimate.
    pub percentile_variance: f64,
    /// p-value of Lilliefors' test of normality; `None` if the test does not apply.
    pub lilliefors_p: Option<f64>,
}

/// A fitted model.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ModelRow {
    /// What it was fitted to: [`ModelRow::DOE`] or [`ModelRow::ENRICHED`].
    pub name: String,
    /// The whole model, as JSON.
    pub json: String,
    /// A summary of the model, as JSON.
    pub summary_json: String,
}

impl ModelRow {
    /// The name of the model of the DoE.
    pub const DOE: &str = "doe";
    /// The name of the model of the DoE and all infill points, from the end of an enrichment.
    pub const ENRICHED: &str = "enriched";
}

/// One run of an optimiser from one start.
#[derive(Debug, Clone, PartialEq)]
pub struct OptimiserRunRow {
    /// The run.
    pub stream: StreamId,
    /// The result, as JSON. Two rows are the same run if this and `simulator_calls` agree.
    pub result_json: String,
    /// Number of calls of the simulator.
    pub simulator_calls: u64,
    /// Processor time, in seconds. It is measured and therefore not compared.
    pub cpu_seconds: f64,
}

/// The best design of one approach.
#[derive(Debug, Clone, PartialEq)]
pub struct OptimumRow {
    /// The problem formulation.
    pub approach: String,
    /// The values of all variables, as a JSON object keyed by name.
    pub x_json: String,
    /// What the approach minimised.
    pub criterion: f64,
    /// Whether every constraint holds.
    pub feasible: bool,
    /// The criteria at the optimum, as JSON.
    pub criteria_json: String,
    /// Calls of the simulator in all runs of the approach.
    pub simulator_calls: u64,
    /// Processor time of all runs of the approach, in seconds.
    pub cpu_seconds: f64,
    /// A remark for the report; empty if there is none.
    pub note: String,
}

/// The kinds of event recorded against a job.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum FailureKind {
    /// The lease expired after the job started.
    Crash,
    /// The job returned an error.
    Failure,
    /// The job was quarantined.
    Quarantine,
}

impl FailureKind {
    /// The name of the kind in the table.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Crash => "crash",
            Self::Failure => "failure",
            Self::Quarantine => "quarantine",
        }
    }

    pub(crate) fn parse(text: &str) -> Option<Self> {
        [Self::Crash, Self::Failure, Self::Quarantine]
            .into_iter()
            .find(|k| k.as_str() == text)
    }
}

/// One crash, failure or quarantine of a stream.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FailureRow {
    /// The stream.
    pub stream: StreamId,
    /// Whether the lease had other streams, too, any of which may be the cause.
    pub shared: bool,
    /// The number of the lease.
    pub lease: u32,
    /// The worker that held the job's lease.
    pub worker: String,
    /// The worker's own number of the report. A second row with the same worker and number is not
    /// stored; rows without a number are always stored.
    pub serial: Option<u64>,
    /// The kind of the event.
    pub kind: FailureKind,
    /// The reported error.
    pub error: String,
    /// The time in milliseconds since 1970 (UTC), if the caller records it.
    pub at_unix_ms: Option<i64>,
}

/// The recorded crashes and failures of a stream.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StreamHistory {
    /// The stream.
    pub stream: StreamId,
    /// The newest lease with a recorded event.
    pub last_lease: u32,
    /// Crashes since the stream was last quarantined.
    pub crashes: u32,
    /// Failures since the stream was last quarantined.
    pub failures: u32,
}

/// Failures of one kind with one cause.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FailureGroup {
    /// The kind of the failures.
    pub kind: FailureKind,
    /// The first line of the error with every number replaced by `#`, cut after some 200 bytes: the
    /// part that the failures of the group have in common.
    pub cause: String,
    /// Number of failures in the group.
    pub count: u64,
    /// The first line of the latest error, with its numbers.
    pub last_error: String,
    /// The stream of the latest failure.
    pub last_stream: StreamId,
    /// The worker of the latest failure.
    pub last_worker: String,
}

/// The measured cost of a job.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JobTimeRow {
    /// The stream.
    pub stream: StreamId,
    /// What tells the jobs of one stream apart.
    pub part: u64,
    /// Processor time, in seconds. It is measured and therefore never compared: the first value is
    /// kept.
    pub cpu_seconds: f64,
}

/// The wall time of a stage.
#[derive(Debug, Clone, PartialEq)]
pub struct StageTimeRow {
    /// The stage's name.
    pub stage: String,
    /// Time in the stage while a coordinator ran, in seconds. Measured, so never compared.
    pub wall_seconds: f64,
}

/// An external simulator's evaluation of a candidate of an optimiser run.
#[derive(Debug, Clone, PartialEq)]
pub struct EvaluationRow {
    /// The run, or an infill point.
    pub stream: StreamId,
    /// Index of the evaluation within the run, from 0.
    pub evaluation: u64,
    /// The values of all variables.
    pub x: Vec<f64>,
    /// Why the design is not simulable. The fields below are then `None`.
    pub refused: Option<String>,
    /// The response without random effects, if the problem has a baseline.
    pub value: Option<f64>,
    /// The values that constraints are set on.
    pub criteria: Option<Vec<f64>>,
    /// The same values in the baseline state, if they were requested.
    pub worn_criteria: Option<Vec<f64>>,
    /// The sampled response of a feasible design, for a direct search.
    pub samples: Option<Vec<f64>>,
}

/// Rows that are stored together or not at all.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Batch {
    /// Criteria of designs.
    pub criteria: Vec<CriteriaRow>,
    /// Samples of designs, optima and infill points.
    pub samples: Vec<SampleBlock>,
    /// Optimiser runs.
    pub runs: Vec<OptimiserRunRow>,
    /// Evaluations of optimiser runs.
    pub evaluations: Vec<EvaluationRow>,
    /// Costs of jobs.
    pub times: Vec<JobTimeRow>,
    /// What the optimiser runs were computed from.
    pub derivations: Vec<Derivation>,
    /// Failures. They are appended, except those stored already under the same worker and number.
    pub failures: Vec<FailureRow>,
    /// The stream and the generation of these results, if they may be out of date. They are stored
    /// only if that generation was the last one given to
    /// [`Store::put_generations`](crate::Store::put_generations).
    pub only_for: Option<(StreamId, u64)>,
}

impl Batch {
    /// Appends the rows of another batch, which must not have an `only_for` of its own.
    pub fn append(&mut self, mut other: Self) {
        self.criteria.append(&mut other.criteria);
        self.samples.append(&mut other.samples);
        self.runs.append(&mut other.runs);
        self.evaluations.append(&mut other.evaluations);
        self.times.append(&mut other.times);
        self.derivations.append(&mut other.derivations);
        self.failures.append(&mut other.failures);
        self.only_for = self.only_for.take().or(other.only_for);
    }

    /// The number of rows of all kinds.
    pub fn len(&self) -> usize {
        self.criteria.len()
            + self
                .samples
                .iter()
                .map(|block| block.samples.len())
                .sum::<usize>()
            + self.runs.len()
            + self.evaluations.len()
            + self.times.len()
            + self.failures.len()
    }

    /// Whether there is nothing to store.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// The outcome of a committed batch.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Receipt {
    /// Rows that were not stored before.
    pub new_rows: u64,
    /// Rows that were stored before with the same value.
    pub duplicate_rows: u64,
    /// Whether nothing was stored because the batch is out of date.
    pub is_stale: bool,
}

/// The missing work of a design.
#[derive(Debug, Clone, PartialEq)]
pub struct MissingWork {
    /// The design.
    pub design: DesignRow,
    /// Whether its criteria are missing.
    pub criteria: bool,
    /// The missing samples, as disjoint ascending ranges. For a design whose criteria are missing
    /// they are needed only if it proves simulable.
    pub samples: Vec<Range<u64>>,
}

/// The progress of a campaign, with all counts of the same moment.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Progress {
    /// Number of designs.
    pub designs: u64,
    /// Designs whose criteria are known.
    pub criteria_done: u64,
    /// Simulable designs.
    pub simulable: u64,
    /// Simulable designs that get no samples, for a reason recorded with them.
    pub ruled_out: u64,
    /// Samples of designs.
    pub samples: u64,
    /// Designs with a response.
    pub responses: u64,
    /// Fitted models.
    pub models: u64,
    /// Finished optimiser runs.
    pub optimiser_runs: u64,
    /// Optima.
    pub optima: u64,
    /// Samples at optima.
    pub point_samples: u64,
    /// Recorded crashes, failures and quarantines.
    pub failures: u64,
}
