//! Reasons to doubt results, a sentence each with the remedy.

pub(crate) mod campaign;
pub mod pair;
pub(crate) mod recommended;
