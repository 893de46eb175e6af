//! The report of a campaign, and other pages and charts.
//!
//! [`Report::read`] takes the [`Snapshot`](crate::snapshot::Snapshot) of a campaign and computes what its page shows
//! besides: drawings, wear profiles, slices of the model, the paper's designs. [`render`] turns it into one
//! self-contained HTML page: style and charts are inline, nothing is loaded and nothing runs, so the page can be
//! mailed, archived and printed. [`write()`] does both. [`render_pair`] makes the page of one gear pair,
//! [`render_atlas`] the stability atlas, and [`charts`] has every chart by itself. Rendering is a pure function of
//! its input: equal data give equal bytes.
//!
//! The charts come from a small SVG writer of this crate rather than from a plotting library. The
//! page has to follow the reader's light or dark theme, which needs classes instead of fixed
//! colours; it has to stay small with several thousand points per scatter plot, which needs many
//! points per path element; and gear outlines need the same writer anyway.
//!
//! Units are those of the field names: µm for transmission errors and wear, mm for lengths, MPa for
//! stresses, degrees for angles.

mod atlas;
pub mod charts;
mod contents;
mod doe;
mod drawing;
mod enrichment;
mod error;
mod facts;
mod head;
mod model;
mod notes;
mod page;
pub mod paper;
mod printed;
mod quantity;
mod runs;
mod summary;
mod svg;
mod symbols;
mod torque;
mod wear;
mod write;

pub use atlas::{AtlasEntry, AtlasMethod, AtlasPage};
pub use contents::{GearFigures, Report};
pub(crate) use doe::statistics;
pub use doe::{DoePoint, Response};
pub use drawing::{
    ContactPattern, FlankProfile, GearDrawing, GearOutline, Illustration, MagnifiedRelief,
    PressureCurves, SteCurves, contact, drawing, profiles, ste,
};
pub use enrichment::{Enrichment, EnrichmentRound, rounds};
pub use error::Error;
pub use model::{ScatterShare, Slice, VariableIndices};
pub use page::{
    ChartFile, PAGE_STYLE, PairPage, ReportFiles, TradeoffPage, TradeoffRow, TradeoffStudy,
    campaign_digest, campaign_name, render, render_atlas, render_pair, render_tradeoff,
};
pub use printed::{PaperFigures, PreliminaryDesign, PrintedDesign, PrintedFigure, SimilarDesign};
pub use quantity::{NamedValue, approach_name, response_name, variable_name, variables};
pub(crate) use quantity::{label, limits, values};
pub use runs::OptimiserRun;
pub use svg::{Axis, Chart, Mark, Picture, Scale, Series};
pub use symbols::symbol;
pub use torque::{RandomFlanks, TorqueCurves, over_torque};
pub use wear::WearProfiles;
pub use write::{FILE, write, write_file};
