//! Charts within a page, and as files beside it.

use std::fmt::Write as _;

use crate::number::column;
use crate::report::error::Error;
use crate::report::svg::{Picture, Table, escape};

/// A chart as files of its own.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ChartFile {
    /// The file's name, without an ending.
    pub name: String,
    /// The chart, with its style.
    pub svg: String,
    /// The points; `None` for a drawing.
    pub csv: Option<String>,
}

/// A chart, or the sentence that stands in its place.
pub(super) struct Figure {
    /// The chart with its data table, as HTML.
    pub(super) svg: Option<String>,
    pub(super) sentence: String,
    pub(super) file: Option<ChartFile>,
}

/// Charts with more points than this have them in the CSV alone.
const ROWS: usize = 120;

impl Figure {
    /// The chart, or the sentence, for a template.
    pub(super) fn html(&self) -> String {
        match &self.svg {
            Some(svg) => svg.clone(),
            None => format!("<p class=\"empty\">{}</p>", escape(&self.sentence)),
        }
    }

    pub(super) fn missing(sentence: &str) -> Self {
        Self {
            svg: None,
            sentence: sentence.to_owned(),
            file: None,
        }
    }

    pub(super) fn with_sentence(mut self, sentence: &str) -> Self {
        if self.svg.is_some() {
            self.sentence = sentence.to_owned();
        }
        self
    }
}

/// A chart for the page, whose file is called `name`. An empty chart becomes a sentence; any other error is returned.
pub(super) fn figure(name: &str, picture: Result<Picture, Error>) -> Result<Figure, Error> {
    match picture {
        Ok(picture) => Ok(Figure {
            svg: Some(picture.inline() + &picture.data().map_or_else(String::new, table)),
            sentence: String::new(),
            file: Some(ChartFile {
                name: name.to_owned(),
                svg: picture.standalone(),
                csv: picture.data().map(Table::csv),
            }),
        }),
        Err(Error::NothingToDraw { why, .. }) => {
            Ok(Figure::missing(&format!("Nothing to draw: {why}.")))
        }
        Err(other) => Err(other),
    }
}

/// The data table of a chart, for readers who do not see it.
fn table(data: &Table) -> String {
    let [x, y] = data.axes.each_ref().map(|label| escape(label));
    if data.len() > ROWS {
        return String::new();
    }
    let mut html = format!(
        "<details class=\"data\"><summary>Data</summary><div class=\"scroll\"><table><thead><tr><th scope=\"col\" \
         class=\"text\">Series</th><th scope=\"col\">{x}</th><th scope=\"col\">{y}</th></tr></thead><tbody>\n"
    );
    let points = || data.series.iter().flat_map(|(_, points)| points);
    let [xs, ys] = [0, 1].map(|i| {
        let values: Vec<(f64, &str)> = points().map(|point| (point[i], "")).collect();
        column(&values, 5)
    });
    let mut rows = xs.iter().zip(&ys);
    for (name, points) in &data.series {
        let name = escape(name);
        for (x, y) in rows.by_ref().take(points.len()) {
            // Writing to a String cannot fail.
            let _ = writeln!(
                html,
                "<tr><th scope=\"row\">{name}</th><td>{x}</td><td>{y}</td></tr>"
            );
        }
    }
    html += "</tbody></table></div></details>\n";
    html
}
