//! The service and the engine, called as the network would call them, on a real store; and the program.

mod enrichment;
mod modelling;
mod precision;
mod running;
mod service;
