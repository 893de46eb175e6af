//! Whether a larger smallest distance makes a better design: kriging's error from a random, an
//! enhanced stochastic evolutionary (ESE) and a maximin Latin hypercube.
//!
//! `cargo run --release -p kriging --example design_error -- [POINTS [SEEDS]]` (200 and 10)
//!
//! For each seed, the three designs of that many points in six variables observe three functions with
//! the same noise (standard deviation 0.10 to 0.16); the root mean square error of kriging's mean is
//! taken at 2000 random points. The table gives means over the seeds, and the mean and the standard
//! error of the paired ratio to ESE: below 1 + 2 standard errors, a design is no worse.
//!
//! The function `ridge`, a bowl with a sharp ridge, is kriging's mean through the 3000 noise-free
//! values in the crate's `data`.
//!
//! `docs/kriging.md`, section "Designs", has the measured ratios. A larger smallest distance helps when the model is
//! right, and does not help when the function has a kink.
//!
//! ESE: R. Jin, W. Chen, A. Sudjianto, "An efficient algorithm for constructing optimal design of
//! computer experiments", J. Statist. Plann. Inference 134 (2005) 268–287, with φₚ, p = 50.

#![expect(clippy::print_stdout, reason = "an example's output is its purpose")]

mod common;

use std::error::Error;
use std::path::Path;

use doe::{Design, Options, maximin, random_lhs};
use kriging::{Data, FitOptions, Model, fit};
use rand::RngExt as _;
use stats::streams::{Purpose, StreamRng, stream};

use common::{D, hart6, normal};

const TESTS: usize = 2000;
/// The exponent of φₚ = (Σ δ^−p)^(1/p).
const P: i32 = 50;
/// Outer iterations of ESE; the inner ones and the exchanges follow its authors' advice.
const OUTER: usize = 40;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let mut next = |default: usize| match arguments.next() {
        Some(text) => text.parse(),
        None => Ok(default),
    };
    let (n, seeds) = (next(200)?, next(10)?);
    let ridge = ridge()?;

    type Function<'a> = Box<dyn Fn(&[f64]) -> f64 + 'a>;
    let functions: [(&str, Function<'_>); 3] = [
        ("hart6", Box::new(hart6)),
        ("cusp", Box::new(cusp)),
        ("ridge", Box::new(|x| ridge.mean(x))),
    ];
    let names = ["random", "ese", "maximin"];
    let mut rmse = vec![vec![Vec::new(); names.len()]; functions.len()];
    let mut distance = vec![0.0; names.len()];
    let mut discrepancy = vec![0.0; names.len()];
    for seed in 0..seeds as u64 {
        let options = Options {
            seed,
            ..Options::default()
        };
        let designs = [
            random_lhs(n, D, seed)?,
            Ese::new(n, seed).run(),
            maximin(n, D, &options)?,
        ];
        for (k, design) in designs.iter().enumerate() {
            assert!(design.is_latin(), "{} is no Latin hypercube", names[k]);
            distance[k] += design.min_distance() / seeds as f64;
            discrepancy[k] += design.centred_discrepancy() / seeds as f64;
            for (f, (_, function)) in functions.iter().enumerate() {
                rmse[f][k].push(error_of(design, function.as_ref(), seed)?);
            }
        }
    }

    println!("{n} points in {D} variables, {seeds} seeds");
    println!("design    distance  discrepancy");
    for (k, name) in names.iter().enumerate() {
        println!("{name:9} {:8.4}  {:11.5}", distance[k], discrepancy[k]);
    }
    println!("function  design      rmse  ratio to ese");
    for (f, (function, _)) in functions.iter().enumerate() {
        for (k, name) in names.iter().enumerate() {
            let ratios = rmse[f][k].iter().zip(&rmse[f][1]).map(|(a, b)| a / b);
            let ratios: Vec<f64> = ratios.collect();
            let (mean, _) = mean_and_error(&rmse[f][k]);
            let (ratio, error) = mean_and_error(&ratios);
            println!("{function:9} {name:9} {mean:6.4}  {ratio:.3} ± {error:.3}");
        }
    }
    Ok(())
}

