//! The service and the worker library on a simulated network with all kinds of faults. Minutes of
//! simulated time pass in a moment; only the samples are really computed.

use std::net::Ipv4Addr;
use std::pin::Pin;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::task::{Context, Poll};
use std::time::Duration;

use ledger::Crash;
use problem::formulation::Problem;
use problem::task::compute;
use runner::coordinator::board::{Board, Course};
use runner::gateway::{Dial, Link};
use runner::protocol::v1::campaign_server::CampaignServer;
use runner::protocol::v1::{
    Directive, HeartbeatRequest, Lease, LeaseRequest, LeaseResult, LeaseState, ReleaseRequest,
    ReportRequest,
};
use runner::worker::{Options, Worker};
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;
use tokio_util::sync::CancellationToken;
use tonic::transport::Server;
use tonic::transport::server::Connected;
use turmoil::net::{TcpListener, TcpStream};
use turmoil::{Builder, Sim};

use crate::bench::{LEASE, Memory, campaign, expected, introduction, service};

const PORT: u16 = 7400;
const WORKERS: [&str; 2] = ["worker-0", "worker-1"];

/// A connection that the server has accepted.
struct AcceptedConnection(TcpStream);

impl Connected for AcceptedConnection {
    type ConnectInfo = ();

    fn connect_info(&self) {}
}

impl AsyncRead for AcceptedConnection {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<std::io::Result<()>> {
        Pin::new(&mut self.0).poll_read(context, buffer)
    }
}

impl AsyncWrite for AcceptedConnection {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<std::io::Result<usize>> {
        Pin::new(&mut self.0).poll_write(context, bytes)
    }

