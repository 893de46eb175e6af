//! Errors of a search's inputs.

/// Why a search could not be set up, or could not go on.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Error {
    /// The box has no variables.
    #[error("there is no variable to search over: at least one is needed")]
    NoVariables,
    /// A pair of bounds does not span an interval.
    #[error(
        "bounds of variable {index} (counted from 0) are [{lower}, {upper}]: they must be finite, lower < upper"
    )]
    Bounds {
        /// Index of the variable, from 0.
        index: usize,
        /// Lower bound of the variable.
        lower: f64,
        /// Upper bound of the variable.
        upper: f64,
    },
    /// The start point and the bounds disagree about the number of variables.
    #[error("start point has {got} variables, but the bounds have {expected}")]
    Dimension {
        /// The number of bounds.
        expected: usize,
        /// The number of coordinates of the start point.
        got: usize,
    },
    /// The start point is not in the box.
    #[error(
        "start point is {value} in variable {index} (counted from 0), outside [{lower}, {upper}]"
    )]
    StartOutside {
        /// Index of the variable, from 0.
        index: usize,
        /// The start point's coordinate.
        value: f64,
        /// The lower bound.
        lower: f64,
        /// The upper bound.
        upper: f64,
    },
    /// The population has fewer than two candidates, so it cannot be ranked.
    #[error("population is {population}: at least 2 candidates are needed")]
    Population {
        /// The requested population.
        population: usize,
    },
    /// The number of parents is zero or exceeds the population.
    #[error("{parents} parents of {population} candidates: 1 to {population} are possible")]
    Parents {
        /// The requested number of parents.
        parents: usize,
        /// The population.
        population: usize,
    },
    /// The step size is not positive, or is more than 10 ranges.
    #[error("step size is {step} of the range: it must be positive and at most 10")]
    Step {
        /// The requested step.
        step: f64,
    },
    /// A tolerance is negative or not a number.
    #[error("{name} is {value}: it must be finite and not negative")]
    Tolerance {
        /// The option's name.
        name: &'static str,
        /// Value of the option.
        value: f64,
    },
    /// `tell` got another number of evaluations than there are candidates.
    #[error("{got} evaluations told for {expected} candidates asked")]
    Count {
        /// The population.
        expected: usize,
        /// The number of evaluations passed in.
        got: usize,
    },
    /// `tell` was called with no candidates waiting for their evaluations.
    #[error("evaluations told before any candidate was asked for")]
    NothingAsked,
    /// The budget allows no evaluation.
    #[error("no evaluation is allowed: at least 1 is needed")]
    NoBudget,
    /// The objective was NaN or +∞ wherever it was evaluated.
    #[error("objective was NaN or infinite at all {evaluations} designs: none can be called best")]
    NothingUsable {
        /// Number of designs evaluated.
        evaluations: usize,
    },
}
