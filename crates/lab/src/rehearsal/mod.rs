//! The simulation of a cluster: the real ledger serves simulated workers, to show how many workers
//! one coordinator can serve.
//!
//! [`rehearse`] runs a [`Ledger`](ledger::Ledger), as a coordinator does, for the workers of a
//! [`Scenario`]. Their clock, network and failures are simulated, and their messages are really
//! encoded and decoded. The events depend only on the scenario and its seed; the CPU time is
//! measured.
//!
//! Sockets, TLS and the store are left out. [`Rehearsal::coordinator_cores`] adds their cost by two
//! constants that were measured with real programs ([`CALL_SECONDS`], [`SAMPLE_SECONDS`]).

mod rehearsed;
mod scenario;
mod simulation;
mod worker;

pub use rehearsed::{CALL_SECONDS, Calls, Rehearsal, SAMPLE_SECONDS};
pub use scenario::{Scenario, Wave};
pub use simulation::rehearse;