/// The model that interpolates the known values of `ridge`: the last column of its files.
fn ridge() -> Result<Model, Box<dyn Error>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("data");
    let (mut x, mut y) = (Vec::new(), Vec::new());
    for file in ["ridge_low_n1000_train.csv", "ridge_test2000.csv"] {
        for record in csv::Reader::from_path(folder.join(file))?.records() {
            let row: Vec<f64> = record?.iter().map(str::parse).collect::<Result<_, _>>()?;
            x.extend_from_slice(row.get(..D).ok_or("a row needs six coordinates")?);
            y.extend(row.last());
        }
    }
    let data = Data {
        x: &x,
        d: D,
        y: &y,
        noise_variance: &vec![0.0; y.len()],
    };
    Ok(fit(&data, &FitOptions::default())?)
}

fn mean_and_error(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let squares: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
    (mean, (squares / (n - 1.0).max(1.0) / n).sqrt())
}

/// The root mean square error of kriging's mean from noisy observations at the design's points.
fn error_of(
    design: &Design,
    function: &dyn Fn(&[f64]) -> f64,
    seed: u64,
) -> Result<f64, Box<dyn Error>> {
    let mut rng = stream(seed, Purpose::Test, design.n as u64, 1);
    let noise: Vec<f64> = (0..design.n)
        .map(|_| (0.10 + 0.06 * rng.random::<f64>()).powi(2))
        .collect();
    let y: Vec<f64> = (0..design.n)
        .map(|i| function(design.point(i)) + noise[i].sqrt() * normal(&mut rng))
        .collect();
    let data = Data {
        x: &design.points,
        d: D,
        y: &y,
        noise_variance: &noise,
    };
    let model = fit(&data, &FitOptions::default())?;
    let mut rng = stream(seed, Purpose::Test, 0, 2);
    let x: Vec<f64> = (0..TESTS * D).map(|_| rng.random()).collect();
    let means = model.means(&x)?;
    let squares: f64 = means
        .iter()
        .zip(x.chunks_exact(D))
        .map(|(mean, x)| (mean - function(x)).powi(2))
        .sum();
    Ok((squares / TESTS as f64).sqrt())
}

/// A bowl with a ridge across it that has a cusp, and ripples: nothing a smooth kernel expects.
fn cusp(x: &[f64]) -> f64 {
    let bowl: f64 = x.iter().map(|x| (x - 0.45).powi(2)).sum();
    let across = x[0] + 0.6 * x[1] - 0.4 * x[2] - 0.6;
    let ripples = (9.0 * x[3]).sin() * (7.0 * x[4]).cos();
    12.0 + 8.0 * bowl + 5.0 * (-6.0 * across.abs()).exp() + 0.6 * ripples
}

/// The enhanced stochastic evolutionary search for a Latin hypercube of small φₚ.
struct Ese {
    n: usize,
    /// Row-major.
    levels: Vec<i64>,
    /// δ²^(−p/2) of each pair, n × n, relative to a distance of `unit`.
    terms: Vec<f64>,
    unit: f64,
    rng: StreamRng,
}

impl Ese {
    fn new(n: usize, seed: u64) -> Self {
        let mut rng = stream(seed, Purpose::Test, n as u64, 3);
        let mut levels = vec![0; n * D];
        for k in 0..D {
            for i in 0..n {
                let j = rng.random_range(0..=i as u32) as usize;
                levels[i * D + k] = levels[j * D + k];
                levels[j * D + k] = i as i64;
            }
        }
        let mut ese = Self {
            n,
            levels,
            terms: vec![0.0; n * n],
            // About the distance that good designs have: powers of its ratios do not overflow.
            unit: 0.5 * n as f64 * (30.0 / n as f64).powf(1.0 / D as f64),
            rng,
        };
        for i in 0..n {
            for j in 0..n {
                ese.terms[i * n + j] = if i == j { 0.0 } else { ese.term(i, j) };
            }
        }
        ese
    }

