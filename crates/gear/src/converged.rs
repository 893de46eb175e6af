//! The reference mode: the same model on ever finer grids until its results no longer change.

use crate::corrections::Corrections;
use crate::error::Error;
use crate::input::{Discretisation, PairInput, ToothModel, Wear};
use crate::pair::Pair;

/// Cells and phases of the first grid.
const START: Discretisation = Discretisation {
    cells: 256,
    phases: 128,
};

/// The most doublings: up to 32 768 cells and 16 384 phases.
const DOUBLINGS: usize = 7;

/// First grid and most doublings of coupled cells, whose matrices grow with the square of the phases: up
/// to 96 of them.
const COUPLED: (Discretisation, usize) = (
    Discretisation {
        cells: 64,
        phases: 24,
    },
    2,
);

/// Fraction of the mean transmission error below which ΔSTE is rounding, not variation. The change
/// of such a ΔSTE is relative to this fraction of the mean instead of to ΔSTE.
const SILENT: f64 = 1e-6;

/// A pair on a grid so fine that refining it further hardly changes the results.
#[derive(Debug, Clone)]
pub struct ConvergedPair {
    /// The pair on the finest grid.
    pub pair: Pair,
    /// The finest grid.
    pub discretisation: Discretisation,
    /// Relative change of ΔSTE in the last doubling: the greater of unworn and worn by Archard's
    /// law. For a ΔSTE below 10⁻⁶ of the mean transmission error, it is relative to that.
    pub change: f64,
}

impl Pair {
    /// The reference solution: doubles cells and phases until ΔSTE, unworn and worn by Archard's
    /// law with `wear`, changes by less than `tolerance` (relative; 1e-6 is reached by all but
    /// degenerate pairs, and by no coupled ones), or until the grid has 32 768 cells, with
    /// [`ToothModel::Coupled`] 96 phases. [`ConvergedPair::change`] is the change
    /// that was reached.
    ///
    /// The error of a pair with kinks that the grid does not know falls with the square of the cell
    /// size, so a last change of 1e-6 leaves an error of about 3e-7.
    ///
    /// # Errors
    /// As [`Pair::new`], and [`Error::Input`] for a wear that [`Wear::validate`] refuses.
    pub fn converged(
        input: &PairInput,
        wear: &Wear,
        tolerance: f64,
    ) -> Result<ConvergedPair, Error> {
        Self::converged_with_corrections(input, &Corrections::default(), wear, tolerance)
    }

    /// As [`converged`](Self::converged) for flanks with [`Corrections`].
    ///
    /// # Errors
    /// As [`Pair::with_corrections`], and [`Error::Input`] for a wear that [`Wear::validate`]
    /// refuses.
    pub fn converged_with_corrections(
        input: &PairInput,
        corrections: &Corrections,
        wear: &Wear,
        tolerance: f64,
    ) -> Result<ConvergedPair, Error> {
        wear.validate()?;
        let (mut discretisation, doublings) = match input.tooth_model {
            ToothModel::Coupled => COUPLED,
            _ => (START, DOUBLINGS),
        };
        let build = |disc: &Discretisation| Self::with_corrections(input, corrections, disc);
        let mut pair = build(&discretisation)?;
        let variations = |pair: &Self| {
            let (unworn, worn) = (pair.unworn(), pair.archard(wear).analysis);
            [&unworn, &worn].map(|analysis| {
                let count = analysis.ste_um.len() as f64;
                let mean = analysis.ste_um.iter().sum::<f64>() / count;
                (analysis.delta_ste_um, SILENT * mean.abs())
            })
        };
        let mut last = variations(&pair);
        let mut change = f64::INFINITY;
        for _ in 0..doublings {
            discretisation = discretisation.refined(2);
            pair = build(&discretisation)?;
            let next = variations(&pair);
            change = 0.0;
            for ((old, _), (new, floor)) in last.into_iter().zip(next) {
                if new != old {
                    change = f64::max(change, (new - old).abs() / new.max(floor));
                }
            }
            last = next;
            if change <= tolerance {
                break;
            }
        }
        Ok(ConvergedPair {
            pair,
            discretisation,
            change,
        })
    }
}
