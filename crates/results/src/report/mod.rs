//! Charts and the HTML report.
//!
//! [`render`] turns [`ReportData`] into one self-contained HTML page: style and charts are inline,
//! nothing is loaded and nothing runs, so the page can be mailed, archived and printed.
//! [`render_pair`] does the same for one gear pair, and [`render_atlas`] for the stability atlas. The
//! `chart_*` functions return the same charts as files of their own. Everything is a pure function
//! of its input: equal data give equal bytes.
//!
//! The charts come from a small SVG writer of this crate rather than from a plotting library. The
//! page has to follow the reader's light or dark theme, which needs classes instead of fixed
//! colours; it has to stay small with several thousand points per scatter plot, which needs many
//! points per path element; and gear outlines need the same writer anyway.
//!
//! Units are those of the field names: µm for transmission errors and wear, mm for lengths, MPa for
//! stresses, radians for roll angles, degrees for the helix angle.

mod atlas;
mod charts;
mod comparison;
mod data;
mod drawing;
mod error;
mod number;
mod page;
pub mod paper;
mod quantity;
mod summary;
mod svg;
mod symbols;

pub use atlas::{AtlasEntry, AtlasMethod, AtlasPage};
pub use charts::{
    Extent, PercentileSeries, Response, ResponseMap, TradeoffChart, TradeoffSeries, chart_contact,
    chart_convergence, chart_expected_improvement, chart_front, chart_gears, chart_leave_one_out,
    chart_map, chart_prediction, chart_pressure, chart_responses, chart_solid, chart_ste,
    chart_teeth, chart_tradeoff, chart_wear,
};
pub use comparison::{Comparison, comparison_markdown, comparisons};
pub use data::{
    ContactPattern, DoePoint, Enrichment, EnrichmentRound, GearData, GearDrawing, GearOutline,
    Header, Illustration, KrigingFit, LeaveOneOut, ModelFigure, OptimiserRun, PairPage, Parameter,
    PreliminaryDesign, PressureCurves, PrintedDesign, PrintedFigures, ReportData, SimilarDesign,
    Slice, SteCurves, VariableIndices, WearProfiles,
};
pub use drawing::{contact, drawing, ste};
pub use error::Error;
pub use page::{
    ChartFile, PAGE_STYLE, ReportFiles, TradeoffPage, TradeoffRow, TradeoffStudy, campaign_digest,
    render, render_atlas, render_pair, render_tradeoff,
};
pub use quantity::{NamedValue, approach_name, variable_name, variables};
pub use svg::{Axis, Chart, Mark, Scale, Series};
pub use symbols::symbol;
