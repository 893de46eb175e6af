//! Leases jobs from a coordinator, simulates, and reports the results.
//!
//! A [`Worker`] is four tasks around one shared list of leases: one requests leases, one reports
//! results until they are acknowledged, one sends heartbeats, and a pool of compute threads, one
//! per slot, simulates. The loss of the coordinator stops none of them: finished results are kept,
//! calls are repeated with growing pauses, and when a coordinator answers again, the worker
//! registers again and reports its results.

#![expect(
    clippy::disallowed_methods,
    reason = "calls and simulators have time limits, and a worker gets a random identity"
)]

mod arguments;
mod backoff;
mod demand;
mod error;
mod exec;
mod held;
mod work;

pub use arguments::Arguments;
pub use demand::LeaseDemand;
pub use error::Error;
pub use exec::{Exec, Interface, SimulatorArguments, Trial, trial};
pub use work::{Options, Summary, Worker};

/// The name of this machine. The host of a worker is this name, a colon and the process.
#[must_use]
pub fn machine() -> String {
    let machine = rustix::system::uname();
    machine.nodename().to_string_lossy().into_owned()
}
