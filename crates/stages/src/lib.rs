//! The next steps of a campaign, as pure decisions and pure steps.
//!
//! - [`plan`] decides which samples and runs are missing and which local step comes next: from the
//!   [`state`] of a campaign, which [`snapshot`] reads from its store. [`wanted`] turns that into
//!   requests to workers.
//! - [`designs`] makes the DoE, and [`doe`] is the DoE as it is stored.
//! - [`calls`] counts the calls of an external program that a campaign plans.
//! - [`responses`] says how many samples a design needs, and computes its response from them; [`linear`]
//!   computes their control variate, and [`statistics`] the responses of the whole DoE.
//! - [`plausibility`] finds samples of an external program that are absurd beside all others.
//! - [`fitting`] fits the kriging model to the responses.
//! - [`deciding`] decides rounds of infill from the store's rows; [`infill`] has their points and
//!   settings, [`rounds`] the decisions, [`constraints`] models of an external program's constraints,
//!   `limits` those of limited measures.
//! - [`choosing`] chooses the design that an approach ends with; [`optima`] has the rows of these
//!   designs, [`cost`] their cost.
//! - [`derived`] says which stored results are outdated.
//! - [`searching`] takes optimiser runs on an external simulator from generation to generation.
//! - [`verification`] says how many verification samples a design gets.
//! - [`contradiction`] records results that differ from stored ones.
//! - [`names`] has the names of streams in the store and in messages.
//! - [`references`] has the designs that the paper prints.
//!
//! Nothing here reads a clock or writes to a store.

pub mod calls;
pub mod choosing;
pub mod constraints;
pub mod contradiction;
pub mod cost;
pub mod deciding;
pub mod derived;
pub mod designs;
pub mod doe;
pub mod fitting;
pub mod infill;
mod limits;
pub mod linear;
pub mod names;
pub mod optima;
pub mod plan;
pub mod plausibility;
pub mod references;
pub mod responses;
pub mod rounds;
pub mod searching;
pub mod snapshot;
pub mod stage;
pub mod state;
pub mod statistics;
pub mod verification;
pub mod wanted;
