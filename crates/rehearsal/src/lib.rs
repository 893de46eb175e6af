//! The ledger at work for simulated workers: how far one coordinator carries.
//!
//! [`rehearse`] runs a [`Ledger`](ledger::Ledger), as a coordinator does, for the workers of a
//! [`Scenario`]: their clock, network and failures are simulated, and their messages are encoded and decoded
//! for real. What happens is a function of the scenario and its seed; the CPU time is measured.
//!
//! Left out: sockets, TLS and the store. [`Rehearsed::coordinator_cores`] adds what they cost by two
//! constants that were measured with real programs ([`CALL_SECONDS`], [`SAMPLE_SECONDS`]).

#![warn(missing_docs)]

mod rehearsed;
mod scenario;
mod simulation;
mod worker;

pub use rehearsed::{CALL_SECONDS, Calls, Rehearsed, SAMPLE_SECONDS};
pub use scenario::{Scenario, Wave};
pub use simulation::rehearse;
