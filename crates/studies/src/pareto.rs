//! `coordinator pareto`: P90 of ΔSTE against the contact pressure or the root stress.
//!
//! The front of the DoE needs no samples but those of the finished campaign. The least of many estimates is low
//! by chance, so its designs get verification samples, which the optima already have. Further designs can be
//! searched directly under a tighter and tighter limit of the second objective (the ε-constraint method).

mod front;
mod tables;

pub use front::{Objective, Point, Source, front_of_doe, mark, of_doe, of_optima, refine};
pub use tables::write_tables;
