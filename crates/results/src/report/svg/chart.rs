//! A chart with two axes.

use super::axis::{Ruler, Scale};
use super::canvas::{Anchor, Canvas, Picture, Table, text_width};
use super::clip::{Window, clip_polyline};

/// Values beyond this size are left out, as those that are not finite are: no response of a gear
/// comes near it, and an axis over such a range says nothing.
const GREATEST: f64 = 1e99;

/// Whether a chart can show the value on this scale.
pub(crate) fn drawable(value: f64, scale: Scale) -> bool {
    value.abs() < GREATEST && (scale != Scale::Log || value > 1.0 / GREATEST)
}

#[derive(Debug, Clone)]
pub struct Axis {
    /// Quantity and unit.
    pub label: String,
    pub scale: Scale,
    /// The range to show; the data's own range if `None`.
    pub range: Option<(f64, f64)>,
}

/// The marks of a series.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Mark {
    /// A line, with its dash pattern (empty for a full line).
    Curve(&'static str),
    /// A thin line, with its dash pattern.
    Thin(&'static str),
    /// Half-transparent dots.
    Dots,
    /// Dots in a shade of the sequential palette, from the least (0) to the greatest (5).
    Shades,
    /// Rectangles around the points in a shade of the same palette, with width and height in the axes' units.
    Cells([f64; 2]),
    /// Dots that are seen one by one.
    Points,
    /// Rings, to mark points of another series.
    Rings,
    /// Open circles of this radius around points of another series.
    Halo(f64),
    /// A grey dashed line that does not count for the axes' ranges.
    Guide,
}

#[derive(Debug, Clone)]
pub struct Series {
    /// The entry in the legend, if it has one.
    pub name: Option<String>,
    pub mark: Mark,
    /// Index into the palette.
    pub colour: usize,
    /// Abscissa and ordinate of each point.
    pub points: Vec<[f64; 2]>,
}

#[derive(Debug, Clone)]
pub struct Chart {
    /// Shown above the chart and read aloud.
    pub title: String,
    pub x: Axis,
    pub y: Axis,
    /// Drawn in order, the last on top.
    pub series: Vec<Series>,
    /// Width and height, px.
    pub size: [f64; 2],
}

/// Colours of either palette.
pub(crate) const PALETTE: usize = 6;
const MARGIN: f64 = 10.0;
const LINE: f64 = 17.0;

impl Chart {
    /// The drawn chart, or `None` if no series has a point that can be shown.
    pub(crate) fn draw(&self) -> Option<Picture> {
        let series: Vec<Series> = self.series.iter().map(|s| self.drawable_part(s)).collect();
        let x_range = range_of(&series, 0, self.x.range)?;
        let y_range = range_of(&series, 1, self.y.range)?;
        let [width, height] = self.size;
        let x = Ruler::new(self.x.scale, x_range.0, x_range.1, (width / 80.0) as usize);
        let y = Ruler::new(self.y.scale, y_range.0, y_range.1, (height / 60.0) as usize);

        let mut canvas = Canvas::new();
        canvas.heading([MARGIN, MARGIN + 9.0], &self.title);
        let top = self.legend(&mut canvas, &series, width) + 10.0;
        let widest = y.ticks.iter().map(|t| text_width(&t.1)).fold(0.0, f64::max);
        let left = MARGIN + LINE + widest + 11.0;
        let right = width - MARGIN - x.ticks.last().map_or(0.0, |t| text_width(&t.1)) / 2.0;
        let bottom = height - MARGIN - 2.0 * LINE - 2.0;
        let frame = Window {
            low: [left, top],
            high: [right, bottom],
        };

        let place = |p: [f64; 2]| {
            [
                left + x.position(p[0]) * (right - left),
                bottom - y.position(p[1]) * (bottom - top),
            ]
        };
        let (x0, y0) = (x.range().0, y.range().0);
        let columns = x.ticks.iter().map(|t| place([t.0, y0])[0]);
        let rows = y.ticks.iter().map(|t| place([x0, t.0])[1]);
        let grid: Vec<Vec<[f64; 2]>> = columns
            .map(|at| vec![[at, top], [at, bottom]])
            .chain(rows.map(|at| vec![[left, at], [right, at]]))
            .collect();
        canvas.lines(&grid, "grid", "");
        for series in &series {
            draw_series(&mut canvas, series, &frame, place);
        }
        canvas.rect(frame.low, frame.high, "frame");

        let mut free = f64::NEG_INFINITY;
        for (value, label) in &x.ticks {
            let at = place([*value, y0])[0];
            canvas.lines(&[vec![[at, bottom], [at, bottom + 4.0]]], "tick", "");
            // Ticks of a logarithmic axis may be closer than their labels are wide.
            let half = text_width(label) / 2.0;
            if at - half >= free {
                canvas.text([at, bottom + LINE], Anchor::Middle, "", label);
                free = at + half;
            }
        }
        for (value, label) in &y.ticks {
            let at = place([x0, *value])[1];
            canvas.lines(&[vec![[left - 4.0, at], [left, at]]], "tick", "");
            canvas.text([left - 7.0, at + 4.0], Anchor::End, "", label);
        }
        let middle = [(left + right) / 2.0, (top + bottom) / 2.0];
        canvas.text(
            [middle[0], height - MARGIN],
            Anchor::Middle,
            "",
            &self.x.label,
        );
        canvas.text_upwards([MARGIN + 9.0, middle[1]], Anchor::Middle, &self.y.label);
        let names: Vec<&str> = series
            .iter()
            .filter(|s| !s.points.is_empty())
            .filter_map(|s| s.name.as_deref())
            .collect();
        let shown = match names.is_empty() {
            true => String::new(),
            false => format!(" Shown: {}.", names.join("; ")),
        };
        let label = format!(
            "{}. Horizontal: {}. Vertical: {}.{shown}",
            self.title, self.x.label, self.y.label
        );
        Some(canvas.finish(width, height, &label).with_data(self.table()))
    }

    /// The points of all series but guides.
    fn table(&self) -> Table {
        let series = self.series.iter().filter(|s| s.mark != Mark::Guide);
        let name = |s: &Series| s.name.clone().unwrap_or_default();
        Table {
            axes: [self.x.label.clone(), self.y.label.clone()],
            series: series.map(|s| (name(s), s.points.clone())).collect(),
        }
    }

    /// The series without what the axes cannot show. A line is not interrupted by a left-out point.
    fn drawable_part(&self, series: &Series) -> Series {
        let mut series = series.clone();
        series
            .points
            .retain(|p| drawable(p[0], self.x.scale) && drawable(p[1], self.y.scale));
        series
    }

    /// Draws the legend in as many rows as it needs and returns the y of its lower edge.
    fn legend(&self, canvas: &mut Canvas, series: &[Series], width: f64) -> f64 {
        const SAMPLE: f64 = 26.0;
        let mut at = [MARGIN, MARGIN + 9.0 + LINE];
        let mut any = false;
        for series in series.iter().filter(|s| !s.points.is_empty()) {
            let Some(name) = &series.name else { continue };
            let entry = SAMPLE + 6.0 + text_width(name);
            if any && at[0] + entry > width - MARGIN {
                at = [MARGIN, at[1] + LINE];
            }
            any = true;
            let y = at[1] - 4.0;
            let colour = series.colour % PALETTE;
            let ends = [vec![[at[0], y], [at[0] + SAMPLE, y]]];
            let middle = [at[0] + SAMPLE / 2.0, y];
            match series.mark {
                Mark::Curve(dash) => canvas.lines(&ends, &format!("curve s{colour}"), dash),
                Mark::Thin(dash) => canvas.lines(&ends, &format!("thin s{colour}"), dash),
                Mark::Guide => canvas.lines(&ends, "guide", ""),
                Mark::Dots | Mark::Points => {
                    canvas.circle(middle, 3.0, &format!("f{colour}"));
                }
                Mark::Shades => canvas.circle(middle, 4.0, &format!("q{colour}")),
                Mark::Cells(_) => canvas.rect(
                    [at[0] + 6.0, y - 6.0],
                    [at[0] + SAMPLE, y + 4.0],
                    &format!("q{colour}"),
                ),
                Mark::Rings => canvas.circle(middle, 3.5, &format!("ring s{colour}")),
                Mark::Halo(_) => canvas.circle(middle, 5.5, &format!("halo s{colour}")),
            }
            canvas.label([at[0] + SAMPLE + 5.0, at[1]], name);
            at[0] += entry + 14.0;
        }
        if any { at[1] } else { at[1] - LINE }
    }
}

fn draw_series(
    canvas: &mut Canvas,
    series: &Series,
    frame: &Window,
    place: impl Fn([f64; 2]) -> [f64; 2],
) {
    let points: Vec<[f64; 2]> = series.points.iter().map(|p| place(*p)).collect();
    let colour = series.colour % PALETTE;
    let inside = || points.iter().copied().filter(|p| frame.contains(*p));
    match series.mark {
        Mark::Curve(dash) => {
            canvas.lines(
                &clip_polyline(&points, frame),
                &format!("curve s{colour}"),
                dash,
            );
        }
        Mark::Thin(dash) => {
            canvas.lines(
                &clip_polyline(&points, frame),
                &format!("thin s{colour}"),
                dash,
            );
        }
        Mark::Guide => canvas.lines(&clip_polyline(&points, frame), "guide", ""),
        Mark::Dots => canvas.dots(&inside().collect::<Vec<_>>(), &format!("dots s{colour}")),
        Mark::Shades => canvas.dots(&inside().collect::<Vec<_>>(), &format!("shades p{colour}")),
        Mark::Cells(size) => {
            let half = [0.5 * size[0], 0.5 * size[1]];
            let within = |p: [f64; 2]| [0, 1].map(|i| p[i].clamp(frame.low[i], frame.high[i]));
            let cells = series.points.iter().map(|p| {
                let low = place([p[0] - half[0], p[1] + half[1]]);
                let high = place([p[0] + half[0], p[1] - half[1]]);
                (within(low), within(high))
            });
            canvas.rects(cells, &format!("cell q{colour} p{colour}"));
        }
        Mark::Points => {
            for p in inside() {
                canvas.circle(p, 3.0, &format!("f{colour}"));
            }
        }
        Mark::Rings => {
            for p in inside() {
                canvas.circle(p, 3.5, &format!("ring s{colour}"));
            }
        }
        Mark::Halo(radius) => {
            for p in inside() {
                canvas.circle(p, radius, &format!("halo s{colour}"));
            }
        }
    }
}

/// The wanted range, or the data's; `None` if there are no data.
fn range_of(series: &[Series], axis: usize, wanted: Option<(f64, f64)>) -> Option<(f64, f64)> {
    let own = series
        .iter()
        .filter(|s| s.mark != Mark::Guide)
        .flat_map(|s| &s.points)
        .map(|p| p[axis])
        .fold(None, |range: Option<(f64, f64)>, v| {
            Some(range.map_or((v, v), |(low, high)| (low.min(v), high.max(v))))
        })?;
    Some(wanted.unwrap_or(own))
}
