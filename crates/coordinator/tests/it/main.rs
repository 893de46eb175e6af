//! The service and the engine on a real store, called as from the network; and the program.

mod enrichment;
mod modelling;
mod precision;
mod running;
mod service;
