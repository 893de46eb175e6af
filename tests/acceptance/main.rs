//! Whole programs against each other: nothing here is simulated but the gears.

mod bad_input;
mod campaign;
mod chaos;
mod cluster;
mod commands;
mod deploy;
mod enriched;
mod external;
mod failpoints;
mod faults;
mod leaving;
mod namespaces;
mod operations;
mod page;
mod paper;
mod place;
mod precision;
mod problems;
mod resuming;
mod security;
mod shipped;
mod slurm;
mod stability;
mod stopping;
mod studies;
mod tradeoff;
