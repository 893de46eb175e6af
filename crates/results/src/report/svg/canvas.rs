//! Elements and their coordinates as text.

use std::fmt::Write as _;

/// The text with the five special characters of XML and HTML replaced.
pub(crate) fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            // XML 1.0 has no place for these, not even escaped.
            c if c.is_control() && !matches!(c, '\n' | '\t') => out.push('\u{fffd}'),
            '\u{fffe}' | '\u{ffff}' => out.push('\u{fffd}'),
            c => out.push(c),
        }
    }
    out
}

/// An estimate, on the wide side, of a text's width in pixels at 12 px.
pub(crate) fn text_width(text: &str) -> f64 {
    6.8 * text.chars().count() as f64
}

/// The point of a text that lies at its x coordinate.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Anchor {
    Start,
    Middle,
    End,
}

/// A picture in the making.
#[derive(Debug)]
pub(crate) struct Canvas {
    body: String,
}

impl Canvas {
    pub(crate) fn new() -> Self {
        Self {
            body: String::new(),
        }
    }

    pub(crate) fn rect(&mut self, low: [f64; 2], high: [f64; 2], class: &str) {
        self.element(format_args!(
            r#"<rect class="{class}" x="{}" y="{}" width="{}" height="{}"/>"#,
            px(low[0]),
            px(low[1]),
            px(high[0] - low[0]),
            px(high[1] - low[1]),
        ));
    }

    pub(crate) fn circle(&mut self, centre: [f64; 2], radius: f64, class: &str) {
        self.element(format_args!(
            r#"<circle class="{class}" cx="{}" cy="{}" r="{}"/>"#,
            px(centre[0]),
            px(centre[1]),
            px(radius)
        ));
    }

