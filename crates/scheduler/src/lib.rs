//! Leases, retries and quarantine: a state machine without sockets or clocks.
//!
//! A [`Scheduler`] hands jobs to workers and takes back results, failures and silence. What a job
//! is, it does not know: payloads are opaque. What time it is, it is told with every call, as the
//! time since an origin of the caller's choice that never goes backwards.
//!
//! # The life of a job
//!
//! ```text
//!          lease                complete
//! queued ─────────► leased ───────────────► done
//!    ▲ ▲              │  │                   ▲
//!    │ └──────────────┘  └──► quarantined ───┘
//!    │ expire, fail, release      │ fail, expire past the limit; a late result is still taken
//!    └────────────────────────────┘
//!      retry
//! ```
//!
//! # Invariants
//!
//! - A job is in exactly one of the four states, from the moment it is added.
//! - Done never reopens. A job that is done or given up can be forgotten altogether.
//! - The attempts of a job only grow.
//! - A worker holds only what was granted to it, by this scheduler or by the one before a restart.
//! - The state is a function of the calls and their times: no clock, no random number and no
//!   hash-map order takes part.

#![warn(missing_docs)]

mod explain;
mod options;
mod scheduler;
mod state;
mod types;

pub use explain::Explanation;
pub use options::Options;
pub use scheduler::Scheduler;
pub use types::{
    Completion, Counts, Details, Directive, Expired, Failure, Grant, Held, History, JobId,
    WorkerId, WorkerStatus,
};
