//! What a discretisation costs and what it loses: errors of ΔSTE against the converged reference
//! over random feasible designs of the paper's box, and the time of a worn sample and of a new
//! design, for ten discretisations and for the plain 64 × 21 phase-by-slice sum in the same run.
//!
//! Run with `cargo run --release -p gear --example speed_accuracy -- [designs] [chart.svg]`; the
//! defaults are 200 designs and `speed_accuracy.svg`. Times are medians over the designs, on one
//! core.

#![expect(
    clippy::print_stdout,
    reason = "an example shows its results on standard output"
)]

#[path = "../benches/support/mod.rs"]
mod support;

use std::error::Error;
use std::fmt::Write as _;
use std::hint::black_box;
use std::time::Instant;

use gear::paper::WEAR;
use gear::{Discretisation, Pair, PairInput, Sampler, ToothModel};
use stats::streams::{Purpose, stream};
use support::{PlainSum, TEXTBOOK, in_the_box};

/// Cells and phases.
const GRIDS: [(usize, usize); 10] = [
    (12, 8),
    (16, 12),
    (24, 12),
    (32, 16),
    (48, 24),
    (64, 32),
    (96, 48),
    (128, 64),
    (192, 96),
    (256, 128),
];
/// Samples for each design whose error is measured, and whose time is.
const COMPARED: u64 = 4;
const TIMED: u64 = 40;

/// A design with its converged answers, µm.
struct Reference {
    input: PairInput,
    unworn: f64,
    archard: f64,
    random: Vec<f64>,
    /// The places and gaps of the samples, for the plain sum.
    nodes: Vec<f64>,
    gaps: Vec<Vec<f64>>,
    pair: Pair,
}

/// Median times in µs, and errors sorted: unworn, Archard, random.
struct Row {
    name: String,
    design: f64,
    sample: f64,
    errors: [Vec<f64>; 3],
}

fn quantile(values: &mut [f64], p: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    values[((values.len() - 1) as f64 * p).round() as usize]
}

fn draw(sampler: &mut Sampler, design: usize, sample: u64) -> f64 {
    sampler.draw(&mut stream(2009, Purpose::Wear, design as u64, sample))
}

fn micros(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e6
}

fn reference(input: PairInput, design: usize) -> Result<(Reference, f64), gear::Error> {
    let converged = Pair::converged(&input, &WEAR, 1e-6)?;
    let pair = converged.pair;
    let mut sampler = pair.sampler(&WEAR);
    let mut random = Vec::new();
    let mut gaps = Vec::new();
    for k in 0..COMPARED {
        let profile = sampler.draw_profile(&mut stream(2009, Purpose::Wear, design as u64, k));
        random.push(profile.delta_ste_um);
        let [a, b] = &profile.depth;
        gaps.push(a.iter().zip(b).map(|(a, b)| a + b).collect());
    }
    let worn = pair.archard(&WEAR);
    let reference = Reference {
        input,
        unworn: pair.unworn().delta_ste_um,
        archard: worn.analysis.delta_ste_um,
        random,
        nodes: worn.s,
        gaps,
        pair,
    };
    Ok((reference, converged.change))
}

fn ours(references: &[Reference], grid: (usize, usize)) -> Result<Row, gear::Error> {
    let disc = Discretisation {
        cells: grid.0,
        phases: grid.1,
    };
    let mut errors = [Vec::new(), Vec::new(), Vec::new()];
    let (mut design_times, mut sample_times) = (Vec::new(), Vec::new());
    for (i, reference) in references.iter().enumerate() {
        // The best of three: the machine does other things too.
        let mut best = f64::MAX;
        for _ in 0..3 {
            let start = Instant::now();
            let pair = Pair::new(&reference.input, &disc)?;
            black_box((pair.sliding(), pair.interference(), pair.root_stress()));
            black_box((pair.unworn(), pair.archard(&WEAR)));
            best = best.min(micros(start));
        }
        design_times.push(best);
        let pair = Pair::new(&reference.input, &disc)?;
        let relative = |ours: f64, exact: f64| (ours / exact - 1.0).abs();
        errors[0].push(relative(pair.unworn().delta_ste_um, reference.unworn));
        let archard = pair.archard(&WEAR).analysis.delta_ste_um;
        errors[1].push(relative(archard, reference.archard));
        let mut sampler = pair.sampler(&WEAR);
        for (k, &exact) in (0..).zip(&reference.random) {
            errors[2].push(relative(draw(&mut sampler, i, k), exact));
        }
        let start = Instant::now();
        for k in 0..TIMED {
            black_box(draw(&mut sampler, i, k));
        }
        sample_times.push(micros(start) / TIMED as f64);
    }
    Ok(Row {
        name: format!("{} x {}", grid.0, grid.1),
        design: quantile(&mut design_times, 0.5),
        sample: quantile(&mut sample_times, 0.5),
        errors,
    })
}

