//! What a store says.

mod live;
mod report;
mod status;
