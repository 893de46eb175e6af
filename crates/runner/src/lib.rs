//! Running campaigns: what the two programs share.
//!
//! - [`protocol`] is the wire, [`gateway`] the port, its access file and the connection to it.
//! - [`coordinator`] leases jobs and does the stages; [`worker`] computes them; [`shards`] carries them in files.
//! - [`identity`] says which build this is, and [`console`] is what both programs do on a terminal.

pub mod console;
pub mod coordinator;
pub mod gateway;
pub mod identity;
pub mod protocol;
pub mod shards;
pub mod worker;
