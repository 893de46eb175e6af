//! Speed against accuracy, measured on the machine at hand: what each method and setting costs, and how far
//! its results are from converged ones.
//!
//! A [`Kind`] of study fills a [`Table`] with one row for each method and setting, costs and errors alike.
//! [`View`] picks one cost and one error, and finds the Pareto front and the setting to recommend.
//! [`page`] makes the report of all tables. Views and page are functions of the tables, so a table that
//! was read from its CSV file gives the page that it gave when it was measured.
//!
//! Times are CPU times of the calling thread where it alone computes, and of the process otherwise: what
//! other processes do meanwhile counts little. All else depends on the campaign and the [`Size`] alone.

#![warn(missing_docs)]

mod clock;
mod data;
mod front;
mod kriging;
mod optimisation;
mod page;
mod percentile;
mod runner;
mod simulator;
mod study;
mod summary;
mod table;
mod view;

pub use clock::process_seconds;
pub use front::{Reason, Rule, front, recommend};
pub use optimisation::Ended;
pub use page::page;
pub use runner::{Load, Ran, Runner};
pub use study::{Kind, Size, Study};
pub use table::{Row, Table};
pub use view::View;
