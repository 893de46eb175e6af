//! Measurements of the methods of this workspace.
//!
//! - [`stability`]: the robustness tests of all methods, which are also the stability atlas.
//! - [`tradeoff`]: speed against accuracy.
//! - [`rehearsal`]: the ledger with simulated workers.

pub mod rehearsal;
pub mod stability;
mod summary;
pub mod tradeoff;
