//! The campaign's store: one SQLite file that holds everything a campaign has learnt.
//!
//! This is the only crate with SQL. It knows rows, not their meaning: which design comes next and
//! when a stage is done is decided elsewhere.
//!
//! # Invariants
//!
//! - One writer. [`Store::create_or_open`] holds exclusive locks on `FILE.lock` and, on Linux, on the
//!   file itself until the last row is on disk; readers ([`Store::open_read_only`]) need no lock.
//! - What was acknowledged is on disk: [`Writer::submit`] returns after the commit, and commits are
//!   synced (`journal_mode = WAL`, `synchronous = FULL`).
//! - First write wins. A second value for a design, criteria, sample or optimiser run is either
//!   the same, and counted as a duplicate, or an error that names both. Nothing is overwritten.
//! - A file that is not this campaign's sound store, or that holds less than was acknowledged, is
//!   refused before anything is written to it. So is one with several names, and one that went away
//!   while it was open takes no more rows.
//! - A state of an unfinished run is no result: it is replaced by a later one, removed with the run's
//!   result, and checked by the worker that continues the run.
//! - What was stored is what is read: rows carry a digest of their columns, samples have digests over
//!   all of them, too, and a difference is an error that names table and row. These digests tell accidents:
//!   a bit that flipped, a file that was edited. Whoever edits the store to deceive can make them fit.
//! - Tallies are part of the transactions that store what they count: nobody has to read all
//!   samples to know how many there are, of which designs, and what their digest is.
//!
//! Zeros lose their sign: SQLite stores -0.0 as 0.0, so both are taken as 0.0 everywhere, digest
//! and comparison with held rows included. Numbers that are not finite are refused.
//!
//! # Fail points
//!
//! With the feature `failpoints`, off by default, a test can end the process at these places. They
//! are set as described at the crate `fail`, for example with
//! `FAILPOINTS='store::before_commit=7*off->return'` for the eighth commit, provided that the
//! program calls `fail::FailScenario::setup`.
//!
//! - `store::before_commit`: everything of a group is inserted, nothing is committed;
//! - `store::after_commit`: the group is on disk, nobody has been told;
//! - `store::checkpoint`: while the log is moved into the file; `return(N)` ends the process N
//!   microseconds after the beginning of that;
//! - `store::packing`: part of the samples of an earlier schema are packed, nothing is committed;
//! - `store::migration`: the schema is brought up to date but for the commit.

#![warn(missing_docs)]

mod cause;
mod check;
mod columns;
mod connection;
mod digest;
mod error;
mod failpoints;
mod filesystem;
mod insert;
mod keyed;
mod lock;
mod open;
mod place;
mod query;
mod rounds;
mod rows;
mod samples;
mod schema;
mod store;
mod tables;
mod tally;
mod writer;

pub use error::Error;
pub use filesystem::network_file_system;
pub use rounds::{InfillRow, NewRound, RoundRow, Unsampled};
pub use rows::{
    Batch, CampaignRow, CriteriaRow, DesignRow, EvaluationRow, FailureGroup, FailureKind,
    FailureRow, JobHistory, JobTimeRow, MissingWork, ModelRow, OptimiserRunRow, OptimumRow,
    Progress, Receipt, ResponseRow, SampleRow, StageTimeRow, VerifyRow,
};
pub use store::Store;
pub use writer::Writer;
