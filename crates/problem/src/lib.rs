//! The campaign file, the problem formulations, and the computations of workers.
//!
//! - [`Campaign`] and [`PairFile`] are the user's files, parsed and validated ([`mod@file`]).
//! - [`accuracy`] parses a campaign and chooses its settings for a tolerance.
//! - [`formulation`] maps a design point to a gear pair, its criteria and its constraints.
//! - [`simulator`] is the interface between the stages and a simulator.
//! - [`task`] is the work of a worker: its input, its output, and the pure function between them.
//!
//! This crate does no I/O, reads no clock and does not depend on where it runs.

#![warn(missing_docs)]

pub mod accuracy;
mod approach;
pub mod file;
pub mod formulation;
pub mod optimise;
mod own_designs;
pub mod probe;
mod quantity;
pub mod simulator;
pub mod task;

pub use file::{Campaign, FileError, PairFile};
pub use formulation::{Approach, Criteria, Design, GearCriteria, GearVariables};
pub use quantity::Quantity;
