//! Plans a campaign, leases its jobs to workers, and writes the report.
//!
//! - [`engine`] runs the stages: it asks [`campaign::plan`] what comes next, does the local steps
//!   ([`steps`], [`enrichment`]) itself and puts the jobs on the [`board`].
//! - [`board`] holds the ledger behind one lock, with real time and bells; [`service`] is the gRPC face
//!   of it; [`ingest`] turns what workers hand in into rows of the store.
//! - [`metrics`] shows the same to Prometheus.
//! - [`listening`] keeps the port, [`guard`] has what guards it, [`access`] says who may call what,
//!   and [`keygen`] makes the secrets.
//! - [`status`], [`export`], [`simulate`], [`reporting`] and [`comparing`] read: they work beside a running
//!   campaign, too.
//! - [`studies`] go beyond one campaign: other teeth, corrections, tolerances, a second objective.

pub mod access;
pub mod board;
pub mod comparing;
pub mod engine;
pub mod enrichment;
pub mod export;
pub mod guard;
pub mod ingest;
pub mod keygen;
pub mod listening;
pub mod local;
pub mod metrics;
mod pace;
pub mod references;
pub mod reporting;
pub mod sampling;
pub mod server;
pub mod service;
pub mod simulate;
pub mod snapshot;
pub mod status;
pub mod steps;
pub mod studies;
