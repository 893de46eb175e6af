//! Errors of a request for a design.

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
    /// The effort is negative or not finite.
    #[error("effort is {effort}: it must be finite and not negative")]
    Effort {
        /// The requested effort.
        effort: f64,
    },
    /// The Sobol sequence has fewer points than requested.
    #[error(
        "{n} points of a Sobol sequence requested: 2 to 65536 are possible, the methods maximin and \
         random go to 100000"
    )]
    SobolPoints {
        /// The requested number of points.
        n: usize,
    },
    /// The requested number of points does not exceed that of the design to enlarge.
    #[error("{n} points requested of a design that has {existing} already: ask for more than that")]
    Shrinking {
        /// The requested number of points.
        n: usize,
        /// The number of points of the existing design.
        existing: usize,
    },
    /// A point of the design to enlarge is not in the unit box.
    #[error(
        "point {point} has {value} in variable {variable}, both counted from 0: only points within \
         the unit box, from 0 to 1 in every variable, can be added to"
    )]
    Outside {
        /// Index of the first such point, from 0.
        point: usize,
        /// Index of the first variable that is out of the box there, from 0.
        variable: usize,
        /// The coordinate, as text since it may be NaN.
        value: String,
    },
    /// The number of coordinates of the design to enlarge does not match its size.
    #[error(
        "{got} coordinates given for {n} points in {d} variables: give one of each, point by point"
    )]
    Coordinates {
        /// The number of points.
        n: usize,
        /// The number of variables.
        d: usize,
        /// The number of coordinates.
        got: usize,
    },
    /// The points are not the beginning of the Sobol sequence that is to be continued.
    #[error(
        "point {point}, counted from 0, differs from the Sobol sequence of this seed: only the \
         beginning of this sequence can be continued; add to other designs with the method maximin or random"
    )]
    OtherSequence {
        /// Index of the first point that differs, from 0.
        point: usize,
    },
}
