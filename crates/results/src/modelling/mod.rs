//! Kriging models of a user's own table.
//!
//! - [`table`] reads a table, CSV or similar, and names the line and column of an error in it.
//! - [`fit()`] fits a model to columns of it, and validates the model.
//! - [`file`](mod@file) is the model as JSON, with the names, units and bounds of its columns.
//! - [`predict()`] predicts the response at the rows of another table.
//!
//! Nothing here knows gears or campaigns: a column is what its header states.

mod error;
mod far;
pub mod file;
mod fit;
mod predict;
mod quantity;
pub mod summary;
pub mod table;

pub use error::{Error, InputError};
pub use file::ModelFile;
pub use fit::{Fit, Request, fit};
pub use predict::{PointPrediction, Predictions, predict};
pub use quantity::Quantity;
pub use summary::Summary;
pub use table::Table;
