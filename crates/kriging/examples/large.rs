//! A model of many points: time, accuracy and memory.
//!
//! `cargo run --release -p kriging --example large -- [POINTS]` (100 000)
//!
//! The six-dimensional Hartmann function on 2…40 with noise of a standard deviation of 0.10 to 0.16 at
//! random points, by [`kriging::fit_vecchia`] with its default options. The error is the root mean
//! square one of the mean against the truth at 2000 other points.

#![expect(clippy::disallowed_methods, reason = "it measures time")]
#![expect(clippy::print_stdout, reason = "an example's output is its purpose")]

mod common;

use std::error::Error;
use std::time::Instant;

use kriging::{VecchiaOptions, fit_vecchia};
use rand::RngExt as _;
use stats::streams::{Purpose, stream};

use common::{D, NoisyHart6, hart6, processor_seconds};

const TESTS: usize = 2000;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let n: usize = arguments.next().map_or(Ok(100_000), |text| text.parse())?;
    let options = VecchiaOptions::default();
    let mut rng = stream(7, Purpose::Test, n as u64, 0);
    let sample = NoisyHart6::draw(n, &mut rng);
    let test: Vec<f64> = (0..TESTS * D).map(|_| rng.random()).collect();

    let (began, before) = (Instant::now(), processor_seconds());
    let model = fit_vecchia(&sample.data(), &options)?;
    println!(
        "n = {n}, d = {D}: fit in {:.1} s, {:.1} s of processor time, nll {:.1}",
        began.elapsed().as_secs_f64(),
        processor_seconds() - before,
        model.negative_log_likelihood()
    );
    let before = processor_seconds();
    let predictions = model.predict_many(&test)?;
    println!(
        "{TESTS} predictions with variance in {:.2} s of processor time",
        processor_seconds() - before
    );
    let pairs = predictions.iter().zip(test.chunks_exact(D));
    let squares: f64 = pairs.map(|(p, x)| (p.mean - hart6(x)).powi(2)).sum();
    println!("rmse {:.4}", (squares / TESTS as f64).sqrt());
    // The largest resident set so far, from the process's status (proc(5)).
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let peak = status.lines().find(|line| line.starts_with("VmHWM"));
    println!("{}", peak.unwrap_or("peak memory unknown"));
    Ok(())
}
