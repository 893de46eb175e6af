//! Plans a campaign, leases its jobs to workers, and writes the report.
//!
//! - [`engine`] runs the stages: it asks [`stages::plan`] what comes next, does the local steps and puts
//!   the jobs on the [`board`].
//! - [`board`] holds the ledger behind one lock, with real time and bells; [`service`] is the gRPC face
//!   of it; [`ingest`] turns what workers hand in into rows, which a [`recorder`] stores.
//! - [`server`] opens the store and runs it all; [`study`] runs the simulations of a study, without a
//!   store. [`serving`] is what both have beside the board: the port, and [`local`] workers of the same
//!   process.
//! - [`made`] says where and when a report is made.
//! - `leases` takes back what silent workers hold.

pub mod board;
pub mod compute;
pub mod engine;
pub mod ingest;
mod leases;
pub mod local;
pub mod made;
mod pace;
mod receiving;
pub mod recorder;
pub mod server;
pub mod service;
pub mod serving;
mod steps;
mod stopwatch;
pub mod study;
