//! Tests of whole programs: only the gears are simulated.

#![expect(
    clippy::disallowed_methods,
    reason = "tests wait with time limits and are told by variables what to run"
)]

mod absurd;
mod away;
mod bad_input;
mod broken_node;
mod campaign;
mod chaos;
mod cluster;
mod commands;
mod crashes;
mod deploy;
mod enriched;
mod example;
mod external;
mod fail_points;
mod failing;
mod faults;
mod guide;
mod leaving;
mod namespaces;
mod one_machine;
mod operations;
mod other_output;
mod page;
mod pairs;
mod paper;
mod percentiles;
mod place;
mod precision;
mod problems;
mod quarantine;
mod repairs;
mod resuming;
mod security;
mod seeds;
mod shards;
mod stability;
mod stopping;
mod studies;
mod tradeoff;
mod um_bridge;
mod user_tables;
