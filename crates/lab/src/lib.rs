//! The laboratory: the methods of this workspace under measurement.
//!
//! - [`stability`] runs inputs on which a method breaks or nearly does, and says which promises it keeps.
//! - [`tradeoff`] charts speed against accuracy.
//! - [`rehearsal`] puts the ledger to work for simulated workers.

pub mod rehearsal;
pub mod stability;
pub mod tradeoff;
