//! The cost of a sample over gRPC and into the store, against its cost in one process.

use std::sync::Arc;
use std::time::Duration;

use ledger::{Generation, Grant, LeaseId, StreamId, Unit};
use problem::file::SimulatorKind;
use problem::formulation::Problem;
use problem::task::{Inputs, Source, compute};
use problem::{Campaign, probe};
use prost::Message as _;
use runner::coordinator::board::Course;
use runner::protocol::v1::LeaseResult;
use store::DesignRow;

use crate::{Process, campaign, cpu, cpu_parts, served, slow};

/// Number of measurements of both ways, in turn.
const ROUNDS: usize = 7;

const PER_DESIGN: usize = 30;

/// Simulable designs, spread over the paper's box.
fn designs(problem: &Problem, count: usize) -> Vec<Vec<f64>> {
    use rand::RngExt as _;
    use stats::streams::{Purpose, stream};
    let mut rng = stream(1, Purpose::Test, 0, 0);
    let mut designs = Vec::new();
    while designs.len() < count {
        let unit: [f64; 6] = std::array::from_fn(|_| rng.random());
        let x = problem.free_point(&unit);
        let variables = problem.design(&x, problem.base());
        if problem
            .gears()
            .is_some_and(|gears| gears.pair(&variables).is_ok())
        {
            designs.push(x);
        }
    }
    designs
}

pub(super) async fn measure(samples: usize) -> anyhow::Result<()> {
    let built_in = campaign((samples / PER_DESIGN) as u32, PER_DESIGN as u32)?;
    let problem = Problem::new(built_in.clone());
    let points = designs(&problem, samples / PER_DESIGN);
    let digest = Some(probe::model_digest(&problem));
    // The first time warms up.
    alone(&problem, &points);
    let mut rounds = Vec::new();
    for _ in 0..ROUNDS {
        let before = cpu();
        alone(&problem, &points);
        let alone = cpu() - before;
        rounds.push((
            alone,
            over_grpc(&built_in, &points, digest.clone(), None).await?,
        ));
    }
    tell("built-in simulator", samples, rounds);
    println!(
        "{:.1} bytes of messages per sample, leases and results",
        bytes(&problem, &points) as f64 / samples as f64
    );

    let exe = std::env::current_exe()?;
    let command = format!("exec {} simulate", exe.display());
    let slow = samples / 3;
    let mut external = campaign((slow / PER_DESIGN) as u32, PER_DESIGN as u32)?;
    external.simulator.kind = SimulatorKind::External;
    external.simulator.probe_designs = Some(0);
    let points = &points[..slow / PER_DESIGN];
    // Two slots that call the program directly, without coordinator and store.
    let before = cpu();
    std::thread::scope(|scope| {
        let halves = points.chunks(points.len().div_ceil(2));
        let slots: Vec<_> = halves
            .map(|half| scope.spawn(|| slow::ask(&exe, half.len(), PER_DESIGN)))
            .collect();
        slots
            .into_iter()
            .try_for_each(|slot| slot.join().expect("a slot does not panic"))
    })?;
    let alone = cpu() - before;
    let spread = over_grpc(&external, points, None, Some(&command)).await?;
    tell(
        "a simulator of 1 ms per sample",
        slow,
        vec![(alone, spread)],
    );
    Ok(())
}

/// Computes the samples of all points in this process, on two threads, because the workers have two
/// processors.
fn alone(problem: &Problem, points: &[Vec<f64>]) {
    std::thread::scope(|scope| {
        for half in points.chunks(points.len().div_ceil(2)) {
            scope.spawn(move || {
                for (design, x) in (0..).zip(half) {
                    let unit = Unit {
                        stream: StreamId::design(design),
                        generation: Generation::default(),
                        samples: 0..PER_DESIGN as u32,
                    };
                    let variables = problem.design(x, problem.base());
                    let source = Source::Design(variables);
                    let _ = std::hint::black_box(compute(problem, &unit, &source));
                }
            });
        }
    });
}

