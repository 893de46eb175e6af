//! What a campaign's store says, for people and for programs. Everything here only reads, and works
//! beside a running campaign, too.
//!
//! - [`status`] says how far a campaign is; [`live`] has what only a running coordinator knows of it, and
//!   [`describing`] puts both into words.
//! - [`export`] writes the store's tables as [`rows`] of CSV, JSON or Parquet, [`model`] is its kriging model, and
//!   [`pair_file`] an optimum as a pair file.
//! - [`reporting`] gathers the data of the report; [`comparing`] puts the paper's figures beside ours.
//! - [`mod@percentile`] has a verified percentile with its interval, and [`ranking`] compares those of several
//!   designs.

pub mod comparing;
mod converged;
mod costs;
pub mod describing;
mod doubts;
pub mod export;
pub mod live;
pub mod model;
pub mod pair_file;
#[cfg(feature = "parquet")]
mod parquet;
pub mod percentile;
pub mod ranking;
pub mod reporting;
pub mod rows;
pub mod status;
