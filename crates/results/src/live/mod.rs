//! The live page of a campaign, and the data behind it.
//!
//! - [`views`] turns the rows of the store and the state of a running coordinator into serialisable
//!   views, with pure functions.
//! - `designs` holds the designs of the DoE with their measures, including estimates made before
//!   the campaign computes its responses.
//! - [`site`] reads the store for the views, one at a time, and caches each for a moment, so that a
//!   hundred open pages cost as much as one and no reader delays the writer.
//! - [`metrics`] exposes the status to Prometheus.
//! - [`http`] serves all of that: `/`, `/api/v1/…`, `/api/v1/events`, `/healthz` and `/metrics`.
//!   `admission` limits its connections.
//!
//! The store is only read. The page itself is in `page/`, as the HTML, style and script that are
//! served.

#![expect(clippy::disallowed_methods, reason = "views are kept for a moment")]

mod admission;
mod designs;
pub mod http;
pub mod metrics;
pub mod site;
pub mod views;

pub use http::serve;
pub use site::Site;
