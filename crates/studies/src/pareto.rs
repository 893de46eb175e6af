//! `coordinator pareto`: P90 of ΔSTE against the contact pressure or the root stress.
//!
//! The designs are those of a finished campaign, with the samples that it has: no new ones are
//! needed for the front of its DoE. As the least of many estimates is low by chance, the designs of
//! the front get verification samples, beside the optima, which have them already; and more designs can be
//! searched directly under a tighter and tighter limit of the second objective (the ε-constraint
//! method).

mod front;
mod tables;

pub use front::{Against, Point, Source, front_of_doe, mark, of_doe, of_optima, refine};
pub use tables::write_tables;
