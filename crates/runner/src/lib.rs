//! Running campaigns: the code that the two programs share.
//!
//! - [`protocol`] defines the messages, [`gateway`] the port, its access file and the connection to it.
//! - [`coordinator`] leases jobs and runs the stages; [`worker`] computes the jobs; [`shards`] carries them in files.
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
