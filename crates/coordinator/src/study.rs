//! The simulations of a study: a board and workers as for a campaign, without a store.
//!
//! The designs on the board are the variants that the study asks for, in the order of its requests.
//! Results are kept until the study takes them.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use anyhow::Context as _;
use campaign::formulation::Problem;
use campaign::optimise::RunResult;
use campaign::simulator::State;
use campaign::task::{Inputs, Run, Source};
use campaign::{Campaign, probe};
use ledger::{Kind, StreamId};
use results::status::Status;
use store::{Batch, CriteriaRow, FailureKind, Receipt};
use studies::simulations::{Answer, Request, Simulations};
use tokio::runtime::Handle;
use tokio::sync::Notify;
use tokio_util::sync::CancellationToken;

use crate::board::{self, Board, Course};
use crate::leases;
use crate::local::LocalWorkers;
use crate::recorder::Recorder;
use crate::service::Service;
use crate::serving::{Error, OpenPort, Port, Serving, farewell};

/// The name, campaign and workers of a study.
#[derive(Debug)]
pub struct Plan {
    /// The name of the study, used for its access file.
    pub name: String,
    /// The campaign that it belongs to.
    pub campaign: Campaign,
    /// The workers of this process; may be empty.
    pub workers: LocalWorkers,
    /// The port for other processes, if any.
    pub port: Option<Port>,
    /// Duration of a lease.
    pub lease: Duration,
}

/// Runs a study with the workers of `plan`. Returns none if `shutdown` or a drain came first.
///
/// # Errors
///
/// The port cannot be used, a worker of this process fails, or the study does.
pub async fn run<T: Send + 'static>(
    plan: Plan,
    study: impl FnOnce(&dyn Simulations) -> anyhow::Result<T> + Send + 'static,
    shutdown: CancellationToken,
) -> Result<Option<T>, Error> {
    let problem = Arc::new(Problem::new(plan.campaign.clone()));
    // Only workers ask an external simulator: the first one to register sets the digest.
    let model_digest = (!plan.campaign.is_external()).then(|| probe::model_digest(&problem));
    let opened = match &plan.port {
        Some(port) => Some(OpenPort::new(port, &plan.name).await?),
        None => None,
    };
    let options = ledger::Options {
        lease: plan.lease,
        ..board::options(&plan.campaign)
    };
    let board = Arc::new(Board::new(options, rand::random()));
    let answers = Answers::default();
    let service = Service {
        board: Arc::clone(&board),
        recorder: answers.clone(),
        problem: Arc::clone(&problem),
        model_digest: model_digest.clone(),
    };
    board.open();
    let mut serving = Serving::start(service, opened, &plan.workers)?;
    let stop = shutdown.child_token();
    let workers = Workers {
        inputs: Inputs::new(&plan.campaign, model_digest.as_deref()),
        problem,
        board: Arc::clone(&board),
        answers: answers.clone(),
        next: AtomicU32::new(0),
        stop: stop.clone(),
        runtime: Handle::current(),
    };
    let mut studied = tokio::task::spawn_blocking(move || study(&workers));
    let outcome = tokio::select! {
        studied = &mut studied => match studied {
            Ok(studied) => studied.map(Some).map_err(Error::from),
            Err(panic) => Err(Error::from(anyhow::Error::from(panic))),
        },
        Err(failed) = leases::watch(&board, &answers) => Err(Error::Store(failed)),
        failed = serving.failed() => Err(Error::from(failed)),
        () = board.drained() => Ok(None),
        () = shutdown.cancelled() => Ok(None),
    };
    // Threads of the study may still wait for answers.
    stop.cancel();
    let is_finished = matches!(outcome, Ok(Some(_)));
    let course = if is_finished {
        Course::Finished
    } else {
        Course::Leave
    };
    board.set_course(course);
    farewell(&board).await;
    serving.end(true).await;
    outcome
}

/// The simulations of a study, computed by workers.
struct Workers {
    problem: Arc<Problem>,
    inputs: Inputs,
    board: Arc<Board>,
    answers: Answers,
    /// The number of the next variant.
    next: AtomicU32,
    stop: CancellationToken,
    runtime: Handle,
}

impl Simulations for Workers {
    fn simulate(&self, requests: &[Request]) -> anyhow::Result<Vec<Answer>> {
        let count = u32::try_from(requests.len()).context("too many variants at once")?;
        let first = self.next.fetch_add(count, Ordering::Relaxed);
        let numbers = first..first.checked_add(count).context("too many variants")?;
        let wanted = numbers.clone().zip(requests).map(|(number, request)| {
            let source = Source::Variant(Box::new(request.variant.clone()));
            let stream = StreamId::design(number);
            let mut wanted = self.inputs.wanted(stream, source, request.samples.end);
            wanted.missing = vec![request.samples.clone()];
            wanted
        });
        self.board.want(wanted.collect());
        let brought = self.wait(|collected| {
            let number = |index: usize| u64::from(first) + index as u64;
            let is_complete = |(index, request): (usize, &Request)| {
                let brought = collected.designs.get(&number(index));
                brought.is_some_and(|brought| brought.is_complete(request.samples.len()))
            };
            let is_ready = requests.iter().enumerate().all(is_complete);
            let mut take = |index| collected.designs.remove(&number(index));
            is_ready.then(|| {
                (0..requests.len())
                    .filter_map(&mut take)
                    .collect::<Vec<_>>()
            })
        })?;
        let is_done = |stream: StreamId| {
            stream.kind == Kind::Design
                && u32::try_from(stream.index).is_ok_and(|number| numbers.contains(&number))
        };
        self.board.forget(is_done);
        let answers = requests.iter().zip(brought);
        answers
            .map(|(request, brought)| brought.answer(&self.problem, request))
            .collect()
    }

