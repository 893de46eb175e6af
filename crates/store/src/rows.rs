//! The rows of the store's tables, one struct each, in the order in which a campaign fills them.

use std::ops::Range;

/// The campaign that a store belongs to: its only row.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CampaignRow {
    /// The campaign's name.
    pub name: String,
    /// The campaign file as it was read.
    pub file_text: String,
    /// Digest of the file's canonical content, in hex. Two files with one digest are one campaign.
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
    /// The variables that the design of experiments moves, in their problem's order.
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

/// What is known of a design without sampling it.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct CriteriaRow {
    /// Index of the design.
    pub design: u64,
    /// Whether the simulator gives numbers for the design.
    pub feasible: bool,
    /// Why it gives none, or why the design gets no samples although it does: a code and a sentence.
    pub reason: Option<String>,
    /// The deterministic responses in their problem's order; `None` where the simulator gives none.
    pub responses: Option<Vec<f64>>,
}

/// One sample ΔSTE(x, θ_i).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SampleRow {
    /// Index of the design x.
    pub design: u64,
    /// Index i of the sample.
    pub sample: u64,
    /// ΔSTE in µm.
    pub delta_ste_um: f64,
}

/// What kriging learns about a design.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ResponseRow {
    /// Index of the design.
    pub design: u64,
    /// Mean of the samples, in µm.
    pub mean_um: f64,
    /// Standard deviation of the samples, in µm.
    pub sd_um: f64,
    /// Their 90 % percentile, in µm.
    pub p90_um: f64,
    /// Variance of that estimate, in µm².
    pub p90_variance_um2: f64,
    /// p-value of Lilliefors' test of normality; `None` where it has none.
    pub lilliefors_p: Option<f64>,
}

/// A fitted model.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ModelRow {
    /// The response that it predicts.
    pub name: String,
    /// The whole model, as JSON.
    pub json: String,
    /// What a reader wants to know of it, as JSON.
    pub summary_json: String,
}

/// One run of an optimiser from one start.
#[derive(Debug, Clone, PartialEq)]
pub struct OptimiserRunRow {
    /// The problem formulation.
    pub approach: String,
    /// Index of the start.
    pub start: u64,
    /// Its result, as JSON. What makes two rows the same run, with `simulator_calls`.
    pub result_json: String,
    /// How often it called the simulator.
    pub simulator_calls: u64,
    /// Processor time, in seconds. Measured, so not compared.
    pub cpu_seconds: f64,
}

/// The best design of one approach.
#[derive(Debug, Clone, PartialEq)]
pub struct OptimumRow {
    /// The problem formulation.
    pub approach: String,
    /// An object of every variable's value by name, as JSON.
    pub x_json: String,
    /// The optimised criterion, in µm.
    pub criterion_um: f64,
    /// Whether every constraint holds.
    pub feasible: bool,
    /// The criteria at the optimum, as JSON.
    pub criteria_json: String,
    /// Calls of the simulator over all its runs.
    pub simulator_calls: u64,
    /// Processor time over all its runs, in seconds.
    pub cpu_seconds: f64,
    /// A remark for the report; empty when there is none.
    pub note: String,
}

/// One sample at an optimum.
#[derive(Debug, Clone, PartialEq)]
pub struct VerifyRow {
    /// The approach whose optimum it is.
    pub approach: String,
    /// Index of the sample.
    pub sample: u64,
    /// ΔSTE in µm.
    pub delta_ste_um: f64,
}

/// How a job went wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum FailureKind {
    /// Its worker vanished while it ran.
    Crash,
    /// Its worker reported an error.
    Failure,
    /// It was quarantined.
    Quarantine,
}

impl FailureKind {
    /// Its name in the table.
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

/// One thing that went wrong with one attempt of a job.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FailureRow {
    /// The job, as its messages name it.
    pub job: String,
    /// The attempt.
    pub attempt: u32,
    /// The worker that had it.
    pub worker: String,
    /// The worker's own number of what it reports. A second row of this worker with this number is
    /// not stored; without a number every row is.
    pub serial: Option<u64>,
    /// How it went wrong.
    pub kind: FailureKind,
    /// What was reported.
    pub error: String,
    /// When, in milliseconds since 1970 (UTC), if the caller wants that kept.
    pub at_unix_ms: Option<i64>,
}

/// What went wrong with a job so far.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct JobHistory {
    /// The job's name.
    pub job: String,
    /// The newest attempt of which something is recorded.
    pub attempts: u32,
    /// Workers that vanished while it ran, since the job was last quarantined.
    pub crashes: u32,
    /// Recorded failures since then.
    pub failures: u32,
}

