//! The simulation of a cluster, which shows how many workers one coordinator can serve.
//!
//! [`rehearse`] runs a real [`Ledger`](ledger::Ledger) for the simulated workers of a [`Scenario`]. Their clock,
//! network and failures are simulated; their messages are really encoded and decoded. The events depend only on the
//! scenario and its seed. The CPU time is measured.
//!
//! Sockets, TLS and the store are left out. [`Rehearsal::coordinator_cores`] adds their cost by two constants that
//! were measured with real programs ([`CALL_SECONDS`], [`SAMPLE_SECONDS`]).

mod result;
mod scenario;
mod simulation;
mod worker;

pub use result::{CALL_SECONDS, Calls, Rehearsal, SAMPLE_SECONDS};
pub use scenario::{Scenario, Wave};
pub use simulation::rehearse;
