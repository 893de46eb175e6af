//! What can be wrong with a request for a design.

/// Why no design could be built.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Error {
    /// The number of points is out of range.
    #[error("{n} points requested: 2 to 100000 are possible")]
    Points {
        /// The requested number of points.
        n: usize,
    },
    /// The number of variables is out of range.
    #[error("{d} variables requested: 1 to 20 are possible")]
    Variables {
        /// The requested number of variables.
        d: usize,
    },
    /// The effort is no usable factor.
    #[error("effort is {effort}: it must be finite and not negative")]
    Effort {
        /// The requested effort.
        effort: f64,
    },
}
