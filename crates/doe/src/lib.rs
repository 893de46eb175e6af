//! Maximin Latin hypercube designs of experiments.
//!
//! A Latin hypercube of n points takes each of n levels exactly once in every variable, so that
//! each variable by itself is sampled as finely as the number of points allows. Among the
//! (n!)^(d − 1) of them, a *maximin* one has the largest distance between its two nearest points,
//! which spreads the points in all variables together.
//!
//! ```
//! use doe::{Options, maximin, random_lhs};
//!
//! // Twenty points in the open unit box of three variables.
//! let design = maximin(20, 3, &Options { seed: 1, effort: 1.0 })?;
//! assert!(design.is_latin());
//! assert!(design.min_distance() > random_lhs(20, 3, 1)?.min_distance());
//! # Ok::<(), doe::Error>(())
//! ```
//!
//! - [`maximin`] searches for such a design by swaps of levels; its documentation has the method.
//! - [`enlarge`] adds points to a design and keeps the existing ones. It can be repeated;
//!   [`check_enlarge`] says beforehand whether it is possible.
//! - [`sobol`] gives a scrambled Sobol sequence, and [`Method`] each kind of design by its name.
//! - [`random_lhs`] draws a Latin hypercube at random, as a baseline.
//! - [`Design`] holds the points, in the open unit box, and measures them.
//!
//! Designs depend on size, seed and effort only: the search's budget is a number of steps, not a
//! time, and the search compares integers.
//!
//! # References
//!
//! - M. E. Johnson, L. M. Moore and D. Ylvisaker, *Minimax and maximin distance designs*, Journal of
//!   Statistical Planning and Inference 26, 1990.
//! - M. D. Morris and T. J. Mitchell, *Exploratory designs for computational experiments*, Journal
//!   of Statistical Planning and Inference 43, 1995.
//! - E. R. van Dam, G. Rennen and B. Husslage, *Bounds for maximin Latin hypercube designs*,
//!   Operations Research 57(3), 2009.
//! - P. Z. G. Qian, *Nested Latin hypercube designs*, Biometrika 96, 2009.
//! - A. B. Owen, *Scrambling Sobol' and Niederreiter–Xing points*, Journal of Complexity 14, 1998.
//! - G. Dueck and T. Scheuer, *Threshold accepting*, Journal of Computational Physics 90, 1990.

#![warn(missing_docs)]

mod design;
mod error;
mod maximin;
mod method;
mod nested;
mod search;
mod table;

pub use design::{Design, MAX_VARIABLES, random_lhs};
pub use error::Error;
pub use maximin::{Options, maximin};
pub use method::{Method, sobol};
pub use nested::{check_enlarge, enlarge};
pub use stats::SOBOL_POINTS;
