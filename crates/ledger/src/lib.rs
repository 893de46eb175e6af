//! Which worker computes which samples: streams, leases, crashes and quarantine, without sockets or
//! clocks.
//!
//! A [`Ledger`] knows which samples are missing, leases them to workers, and records which were
//! delivered. It does not know what a sample is: a stream carries an opaque value that a worker
//! needs. It has no clock: every call passes the time since an origin of the caller's choice.
//!
//! - A **stream** ([`StreamId`]) needs samples, or one result: a design, a point, a run of an
//!   optimiser. Its **generation** ([`Generation`]) is the digest of everything that its values
//!   depend on.
//! - A **unit** ([`Unit`]) is a range of one stream's samples.
//! - A **lease** ([`LeaseId`]) grants a few units to a worker, under a number that is never used
//!   again.
//!
//! Results are accepted by stream, generation and range alone. The worker, the lease and the time
//! of delivery do not matter, because the generation guarantees that the numbers are right. The
//! lease only decides which worker a failure or crash counts against.
//!
//! # The life of a stream
//!
//! ```text
//!            lease               all its samples are stored
//!   free ──────────────► leased ────────────────────────────► settled
//!    ▲ ▲                  │  │                                   ▲
//!    │ └── waiting ◄──────┘  └────────► quarantined ────────────────┘
//!    │     after a failure    too many failures or crashes    late samples are kept
//!    └───── released, expired, delivered in part
//! ```
//!
//! [`Options::max_failures`] and [`Options::retry_for`] say which failures count against a sample. A
//! stream whose attempts are used up is quarantined; a [tolerant](StreamDemand::is_tolerant) stream stores the
//! failure as its result.
//!
//! # Invariants
//!
//! - The free samples of a stream are its missing samples that are on no lease and do not wait
//!   after a failure.
//! - A sample is on at most two leases, of different workers.
//! - A worker that is granted a stream that is computed alone holds nothing else.
//! - A settled stream stays settled, unless more samples are wanted or its generation changes.
//! - Lease numbers only increase.
//! - The state is a function of the calls and their times. It does not depend on a clock, random
//!   numbers or hash-map order.

#![warn(missing_docs)]

mod calls;
mod check;
mod control;
mod crashes;
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
pub use options::{HEARTBEATS_PER_LEASE, Options};
pub use ranges::{gaps, subtract};
pub use types::{
    Counts, Crash, CrashRecord, Delivery, Failure, FailureReport, Generation, Grant, Group,
    History, Kind, LeaseId, StreamDemand, StreamId, Unit, Verdict, WorkerId, WorkerStatus,
};
