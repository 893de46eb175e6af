//! The service and the engine, called as the network would call them, on a real store.

mod enrichment;
mod precision;
mod running;
mod service;
