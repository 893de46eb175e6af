//! The stability atlas: inputs on which a method breaks or nearly does, run and measured.
//!
//! [`entries`] is the one table. Each [`Entry`] names an input and what is done instead of failing; its
//! [`run`](Entry::run) calls the library, takes the names of warnings and refusals and their messages from
//! what the library returns, measures, and says which promises were kept. The crate's tests run the table
//! and fail where a promise is broken; `coordinator stability` writes the page from the same run
//! ([`Atlas`]), so the page cannot say what the tests do not.
//!
//! Random numbers come from the named streams of `stats`, and no figure is a time, so that equal builds
//! give equal pages.

mod atlas;
mod entries;
mod entry;
mod outcome;

pub use atlas::Atlas;
pub use entries::entries;
pub use entry::{Entry, Method};
pub use outcome::{Detection, Outcome, Promise};