    fn term(&self, i: usize, j: usize) -> f64 {
        let squared: i64 = (0..D)
            .map(|k| (self.levels[i * D + k] - self.levels[j * D + k]).pow(2))
            .sum();
        (self.unit * self.unit / squared as f64).powi(P / 2)
    }

    fn phi(&self) -> f64 {
        (0.5 * self.terms.iter().sum::<f64>()).powf(1.0 / f64::from(P))
    }

    /// The terms of the points `i` and `j` after an exchange of their levels in variable k, and the
    /// change of the sum over all pairs.
    fn exchanged(&mut self, i: usize, j: usize, k: usize) -> (Vec<[f64; 2]>, f64) {
        self.levels.swap(i * D + k, j * D + k);
        let mut change = 0.0;
        let terms = (0..self.n)
            .map(|m| {
                if m == i || m == j {
                    return [0.0; 2];
                }
                let new = [self.term(i, m), self.term(j, m)];
                change += new[0] + new[1] - self.terms[i * self.n + m] - self.terms[j * self.n + m];
                new
            })
            .collect();
        self.levels.swap(i * D + k, j * D + k);
        (terms, change)
    }

    fn accept(&mut self, i: usize, j: usize, k: usize, terms: &[[f64; 2]]) {
        self.levels.swap(i * D + k, j * D + k);
        for (m, new) in terms.iter().enumerate() {
            if m != i && m != j {
                for (point, term) in [i, j].into_iter().zip(new) {
                    self.terms[point * self.n + m] = *term;
                    self.terms[m * self.n + point] = *term;
                }
            }
        }
    }

    fn run(mut self) -> Design {
        let n = self.n;
        let pairs = n * (n - 1) / 2;
        let exchanges = (pairs / 5).clamp(1, 50);
        let inner = (2 * pairs * D / exchanges).clamp(1, 100);
        let mut phi = self.phi();
        let (mut best, mut best_phi) = (self.levels.clone(), phi);
        let mut threshold = 0.005 * phi;
        let mut exploring_up = true;
        for _ in 0..OUTER {
            let before = best_phi;
            let (mut accepted, mut improved) = (0, 0);
            for step in 0..inner {
                let k = step % D;
                let mut chosen: Option<(usize, usize, Vec<[f64; 2]>, f64)> = None;
                for _ in 0..exchanges {
                    let i = self.rng.random_range(0..n as u32) as usize;
                    let j = self.rng.random_range(0..n as u32) as usize;
                    if i == j {
                        continue;
                    }
                    let (terms, change) = self.exchanged(i, j, k);
                    if chosen.as_ref().is_none_or(|c| change < c.3) {
                        chosen = Some((i, j, terms, change));
                    }
                }
                let Some((i, j, terms, change)) = chosen else {
                    continue;
                };
                let sum = phi.powi(P) + change;
                let trial = sum.max(0.0).powf(1.0 / f64::from(P));
                if trial - phi > threshold * self.rng.random::<f64>() {
                    continue;
                }
                self.accept(i, j, k, &terms);
                phi = self.phi();
                accepted += 1;
                if phi < best_phi {
                    (best_phi, improved) = (phi, improved + 1);
                    best.clone_from(&self.levels);
                }
            }
            let share = f64::from(accepted) / inner as f64;
            if best_phi < before * (1.0 - 1e-6) {
                // Improving: few acceptances that are all improvements leave the threshold as it is.
                if share > 0.1 && improved < accepted {
                    threshold *= 0.8;
                } else if share <= 0.1 {
                    threshold /= 0.8;
                }
            } else {
                // Exploring: up quickly until most steps are accepted, then down slowly.
                if share > 0.8 {
                    exploring_up = false;
                } else if share < 0.1 {
                    exploring_up = true;
                }
                threshold *= if exploring_up { 1.0 / 0.7 } else { 0.9 };
            }
        }
        let centre = |level: i64| (level as f64 + 0.5) / n as f64;
        Design {
            n,
            d: D,
            points: best.into_iter().map(centre).collect(),
        }
    }
}
