//! A campaign's jobs in files, for nodes that cannot connect to a coordinator.
//!
//! A [`Shard`] is the work of one node: the campaign and some of the leases of its present stage,
//! as JSON. A [`Part`] holds the results: a header, then one record with a checksum for each report
//! of the worker, so that a stopped worker can continue. [`Service`] answers a worker as a
//! coordinator would: it leases the jobs of the shard and appends reports to the part.
//!
//! A worker that must end while its coordinator is away leaves its results as a part, too
//! ([`UndeliveredFile`]).

mod error;
mod part;
mod service;
mod shard;
#[cfg(test)]
mod tests;
mod undelivered;

pub use error::Error;
pub use part::{Header, Kinship, Part};
pub use service::Service;
pub use shard::Shard;
pub(crate) use undelivered::unlocked;
pub use undelivered::{OrphanFile, UndeliveredFile};
