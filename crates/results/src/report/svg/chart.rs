//! A chart with two axes.

use super::axis::{Ruler, Scale, Tick};
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
    /// Names of the values 0, 1, …, which take the place of numbers; empty for an axis of numbers.
    pub names: Vec<String>,
}

impl Axis {
    /// An axis over the range of the data.
    #[must_use]
    pub fn new(label: impl Into<String>, scale: Scale) -> Self {
        Self {
            label: label.into(),
            scale,
            range: None,
            names: Vec::new(),
        }
    }

    fn ruler(&self, series: &[Series], axis: usize) -> Option<Ruler> {
        let of = |s: &Series| s.points.iter().map(|p| p[axis]).collect::<Vec<f64>>();
        let counted = series.iter().filter(|s| s.mark != Mark::Guide);
        let values = counted.flat_map(of);
        let own = values.fold(None, |range: Option<(f64, f64)>, v| {
            Some(range.map_or((v, v), |(low, high)| (low.min(v), high.max(v))))
        })?;
        // Areas fill the frame, and lines alone may run from side to side.
        let is_full = self.range.is_some() && series.iter().any(|s| s.mark == Mark::Cells);
        let runs = |s: &Series| s.points.is_empty() || s.mark.is_line();
        let room = match is_full || (axis == 0 && series.iter().all(runs)) {
            true => 0.0,
            false => ROOM,
        };
        let (low, high) = self.range.unwrap_or(own);
        Some(match self.names.len() {
            0 => Ruler::new(self.scale, low, high, room),
            count => Ruler::new(Scale::Linear, -0.5, count as f64 - 0.5, 0.0),
        })
    }

    fn ticks(&self, ruler: &Ruler, length: f64, extent: impl Fn(&str) -> f64) -> Vec<Tick> {
        match self.names.is_empty() {
            true => ruler.ticks(length, extent),
            false => (0..).map(f64::from).zip(self.names.clone()).collect(),
        }
    }
}