    /// Open lines, as one element.
    pub(crate) fn lines(&mut self, pieces: &[Vec<[f64; 2]>], class: &str, dash: &str) {
        let path: String = pieces.iter().map(|piece| trace(piece)).collect();
        if path.is_empty() {
            return;
        }
        if dash.is_empty() {
            self.element(format_args!(r#"<path class="{class}" d="{path}"/>"#));
        } else {
            self.element(format_args!(
                r#"<path class="{class}" stroke-dasharray="{dash}" d="{path}"/>"#
            ));
        }
    }

    /// A filled area.
    pub(crate) fn area(&mut self, points: &[[f64; 2]], class: &str) {
        if points.len() > 2 {
            self.element(format_args!(
                r#"<path class="{class}" fill-rule="evenodd" d="{}Z"/>"#,
                trace(points)
            ));
        }
    }

    /// Filled areas, as one element.
    pub(crate) fn areas(&mut self, areas: &[Vec<[f64; 2]>], class: &str) {
        let path: String = areas.iter().map(|area| trace(area) + "Z").collect();
        if !path.is_empty() {
            self.element(format_args!(r#"<path class="{class}" d="{path}"/>"#));
        }
    }

    /// Rectangles between two corners each, as one element.
    pub(crate) fn rects(
        &mut self,
        corners: impl Iterator<Item = ([f64; 2], [f64; 2])>,
        class: &str,
    ) {
        let path: String = corners
            .map(|(low, high)| {
                let [left, top] = low.map(px);
                let [right, bottom] = high.map(px);
                format!("M{left} {top}H{right}V{bottom}H{left}Z")
            })
            .collect();
        if !path.is_empty() {
            self.element(format_args!(r#"<path class="{class}" d="{path}"/>"#));
        }
    }

    /// Round dots. Dots of one path do not darken where they overlap, because a path is painted once. They are
    /// spread over twelve paths, whose dots do darken. A dot takes about a dozen bytes, far less than an element of
    /// its own.
    pub(crate) fn dots(&mut self, points: &[[f64; 2]], class: &str) {
        const LAYERS: usize = 12;
        for layer in 0..LAYERS.min(points.len()) {
            let path: String = points
                .iter()
                .skip(layer)
                .step_by(LAYERS)
                .map(|p| format!("M{} {}h0", px(p[0]), px(p[1])))
                .collect();
            self.element(format_args!(r#"<path class="{class}" d="{path}"/>"#));
        }
    }

    /// A line of text.
    pub(crate) fn text(&mut self, at: [f64; 2], anchor: Anchor, class: &str, text: &str) {
        self.place_text(at, anchor, class, "", text);
    }

    /// A line of text that reads upwards.
    pub(crate) fn text_upwards(&mut self, at: [f64; 2], anchor: Anchor, text: &str) {
        let turn = format!(r#" transform="rotate(-90 {} {})""#, px(at[0]), px(at[1]));
        self.place_text(at, anchor, "", &turn, text);
    }

    /// A line of ordinary text.
    pub(crate) fn label(&mut self, at: [f64; 2], text: &str) {
        self.text(at, Anchor::Start, "", text);
    }

    /// The picture's title.
    pub(crate) fn heading(&mut self, at: [f64; 2], text: &str) {
        self.text(at, Anchor::Start, "ttl", text);
    }

    /// The finished picture; `label` is what a screen reader says.
    pub(crate) fn finish(self, width: f64, height: f64, label: &str) -> Picture {
        Picture {
            width,
            height,
            label: label.to_owned(),
            body: self.body,
            data: None,
        }
    }

    fn place_text(&mut self, at: [f64; 2], anchor: Anchor, class: &str, turn: &str, text: &str) {
        let anchor = match anchor {
            Anchor::Start => "",
            Anchor::Middle => r#" text-anchor="middle""#,
            Anchor::End => r#" text-anchor="end""#,
        };
        let class = if class.is_empty() {
            String::new()
        } else {
            format!(r#" class="{class}""#)
        };
        self.element(format_args!(
            r#"<text{class} x="{}" y="{}"{anchor}{turn}>{}</text>"#,
            px(at[0]),
            px(at[1]),
            escape(text)
        ));
    }

    fn element(&mut self, element: std::fmt::Arguments<'_>) {
        // Writing to a String cannot fail.
        let _ = self.body.write_fmt(element);
        self.body.push('\n');
    }
}

/// A finished picture.
#[derive(Debug, Clone)]
pub struct Picture {
    width: f64,
    height: f64,
    label: String,
    body: String,
    /// The points; `None` for a drawing.
    data: Option<Table>,
}

/// The points of a chart.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Table {
    /// The labels of both axes.
    pub(crate) axes: [String; 2],
    /// The name of each series with its points.
    pub(crate) series: Vec<(String, Vec<[f64; 2]>)>,
}

impl Table {
    /// Number of points.
    pub(crate) fn len(&self) -> usize {
        self.series.iter().map(|(_, points)| points.len()).sum()
    }

    /// The table as CSV.
    pub(crate) fn csv(&self) -> String {
        let quoted = |text: &str| format!("\"{}\"", text.replace('"', "\"\""));
        let [x, y] = &self.axes;
        let mut csv = format!("series,{},{}\n", quoted(x), quoted(y));
        for (name, points) in &self.series {
            for [x, y] in points {
                // Writing to a String cannot fail.
                let _ = writeln!(csv, "{},{x},{y}", quoted(name));
            }
        }
        csv
    }
}

impl Picture {
    /// The picture with the points that it shows.
    pub(crate) fn with_data(self, data: Table) -> Self {
        Self {
            data: Some(data),
            ..self
        }
    }

    /// The picture with a `subject`, such as a design, which a screen reader says first.
    pub(crate) fn of(self, subject: &str) -> Self {
        Self {
            label: format!("{}. {}", subject.trim_end_matches('.'), self.label),
            ..self
        }
    }

    /// The picture in words.
    pub(crate) fn label(&self) -> &str {
        &self.label
    }

    /// The points; `None` for a drawing.
    pub(crate) const fn data(&self) -> Option<&Table> {
        self.data.as_ref()
    }

    /// The picture as an element of a page that already has the chart style.
    pub(crate) fn inline(&self) -> String {
        self.write("", "")
    }

    /// The picture as a file of its own, with its style and background.
    #[must_use]
    pub fn standalone(&self) -> String {
        let head = format!(
            "<style>{}</style>\n<rect class=\"bg\" width=\"{}\" height=\"{}\"/>\n",
            super::CSS,
            px(self.width),
            px(self.height)
        );
        self.write(r#" xmlns="http://www.w3.org/2000/svg""#, &head)
    }

    fn write(&self, attributes: &str, head: &str) -> String {
        let (w, h, label) = (px(self.width), px(self.height), escape(&self.label));
        format!(
            "<svg{attributes} class=\"chart\" role=\"img\" aria-label=\"{label}\" viewBox=\"0 0 {w} {h}\" \
             width=\"{w}\" height=\"{h}\">\n<title>{label}</title>\n{head}{}</svg>\n",
            self.body
        )
    }
}

/// A coordinate with at most one decimal: a tenth of a pixel is finer than anyone sees.
fn px(value: f64) -> String {
    let tenths = (value * 10.0).round();
    if tenths == 0.0 {
        return "0".to_owned();
    }
    let text = format!("{:.1}", tenths / 10.0);
    text.strip_suffix(".0").map_or(text.clone(), str::to_owned)
}

/// Path commands through the points, without points that would print like the one before.
fn trace(points: &[[f64; 2]]) -> String {
    let mut out = String::with_capacity(points.len() * 10);
    let mut last = String::new();
    for (i, p) in points.iter().enumerate() {
        let here = format!("{} {}", px(p[0]), px(p[1]));
        if i > 0 && here == last {
            continue;
        }
        out.push(if i == 0 { 'M' } else { 'L' });
        out.push_str(&here);
        last = here;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coordinates_are_short() {
        assert_eq!(px(12.0), "12");
        assert_eq!(px(12.34), "12.3");
        assert_eq!(px(-0.04), "0");
        assert_eq!(trace(&[[0.0, 0.0], [0.01, 0.0], [1.0, 2.25]]), "M0 0L1 2.3");
    }

    #[test]
    fn markup_and_control_characters_do_not_survive() {
        assert_eq!(
            escape("<b a='1'>&\u{7}\""),
            "&lt;b a=&#39;1&#39;&gt;&amp;\u{fffd}&quot;"
        );
    }

    #[test]
    fn every_dot_is_drawn_once() {
        let points: Vec<[f64; 2]> = (0..100).map(|i| [f64::from(i), 1.0]).collect();
        let mut canvas = Canvas::new();
        canvas.dots(&points, "dots");
        for i in 0..100 {
            assert_eq!(canvas.body.matches(&format!("M{i} 1h0")).count(), 1);
        }
    }
}
