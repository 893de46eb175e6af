//! Processor time of the fit's and the prediction's parts, beside that of a matrix product.
//!
//! `cargo run --release -p kriging --features faer --example timings -- [F.csv [ROWS]]` (a header; d
//! coordinates, `y`, `noise_var`, anything; 2175 points of `data` by default; 36 000 rows are predicted)
//!
//! Times are the processor's, of all threads together, the best of several runs. Other work on the
//! machine slows them; the rate of a matrix product of the same size says by how much. faer's own
//! factor and inverse are what a likelihood with its gradient would take at the least without this
//! crate's.

#![expect(clippy::print_stdout, reason = "an example's output is its purpose")]

mod common;

use std::error::Error;

use faer::linalg::matmul::matmul;
use faer::linalg::solvers::DenseSolveCore as _;
use faer::{Accum, Mat, Par, Side};
use kriging::{
    Data, FitOptions, LikelihoodGradient, LogLikelihood, VecchiaOptions, fit, fit_vecchia,
};
use rand::RngExt as _;
use stats::streams::{Purpose, stream};

use common::processor_seconds;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let file = arguments.next().unwrap_or_else(|| {
        concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/data/hart6_low_n2175_train.csv"
        )
        .to_owned()
    });
    let rows: usize = arguments.next().map_or(Ok(36_000), |text| text.parse())?;

    let mut reader = csv::Reader::from_path(file)?;
    let d = reader.headers()?.iter().position(|name| name == "y");
    let d = d.ok_or("the file needs a column y")?;
    let (mut x, mut y, mut noise_variance) = (Vec::new(), Vec::new(), Vec::new());
    for record in reader.records() {
        let row: Vec<f64> = record?.iter().map(str::parse).collect::<Result<_, _>>()?;
        x.extend_from_slice(&row[..d]);
        y.push(row[d]);
        noise_variance.push(row[d + 1]);
    }
    let data = Data {
        x: &x,
        d,
        y: &y,
        noise_variance: &noise_variance,
    };
    let n = y.len();
    println!("n = {n}, d = {d}; processor time in seconds");

    let a = Mat::<f64>::from_fn(n, n, |i, j| (i + 2 * j) as f64 / n as f64);
    let mut b = a.clone();
    let product = || matmul(b.as_mut(), Accum::Replace, &a, &a, 1.0, Par::Seq);
    let (seconds, ()) = best(3, product);
    let rate = 2.0 * (n as f64).powi(3) / seconds * 1e-9;
    println!("matrix product            {seconds:9.4}   {rate:.0} GFlop/s");
    faer::set_global_parallelism(Par::Seq);
    let covariance = Mat::<f64>::from_fn(n, n, |i, j| {
        (-0.02 * i.abs_diff(j) as f64).exp() + if i == j { 1.0 } else { 0.0 }
    });
    let (seconds, factor) = best(3, || covariance.llt(Side::Lower));
    let rate = (n as f64).powi(3) / 3.0 / seconds * 1e-9;
    println!("faer's Cholesky factor    {seconds:9.4}   {rate:.0} GFlop/s");
    let factor = factor.map_err(|_| "the covariance is not positive definite")?;
    let (seconds, _) = best(3, || factor.inverse());
    let rate = 2.0 / 3.0 * (n as f64).powi(3) / seconds * 1e-9;
    println!("faer's inverse from it    {seconds:9.4}   {rate:.0} GFlop/s");

    let (seconds, model) = best(3, || fit(&data, &FitOptions::default()));
    let model = model?;
    let nll = model.negative_log_likelihood();
    println!("fit                       {seconds:9.4}   nll {nll:.3}");

    let mut function = LogLikelihood::new(&data, model.kernel(), model.trend())?;
    let (seconds, single) = best(7, || function.evaluate(model.parameters()));
    let single = single?;
    let rounding = single.rounding;
    println!("likelihood with gradient  {seconds:9.4}   C⁻¹C is off by {rounding:.1e}");
    let mut function = function.in_double();
    let (seconds, double) = best(7, || function.evaluate(model.parameters()));
    let slopes = |value: LikelihoodGradient| [value.ln_ranges, vec![value.ln_sigma2]].concat();
    let (single, double) = (slopes(single), slopes(double?));
    let pairs = single.iter().zip(&double);
    let error = pairs.fold(0.0_f64, |error, (a, b)| error.max((a - b).abs()));
    let steepest = double
        .iter()
        .fold(0.0_f64, |most, slope| most.max(slope.abs()));
    println!(
        "all of it in double       {seconds:9.4}   steepest {steepest:.1e}, differs by {error:.1e}"
    );

    let mut rng = stream(1, Purpose::Test, 0, 0);
    let points: Vec<f64> = (0..rows * d).map(|_| rng.random()).collect();
    let (seconds, means) = best(5, || model.means(&points));
    let first = means?[0];
    println!("{rows} means             {seconds:9.4}   the first {first:.6}");
    let (seconds, sum) = best(20, || {
        points
            .chunks_exact(d)
            .take(100)
            .map(|x| model.mean(x))
            .sum::<f64>()
    });
    println!(
        "one mean                  {:9.2e}   sum of 100 {sum:.6}",
        seconds / 100.0
    );
    let (seconds, predictions) = best(2, || model.predict_many(&points));
    let first = predictions?[0].variance;
    // A triangular solve takes n² multiplications and additions.
    let rate = (n as f64).powi(2) * rows as f64 / seconds * 1e-9;
    println!("{rows} with variances    {seconds:9.4}   {rate:.0} GFlop/s, the first {first:.6}");

    let (seconds, vecchia) = best(3, || fit_vecchia(&data, &VecchiaOptions::default()));
    let nll = vecchia?.negative_log_likelihood();
    println!("vecchia fit               {seconds:9.4}   nll {nll:.3}");
    Ok(())
}

/// The least processor time of several runs, and the last result.
fn best<T>(runs: usize, mut run: impl FnMut() -> T) -> (f64, T) {
    let timed = |run: &mut dyn FnMut() -> T| {
        let start = processor_seconds();
        let result = run();
        (processor_seconds() - start, result)
    };
    let (mut least, mut result) = timed(&mut run);
    for _ in 1..runs {
        let (seconds, next) = timed(&mut run);
        least = least.min(seconds);
        result = next;
    }
    (least, result)
}
