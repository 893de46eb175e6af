//! Enrichment of a kriging model near a constrained optimum, as pure decisions.
//!
//! A response that takes many simulations (a percentile) is known, with noise of known variance, at
//! the designs of an experiment. From these, [`decide`] derives which observations to make next,
//! which design to recommend, with the model's 95 % interval for it, and when to stop. It does no
//! I/O and keeps no memory: a round is a function of rows, settings and seed, so it can be
//! interrupted and repeated anywhere. The caller evaluates the constraints, exactly.
//!
//! ```
//! use cmaes::Bounds;
//! use enrich::{Options, SampledDesign, State, decide};
//!
//! // A response of one variable, with its least value at 0.3, known at eight designs.
//! let response = |x: f64| 1.0 + (x - 0.3).powi(2);
//! let sampled = |x: f64| SampledDesign {
//!     x: vec![x],
//!     samples: 30,
//!     response: response(x),
//!     variance: 1e-6,
//!     violation: 0.0,
//!     baseline: 0.0,
//! };
//! let state = State {
//!     sampled: (0..8).map(|i| sampled(f64::from(i) / 7.0)).collect(),
//!     ..State::default()
//! };
//! let options = Options::new(Bounds::new([(0.0, 1.0)])?);
//! // No constraints: every design keeps them.
//! let decision = decide(&state, &options, &|_: &[f64]| Some(-1.0))?;
//! let recommended = decision.recommendation.expect("a design is feasible");
//! assert!((recommended.x[0] - 2.0 / 7.0).abs() < 0.01, "the nearest to 0.3");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! - [`State`] holds the rows, [`Options`] the settings; [`Criterion`] names the infill criteria.
//! - [`Decision`] is the answer: [`Infill`] (new designs, and more samples at promising ones),
//!   [`Recommendation`], [`Stop`] and [`Note`]s.
//!
//! All values are in the unit of the response. The enrichment stops when the criterion values every
//! observation, in every basin and in the whole box, below δ in two rounds in a row, and the half-width
//! of the 95 % interval at the recommended design is below δ, too.
//!
//! Unusual input has a defined result:
//!
//! - equal responses, or too few designs for a model, lead to space-filling rounds with a [`Note`];
//! - responses that are not numbers count as failures; if designs have failed, the value of a new design
//!   is weighted by the probability that it can be simulated, which is learned from all designs;
//! - two rounds in a row in which every observation fails end the enrichment, and so does a box without a
//!   feasible design;
//! - an infill point that falls onto an existing design becomes more samples there;
//! - entries with the same variables are merged;
//! - a budget that pays for none of the worthwhile observations ends the enrichment as
//!   [`Stop::Budget`], not as convergence.

#![warn(missing_docs)]

mod batch;
mod belief;
mod confirm;
mod context;
mod criterion;
mod decide;
mod decision;
mod error;
mod expectation;
mod fill;
mod message;
mod models;
mod offer;
mod options;
mod rotation;
mod search;
mod simulability;
mod state;
mod stop;
mod surrogate;

pub use decide::decide;
pub(crate) use decision::Z95;
pub use decision::{Decision, Infill, Reason, Recommendation};
pub use error::Error;
pub use message::{Note, Stop};
pub use options::{Criterion, Options};
pub use state::{ExactCriteria, RoundRecord, SampledDesign, State};