    fn optimise(&self, runs: Vec<Run>) -> anyhow::Result<Vec<RunResult>> {
        let keys: Vec<StreamId> = runs.iter().map(Run::stream).collect();
        let wanted = runs.into_iter().map(|run| {
            let stream = run.stream();
            self.inputs.wanted(stream, Source::Run(run), 1)
        });
        self.board.want(wanted.collect());
        let brought: Vec<String> = self.wait(|collected| {
            let of = |key| collected.runs.get(key).cloned();
            keys.iter().map(of).collect()
        })?;
        let read = |json: &String| serde_json::from_str(json).context("the result of a run");
        brought.iter().map(read).collect()
    }
}

impl Workers {
    /// Waits until `ready` returns a value for the collected results.
    fn wait<T>(&self, mut ready: impl FnMut(&mut Collected) -> Option<T>) -> anyhow::Result<T> {
        self.runtime.block_on(async {
            loop {
                let changed = self.answers.changed.notified();
                {
                    let mut collected = self.answers.lock();
                    if let Some(error) = &collected.quarantined {
                        anyhow::bail!("{error}");
                    }
                    if let Some(found) = ready(&mut collected) {
                        return Ok(found);
                    }
                }
                tokio::select! {
                    () = changed => {}
                    () = self.stop.cancelled() => anyhow::bail!("the study was stopped"),
                }
            }
        })
    }
}

/// The results of workers, shared with the study.
#[derive(Clone, Default)]
struct Answers {
    collected: Arc<Mutex<Collected>>,
    /// Notified when a batch of results arrives.
    changed: Arc<Notify>,
}

#[derive(Default)]
struct Collected {
    designs: BTreeMap<u64, Brought>,
    /// Results of runs as JSON.
    runs: BTreeMap<StreamId, String>,
    /// Failures by worker and the worker's serial number.
    failures: BTreeSet<(String, u64)>,
    /// The error of the first quarantined job.
    quarantined: Option<String>,
    model_digest: Option<String>,
}

/// The results of one variant.
#[derive(Default)]
struct Brought {
    criteria: Option<CriteriaRow>,
    samples: BTreeMap<u64, f64>,
}

impl Brought {
    fn is_complete(&self, samples: usize) -> bool {
        let is_sampled = self.samples.len() == samples;
        self.criteria
            .as_ref()
            .is_some_and(|row| row.reason.is_some() || is_sampled)
    }

    fn answer(self, problem: &Problem, request: &Request) -> anyhow::Result<Answer> {
        let row = self.criteria.context("a variant was not analysed")?;
        if !row.simulable {
            return Ok(Answer::Refused(row.reason.unwrap_or_default()));
        }
        let variant = &request.variant;
        let analysis = row
            .responses
            .and_then(|responses| problem.analysis(&variant.design, &responses, State::Baseline))
            .context("a worker has sent no responses")?;
        let mut criteria = analysis.criteria.gears();
        if let Some(module) = variant.normal_module_mm {
            criteria.normal_module_mm = module;
        }
        Ok(Answer::Simulated {
            criteria,
            samples: self.samples.into_values().collect(),
        })
    }
}

impl Answers {
    fn lock(&self) -> MutexGuard<'_, Collected> {
        self.collected
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
    }
}

#[tonic::async_trait]
impl Recorder for Answers {
    async fn record(&self, batch: Batch) -> Result<Receipt, store::Error> {
        {
            let mut collected = self.lock();
            for row in batch.criteria {
                let brought = collected.designs.entry(row.design).or_default();
                brought.criteria.get_or_insert(row);
            }
            for block in batch.samples {
                let brought = collected.designs.entry(block.stream.index).or_default();
                brought.samples.extend(block.indexed());
            }
            for row in batch.runs {
                collected.runs.insert(row.stream, row.result_json);
            }
            for row in batch.failures {
                if let Some(serial) = row.serial {
                    collected.failures.insert((row.worker, serial));
                }
                if row.kind == FailureKind::Quarantine {
                    collected.quarantined.get_or_insert(row.error);
                }
            }
        }
        self.changed.notify_waiters();
        Ok(Receipt::default())
    }

    async fn knows_failure(&self, worker: &str, serial: u64) -> Result<bool, store::Error> {
        let failure = (worker.to_owned(), serial);
        Ok(self.lock().failures.contains(&failure))
    }

    async fn pin_model(&self, offered: &str) -> Result<(), store::Error> {
        let mut collected = self.lock();
        let held = collected.model_digest.get_or_insert(offered.to_owned());
        if held == offered {
            return Ok(());
        }
        Err(store::Error::ModelDigestConflict {
            held: held.clone(),
            offered: offered.to_owned(),
        })
    }

    async fn status(&self) -> anyhow::Result<Option<Status>> {
        Ok(None)
    }
}
