//! A campaign's jobs in files, for nodes without a network between them.
//!
//! A [`Shard`] is what one node computes: the campaign and some of the leases of its present stage, as JSON. A
//! [`Part`] is what came of it: a header, then one record for each report of the worker, each with a checksum,
//! so that a worker that is stopped goes on where it was. [`Service`] answers a worker as a coordinator would:
//! it leases what the shard holds and appends what is reported to the part.

mod error;
mod part;
mod service;
mod shard;

pub use error::Error;
pub use part::{Header, Part};
pub use service::Service;
pub use shard::Shard;
