//! Our fits beside those of established libraries, and the optimum found from many seeds.
//!
//! `cargo run --release -p kriging --example peers -- [SEEDS]` (no seeds by default)
//!
//! The crate's `data` holds `peers.json`, a list `rows` with `data`, `peer`, `kernel` (`m52p` and, for the
//! libraries that build products, `m52`: tensor-product Matérn 5/2; else `m52`: radial; `se`), `rmse`,
//! `coverage90`, `nll`; for each data set `<data>_train.csv` (x1…xd, y, noise_var, …) and, with its
//! first word, `<word>_test2000.csv` (x1…xd, f_true).

#![expect(clippy::print_stdout, reason = "an example's output is its purpose")]

mod common;

use std::collections::BTreeMap;
use std::error::Error;
use std::path::Path;

use kriging::{Data, FitOptions, Kernel, fit};
use serde::Deserialize;

use common::processor_seconds;

/// Libraries whose Matérn 5/2 is a product over the coordinates.
const OF_PRODUCTS: [&str; 4] = ["DiceKriging", "libKriging", "smt", "egobox"];

#[derive(Deserialize)]
struct Peers {
    rows: Vec<Peer>,
}

#[derive(Deserialize)]
struct Peer {
    data: String,
    peer: String,
    kernel: String,
    rmse: f64,
    nll: Option<f64>,
    fit_cpu_s: f64,
}

impl Peer {
    fn kernel(&self) -> Option<Kernel> {
        match self.kernel.as_str() {
            "m52p" => Some(Kernel::Matern52),
            "m52" if OF_PRODUCTS.contains(&self.peer.as_str()) => Some(Kernel::Matern52),
            "m52" => Some(Kernel::RadialMatern52),
            "se" => Some(Kernel::SquaredExponential),
            _ => None,
        }
    }
}

struct Table {
    x: Vec<f64>,
    d: usize,
    y: Vec<f64>,
    noise_variance: Vec<f64>,
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let directory = &Path::new(env!("CARGO_MANIFEST_DIR")).join("data");
    let seeds: u64 = arguments.next().map_or(Ok(0), |text| text.parse())?;
    let text = std::fs::read_to_string(directory.join("peers.json"))?;
    let peers: Peers = serde_json::from_str(&text)?;
    let mut groups: BTreeMap<(String, String), Vec<&Peer>> = BTreeMap::new();
    for peer in &peers.rows {
        if let Some(kernel) = peer.kernel() {
            let name = (peer.data.clone(), kernel.to_string());
            groups.entry(name).or_default().push(peer);
        }
    }

    println!(
        "data             kernel             nll      best peer's  rmse    best peer's  ratio  \
         coverage  cpu s  fastest peer's"
    );
    for ((data, kernel), peers) in &groups {
        let (train, test) = read(directory, data)?;
        let options = FitOptions {
            kernel: peers[0].kernel().unwrap_or_default(),
            ..FitOptions::default()
        };
        let start = processor_seconds();
        let model = fit(&train.data(), &options)?;
        let seconds = processor_seconds() - start;
        let predictions = model.predict_many(&test.x)?;
        let (mut squares, mut covered) = (0.0, 0.0);
        for (p, truth) in predictions.iter().zip(&test.y) {
            let error = (p.mean - truth).abs();
            squares += error * error;
            covered += f64::from(u8::from(error <= 1.644_853_626_951_472 * p.variance.sqrt()));
        }
        let count = test.y.len() as f64;
        let rmse = (squares / count).sqrt();
        let least = |values: &mut dyn Iterator<Item = f64>| values.fold(f64::INFINITY, f64::min);
        let best_rmse = least(&mut peers.iter().map(|p| p.rmse));
        let best_nll = least(&mut peers.iter().filter_map(|p| p.nll));
        let fastest = least(&mut peers.iter().map(|p| p.fit_cpu_s));
        println!(
            "{data:16} {kernel:18} {:8.2}  {best_nll:8.1}  {rmse:9.4}  {best_rmse:9.4}  {:7.3}  {:7.3}  \
             {seconds:6.2}  {fastest:6.2}",
            model.negative_log_likelihood(),
            rmse / best_rmse,
            covered / count,
        );
    }

    if seeds > 0 {
        println!("data             seeds  lowest nll  highest nll");
    }
    let mut names: Vec<&String> = groups.keys().map(|(data, _)| data).collect();
    names.dedup();
    for data in names.into_iter().filter(|_| seeds > 0) {
        let (train, _) = read(directory, data)?;
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for seed in 0..seeds {
            let options = FitOptions {
                seed,
                ..FitOptions::default()
            };
            let nll = fit(&train.data(), &options)?.negative_log_likelihood();
            (low, high) = (low.min(nll), high.max(nll));
        }
        println!("{data:16} {seeds:5}  {low:10.4}  {high:11.4}");
    }
    Ok(())
}

/// The training data, and the test data, which have no noise.
fn read(directory: &Path, data: &str) -> Result<(Table, Table), Box<dyn Error>> {
    let train = table(&directory.join(format!("{data}_train.csv")))?;
    let word = data.split('_').next().unwrap_or(data);
    let test = table(&directory.join(format!("{word}_test2000.csv")))?;
    Ok((train, test))
}

fn table(path: &Path) -> Result<Table, Box<dyn Error>> {
    let mut reader = csv::Reader::from_path(path)?;
    let headers = reader.headers()?.clone();
    let place = |name: &str| headers.iter().position(|header| header == name);
    let y = place("y").or_else(|| place("f_true"));
    let y = y.ok_or("a file needs a column y or f_true")?;
    let noise = place("noise_var");
    let mut table = Table {
        x: Vec::new(),
        d: headers
            .iter()
            .take_while(|header| header.starts_with('x'))
            .count(),
        y: Vec::new(),
        noise_variance: Vec::new(),
    };
    for record in reader.records() {
        let row: Vec<f64> = record?.iter().map(str::parse).collect::<Result<_, _>>()?;
        table.x.extend_from_slice(&row[..table.d]);
        table.y.push(row[y]);
        table
            .noise_variance
            .push(noise.map_or(0.0, |column| row[column]));
    }
    Ok(table)
}

impl Table {
    fn data(&self) -> Data<'_> {
        Data {
            x: &self.x,
            d: self.d,
            y: &self.y,
            noise_variance: &self.noise_variance,
        }
    }
}
