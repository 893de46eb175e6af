//! The campaign file, the problem formulations, and the stages as pure decisions.
//!
//! - [`Campaign`] and [`PairFile`] are what a user writes, parsed and validated ([`mod@file`]).
//! - [`formulation`] turns a design point into a gear pair, its criteria and its constraints.
//! - [`simulator`] is what the stages ask of whoever simulates a design.
//! - [`task`] is what workers compute: what it takes, what comes out, and the pure function between
//!   them.
//! - [`enrichment`] has the points and the settings of rounds of infill.
//! - [`direct`] searches the percentile itself, with profile corrections if wanted.
//! - [`plan`] decides, from what the store holds, which stages and which local steps come next.
//!
//! Nothing here does I/O, reads a clock or knows where it runs.

pub mod direct;
pub mod enrichment;
pub mod file;
pub mod formulation;
mod linear;
pub mod optimise;
pub mod plan;
pub mod probe;
pub mod simulator;
pub mod task;

pub use file::{Campaign, FileError, PairFile};
pub use formulation::{Approach, Criteria, Frozen, Variables};
pub use linear::LinearResponse;
