//! The stability atlas: the robustness tests of all methods, which users can run.
//!
//! Each [`Entry`] describes an input on which a method fails or nearly does, and what the library does instead of
//! failing. Its [`run`](Entry::run) calls the library, records the warnings, refusals and messages that the library
//! returns, measures, and checks the promises of the entry. The tests of this crate run all entries and fail when a
//! promise is broken. `coordinator stability` writes the page of the same run ([`Atlas`]).
//!
//! A robustness test belongs here and not in the crate of the method.
//!
//! Random numbers come from the named streams of `stats`, and no figure is a time: the same build gives the same page.

mod atlas;
mod entries;
mod entry;
mod outcome;

pub use atlas::Atlas;
pub use entries::entries;
pub use entry::{Entry, Method};
pub use outcome::{Detection, Outcome, Promise};
