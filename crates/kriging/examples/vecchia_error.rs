//! The loss of accuracy by nearest-neighbour conditioning: a table, and the same as an SVG chart.
//!
//! `cargo run --release -p kriging --example vecchia_error -- [CHART.svg [POINTS …]]`
//! (500, 1000, 2000 and 3000 points)
//!
//! The six-dimensional Hartmann function on 2…40 with noise of a standard deviation of 0.1 to 0.16.
//! For each number of points, an exact fit and fits by [`kriging::fit_vecchia`] with different numbers m
//! of observations per prediction; the last has all of them. The error is the root mean square one of
//! the mean against the truth at 1000 points, divided by the exact fit's, minus one.

#![expect(clippy::print_stdout, reason = "an example's output is its purpose")]

mod common;

use std::error::Error;
use std::fmt::Write as _;

use kriging::{FitOptions, VecchiaOptions, fit, fit_vecchia};
use rand::RngExt as _;
use stats::streams::{Purpose, stream};

use common::{D, NoisyHart6, hart6};

const TESTS: usize = 1000;
const NEIGHBOURS: [usize; 6] = [25, 50, 100, 200, 400, 800];
const COLOURS: [&str; 4] = ["#1b6ca8", "#c8553d", "#4f7942", "#7b4b94"];

/// The errors at one number of points: (m, excess).
struct Curve {
    n: usize,
    excess: Vec<(usize, f64)>,
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let chart = arguments.next();
    let mut sizes = arguments
        .map(|text| text.parse())
        .collect::<Result<Vec<usize>, _>>()?;
    if sizes.is_empty() {
        sizes = vec![500, 1000, 2000, 3000];
    }
    println!("    n     m    rmse   excess  mean off  sd ratio");
    let mut curves = Vec::new();
    for n in sizes {
        curves.push(curve(n)?);
    }
    if let Some(path) = chart {
        std::fs::write(path, svg(&curves))?;
    }
    Ok(())
}

fn curve(n: usize) -> Result<Curve, Box<dyn Error>> {
    let mut rng = stream(6, Purpose::Test, n as u64, 0);
    let sample = NoisyHart6::draw(n, &mut rng);
    let data = sample.data();
    let test: Vec<f64> = (0..TESTS * D).map(|_| rng.random()).collect();
    let exact = fit(&data, &FitOptions::default())?.predict_many(&test)?;
    let root = |squares: f64| (squares / TESTS as f64).sqrt();
    let rmse = |predictions: &[kriging::Prediction]| {
        let pairs = predictions.iter().zip(test.chunks_exact(D));
        root(pairs.map(|(p, x)| (p.mean - hart6(x)).powi(2)).sum())
    };
    let best = rmse(&exact);
    println!("{n:5} exact  {best:6.4}");
    let mut excess = Vec::new();
    for m in NEIGHBOURS.into_iter().filter(|m| *m < n).chain([n]) {
        let options = VecchiaOptions {
            subset: 1000,
            prediction_neighbours: m,
            ..VecchiaOptions::default()
        };
        let found = fit_vecchia(&data, &options)?.predict_many(&test)?;
        let ours = rmse(&found);
        let off = root(
            found
                .iter()
                .zip(&exact)
                .map(|(a, b)| (a.mean - b.mean).powi(2))
                .sum(),
        );
        let ratios = found
            .iter()
            .zip(&exact)
            .map(|(a, b)| (a.variance / b.variance).ln());
        let sd = (0.5 * ratios.sum::<f64>() / TESTS as f64).exp();
        println!(
            "{n:5} {m:5}  {ours:6.4}  {:6.1}%  {off:8.4}  {sd:8.3}",
            100.0 * (ours / best - 1.0)
        );
        excess.push((m, ours / best - 1.0));
    }
    Ok(Curve { n, excess })
}

/// The curves over m, both axes logarithmic; values below a thousandth are drawn at a thousandth.
fn svg(curves: &[Curve]) -> String {
    const FLOOR: f64 = 1e-3;
    let (width, height, left, right, top, bottom) = (640.0, 400.0, 70.0, 30.0, 40.0, 55.0);
    let most = curves
        .iter()
        .flat_map(|c| c.excess.iter().map(|e| e.0))
        .max()
        .unwrap_or(100);
    // The left margin has space for the names of the curves.
    let (low, high) = (12.0_f64.ln(), (1.15 * most as f64).ln());
    let across = |m: f64| left + (m.ln() - low) / (high - low) * (width - left - right);
    let (least, largest) = (FLOOR.ln(), 3.0_f64.ln());
    let up = |e: f64| {
        let share = (e.max(FLOOR).ln() - least) / (largest - least);
        height - bottom - share * (height - top - bottom)
    };
    let mut out = String::new();
    let mut add = |text: String| {
        // Writing to a string cannot fail.
        let _ = writeln!(out, "{text}");
    };
    add(format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" \
         font-family=\"sans-serif\" font-size=\"12\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n\
         <text x=\"{left}\" y=\"20\" font-size=\"14\">Root mean square error from nearest observations, \
         beyond the exact fit's</text>"
    ));
    for (value, label) in [
        (0.001, "≤ 0.1 %"),
        (0.01, "1 %"),
        (0.03, "3 %"),
        (0.1, "10 %"),
        (0.3, "30 %"),
        (1.0, "100 %"),
    ] {
        let y = up(value);
        add(format!(
            "<line x1=\"{left}\" x2=\"{}\" y1=\"{y:.1}\" y2=\"{y:.1}\" stroke=\"#ddd\"/>\n\
             <text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{label}</text>",
            width - right,
            left - 8.0,
            y + 4.0
        ));
    }
    for m in [25, 50, 100, 200, 400, 800, 1600]
        .into_iter()
        .filter(|m| *m <= most)
    {
        let x = across(f64::from(m as u32));
        add(format!(
            "<line x1=\"{x:.1}\" x2=\"{x:.1}\" y1=\"{top}\" y2=\"{}\" stroke=\"#eee\"/>\n\
             <text x=\"{x:.1}\" y=\"{}\" text-anchor=\"middle\">{m}</text>",
            height - bottom,
            height - bottom + 18.0
        ));
    }
    add(format!(
        "<text x=\"{}\" y=\"{}\" text-anchor=\"middle\">observations per prediction (the last point: all)</text>",
        0.5 * (left + width - right),
        height - 12.0
    ));
    let mut name_above = f64::INFINITY;
    for (curve, colour) in curves.iter().zip(COLOURS.iter().cycle()) {
        let at = |(m, e): &(usize, f64)| (across(*m as f64), up(*e));
        let path: Vec<String> = curve
            .excess
            .iter()
            .map(|e| format!("{:.1},{:.1}", at(e).0, at(e).1))
            .collect();
        add(format!(
            "<polyline points=\"{}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"2\"/>",
            path.join(" ")
        ));
        for e in &curve.excess {
            let (x, y) = at(e);
            add(format!(
                "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3.5\" fill=\"{colour}\"/>"
            ));
        }
        if let Some(first) = curve.excess.first() {
            let (x, y) = at(first);
            // One above the other, where the curves of more points lie.
            name_above = (y + 4.0).min(name_above - 13.0);
            add(format!(
                "<text x=\"{:.1}\" y=\"{name_above:.1}\" text-anchor=\"end\" fill=\"{colour}\">n = {}</text>",
                x - 8.0,
                curve.n
            ));
        }
    }
    add("</svg>".into());
    out
}
