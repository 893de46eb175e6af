//! The service and the engine on a real store, called as from the network.

mod bench;
mod disagreeing;
mod enrichment;
mod precision;
mod running;
mod service;
