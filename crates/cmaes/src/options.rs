//! The settings of one search.

use crate::{Bounds, Error};

/// The settings of a [`CmaEs`](crate::CmaEs). Start from [`Options::new`] and change single fields.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// Number of candidates in a generation, λ.
    pub population: usize,
    /// Number of best candidates whose average is the next mean, µ.
    pub parents: usize,
    /// The initial step size σ, as a fraction of each variable's range.
    pub step: f64,
    /// The box that no candidate leaves.
    pub bounds: Bounds,
    /// Number of values of each discrete variable: the caller divides the variable's interval into as many equal
    /// cells and rounds to one value per cell. 0 for a continuous variable; empty if all are continuous.
    pub cells: Vec<usize>,
    /// Whether the worst candidates reduce the variance in their direction (negative weights, the
    /// tutorial's default) or are ignored.
    pub active: bool,
    /// Number of times an out-of-bounds candidate is drawn again before it is moved to the
    /// boundary.
    pub resamples: usize,
    /// The search stops when the values of a whole window of generations differ by less than this.
    pub value_tolerance: f64,
    /// The search stops when the step in every variable is below this fraction of the initial step.
    pub step_tolerance: f64,
}

impl Options {
    /// The tutorial's defaults (table 1 and section B.3) in the given bounds: λ = 4 + ⌊3 ln d⌋,
    /// µ = ⌊λ/2⌋, σ = 0.3, active weights, 100 redraws, tolerances of 1e-12.
    #[must_use]
    pub fn new(bounds: Bounds) -> Self {
        // At least 4, and far below 2⁵³ for any dimension that fits in memory.
        let population = 4 + (3.0 * (bounds.dimension() as f64).ln()).floor() as usize;
        Self {
            population,
            parents: population / 2,
            step: 0.3,
            bounds,
            cells: Vec::new(),
            active: true,
            resamples: 100,
            value_tolerance: 1e-12,
            step_tolerance: 1e-12,
        }
    }

    /// The error of the first option that is out of range.
    pub(crate) fn check(&self) -> Result<(), Error> {
        let Self {
            population,
            parents,
            step,
            ..
        } = *self;
        if population < 2 {
            return Err(Error::Population { population });
        }
        if parents == 0 || parents > population {
            return Err(Error::Parents {
                parents,
                population,
            });
        }
        if !(step > 0.0 && step <= 10.0) {
            return Err(Error::Step { step });
        }
        for (name, value) in [
            ("value tolerance", self.value_tolerance),
            ("step tolerance", self.step_tolerance),
        ] {
            if !(value >= 0.0 && value.is_finite()) {
                return Err(Error::Tolerance { name, value });
            }
        }
        Ok(())
    }
}
