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
    /// No method has this name.
    #[error("no design is called {name:?}, use random, maximin or sobol")]
    UnknownMethod {
        /// The name given.
        name: String,
    },
    /// The Sobol sequence at hand ends before this number of points.
    #[error("{n} points of a Sobol sequence requested: 2 to 65536 are possible")]
    SobolPoints {
        /// The requested number of points.
        n: usize,
    },
    /// A design can only be enlarged.
    #[error("{n} points requested of a design that has {existing} already: ask for more than that")]
    Shrinking {
        /// The requested number of points.
        n: usize,
        /// The number of points that are there.
        existing: usize,
    },
    /// The design to enlarge does not have one point per stratum.
    #[error(
        "two of the {existing} points share a stratum of variable {variable}, or one is outside of \
         the unit box: only a Latin hypercube can be enlarged"
    )]
    NotStratified {
        /// The number of points.
        existing: usize,
        /// The first such variable, from 0.
        variable: usize,
    },
}
