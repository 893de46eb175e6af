//! Soaks a small real campaign in random faults and checks that nothing is lost.
//!
//! `cargo run --release -p acceptance --bin chaos -- --rounds 200 --seed 1`

#![expect(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "a command's output is its purpose"
)]

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use acceptance::chaos::{Soak, Violation};
use clap::Parser;

/// Runs a small campaign again and again while its processes are killed, stopped, restarted and cut
/// off at random, and checks after every round that no acknowledged sample was lost, none is there
/// twice, progress never went back, and the results are those of an undisturbed run.
#[derive(Debug, Parser)]
struct Arguments {
    /// How many rounds
    #[arg(long, value_name = "N", default_value_t = 20)]
    rounds: u64,
    /// What goes wrong, and when, follows from it
    #[arg(long, value_name = "S", default_value_t = 1)]
    seed: u64,
    /// The first round, to run one of them again
    #[arg(long, value_name = "N", default_value_t = 0)]
    first: u64,
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

fn run(arguments: &Arguments) -> Result<u64, Violation> {
    let programs = arguments.programs.clone();
    let programs = programs.unwrap_or_else(acceptance::programs);
    let sandbox = tempfile::tempdir().expect("a temporary folder");
    let folder = sandbox.keep();
    let since = Instant::now();
    let soak = Soak::new(&folder, &programs, arguments.seed)?;
    println!(
        "undisturbed run done in {:.1} s",
        since.elapsed().as_secs_f64()
    );
    let (mut broken, mut acts) = (0, 0);
    for round in arguments.first..arguments.first + arguments.rounds {
        let since = Instant::now();
        match soak.round(round) {
            Ok(done) => {
                acts += done.acts;
                println!(
                    "round {round}: ok, {} acts, {} looks, campaign {:.1} s, {:.1} s in all",
                    done.acts,
                    done.looks,
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
    println!(
        "{} rounds, {acts} acts, {broken} broken promises, {:.0} s",
        arguments.rounds,
        since.elapsed().as_secs_f64()
    );
    if broken == 0 {
        let _ = std::fs::remove_dir_all(&folder);
    }
    Ok(broken)
}
