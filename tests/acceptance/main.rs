//! Whole programs against each other: nothing here is simulated but the gears.

mod bad_input;
mod campaign;
mod cluster;
mod commands;
mod paper;
