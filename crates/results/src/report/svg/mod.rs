//! A small SVG writer for the charts and the gear drawings.
//!
//! Colours live in classes (`charts.css`), not in the elements, so that one picture serves the light
//! and the dark theme. No element has an id, so any number of pictures can stand in one page.
//! Coordinates are pixels of the view box, y downwards.

mod axis;
mod canvas;
mod chart;
mod clip;

pub use axis::Scale;
pub use canvas::Picture;
pub(crate) use canvas::{Canvas, Table, escape, text_width};
pub use chart::{Axis, Chart, Mark, Series};
pub(crate) use chart::{SHADES, drawable};
pub(crate) use clip::{Window, clip_polygon, clip_polyline};

/// The style of every chart; a page that holds inline charts includes it once.
pub(crate) const CSS: &str = include_str!("charts.css");
