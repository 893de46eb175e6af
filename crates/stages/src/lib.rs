//! What a campaign does next, as pure decisions and pure steps.
//!
//! - [`plan`] decides which samples and runs are missing and which local step comes next: from the
//!   [`state`] of a campaign, which [`snapshot`] reads from its store. [`wanted`] says what that asks of
//!   workers.
//! - [`designs`] makes the DoE.
//! - [`responses`] says how many samples a design needs, and makes its response of them; [`linear`]
//!   computes their control variate, and [`statistics`] makes the responses of the whole DoE.
//! - [`fitting`] fits the kriging model to the responses.
//! - [`deciding`] decides rounds of infill from the store's rows; [`infill`] has their points and settings,
//!   [`rounds`] what was decided, [`constraints`] what stands in for the constraints of an external program.
//! - [`choosing`] ends an approach with a design; [`optima`] has the rows of these, [`cost`] what they took.
//! - [`derived`] says what is forgotten when samples of the DoE change.
//! - [`searching`] takes optimiser runs on an external simulator from generation to generation.
//! - [`names`] has what streams are called in the store and in messages.
//! - [`references`] has the designs that the paper prints.
//!
//! Nothing here reads a clock or writes to a store.

pub mod choosing;
pub mod constraints;
pub mod cost;
pub mod deciding;
pub mod derived;
pub mod designs;
pub mod fitting;
pub mod infill;
pub mod linear;
pub mod names;
pub mod optima;
pub mod plan;
pub mod references;
pub mod responses;
pub mod rounds;
pub mod searching;
pub mod snapshot;
pub mod state;
pub mod statistics;
pub mod wanted;