    fn poll_flush(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<std::io::Result<()>> {
        Pin::new(&mut self.0).poll_flush(context)
    }

    fn poll_shutdown(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<std::io::Result<()>> {
        Pin::new(&mut self.0).poll_shutdown(context)
    }
}

/// The state that outlives a coordinator, and the running one.
#[derive(Clone)]
struct World {
    problem: Arc<Problem>,
    memory: Memory,
    epoch: Arc<AtomicU64>,
    board: Arc<Mutex<Option<Arc<Board>>>>,
    /// Workers that fell silent, as reported by the ledger.
    crashes: Arc<Mutex<Vec<Crash>>>,
    /// Whether the campaign may end.
    may_end: bool,
}

impl World {
    fn new() -> Self {
        Self {
            problem: Arc::new(Problem::new(campaign())),
            memory: Memory::default(),
            epoch: Arc::default(),
            board: Arc::default(),
            crashes: Arc::default(),
            may_end: true,
        }
    }

    fn board(&self) -> Option<Arc<Board>> {
        self.board
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .clone()
    }

    /// Runs a coordinator until it is crashed.
    async fn serve(self) -> turmoil::Result {
        let epoch = 1 + self.epoch.fetch_add(1, Ordering::SeqCst);
        let service = service(&self.problem, &self.memory, epoch);
        let board = Arc::clone(&service.board);
        *self.board.lock().unwrap_or_else(PoisonError::into_inner) = Some(Arc::clone(&board));
        let (memory, may_end) = (self.memory.clone(), self.may_end);
        let crashes = Arc::clone(&self.crashes);
        tokio::spawn(async move {
            loop {
                tokio::time::sleep(LEASE / 20).await;
                let mut of_world = crashes.lock().unwrap_or_else(PoisonError::into_inner);
                of_world.extend(board.expire());
                drop(of_world);
                if may_end && memory.is_complete() {
                    board.set_course(Course::Finished);
                }
            }
        });
        let listener = TcpListener::bind((Ipv4Addr::UNSPECIFIED, PORT)).await?;
        let (sender, accepted) = mpsc::channel(16);
        tokio::spawn(async move {
            while let Ok((stream, _)) = listener.accept().await {
                if sender
                    .send(Ok::<_, std::io::Error>(AcceptedConnection(stream)))
                    .await
                    .is_err()
                {
                    return;
                }
            }
        });
        Server::builder()
            .add_service(CampaignServer::new(service))
            .serve_with_incoming(ReceiverStream::new(accepted))
            .await?;
        Ok(())
    }
}

fn link() -> Link {
    Link::local(Dial::new(|| TcpStream::connect(("coordinator", PORT))))
}

fn options(host: &str) -> Options {
    Options {
        slots: 1,
        exec: None,
        host: host.to_owned(),
        connect_timeout: Duration::from_secs(600),
        give_up_after: Duration::from_secs(600),
        undelivered: None,
        journal: None,
        grace: Duration::from_secs(1),
        max_runtime: None,
        idle_exit: None,
    }
}

fn simulation(seed: u64) -> Builder {
    let mut builder = Builder::new();
    builder
        .rng_seed(seed)
        .tick_duration(Duration::from_millis(5))
        .simulation_duration(Duration::from_secs(100_000))
        .tcp_capacity(4096);
    builder
}

fn start_coordinator(sim: &mut Sim<'_>, world: &World) {
    let world = world.clone();
    sim.host("coordinator", move || world.clone().serve());
}

fn start_workers(sim: &mut Sim<'_>) {
    for name in WORKERS {
        sim.client(name, async move {
            let summary = Worker::new(link(), options(name))
                .run(CancellationToken::new())
                .await?;
            assert!(summary.finished, "{name} left before the end");
            Ok(())
        });
    }
}

/// Runs until every worker has left. Calls `trouble` as soon as both workers are present and
/// `repair` after `lasting`.
fn run(
    mut sim: Sim<'_>,
    world: &World,
    lasting: Duration,
    trouble: impl Fn(&mut Sim<'_>),
    repair: impl Fn(&mut Sim<'_>),
) {
    let all_there = || {
        world
            .board()
            .is_some_and(|board| board.live().workers.len() == 2)
    };
    while !all_there() {
        assert!(!sim.step().unwrap(), "it ended before it began");
    }
    trouble(&mut sim);
    let until = sim.elapsed() + lasting;
    let mut ended = false;
    while sim.elapsed() < until && !ended {
        ended = sim.step().unwrap();
    }
    repair(&mut sim);
    while !ended {
        ended = sim.step().unwrap();
    }
    // No worker crashes, so silence may cost work but quarantines nothing.
    let crashes = world.crashes.lock().unwrap_or_else(PoisonError::into_inner);
    assert!(
        !crashes.iter().any(|crash| crash.quarantined),
        "{crashes:?}"
    );
    assert!(lasting > LEASE || crashes.is_empty(), "{crashes:?}");
    let board = world.board().expect("it ran");
    assert!(board.quarantined().is_empty());
    world.memory.with(|stored| {
        assert_eq!(stored.conflicts, 0);
        assert_eq!(stored.failures, []);
        assert!(
            stored.samples == expected(&world.problem),
            "other samples than undisturbed"
        );
    });
}

/// Longer than a lease and longer than the time limit of a call.
const LONG: Duration = Duration::from_secs(40);

#[test]
fn an_undisturbed_network_loses_nothing() {
    let world = World::new();
    let mut sim = simulation(1).build();
    start_coordinator(&mut sim, &world);
    start_workers(&mut sim);
    run(sim, &world, Duration::ZERO, |_| {}, |_| {});
}

#[test]
fn a_partition_loses_nothing() {
    let world = World::new();
    let mut sim = simulation(2).build();
    start_coordinator(&mut sim, &world);
    start_workers(&mut sim);
    let memory = world.memory.clone();
    let repair = |sim: &mut Sim<'_>| {
        assert!(!memory.is_complete(), "nobody was cut off");
        for worker in WORKERS {
            sim.repair(worker, "coordinator");
        }
    };
    let trouble = |sim: &mut Sim<'_>| {
        for worker in WORKERS {
            sim.partition(worker, "coordinator");
        }
    };
    run(sim, &world, LONG, trouble, repair);
}

#[test]
fn a_partition_one_way_loses_nothing() {
    for (seed, to_coordinator) in [(3, true), (4, false)] {
        let world = World::new();
        let mut sim = simulation(seed).build();
        start_coordinator(&mut sim, &world);
        start_workers(&mut sim);
        let way = |worker| {
            if to_coordinator {
                (worker, "coordinator")
            } else {
                ("coordinator", worker)
            }
        };
        let trouble = |sim: &mut Sim<'_>| {
            for (from, to) in WORKERS.map(way) {
                sim.partition_oneway(from, to);
            }
        };
        let repair = |sim: &mut Sim<'_>| {
            for (from, to) in WORKERS.map(way) {
                sim.repair_oneway(from, to);
            }
        };
        run(sim, &world, LONG, trouble, repair);
    }
}

