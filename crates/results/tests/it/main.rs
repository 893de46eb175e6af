//! What a store says.

mod report;
mod status;
