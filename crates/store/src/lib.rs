//! The campaign's store: one SQLite file that holds everything a campaign has learnt.
//!
//! This is the only crate with SQL. It knows rows, not their meaning: which design comes next and
//! when a stage is done is decided elsewhere.
//!
//! # Invariants
//!
//! - One writer. [`Store::create_or_open`] holds an exclusive lock on `FILE.lock` until the last
//!   row is on disk; readers ([`Store::open_read_only`]) need no lock.
//! - What was acknowledged is on disk: [`Writer::submit`] returns after the commit, and commits are
//!   synced (`journal_mode = WAL`, `synchronous = FULL`).
//! - First write wins. A second value for a design, criteria, sample or optimiser run is either
//!   the same, and counted as a duplicate, or an error that names both. Nothing is overwritten.
//! - A file that is not this campaign's sound store is refused before anything is written to it.
//!
//! Zeros lose their sign: SQLite stores -0.0 as 0.0, so both are taken as 0.0 everywhere, digest
//! and comparison with held rows included. Numbers that are not finite are refused.

#![warn(missing_docs)]

mod error;
mod filesystem;
mod insert;
mod open;
mod query;
mod rows;
mod store;
mod writer;

pub use error::Error;
pub use filesystem::network_file_system;
pub use rows::{
    Batch, CampaignRow, CriteriaRow, DesignRow, FailureKind, FailureRow, JobTimeRow, MissingWork,
    ModelRow, OptimiserRunRow, OptimumRow, Progress, Receipt, ResponseRow, SampleRow, VerifyRow,
};
pub use store::Store;
pub use writer::Writer;
