//! Results of a campaign, read from its store, for people and for programs. Everything here only reads, and works
//! beside a running campaign, too.
//!
//! - [`status`] is the progress of a campaign, [`running`] the state of a running coordinator; [`describing`] puts both
//!   into words.
//! - [`export`] writes the store's tables as CSV, JSON or Parquet through [`table`], or keeps them in memory as
//!   [`columnar`] ones; [`model`] is its kriging model, and [`pair_file`] an optimum as a pair file.
//! - [`report`] is the report with its charts; [`comparison`] puts the paper's figures beside ours.
//! - [`new_file`] writes a file wholly or not at all.
//! - [`sheet`] is the data sheet of a gear pair.
//! - [`doubts`] has the reasons to doubt a pair, a recommended design and what a store holds.
//! - [`number`] shows numbers to people.
//! - [`live`] is the live page, and [`descriptors`] limits its connections so that files can still be opened.
//! - [`snapshot`] has the rows of a campaign, and [`optima`] its optima, verified and ranked.
//! - [`modelling`] fits models to tables of a user's own.

pub mod cell;
pub mod columnar;
mod columns;
pub mod comparison;
pub mod costs;
pub mod describing;
pub mod descriptors;
pub mod doubts;
pub mod estimate;
pub mod export;
mod finer_grid;
pub mod live;
pub mod model;
pub mod modelling;
pub mod new_file;
pub mod number;
pub mod optima;
pub mod pair_file;
#[cfg(feature = "parquet")]
mod parquet;
pub mod report;
pub mod running;
pub mod sheet;
pub mod snapshot;
pub mod status;
pub mod table;
