//! What a campaign's store says, for people and for programs. Everything here only reads, and works
//! beside a running campaign, too.
//!
//! - [`status`] says how far a campaign is; [`running`] has what only a running coordinator knows of it, and
//!   [`describing`] puts both into words.
//! - [`export`] writes the store's tables as [`table`]s of CSV, JSON or Parquet, [`model`] is its kriging model, and
//!   [`pair_file`] an optimum as a pair file.
//! - [`reporting`] gathers the data of the report, and [`report`] makes charts and pages of them; [`comparing`] puts
//!   the paper's figures beside ours.
//! - [`live`] is the live page.
//! - [`snapshot`] is what the store holds, typed, and [`optima`] its optima, verified and ranked.
//! - [`modelling`] fits models to tables of a user's own.

pub mod comparing;
mod converged;
pub mod costs;
pub mod describing;
mod doubts;
pub mod export;
pub mod live;
pub mod model;
pub mod modelling;
pub mod optima;
pub mod pair_file;
#[cfg(feature = "parquet")]
mod parquet;
pub mod report;
pub mod reporting;
pub mod running;
pub mod snapshot;
pub mod status;
pub mod table;
