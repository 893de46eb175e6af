//! Running campaigns: what the two programs share.
//!
//! - [`protocol`] is the wire, [`gateway`] the port, its access file and the connection to it.
//! - [`coordinator`] leases jobs and does the stages; [`worker`] computes them; [`shards`] carries them in files.
//! - [`identity`] names the build; [`exit`] has the exit codes; [`console`] has the log, signals and help.

pub mod console;
pub mod coordinator;
pub mod cpu;
pub mod exit;
pub mod gateway;
pub mod identity;
mod outside;
pub mod protocol;
pub mod shards;
pub mod worker;
