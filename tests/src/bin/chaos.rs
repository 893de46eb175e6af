//! Runs small real campaigns with random faults and checks that nothing is lost.
//!
//! `cargo run --release -p acceptance --bin chaos -- --rounds 200 --seed 1`

#![expect(clippy::disallowed_methods, reason = "rounds are timed")]
#![expect(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "a command's output is its purpose"
)]

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use acceptance::chaos::{Kind, Soak, Violation};
use clap::Parser;

/// Runs small campaigns again and again while their processes are killed, stopped, restarted, drained
/// and cut off at random, their external simulators fail and their optima are chosen anew. Checks
/// after every round that no acknowledged sample was lost, none is there twice, progress never went
/// back, and the results are those of an undisturbed run.
#[derive(Debug, Parser)]
struct Arguments {
    /// How many rounds
    #[arg(long, value_name = "N", default_value_t = 20)]
    rounds: u64,
    /// Seed of the faults and their times
    #[arg(long, value_name = "S", default_value_t = 1)]
    seed: u64,
    /// The first round, to run one of them again
    #[arg(long, value_name = "N", default_value_t = 0)]
    first: u64,
    /// The kind of campaign of every round: plain, precise, enriched, grown, external, licence,
    /// problem, files, sharded, alone
    /// [default: drawn]
    #[arg(long, value_name = "KIND", value_parser = kind)]
    kind: Option<Kind>,
    /// Keep the folders of all rounds
    #[arg(long)]
    keep: bool,
    /// The folder of the programs `coordinator` and `worker` [default: build them]
    #[arg(long, value_name = "DIR")]
    programs: Option<PathBuf>,
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    match run(&arguments) {
        Ok(0) => ExitCode::SUCCESS,
        Ok(_) => ExitCode::FAILURE,
        Err(violation) => {
            eprintln!("error: {violation}");
            ExitCode::FAILURE
        }
    }
}

fn kind(name: &str) -> Result<Kind, String> {
    let found = Kind::ALL.into_iter().find(|kind| kind.name() == name);
    found.ok_or_else(|| format!("no kind of campaign is called {name:?}"))
}

/// Totals of the rounds of one kind.
#[derive(Debug, Default)]
struct Count {
    rounds: usize,
    acts: usize,
    stale: usize,
    seconds: f64,
}

fn run(arguments: &Arguments) -> Result<u64, Violation> {
    let programs = arguments.programs.clone();
    let programs = programs.unwrap_or_else(acceptance::programs);
    // They are started in other folders.
    let programs = std::path::absolute(programs).expect("a path that is not empty");
    let sandbox = tempfile::tempdir().expect("a temporary folder");
    let folder = sandbox.keep();
    let since = Instant::now();
    let soak = Soak::new(&folder, &programs, arguments.seed)?.keeping(arguments.keep);
    let mut broken = 0;
    let mut counts: BTreeMap<Kind, Count> = BTreeMap::new();
    for round in arguments.first..arguments.first + arguments.rounds {
        let since = Instant::now();
        match soak.round(round, arguments.kind) {
            Ok(done) => {
                let count = counts.entry(done.kind).or_default();
                count.rounds += 1;
                count.acts += done.acts;
                count.stale += done.stale;
                count.seconds += done.time.as_secs_f64();
                println!(
                    "round {round}: ok, {}, {} acts, {} looks, {} views, {} stale results, campaign {:.1} s, \
                     {:.1} s in all",
                    done.kind.name(),
                    done.acts,
                    done.looks,
                    done.visits,
                    done.stale,
                    done.time.as_secs_f64(),
                    since.elapsed().as_secs_f64()
                );
            }
            Err(violation) => {
                broken += 1;
                let folder = folder.display();
                println!("round {round}: BROKEN, see {folder}/round-{round}: {violation}");
            }
        }
    }
    for (kind, count) in &counts {
        println!(
            "{}: {} rounds, {} acts, {} stale results, {:.1} s a campaign",
            kind.name(),
            count.rounds,
            count.acts,
            count.stale,
            count.seconds / count.rounds as f64
        );
    }
    let acts: usize = counts.values().map(|count| count.acts).sum();
    println!(
        "{} rounds, {acts} acts, {broken} broken promises, {:.0} s",
        arguments.rounds,
        since.elapsed().as_secs_f64()
    );
    if arguments.keep {
        println!("see {}", folder.display());
    } else if broken == 0 {
        let _ = std::fs::remove_dir_all(&folder);
    }
    Ok(broken)
}
