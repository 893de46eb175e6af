//! Stopping criteria of a search, and their names.

use std::collections::VecDeque;
use std::fmt;

use crate::Evaluation;

/// Why a search should end (the tutorial's section B.3).
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Stop {
    /// Every candidate of the last `generations` generations failed (NaN or +∞).
    AllFailed {
        /// The length of the window.
        generations: usize,
    },
    /// The last generation and the best of each of the last `generations` generations have exactly
    /// the same value: the search sees a plateau, on which ranks carry no information.
    Plateau {
        /// The length of the window.
        generations: usize,
    },
    /// The values of the window and of the last generation differ by less than the tolerance.
    ValueTolerance {
        /// Largest minus smallest value.
        spread: f64,
    },
    /// The step in every variable is below the tolerance, or no longer changes the mean.
    StepTooSmall {
        /// The longest step of any variable, as a fraction of its range.
        step: f64,
    },
    /// The step grew 10 000-fold: there is no minimum at the scale of the initial step.
    StepTooLarge {
        /// The longest step along any principal axis, as a fraction of the range.
        step: f64,
    },
    /// The covariance matrix has a condition number above 10¹⁴: beyond it, rounding decides.
    IllConditioned {
        /// Largest over smallest eigenvalue.
        condition: f64,
    },
    /// The covariance matrix lost its positive eigenvalues, or is not finite.
    DegenerateCovariance {
        /// The smallest eigenvalue, NaN if there is none.
        smallest: f64,
    },
}

impl fmt::Display for Stop {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::AllFailed { generations } => {
                write!(f, "all candidates of {generations} generations failed")
            }
            Self::Plateau { generations } => {
                write!(f, "all values of {generations} generations are equal")
            }
            Self::ValueTolerance { spread } => {
                write!(f, "values differ by {spread:e} only")
            }
            Self::StepTooSmall { step } => write!(f, "step size fell to {step:e}"),
            Self::StepTooLarge { step } => write!(f, "step size grew to {step:e}"),
            Self::IllConditioned { condition } => {
                write!(f, "covariance matrix has condition number {condition:e}")
            }
            Self::DegenerateCovariance { smallest } => {
                write!(f, "covariance matrix has eigenvalue {smallest:e}")
            }
        }
    }
}

/// The best evaluations of the last generations, from which stagnation is detected.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Window {
    bests: VecDeque<Evaluation>,
    length: usize,
    /// Largest minus smallest value among the `bests` of a full window and the candidates of the last generation.
    spread: Option<f64>,
}

impl Window {
    /// A window of 10 + ⌈30 d/λ⌉ generations, long enough not to mistake a slow phase for the end.
    pub(crate) fn new(dimension: usize, population: usize) -> Self {
        let length = 10 + (30 * dimension).div_ceil(population);
        Self {
            bests: VecDeque::with_capacity(length),
            length,
            spread: None,
        }
    }

    /// Largest minus smallest value among the bests of the window and the candidates of the last generation; `None`
    /// until the window is full, or if all of these failed.
    pub(crate) fn spread(&self) -> Option<f64> {
        self.spread
    }

    /// Records a generation (sorted, best first). Returns the reason to stop, if the window gives
    /// one.
    pub(crate) fn record(&mut self, sorted: &[Evaluation], tolerance: f64) -> Option<Stop> {
        let (first, last) = (sorted.first()?, sorted.last()?);
        if self.bests.len() == self.length {
            self.bests.pop_front();
        }
        self.bests.push_back(*first);
        self.spread = None;
        if self.bests.len() < self.length {
            return None;
        }
        let generations = self.length;
        if self.bests.iter().all(|best| !best.is_usable()) {
            return Some(Stop::AllFailed { generations });
        }
        // No two values differ by more than the lowest and the highest.
        let lowest = self
            .bests
            .iter()
            .fold(first, |a, b| if b.is_better_than(a) { b } else { a });
        let highest = self
            .bests
            .iter()
            .fold(last, |a, b| if a.is_better_than(b) { b } else { a });
        let spread = lowest.gap(highest);
        self.spread = Some(spread);
        if spread == 0.0 {
            Some(Stop::Plateau { generations })
        } else if spread < tolerance {
            Some(Stop::ValueTolerance { spread })
        } else {
            None
        }
    }
}
