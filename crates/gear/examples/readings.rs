//! Agreement of readings of the paper with its printed values: the score of each law of wear with each tooth model and
//! tip rule, over the design of experiments of the paper's campaign.
//!
//! Run with `cargo run --release -p gear --example readings -- [designs] [seed]`; the defaults are
//! 3000 and 2009. It prints Markdown, as `coordinator compare` does.

#![expect(
    clippy::print_stdout,
    reason = "an example shows its results on standard output"
)]

use std::error::Error;

use gear::paper::BOX;
use gear::paper::readings::{markdown, readings};

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let count = arguments.next().map_or(Ok(3000), |a| a.parse())?;
    let seed = arguments.next().map_or(Ok(2009), |a| a.parse())?;
    let options = doe::Options {
        seed,
        ..doe::Options::default()
    };
    let unit = doe::maximin(count, BOX.len(), &options)?;
    let scaled = |i| {
        let point = unit.point(i);
        std::array::from_fn(|k| BOX[k][0] + (BOX[k][1] - BOX[k][0]) * point[k])
    };
    let designs: Vec<[f64; 6]> = (0..count).map(scaled).collect();
    let scores: Vec<_> = readings()
        .map(|reading| reading.fitted(seed).score(&designs, seed))
        .collect();
    print!("{}", markdown(&scores));
    Ok(())
}
