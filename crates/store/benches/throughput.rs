//! Measures how fast the store writes and reads samples: `cargo bench -p store --bench
//! throughput -- [DESIGNS] [SAMPLES] [FILE]`. A relative FILE is in this package's folder.
//!
//! First four callers submit batches of whole designs, as four busy workers would. Then two callers, each with 256
//! submissions in flight, submit one-row batches, as no-op jobs would: first all of one design, then each of another.
//! The reads of a status page and of a restart are timed last. An existing file is not filled again.

#![expect(clippy::disallowed_methods, reason = "it measures time")]
#![expect(clippy::print_stdout, reason = "a program for the command line")]

use std::collections::BTreeMap;
use std::future::Future;
use std::path::Path;
use std::time::{Duration, Instant};

use ledger::StreamId;
use rustix::time::{ClockId, clock_gettime};
use store::{
    Batch, CampaignRow, CriteriaRow, DesignRow, Error, FailureKind, FailureRow, JobTimeRow,
    SampleBlock, Store,
};

type Failure = Box<dyn std::error::Error>;

/// Number of samples in a large batch, all of one design if it has that many.
const LARGE_BATCH: u64 = 5000;
const SMALL_BATCHES: u64 = 100_000;
const CALLERS: u64 = 2;
const IN_FLIGHT: u64 = 256;

#[tokio::main]
async fn main() -> Result<(), Failure> {
    // `cargo bench` adds the argument `--bench`.
    let mut arguments = std::env::args().skip(1).filter(|text| text != "--bench");
    let designs: u64 = arguments.next().map_or(Ok(1000), |a| a.parse())?;
    let samples: u64 = arguments.next().map_or(Ok(500), |a| a.parse())?;
    let path = arguments
        .next()
        .map_or_else(|| std::env::temp_dir().join("throughput.db"), Into::into);
    let campaign = CampaignRow {
        name: "throughput".into(),
        file_text: String::new(),
        digest: format!("{designs} {samples}"),
        seed: 0,
        program_version: env!("CARGO_PKG_VERSION").into(),
        model_digest: None,
    };
    if !path.try_exists()? {
        fill(&path, &campaign, designs, samples).await?;
    }
    read(&path, &campaign, samples).await
}

async fn fill(
    path: &Path,
    campaign: &CampaignRow,
    designs: u64,
    samples: u64,
) -> Result<(), Failure> {
    let store = Store::create_or_open(path, campaign).await?;
    // The last design gets the one-row batches.
    let rows: Vec<DesignRow> = (0..=designs).map(design).collect();
    let doing = format!("{designs} designs stored");
    timed(&doing, designs, store.put_designs(&rows)).await?;

    let together = (LARGE_BATCH / samples.max(1)).max(1);
    let mut callers = tokio::task::JoinSet::new();
    for caller in 0..4 {
        let writer = store.writer()?;
        callers.spawn(async move {
            for first in (0..designs)
                .step_by(together as usize)
                .skip(caller)
                .step_by(4)
            {
                let of = first..designs.min(first + together);
                let blocks = of.clone().map(|design| SampleBlock {
                    stream: StreamId::design(design as u32),
                    first_sample: 0,
                    samples: (0..samples)
                        .map(|i| 1.0 / (i + 1) as f64)
                        .collect::<Vec<f64>>()
                        .into(),
                });
                let batch = Batch {
                    samples: blocks.collect(),
                    criteria: of.map(criteria).collect(),
                    ..Batch::default()
                };
                writer.submit(batch).await?;
            }
            Ok::<(), Error>(())
        });
    }
    let doing = format!("{} samples stored in large batches", designs * samples);
    timed(&doing, designs * samples, joined(callers)).await?;

    let one_sample = |i| Batch {
        samples: vec![SampleBlock {
            stream: StreamId::design(designs as u32),
            first_sample: i,
            samples: vec![1.0].into(),
        }],
        ..Batch::default()
    };
    let one_time = |i| Batch {
        times: vec![JobTimeRow {
            stream: StreamId::design(0),
            part: i,
            cpu_seconds: 0.0,
        }],
        ..Batch::default()
    };
    let both = |i| Batch {
        times: one_time(SMALL_BATCHES + i).times,
        ..one_sample(SMALL_BATCHES + i)
    };
    small(&store, "batches of one sample", one_sample).await?;
    small(&store, "batches of one job time", one_time).await?;
    small(&store, "batches of one sample and one job time", both).await?;
    // Each batch belongs to another design, like the jobs of a DoE that end out of order.
    let apart = |i| Batch {
        samples: vec![SampleBlock {
            stream: StreamId::design((i % designs) as u32),
            first_sample: samples + i / designs,
            samples: vec![1.0].into(),
        }],
        times: one_time(2 * SMALL_BATCHES + i).times,
        ..Batch::default()
    };
    small(&store, "the same, each of another design", apart).await?;

    let failures = (0..10_000_u32).map(|i| FailureRow {
        stream: StreamId::design(i),
        sample: None,
        shared: false,
        lease: 1,
        worker: format!("worker-{}", i % 100),
        serial: None,
        kind: FailureKind::Failure,
        error: format!(
            "cause {}: no load path in sample {i}",
            ["a", "b", "c"][i as usize % 3]
        ),
        at_unix_ms: None,
    });
    let batch = Batch {
        failures: failures.collect(),
        ..Batch::default()
    };
    timed(
        "10000 failures stored",
        10_000,
        store.writer()?.submit(batch),
    )
    .await?;
    timed("closed", 0, store.close()).await?;
    Ok(())
}

