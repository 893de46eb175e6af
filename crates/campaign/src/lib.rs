//! The campaign file, the problem formulations, and what workers compute.
//!
//! - [`Campaign`] and [`PairFile`] are what a user writes, parsed and validated ([`mod@file`]).
//! - [`accuracy`] parses a campaign and chooses its settings for a tolerance.
//! - [`formulation`] turns a design point into a gear pair, its criteria and its constraints.
//! - [`variant`] is a design as studies ask for it: with profile corrections, say.
//! - [`simulator`] is what the stages ask of whoever simulates a design.
//! - [`task`] is what workers compute: what it takes, what comes out, and the pure function between
//!   them.
//!
//! Nothing here does I/O, reads a clock or knows where it runs.

pub mod accuracy;
pub mod file;
pub mod formulation;
pub mod optimise;
pub mod probe;
pub mod simulator;
pub mod task;
pub mod variant;

pub use file::{Campaign, FileError, PairFile};
pub use formulation::{Approach, Criteria, Design, GearCriteria, GearVariables};
pub use variant::{Variant, WearFactors};
