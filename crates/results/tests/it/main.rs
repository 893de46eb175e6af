//! What a store says.

mod status;