/// Keeps many submissions in flight, each of one small batch.
async fn small(store: &Store, what: &str, batch: impl Fn(u64) -> Batch) -> Result<(), Failure> {
    let slots = CALLERS * IN_FLIGHT;
    let mut callers = tokio::task::JoinSet::new();
    for slot in 0..slots {
        let writer = store.writer()?;
        let batches: Vec<Batch> = (slot..SMALL_BATCHES)
            .step_by(slots as usize)
            .map(&batch)
            .collect();
        callers.spawn(async move {
            for batch in batches {
                writer.submit(batch).await?;
            }
            Ok::<(), Error>(())
        });
    }
    let doing = format!("{SMALL_BATCHES} {what}");
    timed(&doing, SMALL_BATCHES, joined(callers)).await
}

async fn read(path: &Path, campaign: &CampaignRow, samples: u64) -> Result<(), Failure> {
    let store = timed("opened for reading", 0, Store::open_read_only(path)).await?;
    for _ in 0..2 {
        let status = async {
            let progress = store.progress().await?;
            let groups = store.failure_groups().await?;
            Ok((progress, store.samples_digest().await?, groups.len()))
        };
        let (progress, digest, groups) = timed("status", 0, status).await?;
        println!("  {progress:?}\n  digest {digest}, {groups} groups of failures");
    }
    timed("sampled counts", 0, store.sampled_counts()).await?;
    timed("closed", 0, store.close()).await?;

    let store = timed("opened", 0, Store::create_or_open(path, campaign)).await?;
    let none = BTreeMap::new();
    let missing = timed("missing work", 0, store.missing_work(samples, &none)).await?;
    println!("  of {} designs", missing.len());
    let missing = timed("missing work of one sample more", 0, async {
        store.missing_work(samples + 1, &none).await
    });
    println!("  of {} designs", missing.await?.len());
    timed("the file checked", 0, store.checked()).await?;
    let visit = store.visit_samples(|_| Ok::<(), Error>(()));
    timed(
        "all samples visited and compared with their digests",
        0,
        visit,
    )
    .await?;
    timed("closed", 0, store.close()).await?;
    Ok(())
}

fn design(design: u64) -> DesignRow {
    DesignRow::new(design, [0.0, 0.0, 1.0, 1.0, 1.0, 1.0])
}

fn criteria(design: u64) -> CriteriaRow {
    CriteriaRow {
        design,
        simulable: true,
        responses: Some(vec![2.25, 1.5, 1100.0]),
        ..CriteriaRow::default()
    }
}

async fn joined(mut callers: tokio::task::JoinSet<Result<(), Error>>) -> Result<(), Error> {
    while let Some(caller) = callers.join_next().await {
        match caller {
            Ok(ended) => ended?,
            Err(panic) => std::panic::resume_unwind(panic.into_panic()),
        }
    }
    Ok(())
}

/// Runs a piece of work and prints how long it took, in total and per item of `count`.
async fn timed<T>(
    doing: &str,
    count: u64,
    work: impl Future<Output = Result<T, Error>>,
) -> Result<T, Failure> {
    let (wall, cpu) = (Instant::now(), cpu_time());
    let result = work.await?;
    let (wall, cpu) = (wall.elapsed(), cpu_time() - cpu);
    print!("{doing}: {wall:.2?}, {cpu:.2?} of processor time");
    if count > 0 {
        print!(
            " ({:.0} a second, {:.2} us of processor time each)",
            count as f64 / wall.as_secs_f64(),
            cpu.as_secs_f64() * 1e6 / count as f64
        );
    }
    println!();
    Ok(result)
}

/// Processor time of all threads of this process.
fn cpu_time() -> Duration {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    Duration::new(time.tv_sec as u64, time.tv_nsec as u32)
}
