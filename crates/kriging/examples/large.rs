//! A model of many points: time, accuracy, coverage and memory.
//!
//! `cargo run --release -p kriging --example large -- [POINTS [exact|smooth]]` (100 000)
//!
//! The six-dimensional Hartmann function on 2…40 with noise of a standard deviation of 0.10 to 0.16 at random points,
//! by [`kriging::fit_vecchia`] with its default options, or by [`kriging::fit()`] from all points; or, as `smooth`, sin
//! 5a cos 3b without noise, from all points. The error is the root mean square error of the mean against the truth at
//! 2000 other points, and the coverage that of 90 % intervals of the truth there.

#![expect(clippy::disallowed_methods, reason = "it measures time")]
#![expect(clippy::print_stdout, reason = "an example's output is its purpose")]

mod common;

use std::error::Error;
use std::time::Instant;

use kriging::{Data, FitOptions, Surrogate, VecchiaOptions, fit, fit_vecchia};
use rand::RngExt as _;
use stats::streams::{Purpose, stream};

use common::{D, NoisyHart6, hart6, processor_seconds};

const TESTS: usize = 2000;

/// A function of the unit square that is known to the last digit.
fn smooth(x: &[f64]) -> f64 {
    (5.0 * x[0]).sin() * (3.0 * x[1]).cos()
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let n: usize = arguments.next().map_or(Ok(100_000), |text| text.parse())?;
    let what = arguments.next();
    let mut rng = stream(7, Purpose::Test, n as u64, 0);
    let is_smooth = what.as_deref() == Some("smooth");
    let d = if is_smooth { 2 } else { D };
    let truth: fn(&[f64]) -> f64 = if is_smooth { smooth } else { hart6 };
    let (x, y, noise) = if is_smooth {
        let x: Vec<f64> = (0..n * d).map(|_| rng.random()).collect();
        let y: Vec<f64> = x.chunks_exact(d).map(smooth).collect();
        (x, y, vec![0.0; n])
    } else {
        let sample = NoisyHart6::draw(n, &mut rng);
        let Data {
            x,
            y,
            noise_variance,
            ..
        } = sample.data();
        (x.to_vec(), y.to_vec(), noise_variance.to_vec())
    };
    let data = Data {
        x: &x,
        d,
        y: &y,
        noise_variance: &noise,
    };
    let test: Vec<f64> = (0..TESTS * d).map(|_| rng.random()).collect();

    let (began, before) = (Instant::now(), processor_seconds());
    let (model, calibration): (Surrogate, Box<dyn FnOnce() -> f64>) = match what {
        None => {
            let model = fit_vecchia(&data, &VecchiaOptions::default())?;
            let own = model.clone();
            (model.into(), Box::new(|| own.calibrated().calibration()))
        }
        Some(_) => {
            let model = fit(&data, &FitOptions::default())?;
            let own = model.clone();
            (model.into(), Box::new(|| own.calibrated().calibration()))
        }
    };
    println!(
        "n = {n}, d = {d}: fit in {:.1} s, {:.1} s of processor time, nll {:.1}",
        began.elapsed().as_secs_f64(),
        processor_seconds() - before,
        model.negative_log_likelihood()
    );
    for warning in model.warnings() {
        println!("{warning}");
    }
    let before = processor_seconds();
    let predictions = model.predict_many(&test)?;
    println!(
        "{TESTS} predictions with variance in {:.2} s of processor time",
        processor_seconds() - before
    );
    let pairs = predictions.iter().zip(test.chunks_exact(d));
    let errors: Vec<(f64, f64)> = pairs
        .map(|(p, x)| (p.mean - truth(x), p.variance.sqrt()))
        .collect();
    let squares: f64 = errors.iter().map(|(error, _)| error * error).sum();
    let covered = errors
        .iter()
        .filter(|(error, sd)| error.abs() <= 1.6449 * sd);
    let scale = calibration();
    let of_calibrated = errors
        .iter()
        .filter(|(error, sd)| error.abs() <= 1.6449 * sd * scale.sqrt());
    println!(
        "rmse {:.3e}, coverage of 90 % intervals {:.3}, with variances calibrated by {scale:.2} {:.3}",
        (squares / TESTS as f64).sqrt(),
        covered.count() as f64 / TESTS as f64,
        of_calibrated.count() as f64 / TESTS as f64
    );
    // The largest resident set so far, from the process's status (proc(5)).
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let peak = status.lines().find(|line| line.starts_with("VmHWM"));
    println!("{}", peak.unwrap_or("peak memory unknown"));
    Ok(())
}
