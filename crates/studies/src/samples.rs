//! Samples of designs, drawn on all threads.

use std::ops::Range;

use anyhow::bail;
use ledger::{Generation, StreamId, Unit};
use problem::Design;
use problem::formulation::Problem;
use problem::task::{Output, Source, compute};
use rayon::prelude::*;

/// Number of samples that a thread draws of one design at a time. It is large because each piece
/// prepares the design again.
const PIECE: usize = 500;

/// Verification samples of ΔSTE, µm, as many as every optimum of the campaign gets first. All designs get the same
/// random numbers.
///
/// # Errors
///
/// The design cannot be simulated.
pub fn verification(problem: &Problem, design: &Design) -> anyhow::Result<Vec<f64>> {
    let source = Source::Point(design.clone());
    in_pieces(problem.campaign().verify.first(), |samples| {
        let unit = Unit {
            stream: StreamId::point(0),
            generation: Generation::default(),
            samples,
        };
        match compute(problem, &unit, &source).map_err(anyhow::Error::msg)? {
            Output::Samples(samples) => Ok(problem.objective().values(&samples)),
            other => bail!("a point cannot give {other:?}"),
        }
    })
}

/// The samples 0 to `count`, which `draw` draws piece by piece, in their order.
pub(crate) fn in_pieces(
    count: u32,
    draw: impl Fn(Range<u32>) -> anyhow::Result<Vec<f64>> + Sync,
) -> anyhow::Result<Vec<f64>> {
    let pieces: anyhow::Result<Vec<Vec<f64>>> = (0..count)
        .into_par_iter()
        .step_by(PIECE)
        .map(|first| draw(first..count.min(first + PIECE as u32)))
        .collect();
    Ok(pieces?.concat())
}