/// Size of the leases and results of all points as messages, in bytes.
fn bytes(problem: &Problem, points: &[Vec<f64>]) -> usize {
    let inputs = Inputs::new(problem.campaign(), None);
    let unit = |(design, x): (u32, &Vec<f64>)| {
        let source = Source::Design(problem.design(x, problem.base()));
        let stream = StreamId::design(design);
        let unit = Unit {
            stream,
            generation: inputs.generation(stream, &source),
            samples: 0..PER_DESIGN as u32,
        };
        (unit, Arc::new(source))
    };
    let units: Vec<(Unit, Arc<Source>)> = (0..).zip(points).map(unit).collect();
    let results = units.iter().map(|(unit, source)| {
        let output = compute(problem, unit, source);
        runner::protocol::result(unit, &output.map(Some), 1e-3)
    });
    let result = LeaseResult {
        results: results.collect(),
        ..LeaseResult::default()
    };
    let grant = Grant {
        lease: LeaseId {
            epoch: 1,
            number: 1,
        },
        units,
        seconds: 1.0,
        is_control: false,
    };
    runner::protocol::lease(&grant).encoded_len() + result.encoded_len()
}

/// CPU time of a campaign's samples with two workers, including their start and the coordinator's.
async fn over_grpc(
    campaign: &Campaign,
    points: &[Vec<f64>],
    digest: Option<String>,
    exec: Option<&str>,
) -> anyhow::Result<[f64; 2]> {
    let before = cpu_parts();
    let served = served(campaign, digest, true).await?;
    let rows: Vec<DesignRow> = (0..)
        .zip(points)
        .map(|(design, x)| DesignRow::new(design, x.clone()))
        .collect();
    served.store.put_designs(&rows).await?;
    let problem = Problem::new(campaign.clone());
    let inputs = Inputs::new(campaign, None);
    let wanted = (0..).zip(points).map(|(design, x)| {
        let source = Source::Design(problem.design(x, problem.base()));
        let samples = campaign.sampling.samples_per_design;
        inputs.wanted(StreamId::design(design), source, samples)
    });
    served.board.want(wanted.collect());
    served.board.open();
    let mut arguments = vec!["worker", &served.access];
    arguments.extend(exec);
    let workers = [Process::start(&arguments)?, Process::start(&arguments)?];
    let wanted = points.len() as u64 * u64::from(campaign.sampling.samples_per_design);
    while served.store.progress().await?.samples < wanted {
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
    served.board.set_course(Course::Finished);
    for worker in workers {
        worker.wait()?;
    }
    served.stop.cancel();
    served.store.close().await?;
    let after = cpu_parts();
    Ok([after[0] - before[0], after[1] - before[1]])
}

/// Prints the round of the median ratio and the range of the ratios.
fn tell(what: &str, samples: usize, mut rounds: Vec<(f64, [f64; 2])>) {
    let more = |(alone, [coordinator, workers]): &(f64, [f64; 2])| {
        100.0 * ((coordinator + workers) / alone - 1.0)
    };
    rounds.sort_by(|a, b| more(a).total_cmp(&more(b)));
    let (alone, [coordinator, workers]) = rounds[rounds.len() / 2];
    let micros = |seconds: f64| 1e6 * seconds / samples as f64;
    println!(
        "{what}: {samples} samples, {:.1} µs each in one process; over gRPC {:.1} µs in the workers \
         and {:.1} µs in the coordinator and its store: {:+.1} % CPU time",
        micros(alone),
        micros(workers),
        micros(coordinator),
        more(&rounds[rounds.len() / 2]),
    );
    if let [first, .., last] = rounds.as_slice() {
        println!(
            "the median of {} rounds from {:+.1} to {:+.1} %",
            rounds.len(),
            more(first),
            more(last)
        );
    }
}
