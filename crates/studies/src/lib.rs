//! Studies: computations on several campaigns, on a finished one, or without one.
//!
//! - [`sweep`] compares campaigns with other numbers of teeth.
//! - [`sizing`] ranks numbers of teeth and dimensions, each at its own optimum.
//! - [`sensitivity`] splits the variance of an optimum's percentile among tolerances.
//! - [`pareto`] weighs the percentile against a second objective.
//! - [`simulate`] computes one pair of gears, and [`um_bridge`] offers a campaign's gears to other programs.
//! - [`direct`] searches the least percentile, and [`samples`] draws the verification samples of the result.
//! - [`finished`] reads the finished campaign of a study, [`refusal`] has the reasons to refuse one, and [`table`]
//!   writes the results.
//!
//! A study of a campaign computes rows from its file or its finished store, and writes them as CSV, as a
//! Markdown table and, where a picture helps, as an SVG chart. None writes to a campaign's store.
//! Simulations run in this process on all threads of the caller's rayon pool, and results do not
//! depend on their number. Only [`sweep`] runs whole campaigns, which the caller does.

mod arguments;
pub mod direct;
pub mod finished;
pub mod pareto;
pub mod refusal;
pub mod samples;
pub mod sensitivity;
pub mod simulate;
pub mod sizing;
pub mod sweep;
pub mod table;
pub mod um_bridge;