/// The marks of a series.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Mark {
    /// A line, with its dash pattern (empty for a full line).
    Curve(&'static str),
    /// A smooth line through the points, with its dash pattern. It is periodic if it ends as high as it begins.
    Smooth(&'static str),
    /// A thin line, with its dash pattern.
    Thin(&'static str),
    /// Half-transparent dots.
    Dots,
    /// Dots in one of `SHADES` shades, from the least to the greatest.
    Shades,
    /// Rectangles in one of `SHADES` shades; points are pairs of opposite corners. In the legend all shades together
    /// are a bar between the names of the first and the last such series.
    Cells,
    /// Half-transparent rectangles; points are pairs of opposite corners.
    Bars,
    /// Dots that are seen one by one.
    Points,
    /// Rings, to mark points of another series or missing values.
    Rings,
    /// Open circles of this radius around points of another series.
    Halo(f64),
    /// A grey dashed line that does not count for the axes' ranges.
    Guide,
}

impl Mark {
    const fn is_line(self) -> bool {
        matches!(
            self,
            Self::Curve(_) | Self::Smooth(_) | Self::Thin(_) | Self::Guide
        )
    }

    const fn dash(self) -> &'static str {
        match self {
            Self::Curve(dash) | Self::Smooth(dash) | Self::Thin(dash) => dash,
            _ => "",
        }
    }

    /// The CSS class of its elements.
    fn class(self, colour: usize) -> String {
        let name = match self {
            Self::Guide => return "guide".to_owned(),
            Self::Shades | Self::Cells => {
                let name = if self == Self::Cells {
                    "cell"
                } else {
                    "shades"
                };
                return format!("{name} q{}", colour % SHADES);
            }
            Self::Curve(_) | Self::Smooth(_) => "curve",
            Self::Thin(_) => "thin",
            Self::Dots => "dots",
            Self::Bars => "bar",
            Self::Points => "point",
            Self::Rings => "ring",
            Self::Halo(_) => "halo",
        };
        format!("{name} s{}", colour % PALETTE)
    }
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

/// Colours of the palette.
const PALETTE: usize = 6;
/// Shades of a scale.
pub(crate) const SHADES: usize = 24;
const MARGIN: f64 = 10.0;
const LINE: f64 = 17.0;
/// Ratio of the width of a title's letters to that of other text.
const BOLD: f64 = 1.17;
/// Share of a range by which an axis is longer at each end, so that no mark lies on the frame.
const ROOM: f64 = 0.04;
/// Width of a series' sample in the legend, px.
const SAMPLE: f64 = 26.0;

/// A series with the parts that the axes show, in units of the axes' lengths.
struct Shown<'a> {
    series: &'a Series,
    parts: Vec<Vec<[f64; 2]>>,
}

impl Chart {
    /// The drawn chart, or `None` if no series has a point that can be shown.
    pub(crate) fn draw(&self) -> Option<Picture> {
        let series: Vec<Series> = self.series.iter().map(|s| self.drawable_part(s)).collect();
        let rulers = [self.x.ruler(&series, 0)?, self.y.ruler(&series, 1)?];
        let shown: Vec<Shown> = series.iter().filter_map(|s| shown(s, &rulers)).collect();
        let [x, y] = &rulers;
        let [width, height] = self.size;

        let mut canvas = Canvas::new();
        let below = heading(&mut canvas, &self.title, width);
        let top = legend(&mut canvas, &shown, [MARGIN, below], width) + 14.0;
        let bottom = height - MARGIN - 2.0 * LINE - 2.0;
        let y_ticks = self.y.ticks(y, bottom - top, |_| 12.0);
        let widest = y_ticks.iter().map(|t| text_width(&t.1)).fold(0.0, f64::max);
        let left = MARGIN + LINE + widest + 11.0;
        let x_ticks = self.x.ticks(x, width - left - 2.0 * MARGIN, text_width);
        let last = x_ticks.last().map_or(0.0, |t| text_width(&t.1));
        let right = width - MARGIN - 0.5 * last;
        let frame = Window {
            low: [left, top],
            high: [right, bottom],
        };
        let place = |p: [f64; 2]| [left + p[0] * (right - left), bottom - p[1] * (bottom - top)];
        let columns = || {
            x_ticks
                .iter()
                .map(|t| (place([x.position(t.0), 0.0])[0], &t.1))
        };
        let rows = || {
            y_ticks
                .iter()
                .map(|t| (place([0.0, y.position(t.0)])[1], &t.1))
        };
        let grid: Vec<Vec<[f64; 2]>> = columns()
            .map(|(at, _)| vec![[at, top], [at, bottom]])
            .chain(rows().map(|(at, _)| vec![[left, at], [right, at]]))
            .collect();
        canvas.lines(&grid, "grid", "");
        for one in &shown {
            let parts = one.parts.iter();
            let parts: Vec<Vec<[f64; 2]>> = parts
                .map(|part| part.iter().map(|p| place(*p)).collect())
                .collect();
            draw_marks(&mut canvas, one.series, &parts);
        }
        canvas.rect(frame.low, frame.high, "frame");

        for (at, label) in columns() {
            canvas.lines(&[vec![[at, bottom], [at, bottom + 4.0]]], "tick", "");
            canvas.text([at, bottom + LINE], Anchor::Middle, "", label);
        }
        for (at, label) in rows() {
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
        let names = shown.iter().filter_map(|one| one.series.name.as_deref());
        let names = names.collect::<Vec<_>>().join("; ");
        let names = match names.is_empty() {
            true => String::new(),
            false => format!(" Shown: {names}."),
        };
        let label = format!(
            "{}. Horizontal: {}. Vertical: {}.{names}",
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
}

/// The parts of a series between the ends of both axes; `None` without any.
fn shown<'a>(series: &'a Series, rulers: &[Ruler; 2]) -> Option<Shown<'a>> {
    const FRAME: Window = Window {
        low: [0.0; 2],
        high: [1.0; 2],
    };
    let place = |p: &[f64; 2]| [0, 1].map(|i| rulers[i].position(p[i]));
    let points: Vec<[f64; 2]> = series.points.iter().map(place).collect();
    let parts = match series.mark {
        Mark::Smooth(_) => clip_polyline(&smooth(&points), &FRAME),
        mark if mark.is_line() => clip_polyline(&points, &FRAME),
        Mark::Cells | Mark::Bars => {
            let within = |p: &[f64; 2]| p.map(|v| v.clamp(0.0, 1.0));
            vec![points.iter().map(within).collect()]
        }
        _ => vec![points.into_iter().filter(|p| FRAME.contains(*p)).collect()],
    };
    let is_empty = parts.iter().all(Vec::is_empty);
    (!is_empty).then_some(Shown { series, parts })
}

/// Draws the title in as many lines as it needs and returns the y of the next line.
fn heading(canvas: &mut Canvas, title: &str, width: f64) -> f64 {
    let most = (width - 2.0 * MARGIN) / BOLD;
    let mut at = [MARGIN, MARGIN + 9.0];
    let mut line = String::new();
    for word in title.split(' ') {
        let longer = format!("{line} {word}").trim_start().to_owned();
        if !line.is_empty() && text_width(&longer) > most {
            canvas.heading(at, &line);
            at[1] += LINE;
            line = word.to_owned();
        } else {
            line = longer;
        }
    }
    canvas.heading(at, &line);
    at[1] + LINE
}

/// Draws the legend from the baseline `at` in as many rows as it needs and returns the y of its lower edge.
fn legend(canvas: &mut Canvas, shown: &[Shown<'_>], mut at: [f64; 2], width: f64) -> f64 {
    let mut any = false;
    let is_cells = |one: &Shown| one.series.mark == Mark::Cells;
    for group in shown.chunk_by(|a, b| is_cells(a) && is_cells(b)) {
        let series = group[0].series;
        let Some(name) = &series.name else { continue };
        let last = group.last().and_then(|one| one.series.name.as_ref());
        let bar = last.filter(|_| is_cells(&group[0]));
        let entry = match bar {
            None => SAMPLE + 5.0 + text_width(name),
            Some(last) => text_width(name) + 6.0 * SHADES as f64 + 16.0 + text_width(last),
        };
        if any && at[0] + entry > width - MARGIN {
            at = [MARGIN, at[1] + LINE];
        }
        any = true;
        let y = at[1] - 4.0;
        let end = at[0] + SAMPLE;
        if let Some(last) = bar {
            canvas.label(at, name);
            let mut left = at[0] + text_width(name) + 10.0;
            for shade in 0..SHADES {
                let class = Mark::Cells.class(shade);
                canvas.rect([left, y - 6.0], [left + 6.0, y + 5.0], &class);
                left += 6.0;
            }
            canvas.label([left + 6.0, at[1]], last);
        } else {
            let sample = match series.mark {
                mark if mark.is_line() => vec![[at[0], y], [end, y]],
                Mark::Bars => vec![[at[0] + 6.0, y - 5.0], [end, y + 5.0]],
                _ => vec![[at[0] + SAMPLE / 2.0, y]],
            };
            match series.mark {
                Mark::Dots => canvas.circle(sample[0], 3.0, &Mark::Points.class(series.colour)),
                Mark::Shades => canvas.circle(sample[0], 4.0, &Mark::Cells.class(series.colour)),
                Mark::Halo(_) => canvas.circle(sample[0], 5.5, &series.mark.class(series.colour)),
                _ => draw_marks(canvas, series, &[sample]),
            }
            canvas.label([end + 5.0, at[1]], name);
        }
        at[0] += entry + 15.0;
    }
    if any { at[1] } else { at[1] - LINE }
}

/// Draws the marks of a series at places on the canvas.
fn draw_marks(canvas: &mut Canvas, series: &Series, parts: &[Vec<[f64; 2]>]) {
    let class = series.mark.class(series.colour);
    let mut circles = |radius: f64| {
        for p in parts.iter().flatten() {
            canvas.circle(*p, radius, &class);
        }
    };
    match series.mark {
        Mark::Points => circles(3.0),
        Mark::Rings => circles(3.5),
        Mark::Halo(radius) => circles(radius),
        Mark::Dots | Mark::Shades => canvas.dots(&parts.concat(), &class),
        Mark::Cells | Mark::Bars => {
            let corners = parts.iter().flat_map(|part| part.chunks_exact(2));
            canvas.rects(corners.map(|two| (two[0], two[1])), &class);
        }
        _ => canvas.lines(parts, &class, series.mark.dash()),
    }
}

/// More points on a smooth curve through these: cubic pieces with the slopes of parabolas through three neighbours.
fn smooth(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    const PIECES: usize = 8;
    let (Some(first), Some(last)) = (points.first(), points.last()) else {
        return Vec::new();
    };
    let n = points.len();
    if n < 3 || points.windows(2).any(|two| two[1][0] <= two[0][0]) {
        return points.to_vec();
    }
    let secant = |i: usize| (points[i + 1][1] - points[i][1]) / (points[i + 1][0] - points[i][0]);
    let width = |i: usize| points[i + 1][0] - points[i][0];
    let between =
        |a: usize, b: usize| (secant(a) * width(b) + secant(b) * width(a)) / (width(a) + width(b));
    let is_periodic = (last[1] - first[1]).abs() < 1e-9;
    let slope = |i: usize| match i {
        _ if 0 < i && i < n - 1 => between(i - 1, i),
        _ if is_periodic => between(n - 2, 0),
        0 => 2.0 * secant(0) - between(0, 1),
        _ => 2.0 * secant(n - 2) - between(n - 3, n - 2),
    };
    let mut out = vec![*first];
    for i in 0..n - 1 {
        let ([x, y], h) = (points[i], width(i));
        let [a, b] = [h * slope(i), h * slope(i + 1)];
        let rise = points[i + 1][1] - y;
        out.extend((1..=PIECES).map(|k| {
            let t = k as f64 / PIECES as f64;
            let cubic = a * t + t * t * ((3.0 * rise - 2.0 * a - b) + t * (a + b - 2.0 * rise));
            [x + t * h, y + cubic]
        }));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_smooth_curve_goes_through_its_points_without_corners() {
        let wave = |k: u32| {
            let x = f64::from(k) / 24.0;
            [x, 0.5 + 0.4 * (std::f64::consts::TAU * x).sin()]
        };
        let points: Vec<[f64; 2]> = (0..=24).map(wave).collect();
        let curve = smooth(&points);
        for (k, point) in points.iter().enumerate() {
            let [x, y] = curve[8 * k];
            assert!((x - point[0]).abs() < 1e-12 && (y - point[1]).abs() < 1e-12);
        }
        for [x, y] in &curve {
            let exact = 0.5 + 0.4 * (std::f64::consts::TAU * x).sin();
            assert!((y - exact).abs() < 1e-3, "{x}: {y} {exact}");
        }
        assert_eq!(smooth(&points[..2]), points[..2]);
    }

    #[test]
    fn the_legend_names_what_the_chart_shows() {
        let chart = |limit: f64| {
            let one = |name: &str, mark, points: &[[f64; 2]]| Series {
                name: Some(name.to_owned()),
                mark,
                colour: 0,
                points: points.to_vec(),
            };
            let chart = Chart {
                title: String::new(),
                x: Axis::new("x", Scale::Linear),
                y: Axis::new("y", Scale::Log),
                series: vec![
                    one("limit", Mark::Guide, &[[limit, 1e-9], [limit, 1e9]]),
                    one("designs", Mark::Points, &[[1.0, 2.0], [3.0, 7.0]]),
                ],
                size: [480.0, 360.0],
            };
            chart.draw().unwrap().standalone()
        };
        assert!(chart(2.0).contains(">limit<"));
        let without = chart(9.0);
        assert!(!without.contains("limit") && without.contains(">designs<"));
    }
}
