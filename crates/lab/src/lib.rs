//! Measurements of the methods of this workspace.
//!
//! - [`stability`]: the robustness tests of all methods, which are also the stability atlas.
//! - [`contact`]: the tooth models against finite elements.
//! - [`tradeoff`]: speed against accuracy.
//! - [`rehearsal`]: the ledger with simulated workers.

pub mod contact;
pub mod rehearsal;
pub mod stability;
mod summary;
pub mod tradeoff;