#[test]
fn a_delay_beyond_the_lease_loses_nothing() {
    let world = World::new();
    let mut sim = simulation(5).build();
    start_coordinator(&mut sim, &world);
    start_workers(&mut sim);
    let trouble = |sim: &mut Sim<'_>| {
        for worker in WORKERS {
            sim.hold(worker, "coordinator");
        }
    };
    let repair = |sim: &mut Sim<'_>| {
        for worker in WORKERS {
            sim.release(worker, "coordinator");
        }
    };
    run(sim, &world, 2 * LEASE, trouble, repair);
}

#[test]
fn a_slow_network_loses_nothing() {
    let world = World::new();
    let mut sim = simulation(6)
        .min_message_latency(Duration::from_millis(200))
        .max_message_latency(Duration::from_millis(2000))
        .build();
    start_coordinator(&mut sim, &world);
    start_workers(&mut sim);
    run(sim, &world, Duration::ZERO, |_| {}, |_| {});
}

/// The coordinator is restarted without closing its connections: the workers' ends stay open.
#[test]
fn connections_half_open_after_a_restart_lose_nothing() {
    let world = World::new();
    let mut sim = simulation(7).build();
    start_coordinator(&mut sim, &world);
    start_workers(&mut sim);
    let trouble = |sim: &mut Sim<'_>| {
        for worker in WORKERS {
            sim.partition(worker, "coordinator");
        }
        sim.bounce("coordinator");
    };
    let repair = |sim: &mut Sim<'_>| {
        for worker in WORKERS {
            sim.repair(worker, "coordinator");
        }
    };
    run(sim, &world, LEASE, trouble, repair);
    assert_eq!(world.epoch.load(Ordering::SeqCst), 2);
}

#[test]
fn a_coordinator_that_is_away_for_a_while_loses_nothing() {
    let world = World::new();
    let mut sim = simulation(8).build();
    start_coordinator(&mut sim, &world);
    start_workers(&mut sim);
    let crash = |sim: &mut Sim<'_>| sim.crash("coordinator");
    let bounce = |sim: &mut Sim<'_>| sim.bounce("coordinator");
    run(sim, &world, LONG, crash, bounce);
}

