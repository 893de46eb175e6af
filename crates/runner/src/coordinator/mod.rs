//! Plans a campaign, leases its jobs to workers, and writes the report.
//!
//! - [`engine`] runs the stages: it asks [`stages::plan`] for the next step, does the local steps and
//!   puts the jobs on the [`board`].
//! - [`board`] holds the ledger behind one lock, with real time and notifications. [`service`] is its
//!   gRPC service. [`ingest`] converts reported results to rows, which a [`recorder`] stores.
//! - [`server`] opens the store and runs a campaign. [`serving`] has the port, and the [`local`] workers
//!   of the same process.
//! - [`provenance`] names the machine, time and program version of a report.
//! - `leases` ends expired leases. `repeats` ends a run whose steps have no effect.

#![expect(
    clippy::disallowed_methods,
    reason = "the board gives the ledger the time, and a run gets a random identity"
)]

pub mod board;
mod budget;
mod compute;
pub mod engine;
pub mod ingest;
mod leases;
pub mod local;
mod models;
mod pace;
pub mod provenance;
mod receiver;
pub mod recorder;
mod repeats;
pub mod server;
pub mod service;
pub mod serving;
mod steps;
mod stopwatch;
