//! Leases jobs from a coordinator, simulates, and reports the results.
//!
//! A [`Worker`] is four tasks around one shared list of the jobs it holds: one leases, one hands
//! results in until they are acknowledged, one sends heartbeats, and a pool of compute threads,
//! one per slot, simulates. A lost coordinator stops none of them: finished results are kept, calls
//! are repeated with growing pauses, and when a coordinator answers again the worker registers
//! anew and hands in what it has.

#![expect(
    clippy::disallowed_methods,
    reason = "calls and simulators have time limits, and a worker gets a random identity"
)]

mod backoff;
mod error;
mod exec;
mod held;
mod work;

pub use error::Error;
pub use exec::{Exec, FileMode, SimulatorArguments};
pub use work::{Options, Summary, Worker};
