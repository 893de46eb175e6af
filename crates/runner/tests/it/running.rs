//! A coordinator and its workers in this process, without a port between them.

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use ledger::{StreamId, Unit};
use problem::formulation::Problem;
use problem::task::compute;
use problem::{Campaign, probe};
use runner::coordinator::board::Board;
use runner::coordinator::engine::{CampaignEnd, Engine};
use runner::coordinator::recorder::StoreRecorder;
use runner::coordinator::service::Service;
use runner::protocol::v1::campaign_server::Campaign as _;
use runner::protocol::v1::{LeaseRequest, LeaseResult, RegisterRequest, ReportRequest};
use store::{CampaignRow, Store};
use tokio_util::sync::CancellationToken;
use tonic::Request;

/// Whether the samples of a unit fail, given the point's name in the store.
pub(crate) type Fails<'a> = &'a (dyn Fn(Option<&str>, &Unit) -> bool + Sync);

/// A coordinator and its store.
pub(crate) struct Coordinator {
    pub(crate) store: Store,
    pub(crate) board: Arc<Board>,
    problem: Arc<Problem>,
    service: Service<StoreRecorder>,
    engine: Engine,
}

impl Coordinator {
    /// Starts a coordinator of the campaign in `text`, on a new or existing store.
    pub(crate) async fn start(path: &Path, text: String) -> Self {
        let campaign = Campaign::parse("c.toml", &text).unwrap();
        let row = CampaignRow {
            name: campaign.name.clone(),
            file_text: text,
            digest: campaign.digest(),
            seed: campaign.seed,
            program_version: "0".to_owned(),
            model_digest: None,
        };
        let store = Store::create_or_open(path, &row).await.unwrap();
        let problem = Arc::new(Problem::new(campaign.clone()));
        let options = ledger::Options {
            suspension: Duration::ZERO,
            retry_after: Duration::ZERO,
            ..ledger::Options::default()
        };
        let board = Arc::new(Board::new(options, 1));
        board.remember(store.stream_histories().await.unwrap());
        let service = Service {
            board: Arc::clone(&board),
            recorder: StoreRecorder::new(&store).unwrap(),
            problem: Arc::clone(&problem),
            model_digest: Some(probe::model_digest(&problem)),
        };
        let engine = Engine::new(
            Arc::clone(&problem),
            None,
            store.clone(),
            Arc::clone(&board),
        );
        Self {
            store,
            board,
            problem,
            service,
            engine,
        }
    }

    /// Runs the campaign with `workers` workers until it ends or `stop` does.
    pub(crate) async fn run(
        &self,
        workers: usize,
        fails: Fails<'_>,
        stop: impl Future<Output = ()>,
    ) -> Option<CampaignEnd> {
        let shutdown = CancellationToken::new();
        tokio::select! {
            ended = self.engine.run(&shutdown) => ended.unwrap(),
            () = self.work(workers, fails) => None,
            () = stop => None,
        }
    }

    /// Runs `workers` workers, which never end by themselves.
    pub(crate) async fn work(&self, workers: usize, fails: Fails<'_>) {
        let work = (0..workers).map(|worker| self.work_as(format!("worker-{worker}"), fails));
        futures_util::future::join_all(work).await;
    }

    async fn work_as(&self, id: String, fails: Fails<'_>) {
        let service = &self.service;
        loop {
            let request = RegisterRequest {
                worker_id: id.clone(),
                host: "here".to_owned(),
                program_version: runner::identity::BUILD.to_owned(),
                model_digest: service.model_digest.clone().unwrap(),
                slots: 1,
                held: Vec::new(),
                died: Vec::new(),
            };
            if service.register(Request::new(request)).await.is_ok() {
                break;
            }
            tokio::time::sleep(Duration::from_millis(1)).await;
        }
        loop {
            let request = LeaseRequest {
                worker_id: id.clone(),
                credit: 1,
                seconds: 1.0,
                wait_ms: 50,
            };
            let leased = service.lease(Request::new(request)).await.unwrap();
            for lease in leased.into_inner().leases {
                let units = lease.units().unwrap();
                let infill = self.store.infill().await.unwrap();
                let infill = |stream| {
                    let mut rows = infill.iter();
                    let row = rows.find(|row| StreamId::point(row.number) == stream);
                    row.map(|row| row.name.as_str())
                };
                let results = units.iter().map(|(unit, source)| {
                    let output = if fails(infill(unit.stream), unit) {
                        Err("no load path".to_owned())
                    } else {
                        compute(&*self.problem, unit, source)
                    };
                    runner::protocol::result(unit, &output.map(Some), 0.25)
                });
                let result = LeaseResult {
                    id: lease.id,
                    results: results.collect(),
                    wall_seconds: 0.001,
                    origin: None,
                };
                let request = ReportRequest {
                    worker_id: id.clone(),
                    results: vec![result],
                };
                service.report(Request::new(request)).await.unwrap();
            }
            tokio::task::yield_now().await;
        }
    }
}