/// Failures of one kind with one cause.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FailureGroup {
    /// How the jobs went wrong.
    pub kind: FailureKind,
    /// The first line of what was reported, with `#` in the place of every number and cut after
    /// some 200 bytes: what the failures of the group have in common.
    pub cause: String,
    /// How many there are.
    pub count: u64,
    /// The first line of what was reported last, numbers included.
    pub last_error: String,
    /// The job of the last one.
    pub last_job: String,
    /// The worker of the last one.
    pub last_worker: String,
}

/// What a job cost.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JobTimeRow {
    /// The job's number.
    pub job: u64,
    /// Processor time, in seconds. Measured, so never compared: the first one is kept.
    pub cpu_seconds: f64,
}

/// How long a stage took.
#[derive(Debug, Clone, PartialEq)]
pub struct StageTimeRow {
    /// The stage's name.
    pub stage: String,
    /// How long the campaign waited for it while a coordinator ran, in seconds. Measured, so never compared.
    pub wall_seconds: f64,
}

/// What an external simulator says of a candidate of an optimiser run.
#[derive(Debug, Clone, PartialEq)]
pub struct EvaluationRow {
    /// What the run is called where generations are.
    pub stream: String,
    /// Which evaluation of the run, from 0.
    pub evaluation: u64,
    /// The values of all variables.
    pub x: Vec<f64>,
    /// Why the design cannot be simulated; there is nothing else then.
    pub refused: Option<String>,
    /// The response without random effects, if the problem has a baseline.
    pub value: Option<f64>,
    /// What constraints are set on.
    pub criteria: Option<Vec<f64>>,
    /// The same in the baseline state, where it was asked for.
    pub worn_criteria: Option<Vec<f64>>,
    /// Of a direct search, the sampled response of a design that keeps the constraints.
    pub samples: Option<Vec<f64>>,
}

/// Rows that are stored together or not at all.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Batch {
    /// Criteria of designs.
    pub criteria: Vec<CriteriaRow>,
    /// Samples of designs.
    pub samples: Vec<SampleRow>,
    /// Samples of optima.
    pub verify: Vec<VerifyRow>,
    /// Optimiser runs.
    pub runs: Vec<OptimiserRunRow>,
    /// Evaluations of optimiser runs.
    pub evaluations: Vec<EvaluationRow>,
    /// What jobs cost.
    pub times: Vec<JobTimeRow>,
    /// Failures; appended, but for those that are known by their worker's number.
    pub failures: Vec<FailureRow>,
    /// The stream and the generation whose results these are, if they may be out of date: they are
    /// stored only if that is the generation which
    /// [`Store::put_generations`](crate::Store::put_generations) put last.
    pub only_for: Option<(String, u64)>,
}

impl Batch {
    /// Adds the rows of another batch, which must not be for a generation of its own.
    pub fn append(&mut self, mut other: Self) {
        self.criteria.append(&mut other.criteria);
        self.samples.append(&mut other.samples);
        self.verify.append(&mut other.verify);
        self.runs.append(&mut other.runs);
        self.evaluations.append(&mut other.evaluations);
        self.times.append(&mut other.times);
        self.failures.append(&mut other.failures);
        self.only_for = self.only_for.take().or(other.only_for);
    }

    /// The number of rows of all kinds.
    pub fn len(&self) -> usize {
        self.criteria.len()
            + self.samples.len()
            + self.verify.len()
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

/// What became of the rows of a committed batch.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Receipt {
    /// Rows that were not there before.
    pub new_rows: u64,
    /// Rows that were there already, with the same value.
    pub duplicate_rows: u64,
    /// Whether nothing was stored, because it is out of date.
    pub is_stale: bool,
}

/// What a design still lacks.
#[derive(Debug, Clone, PartialEq)]
pub struct MissingWork {
    /// The design.
    pub design: DesignRow,
    /// Whether its criteria are missing.
    pub criteria: bool,
    /// The missing samples, as disjoint ascending ranges. For a design whose criteria are missing
    /// these are needed only if it turns out feasible.
    pub samples: Vec<Range<u64>>,
}

/// How far a campaign is, all counts of one moment.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Progress {
    /// Designs.
    pub designs: u64,
    /// Designs whose criteria are known.
    pub criteria_done: u64,
    /// Those of them that are feasible.
    pub feasible: u64,
    /// The feasible ones that get no samples, for a reason beside them.
    pub ruled_out: u64,
    /// Samples of designs.
    pub samples: u64,
    /// Designs with a response.
    pub responses: u64,
    /// How many samples the responses were computed from, where that is known.
    pub samples_of_responses: Option<u64>,
    /// Fitted models.
    pub models: u64,
    /// Finished optimiser runs.
    pub optimiser_runs: u64,
    /// Optima.
    pub optima: u64,
    /// Samples at optima.
    pub verify_samples: u64,
    /// Recorded crashes, failures and quarantines.
    pub failures: u64,
}
