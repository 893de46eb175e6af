//! A service on a store with one design, and the calls of its workers.

use std::sync::Arc;
use std::time::Duration;

use ledger::{Options, StreamId};
use problem::formulation::Problem;
use problem::task::{Inputs, Source, compute};
use problem::{Campaign, Design, probe};
use runner::coordinator::board::Board;
use runner::coordinator::recorder::StoreRecorder;
use runner::coordinator::service::Service;
use runner::protocol::v1::campaign_server::Campaign as _;
use runner::protocol::v1::{
    Directive, Lease, LeaseRequest, LeaseResult, RegisterRequest, ReportRequest,
};
use store::{CampaignRow, DesignRow, Store};
use tempfile::TempDir;
use tonic::Request;

/// Number of samples that the only design needs.
pub(crate) const SAMPLES: usize = 10;

/// The only design.
pub(crate) const X: [f64; 6] = [0.25, 1.37, 1.37, 0.85, 1.31, 0.80];

fn design(problem: &Problem) -> Design {
    problem.design(&X, problem.base())
}

/// A board with one design that lacks its samples.
pub(crate) fn board(problem: &Problem, epoch: u64) -> Arc<Board> {
    let options = Options {
        retry_after: Duration::ZERO,
        retry_for: Duration::ZERO,
        ..Options::default()
    };
    let board = Board::new(options, epoch);
    let inputs = Inputs::new(problem.campaign(), None);
    let source = Source::Design(design(problem));
    let samples = SAMPLES as u32;
    board.want(vec![inputs.wanted(StreamId::design(0), source, samples)]);
    board.open();
    Arc::new(board)
}

pub(crate) struct Bench {
    _folder: TempDir,
    pub(crate) problem: Arc<Problem>,
    pub(crate) service: Service<StoreRecorder>,
    pub(crate) board: Arc<Board>,
    pub(crate) store: Store,
}

pub(crate) async fn bench() -> Bench {
    let folder = tempfile::tempdir().unwrap();
    let campaign = Campaign::parse("paper.toml", Campaign::PAPER).unwrap();
    let row = CampaignRow {
        name: campaign.name.clone(),
        file_text: Campaign::PAPER.to_owned(),
        digest: campaign.digest(),
        seed: campaign.seed,
        program_version: "0".to_owned(),
        model_digest: None,
    };
    let store = Store::create_or_open(&folder.path().join("s.db"), &row)
        .await
        .unwrap();
    store.put_designs(&[DesignRow::new(0, X)]).await.unwrap();
    let problem = Arc::new(Problem::new(campaign.clone()));
    let board = board(&problem, 7);
    let service = Service {
        board: Arc::clone(&board),
        recorder: StoreRecorder::new(&store).unwrap(),
        problem: Arc::clone(&problem),
        model_digest: Some(probe::model_digest(&problem)),
    };
    Bench {
        _folder: folder,
        problem,
        service,
        board,
        store,
    }
}

impl Bench {
    pub(crate) fn introduction(&self, worker: &str) -> RegisterRequest {
        RegisterRequest {
            worker_id: worker.to_owned(),
            host: "here".to_owned(),
            program_version: runner::identity::BUILD.to_owned(),
            model_digest: self.service.model_digest.clone().unwrap(),
            slots: 1,
            held: Vec::new(),
            died: Vec::new(),
        }
    }

    pub(crate) async fn register(&self, request: RegisterRequest) -> Result<(), tonic::Status> {
        self.service.register(Request::new(request)).await.map(drop)
    }

    pub(crate) async fn lease(&self, worker: &str) -> (Vec<Lease>, Directive) {
        let request = LeaseRequest {
            worker_id: worker.to_owned(),
            credit: 1,
            seconds: 1.0,
            wait_ms: 0,
        };
        let response = self
            .service
            .lease(Request::new(request))
            .await
            .unwrap()
            .into_inner();
        let directive = response.directive();
        (response.leases, directive)
    }

    pub(crate) async fn report(&self, worker: &str, result: LeaseResult) -> Directive {
        let request = ReportRequest {
            worker_id: worker.to_owned(),
            results: vec![result],
        };
        self.service
            .report(Request::new(request))
            .await
            .unwrap()
            .into_inner()
            .directive()
    }

    /// The results of a correct worker for a lease.
    pub(crate) fn answer(&self, lease: &Lease) -> LeaseResult {
        let results = lease.units().unwrap();
        let results = results.iter().map(|(unit, source)| {
            let output = compute(&*self.problem, unit, source);
            runner::protocol::result(unit, &output.map(Some), 0.5)
        });
        LeaseResult {
            id: lease.id,
            results: results.collect(),
            wall_seconds: 0.5,
            origin: None,
        }
    }

    pub(crate) async fn samples(&self) -> usize {
        let blocks = self.store.blocks_of(StreamId::design(0)).await.unwrap();
        blocks.iter().map(|block| block.samples.len()).sum()
    }
}
