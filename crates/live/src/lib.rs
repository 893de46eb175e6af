//! The live page of a campaign, and the data behind it.
//!
//! - [`views`] turns what the store holds and what a running coordinator knows into serialisable views:
//!   pure functions of rows.
//! - `designs` holds the designs of the DoE with their percentiles, also before the campaign has computed
//!   its responses.
//! - [`site`] reads the store for the views, one at a time, and keeps each for a moment, so that a hundred
//!   open pages cost what one costs and no reader delays the writer.
//! - [`metrics`] shows the status to Prometheus.
//! - [`http`] serves all of that: `/`, `/api/v1/…`, `/api/v1/events`, `/healthz` and `/metrics`.
//!
//! The store is only read. The page itself is in `page/`: HTML, style and script as they are served.

#![expect(clippy::disallowed_methods, reason = "views are kept for a moment")]

mod designs;
pub mod http;
pub mod metrics;
pub mod site;
pub mod views;

pub use http::serve;
pub use site::Site;
