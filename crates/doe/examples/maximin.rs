//! Prints a maximin Latin hypercube as CSV, and its measures to the standard error stream.
//!
//! `cargo run --release -p doe --example maximin -- 100 6 1 > design.csv`
//!
//! A fourth argument is the effort (1 by default), a fifth the kind of design (`maximin`, `random`,
//! `sobol`).

#![expect(clippy::disallowed_methods, reason = "it measures time")]
#![expect(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "an example's output is its purpose"
)]

use std::process::ExitCode;
use std::time::Instant;

use doe::{Design, Method, Options};

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match run(&arguments) {
        Ok((design, seconds)) => {
            for i in 0..design.n {
                let row: Vec<String> = design.point(i).iter().map(ToString::to_string).collect();
                println!("{}", row.join(","));
            }
            let discrepancy = design.centred_discrepancy();
            eprintln!(
                "min distance {:.4}, centred discrepancy {discrepancy:.5}, Latin {}, {seconds:.2} s",
                design.min_distance(),
                design.is_latin(),
            );
            ExitCode::SUCCESS
        }
        Err(message) => {
            eprintln!("{message}");
            ExitCode::from(2)
        }
    }
}

fn run(arguments: &[String]) -> Result<(Design, f64), String> {
    let usage = "arguments: POINTS VARIABLES SEED [EFFORT [METHOD]]";
    let (n, d, seed, effort, method) = match arguments {
        [n, d, seed] => (n, d, seed, "1", "maximin"),
        [n, d, seed, effort] => (n, d, seed, effort.as_str(), "maximin"),
        [n, d, seed, effort, method] => (n, d, seed, effort.as_str(), method.as_str()),
        _ => return Err(usage.into()),
    };
    let options = Options {
        seed: seed.parse().map_err(|e| format!("seed {seed}: {e}"))?,
        effort: effort
            .parse()
            .map_err(|e| format!("effort {effort}: {e}"))?,
    };
    let n = n.parse().map_err(|e| format!("points {n}: {e}"))?;
    let d = d.parse().map_err(|e| format!("variables {d}: {e}"))?;
    let start = Instant::now();
    let mut methods = Method::ALL.into_iter();
    let method = methods
        .find(|one| one.to_string() == method)
        .ok_or_else(|| format!("no design is called {method}"))?;
    let design = method.design(n, d, &options).map_err(|e| e.to_string())?;
    Ok((design, start.elapsed().as_secs_f64()))
}