/// A worker whose every call arrives twice, over two connections and thus in either order, and some
/// of whose calls arrive once more when they are out of date.
async fn stutter(problem: Arc<Problem>) -> turmoil::Result {
    let links = (link(), link());
    let (one, two) = (&links.0, &links.1);
    macro_rules! twice {
        ($method:ident, $request:expr) => {{
            let request = $request;
            let (mut one, mut two) = (one.client(), two.client());
            let (first, second) = tokio::join!(one.$method(request.clone()), two.$method(request));
            (first?.into_inner(), second?.into_inner())
        }};
    }
    let worker_id = "stutterer".to_owned();
    twice!(register, introduction(&worker_id));
    let mut past: Vec<ReportRequest> = Vec::new();
    loop {
        let request = LeaseRequest {
            worker_id: worker_id.clone(),
            credit: 1,
            seconds: 1.0,
            wait_ms: 500,
        };
        let (first, second) = twice!(lease, request);
        if [&first, &second]
            .iter()
            .any(|answer| answer.directive() == Directive::Finished)
        {
            return Ok(());
        }
        let leases: Vec<Lease> = first.leases.into_iter().chain(second.leases).collect();
        let held = leases.iter().map(|lease| LeaseState {
            id: lease.id,
            started: true,
        });
        let heartbeat = HeartbeatRequest {
            worker_id: worker_id.clone(),
            held: held.collect(),
        };
        twice!(heartbeat, heartbeat.clone());
        let mut results = Vec::new();
        for lease in &leases {
            let units = lease.units().map_err(|why| why.to_string())?;
            let of_units = units.iter().map(|(unit, source)| {
                let output = compute(&*problem, unit, source);
                runner::protocol::result(unit, &output.map(Some), 0.1)
            });
            results.push(LeaseResult {
                id: lease.id,
                results: of_units.collect(),
                wall_seconds: 1.0,
                origin: None,
            });
        }
        let report = ReportRequest {
            worker_id: worker_id.clone(),
            results,
        };
        // One of two simultaneous reports is deferred and sent again.
        let (mut first, mut second) = (one.client(), two.client());
        let twice = tokio::join!(first.report(report.clone()), second.report(report.clone()));
        for answer in [twice.0, twice.1] {
            if let Err(status) = answer {
                assert_eq!(status.code(), tonic::Code::Unavailable);
            }
        }
        first.report(report.clone()).await?;
        // All three are out of date by now.
        twice!(heartbeat, heartbeat);
        let release = ReleaseRequest {
            worker_id: worker_id.clone(),
            leases: leases.iter().filter_map(|lease| lease.id).collect(),
            leaving: false,
        };
        twice!(release, release);
        if let Some(old) = past.first() {
            one.client().report(old.clone()).await?;
        }
        past.push(report);
    }
}

#[test]
fn calls_that_come_twice_and_in_another_order_change_nothing() {
    for seed in 10..13 {
        let world = World::new();
        let mut sim = simulation(seed).build();
        start_coordinator(&mut sim, &world);
        sim.client("stutterer", stutter(Arc::clone(&world.problem)));
        sim.run().unwrap();
        world.memory.with(|stored| {
            assert_eq!(stored.conflicts, 0);
            assert_eq!(stored.failures, []);
            assert!(stored.duplicates > 0, "nothing came twice");
            assert!(stored.samples == expected(&world.problem));
        });
        let counts = world.board().expect("it ran").live().counts;
        assert_eq!((counts.free, counts.leased, counts.quarantined), (0, 0, 0));
    }
}

#[test]
fn a_thousand_workers_that_register_at_once_are_all_served() {
    const CROWD: usize = 1000;
    let world = World {
        may_end: false,
        ..World::new()
    };
    let mut sim = simulation(20).build();
    start_coordinator(&mut sim, &world);
    sim.client("crowd", async move {
        let mut crowd = tokio::task::JoinSet::new();
        for index in 0..CROWD {
            crowd.spawn(async move {
                let link = link();
                let worker_id = format!("worker {index}");
                let registered = link.client().register(introduction(&worker_id)).await?;
                let heartbeat = HeartbeatRequest {
                    worker_id,
                    held: Vec::new(),
                };
                let answer = link.client().heartbeat(heartbeat).await?.into_inner();
                assert_eq!(answer.directive(), Directive::Continue);
                Ok::<u64, tonic::Status>(registered.into_inner().epoch)
            });
        }
        while let Some(served) = crowd.join_next().await {
            assert_eq!(served??, 1);
        }
        Ok(())
    });
    sim.run().unwrap();
    assert_eq!(world.board().expect("it ran").live().workers.len(), CROWD);
}