/// The plain sum gets compliance and gap from the converged pair, and its time leaves out the
/// drawing of the random field.
fn plain(references: &[Reference]) -> Row {
    let mut errors = [Vec::new(), Vec::new(), Vec::new()];
    let (mut design_times, mut sample_times) = (Vec::new(), Vec::new());
    for reference in references {
        let relative = |ours: f64, exact: f64| (ours / exact - 1.0).abs();
        let start = Instant::now();
        let mut sum = PlainSum::new(&reference.pair, &reference.nodes, TEXTBOOK);
        let zero = vec![0.0; reference.nodes.len()];
        let unworn = sum.delta_ste_um(&zero);
        design_times.push(micros(start));
        errors[0].push(relative(unworn, reference.unworn));
        let worn = reference.pair.archard(&WEAR);
        let gap: Vec<f64> = worn.depth.iter().map(|depth| 2.0 * depth).collect();
        errors[1].push(relative(sum.delta_ste_um(&gap), reference.archard));
        for (gap, &exact) in reference.gaps.iter().zip(&reference.random) {
            errors[2].push(relative(sum.delta_ste_um(gap), exact));
        }
        let start = Instant::now();
        for gap in &reference.gaps {
            black_box(sum.delta_ste_um(gap));
        }
        sample_times.push(micros(start) / reference.gaps.len() as f64);
    }
    Row {
        name: format!("plain {} x {}", TEXTBOOK[0], TEXTBOOK[1]),
        design: quantile(&mut design_times, 0.5),
        sample: quantile(&mut sample_times, 0.5),
        errors,
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let designs: usize = arguments.first().map_or(Ok(200), |a| a.parse())?;
    let file = arguments
        .get(1)
        .map_or("speed_accuracy.svg", String::as_str);
    let mut charts = Vec::new();
    for &model in ToothModel::ALL {
        let mut rng = stream(2009, Purpose::Test, 0, 0);
        let mut references = Vec::new();
        let mut change = 0.0_f64;
        while references.len() < designs {
            match reference(in_the_box(&mut rng, model), references.len()) {
                Ok((reference, last)) => {
                    change = change.max(last);
                    references.push(reference);
                }
                Err(gear::Error::Infeasible(_)) => {}
                Err(error) => return Err(error.into()),
            }
        }
        println!("{model}: {designs} designs, last change of the reference at most {change:.1e}");
        println!(
            "{:>14} {:>10} {:>10} {:>12}   median and 95th percentile of the error of ΔSTE",
            "cells x phases", "design µs", "sample µs", "samples/s"
        );
        println!(
            "{:49}   {:>17} {:>17} {:>17}",
            "", "unworn", "Archard", "random"
        );
        let mut rows = Vec::new();
        for grid in GRIDS {
            rows.push(ours(&references, grid)?);
        }
        rows.push(plain(&references));
        for row in &mut rows {
            let mut line = format!(
                "{:>14} {:10.1} {:10.2} {:12.0}  ",
                row.name,
                row.design,
                row.sample,
                1e6 / row.sample
            );
            for errors in &mut row.errors {
                let [median, high] = [0.5, 0.95].map(|p| 100.0 * quantile(errors, p));
                write!(line, " {median:7.4} {high:7.4} %")?;
            }
            println!("{line}");
        }
        charts.push((model.name(), rows));
    }
    std::fs::write(file, svg(&charts))?;
    println!("wrote {file}");
    Ok(())
}

/// Two log-log panels, error in % against time in µs: random samples, and both deterministic ΔSTE.
fn svg(charts: &[(&str, Vec<Row>)]) -> String {
    const SIZE: (f64, f64) = (400.0, 300.0);
    const X: (f64, f64) = (-0.25, 3.25);
    const Y: (f64, f64) = (-3.5, 1.5);
    let mut out = String::from(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 980 400\" \
         font-family=\"sans-serif\" font-size=\"11\">\n<rect width=\"980\" height=\"400\" \
         fill=\"white\"/>\n",
    );
    let colours = ["#1b6ca8", "#c2571a", "#2c7a3f", "#8a4f9e"];
    for (panel, title) in ["µs per worn sample", "µs per new design"]
        .into_iter()
        .enumerate()
    {
        let left = 60.0 + 480.0 * panel as f64;
        let place = |time: f64, error: f64| {
            let x = (time.log10() - X.0) / (X.1 - X.0);
            let y = (error.max(1e-6).log10() - Y.0) / (Y.1 - Y.0);
            (
                left + x.clamp(0.0, 1.0) * SIZE.0,
                30.0 + (1.0 - y.clamp(0.0, 1.0)) * SIZE.1,
            )
        };
        for k in 0..=3 {
            let (x, y) = place(10_f64.powi(k), 10_f64.powf(Y.0));
            out += &format!(
                "<path d=\"M{x:.1} 30V{y:.1}\" stroke=\"#ddd\"/><text x=\"{x:.1}\" y=\"{:.1}\" \
                 text-anchor=\"middle\">{}</text>\n",
                y + 15.0,
                10_i32.pow(k as u32)
            );
        }
        for k in -3..=1 {
            let (_, y) = place(1.0, 10_f64.powi(k));
            out += &format!(
                "<path d=\"M{left} {y:.1}h{}\" stroke=\"#ddd\"/><text x=\"{:.1}\" y=\"{:.1}\" \
                 text-anchor=\"end\">{} %</text>\n",
                SIZE.0,
                left - 5.0,
                y + 4.0,
                10_f64.powi(k)
            );
        }
        out += &format!(
            "<text x=\"{:.1}\" y=\"362\" text-anchor=\"middle\">{title}</text>\n",
            left + 0.5 * SIZE.0
        );
        for ((_, rows), colour) in charts.iter().zip(colours) {
            for (p, dash) in [(0.5, ""), (0.95, " stroke-dasharray=\"5 3\"")] {
                let mut line = String::new();
                for row in rows {
                    let mut errors = if panel == 0 {
                        row.errors[2].clone()
                    } else {
                        [row.errors[0].as_slice(), &row.errors[1]].concat()
                    };
                    let time = if panel == 0 { row.sample } else { row.design };
                    let (x, y) = place(time, 100.0 * quantile(&mut errors, p));
                    if row.name.starts_with("plain") {
                        out += &format!(
                            "<path d=\"M{:.1} {:.1}l8 8m0 -8l-8 8\" stroke=\"{colour}\"{dash}/>\n",
                            x - 4.0,
                            y - 4.0
                        );
                    } else {
                        line += &format!("{x:.1},{y:.1} ");
                        out += &format!(
                            "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"2.5\" fill=\"{colour}\">\
                             <title>{}</title></circle>\n",
                            row.name
                        );
                    }
                }
                out += &format!(
                    "<polyline points=\"{line}\" fill=\"none\" stroke=\"{colour}\"{dash}/>\n"
                );
            }
        }
    }
    let names: Vec<String> = charts
        .iter()
        .zip(colours)
        .map(|((name, _), colour)| format!("<tspan fill=\"{colour}\">{name}</tspan>"))
        .collect();
    out += &format!(
        "<text x=\"60\" y=\"18\">error of ΔSTE: {}; solid median, dashed 95th percentile; crosses: \
         plain 64 × 21 sum, field not timed</text>\n</svg>\n",
        names.join(", ")
    );
    out
}
