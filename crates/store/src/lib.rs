//! The campaign's store: one SQLite file with all inputs and results of a campaign.
//!
//! This is the only crate with SQL. It stores rows and does not interpret them: other crates decide
//! which design comes next and when a stage is complete.
//!
//! # Invariants
//!
//! - One writer. [`Store::create_or_open`] holds exclusive locks on `FILE.lock` and, on Linux, on
//!   the file itself until the last row is on disk. Readers ([`Store::open_read_only`]) need no
//!   lock.
//! - Acknowledged rows are on disk: [`Writer::submit`] returns after the commit, and commits are
//!   synced (`journal_mode = WAL`, `synchronous = FULL`).
//! - The first write wins. A second value for a design, criteria, sample or optimiser run is either
//!   equal, and counted as a duplicate, or an error that names both. It never overwrites the first.
//! - A file that is not a sound store of this campaign, or that has fewer commits than were
//!   acknowledged, is refused before anything is written to it. So is a file with several names. A
//!   file that is removed or replaced while it is open accepts no further rows.
//! - A result is read as it was stored: its row carries a digest of its columns, and a difference is
//!   an error that names table and row.
//! - Tallies are updated in the transactions that store the rows they count. The number of samples,
//!   their distribution over designs and their digest are therefore known without reading all
//!   samples.
//!
//! # What finds which damage
//!
//! | damage | found by |
//! |---|---|
//! | a page that was overwritten, cut off or is of another file | SQLite's check of the pages |
//! | an index that differs from its table | SQLite's check of the indexes |
//! | a value that changed in a row or in a block of samples | the digest of the row |
//! | a block of samples that is missing or was added | the counts in the tally of its stream |
//! | commits that are missing because the log was cut or an older copy was put back | the number of commits in the lock file |
//! | a file that is removed or replaced while it is open | device and inode numbers |
//!
//! All but the last are compared when the file is opened: above 64 MiB in the background, and the number of commits only
//! for a coordinator. The digests are also compared whenever a row is read.
//! The digests detect accidents such as a flipped bit or an edited file. They do not protect against
//! deliberate edits that adapt them.
//!
//! Negative zero loses its sign: SQLite stores -0.0 as 0.0, so both count as 0.0 in single
//! numbers and in samples, digests and comparisons with stored rows included. NaN is refused.
//!
//! # Fail points
//!
//! [`FailPoint::set`] makes the process end at one of the points below; the coordinator calls it for
//! its hidden option `--fail-point`. A point is written `NAME`, `NAME:PASSES` or
//! `NAME:PASSES:MICROSECONDS`: `before_commit:7` is the eighth commit, and `checkpoint:0:300` is 300
//! microseconds after the beginning of the first checkpoint.
//!
//! - `before_commit`: all rows of a group are inserted, but not committed;
//! - `after_commit`: the group is on disk, but not acknowledged;
//! - `checkpoint`: the log is about to be copied to the file;
//! - `creation`: a new store has its tables, but they are not committed.

#![warn(missing_docs)]

mod batch;
mod blocks;
mod campaign;
mod cause;
mod change;
mod commits;
mod connection;
mod criteria;
mod derived;
mod designs;
mod digest;
mod discard;
mod error;
mod evaluations;
mod fail_point;
mod failures;
mod filesystem;
mod generations;
mod identity;
mod infill;
mod integrity;
mod lock;
mod missing;
mod models;
mod open;
mod optima;
mod origins;
mod own_file;
mod paths;
mod progress;
mod receipt;
mod responses;
mod rounds;
mod row;
mod runs;
mod samples;
mod schema;
mod store;
mod tally;
mod times;
mod values;
mod writer;

pub use batch::Batch;
pub use blocks::SampleBlock;
pub use campaign::CampaignRow;
pub use criteria::CriteriaRow;
pub use derived::{Derivation, DerivedResult};
pub use designs::DesignRow;
pub use discard::{Discard, RemovedRows};
pub use error::Error;
pub use evaluations::EvaluationRow;
pub use fail_point::FailPoint;
pub use failures::{FailureGroup, FailureKind, FailureRow};
pub use filesystem::network_file_system;
pub use infill::InfillRow;
pub use missing::MissingWork;
pub use models::ModelRow;
pub use optima::OptimumRow;
pub use origins::OriginRow;
pub use own_file::open_own_file;
pub use progress::Progress;
pub use receipt::Receipt;
pub use responses::ResponseRow;
pub use rounds::{NewRound, RoundRow, UnsampledPoint};
pub use runs::OptimiserRunRow;
pub use store::Store;
pub use tally::SampleTally;
pub use times::{JobTimeRow, StageTimeRow};
pub use writer::Writer;
