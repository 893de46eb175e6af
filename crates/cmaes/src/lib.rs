//! Covariance matrix adaptation evolution strategy with bounds and restarts.
//!
//! The CMA-ES minimises a function of which only values are known: it draws a population of
//! candidates from a normal distribution, ranks them, moves the mean to the weighted average of the
//! better half, and adapts the step size and the covariance matrix to the steps that succeeded
//! (rank-one and rank-µ updates, cumulative step-size adaptation). Only ranks enter, so the search
//! does not change under a monotone transformation of the objective.
//!
//! ```
//! use cmaes::{Bounds, CmaEs, Options};
//! use stats::streams::{Purpose, stream};
//!
//! let sphere = |x: &[f64]| (x[0] - 0.5).powi(2) + (x[1] + 0.25).powi(2);
//! let bounds = Bounds::new([(-2.0, 2.0), (-2.0, 2.0)])?;
//! let mut search = CmaEs::new(&[1.0, 1.0], Options::new(bounds))?;
//! let mut rng = stream(1, Purpose::Test, 0, 0);
//! while search.stop().is_none() && search.evaluations() < 2000 {
//!     let candidates = search.ask(&mut rng);
//!     let values: Vec<f64> = candidates.iter().map(|x| sphere(x)).collect();
//!     search.tell(&values)?;
//! }
//! let (x, _) = search.best().expect("all candidates have values");
//! assert!((x[0] - 0.5).abs() < 1e-4 && (x[1] + 0.25).abs() < 1e-4);
//! # Ok::<(), cmaes::Error>(())
//! ```
//!
//! - [`CmaEs`] is the strategy itself, with an ask-and-tell interface: the caller evaluates.
//! - [`Run`] runs one search after another until a budget is spent. Its [`Restarts`] are from the best
//!   design so far (as in the gear paper), with growing populations (IPOP) or with two regimes (BIPOP).
//! - [`minimise_run`] does a whole run on a function of the caller's.
//!
//! Variables are scaled by their range: inside, the search works in the unit box, so a step of 0.3
//! is 0.3 of each variable's range. Candidates never leave the bounds.
//!
//! Constraints need no penalty weight: an [`Evaluation`] may carry a violation, and feasible
//! candidates, by value, rank before infeasible ones, by violation.
//!
//! The search is a function of its inputs and of the random stream passed in. Matrix products avoid
//! kernels that are chosen at run time from the processor's features, so two machines that run the
//! same build on the same mathematical library compute the same bits.
//!
//! # References
//!
//! - N. Hansen, *The CMA Evolution Strategy: A Tutorial*, arXiv:1604.00772v2, 2023. Equation and
//!   table numbers in this crate are the tutorial's.
//! - N. Hansen and A. Ostermeier, *Completely derandomized self-adaptation in evolution
//!   strategies*, Evolutionary Computation 9(2), 2001.

#![warn(missing_docs)]

mod bounds;
mod error;
mod evaluation;
mod margin;
mod minimise;
mod options;
mod parameters;
mod run;
mod stop;
mod strategy;

pub use bounds::Bounds;
pub use error::Error;
pub use evaluation::Evaluation;
pub use minimise::minimise_run;
pub use options::Options;
pub use run::{Cause, Outcome, Restart, Restarts, Run, RunOptions};
pub use stop::Stop;
pub use strategy::CmaEs;
