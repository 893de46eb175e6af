//! Studies: computations on several campaigns, on a finished one, or without one.
//!
//! - [`sweep`] compares campaigns with other numbers of teeth.
//! - [`corrections`] searches profile corrections, with the [`direct`] search of the percentile.
//! - [`sensitivity`] splits the variance of an optimum's percentile among tolerances.
//! - [`pareto`] weighs the percentile against a second objective.
//! - [`finished`] reads the finished campaign that they start from, [`refusal`] has the reasons to
//!   refuse one, and [`table`] writes the results.
//! - [`simulations`] is the interface to the workers.
//! - [`simulate`] computes one pair of gears.
//!
//! A study of a campaign computes rows from its file or its finished store, and writes them as CSV, as a
//! Markdown table and, where a picture helps, as an SVG chart. None writes to a campaign's store.

pub mod corrections;
pub mod direct;
pub mod finished;
pub mod pareto;
pub mod refusal;
pub mod sensitivity;
pub mod simulate;
pub mod simulations;
pub mod sweep;
pub mod table;
