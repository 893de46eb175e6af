//! Measurements of the methods of this workspace.
//!
//! - [`stability`]: the robustness tests of all methods, which are also the stability atlas.
//! - [`tradeoff`]: speed against accuracy.
//! - [`rehearsal`]: the ledger with simulated workers.

#![allow(
    missing_docs,
    reason = "a comment that repeats the name of an item helps nobody"
)]

pub mod rehearsal;
pub mod stability;
mod summary;
pub mod tradeoff;
