//! The service answers or refuses any message and continues to work.

#![no_main]

// The in-memory campaign of the simulated tests, of which only a part is used here.
#[allow(dead_code)]
#[path = "../../simulated/bench.rs"]
mod bench;

use std::sync::OnceLock;
use std::time::Duration;

use bench::{Memory, campaign, introduction, service};
use problem::formulation::Problem;
use runner::coordinator::service::Service;
use libfuzzer_sys::fuzz_target;
use prost::Message;
use runner::protocol::v1::campaign_server::Campaign as _;
use runner::protocol::v1::{
    DrainRequest, ExplainRequest, HeartbeatRequest, LeaseRequest, RegisterRequest, ReleaseRequest,
    ReportRequest, RetryRequest, StatusRequest, WatchRequest,
};
use tonic::Request;

/// Decodes bytes as the message that `kind` selects and sends it, if they are valid.
async fn send(service: &Service<Memory>, kind: u8, bytes: &[u8]) {
    macro_rules! call {
        ($($kind:pat => $method:ident: $message:ty),*) => {
            match kind % 10 {
                $($kind => if let Ok(message) = <$message>::decode(bytes) {
                    let _ = service.$method(Request::new(message)).await;
                },)*
            }
        };
    }
    call!(
        0 => register: RegisterRequest,
        1 => lease: LeaseRequest,
        2 => heartbeat: HeartbeatRequest,
        3 => report: ReportRequest,
        4 => release: ReleaseRequest,
        5 => status: StatusRequest,
        6 => watch: WatchRequest,
        7 => explain: ExplainRequest,
        8 => drain: DrainRequest,
        _ => retry: RetryRequest
    );
}

fuzz_target!(|messages: Vec<(u8, Vec<u8>)>| {
    static PROBLEM: OnceLock<Problem> = OnceLock::new();
    let problem = PROBLEM.get_or_init(|| Problem::new(campaign()));
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_time()
        // A clock that jumps to the end of every wait.
        .start_paused(true)
        .build()
        .expect("a runtime");
    runtime.block_on(async {
        let service = service(problem, &Memory::default(), 1);
        let known = Request::new(introduction("a"));
        service.register(known).await.expect("a good introduction");
        for (kind, bytes) in messages.iter().take(20) {
            send(&service, *kind, bytes).await;
        }
        // Later a well-behaved worker is still served. Whether a job is left depends on the
        // messages before.
        tokio::time::advance(Duration::from_secs(3600)).await;
        service.board.expire();
        let good = Request::new(introduction("good"));
        service.register(good).await.expect("a good introduction");
        let request = LeaseRequest {
            worker_id: "good".to_owned(),
            credit: 1,
            seconds: 1.0,
            wait_ms: 0,
        };
        let response = service.lease(Request::new(request)).await;
        response.expect("a good request");
    });
});
