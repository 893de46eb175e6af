//! Speed against accuracy, measured on this machine: the cost of each method and setting, and the
//! distance of its results from converged ones.
//!
//! A [`Kind`] of study fills a [`Table`] with one row for each method and setting, which holds
//! costs and errors. [`View`] picks one cost and one error, and finds the Pareto front and the
//! recommended setting. [`page`] makes the report of all tables. Views and page depend only on the
//! tables, so a table read from its CSV file gives the same page as when it was measured.
//!
//! Times are CPU times: of the calling thread if it alone computes, otherwise of the process. Other
//! processes have little influence on them. The studies Runner and Cores measure elapsed time instead. Everything else
//! depends only on the campaign and the [`Size`].

mod clock;
mod contact;
mod cores;
mod data;
mod estimators;
mod front;
mod growth;
mod kriging;
mod optimisation;
mod page;
mod percentile;
mod runner;
mod simulator;
mod size;
mod study;
mod table;
mod view;

pub use clock::process_seconds;
pub use front::{Reason, Rule, front, recommend};
pub use page::page;
pub use runner::{ApproachResult, CampaignTimes, Load, Runner, RunnerTimes};
pub use size::Size;
pub use study::{Kind, Study};
pub use table::{Row, Table};
pub use view::View;
