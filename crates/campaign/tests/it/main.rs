//! Runs of the campaign's optimiser on problems that are made to be hard.

mod problems;
mod stability;
