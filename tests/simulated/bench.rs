//! A small campaign with an in-memory store, and its expected samples.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::Duration;

use ledger::{Generation, Options, StreamDemand, StreamId, Unit};
use problem::formulation::Problem;
use problem::task::{Inputs, Output, Source, compute};
use problem::{Campaign, probe};
use results::status::Status;
use runner::coordinator::board::Board;
use runner::coordinator::recorder::Recorder;
use runner::coordinator::service::Service;
use runner::protocol::v1::RegisterRequest;
use store::{Batch, FailureRow, Receipt};

/// Duration of a lease.
pub(crate) const LEASE: Duration = Duration::from_secs(5);

/// Duration of a commit, during which anything may happen.
const COMMIT: Duration = Duration::from_millis(20);

/// Number of designs, all of which are feasible: the first one with slightly different tool
/// addenda.
pub(crate) const DESIGNS: u32 = 6;

/// Number of samples of each design.
pub(crate) const SAMPLES: u32 = 400;

/// Samples by (design, index).
pub(crate) type Samples = BTreeMap<(u64, u64), f64>;

/// The stored rows, which outlive every coordinator. Clones share them.
#[derive(Clone, Default)]
pub(crate) struct Memory {
    inner: Arc<Mutex<StoredRows>>,
}

#[derive(Default)]
pub(crate) struct StoredRows {
    pub(crate) samples: Samples,
    pub(crate) criteria: BTreeMap<u64, bool>,
    pub(crate) failures: Vec<FailureRow>,
    /// Number of rows stored again with the same value.
    pub(crate) duplicates: u64,
    /// Number of rows submitted again with another value.
    pub(crate) conflicts: u64,
}

impl StoredRows {
    fn knows_failure(&self, worker: &str, serial: Option<u64>) -> bool {
        let is_same = |row: &FailureRow| row.worker == worker && row.serial == serial;
        serial.is_some() && self.failures.iter().any(is_same)
    }
}

impl Memory {
    pub(crate) fn with<T>(&self, act: impl FnOnce(&mut StoredRows) -> T) -> T {
        act(&mut self.inner.lock().unwrap_or_else(PoisonError::into_inner))
    }

    pub(crate) fn is_complete(&self) -> bool {
        self.with(|stored| stored.samples.len() == (DESIGNS * SAMPLES) as usize)
    }

    /// The missing work that a starting coordinator finds.
    fn missing(&self, problem: &Problem) -> Vec<StreamDemand<Arc<Source>>> {
        let inputs = Inputs::new(problem.campaign(), None);
        let wanted = (0..DESIGNS).map(|design| {
            let held = self.with(|stored| {
                let samples = stored.samples.keys();
                let of_design = samples.filter(|(of, _)| *of == u64::from(design));
                of_design.map(|(_, sample)| *sample as u32).collect()
            });
            let source = source(problem, design);
            let mut wanted = inputs.wanted(StreamId::design(design), source, SAMPLES);
            wanted.missing = ledger::gaps(&held, SAMPLES);
            wanted
        });
        wanted.collect()
    }
}

#[tonic::async_trait]
impl Recorder for Memory {
    async fn record(&self, batch: Batch) -> Result<Receipt, store::Error> {
        tokio::time::sleep(COMMIT).await;
        let mut receipt = Receipt::default();
        self.with(|stored| {
            for block in batch.samples {
                for (sample, value) in block.indexed() {
                    let key = (block.stream.index, sample);
                    if let Some(held) = stored.samples.insert(key, value[0]) {
                        stored.conflicts += u64::from(held.to_bits() != value[0].to_bits());
                        stored.duplicates += 1;
                        receipt.duplicate_rows += 1;
                    } else {
                        receipt.new_rows += 1;
                    }
                }
            }
            for row in batch.criteria {
                stored.criteria.insert(row.design, row.simulable);
            }
            for row in batch.failures {
                if stored.knows_failure(&row.worker, row.serial) {
                    receipt.duplicate_rows += 1;
                } else {
                    stored.failures.push(row);
                    receipt.new_rows += 1;
                }
            }
        });
        Ok(receipt)
    }

    async fn knows_failure(&self, worker: &str, serial: u64) -> Result<bool, store::Error> {
        Ok(self.with(|stored| stored.knows_failure(worker, Some(serial))))
    }

    async fn offer_model(&self, _worker: &str, _offered: &str) -> Result<(), store::Error> {
        Ok(())
    }

    async fn pin_model(&self, _worker: &str) -> Result<(), store::Error> {
        Ok(())
    }

    fn has_other_model(&self, _worker: &str) -> bool {
        false
    }

    async fn status(&self) -> anyhow::Result<Status> {
        anyhow::bail!("this store has no campaign")
    }
}

pub(crate) fn source(problem: &Problem, design: u32) -> Source {
    let shift = f64::from(design) * 0.01;
    let x = [0.25 + shift, 1.37, 1.37, 0.85, 1.31, 0.80];
    Source::Design(problem.design(&x, problem.base()))
}

/// The shipped quick campaign.
pub(crate) fn campaign() -> Campaign {
    Campaign::parse("quick.toml", &acceptance::quick_campaign(&[])).expect("it is shipped")
}

/// A board with the missing work.
pub(crate) fn board(problem: &Problem, memory: &Memory, epoch: u64) -> Arc<Board> {
    let options = Options {
        lease: LEASE,
        ..Options::default()
    };
    let board = Board::new(options, epoch);
    board.want(memory.missing(problem));
    board.open();
    Arc::new(board)
}

/// The service of such a board.
pub(crate) fn service(problem: &Problem, memory: &Memory, epoch: u64) -> Service<Memory> {
    Service {
        board: board(problem, memory, epoch),
        recorder: memory.clone(),
        problem: Arc::new(problem.clone()),
        model_digest: Some(digest().to_owned()),
    }
}

/// The digest of the built-in model's answers.
fn digest() -> &'static str {
    static DIGEST: OnceLock<String> = OnceLock::new();
    DIGEST.get_or_init(|| probe::model_digest(&Problem::new(campaign())))
}

/// The registration of a worker.
pub(crate) fn introduction(worker: &str) -> RegisterRequest {
    RegisterRequest {
        worker_id: worker.to_owned(),
        host: "here".to_owned(),
        program_version: runner::identity::BUILD.to_owned(),
        model_digest: digest().to_owned(),
        slots: 1,
        held: Vec::new(),
        died: Vec::new(),
    }
}

/// The samples as one machine computes them without a network.
pub(crate) fn expected(problem: &Problem) -> Samples {
    let mut samples = Samples::new();
    for design in 0..DESIGNS {
        let unit = Unit {
            stream: StreamId::design(design),
            generation: Generation::default(),
            samples: 0..SAMPLES,
        };
        let output = compute(problem, &unit, &source(problem, design));
        let Ok(Output::Design {
            samples: values, ..
        }) = output
        else {
            panic!("design {design} can be simulated");
        };
        samples.extend(
            (0..)
                .zip(values.into_values())
                .map(|(i, sample)| ((u64::from(design), i), sample)),
        );
    }
    samples
}
