//! Enrichment of a kriging model near a constrained optimum, as pure decisions.
//!
//! A response that takes many simulations (a percentile) is known, with noise of known variance, at
//! the designs of an experiment. [`decide`] looks at what is known and says which observations to
//! make next, which design to recommend, with the model's 95 % interval for it, and when to stop.
//! It does no I/O and keeps no memory: a round is a function of rows, settings and seed, so it can
//! be interrupted and repeated anywhere. Constraints are evaluated exactly, by the caller.
//!
//! - [`State`] is what the rows say, [`Options`] what the user wants; [`Criterion`] names the infill
//!   criteria.
//! - [`Decision`] is the answer: [`Infill`] (new designs, and more samples at promising ones),
//!   [`Recommendation`], [`Stop`] and [`Note`]s.
//!
//! The stopping rule is stated in µm: stop when the most that the criterion expects of any
//! observation is below δ in two rounds in a row, and the half-width of the 95 % interval at the
//! recommended design is below δ too.
//!
//! What happens in bad weather: a response that is equal everywhere, or designs too few for a model,
//! lead to space-filling rounds with a [`Note`]; responses that are no numbers count as failures, and
//! the neighbourhood of a failure (1 % of the ranges) is avoided; two rounds of nothing but failures
//! end the enrichment, as does a box without a feasible design; an infill point that falls onto an
//! existing design becomes more samples there; entries at one place are merged.

#![warn(missing_docs)]

mod batch;
mod belief;
mod confirm;
mod context;
mod criterion;
mod decide;
mod decision;
mod error;
mod fill;
mod models;
mod offer;
mod options;
mod rotation;
mod search;
mod state;
mod stop;
mod surrogate;

pub use decide::decide;
pub(crate) use decision::Z95;
pub use decision::{Decision, Infill, Note, Reason, Recommendation, Stop};
pub use error::Error;
pub use options::{Criterion, Options};
pub use state::{Known, RoundRecord, Sampled, State};
