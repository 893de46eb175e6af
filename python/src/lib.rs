//! The compiled part of the Python package `pitchline`. The public interface, with defaults and documentation, is in
//! `pitchline/`. This crate converts arrays and texts to arguments of the workspace's crates, and their results to
//! arrays.

mod arrays;
mod doe;
mod error;
mod gears;
mod interrupt;
mod kriging;
mod problem;
mod results;
mod search;
mod statistics;

use pyo3::prelude::*;

#[pymodule]
mod _pitchline {
    #[pymodule_export]
    use crate::doe::{design, discrepancy, distance, enlarge};
    #[pymodule_export]
    use crate::error::PitchlineError;
    #[pymodule_export]
    use crate::gears::Pair;
    #[pymodule_export]
    use crate::kriging::Model;
    #[pymodule_export]
    use crate::problem::{Problem, name_of, toml_of};
    #[pymodule_export]
    use crate::results::{Store, Table};
    #[pymodule_export]
    use crate::search::{Run, Search};
    #[pymodule_export]
    use crate::statistics::{difference, estimate, lilliefors, verified};
}
