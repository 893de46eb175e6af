//! Who computes which samples: streams, leases, blame and quarantine, without sockets or clocks.
//!
//! A [`Ledger`] knows what is missing, hands it out, and takes back what was computed. What a sample
//! is, it does not know: a stream carries something opaque that a worker needs. What time it is, it
//! is told with every call, as the time since an origin of the caller's choice.
//!
//! - A **stream** ([`StreamId`]) needs samples, or one result: a design, a point, a run of an
//!   optimiser. Its **generation** ([`Generation`]) is the digest of everything that its values
//!   depend on.
//! - A **unit** ([`Unit`]) is a range of one stream's samples.
//! - A **lease** ([`LeaseId`]) is what a worker holds: a few units, under a number that is never used
//!   again.
//!
//! Results are accepted by stream, generation and range alone: who brings them, under which lease
//! and how late does not matter, because the generation says that they are the right numbers. The
//! lease only decides who is blamed.
//!
//! # The life of a stream
//!
//! ```text
//!            lease               all its samples are stored
//!   free ──────────────► leased ────────────────────────────► settled
//!    ▲ ▲                  │  │                                   ▲
//!    │ └── waiting ◄──────┘  └────────► quarantined ────────────────┘
//!    │     after a failure    a failure or a crash too many   what comes late is kept
//!    └───── released, expired, delivered in part
//! ```
//!
//! # Invariants
//!
//! - What is free of a stream is what is missing and on no lease.
//! - A sample is on two leases at most, of different workers.
//! - What is settled stays so, unless more samples are wanted or its generation changes.
//! - Lease numbers only grow.
//! - The state is a function of the calls and their times: no clock, no random number and no
//!   hash-map order takes part.

#![warn(missing_docs)]

mod calls;
mod check;
mod cutting;
mod explain;
mod leases;
mod ledger;
mod options;
mod ranges;
mod state;
mod streams;
mod types;
mod workers;

pub use explain::Explanation;
pub use ledger::Ledger;
pub use options::Options;
pub use ranges::{gaps, subtract};
pub use types::{
    Accepted, Counts, Delivery, Failure, Generation, Grant, Group, History, Kind, LeaseId,
    StreamId, Unit, Vanished, Wanted, WorkerId, WorkerStatus,
};
