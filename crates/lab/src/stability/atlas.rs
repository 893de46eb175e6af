//! The results of the table: as a page, as CSV, as JSON, and as lines of text.

use results::report::{AtlasEntry, AtlasMethod, AtlasPage, Chart};
use serde_json::{Value, json};

use crate::stability::{Entry, Method, Outcome, entries};

/// All entries with their outcomes.
#[derive(Debug, Clone)]
pub struct Atlas {
    found: Vec<(Entry, Outcome)>,
}

impl Atlas {
    /// Runs all entries in their order.
    #[must_use]
    pub fn run() -> Self {
        let found = entries().into_iter().map(|entry| (entry, entry.run()));
        Self {
            found: found.collect(),
        }
    }

    /// The entries with their outcomes.
    #[must_use]
    pub fn found(&self) -> &[(Entry, Outcome)] {
        &self.found
    }

    /// Whether every entry keeps its promises.
    #[must_use]
    pub fn is_kept(&self) -> bool {
        self.found.iter().all(|(_, outcome)| outcome.is_kept())
    }

    /// The page, one self-contained HTML file.
    ///
    /// # Errors
    ///
    /// The template fails.
    pub fn page(&self, program_version: &str) -> Result<String, results::report::Error> {
        results::report::render_atlas(&AtlasPage {
            program_version: program_version.to_owned(),
            methods: Method::ALL.map(|method| self.method(method)).into(),
        })
    }

    fn method(&self, method: Method) -> AtlasMethod {
        let own = self.found.iter();
        let own = own.filter(|(entry, _)| entry.method == method);
        AtlasMethod {
            name: method.name().to_owned(),
            entries: own.map(|(entry, outcome)| view(entry, outcome)).collect(),
        }
    }

    /// The tables by the names of their files: `promises.csv`, `figures.csv`, and the points of each
    /// chart in a table of its own.
    ///
    /// # Errors
    ///
    /// A table cannot be written to memory.
    pub fn tables(&self) -> Result<Vec<(String, Vec<u8>)>, csv::Error> {
        let mut promises = vec![["entry", "method", "promise", "kept"].map(str::to_owned)];
        let mut figures = vec![["entry", "figure", "value", "unit"].map(str::to_owned)];
        let mut tables = Vec::new();
        for (entry, outcome) in &self.found {
            let id = entry.id.to_owned();
            promises.extend(outcome.promises().iter().map(|promise| {
                let kept = u8::from(promise.is_kept).to_string();
                let method = entry.method.name().to_owned();
                [id.clone(), method, promise.sentence.clone(), kept]
            }));
            figures.extend(outcome.figures().iter().map(|figure| {
                let value = figure.value.to_string();
                [id.clone(), figure.name.clone(), value, figure.unit.clone()]
            }));
            for (number, chart) in (1..).zip(outcome.charts()) {
                let name = match outcome.charts().len() {
                    1 => format!("{id}.csv"),
                    _ => format!("{id}-{number}.csv"),
                };
                tables.push((name, csv_of(&points(chart))?));
            }
        }
        tables.push(("promises.csv".to_owned(), csv_of(&promises)?));
        tables.push(("figures.csv".to_owned(), csv_of(&figures)?));
        Ok(tables)
    }

    /// One line for each entry, and one for all.
    #[must_use]
    pub fn describe(&self) -> String {
        let mut text: String = self.found.iter().map(|(entry, o)| line(entry, o)).collect();
        let broken = self.found.iter().filter(|(_, outcome)| !outcome.is_kept());
        let broken = broken.count();
        let all = self.found.len();
        text += &match broken {
            0 => format!("all {all} entries keep their promises\n"),
            _ => format!("{broken} of {all} entries break a promise\n"),
        };
        text
    }

    /// The entries as JSON.
    #[must_use]
    pub fn to_json(&self) -> Value {
        let entries = self.found.iter().map(|(entry, outcome)| {
            let detected = outcome.detections().iter();
            let figures = outcome.figures().iter();
            let promises = outcome.promises().iter();
            json!({
                "id": entry.id,
                "method": entry.method.name(),
                "title": entry.title,
                "input": entry.input,
                "instead": entry.instead,
                "kept": outcome.is_kept(),
                "detected": detected
                    .map(|d| json!({"name": d.name, "message": d.message}))
                    .collect::<Vec<_>>(),
                "figures": figures
                    .map(|f| json!({"name": f.name, "value": f.value, "unit": f.unit}))
                    .collect::<Vec<_>>(),
                "promises": promises
                    .map(|p| json!({"promise": p.sentence, "kept": p.is_kept}))
                    .collect::<Vec<_>>(),
            })
        });
        entries.collect::<Vec<_>>().into()
    }
}

/// `kept    kriging-outlier    error without it 1.2e-3`, for example; broken promises follow.
fn line(entry: &Entry, outcome: &Outcome) -> String {
    let verdict = if outcome.is_kept() { "kept" } else { "BROKEN" };
    let figure = outcome.figures().first().map_or_else(String::new, |f| {
        let is_plain = f.value == 0.0 || (1e-3..1e6).contains(&f.value.abs());
        let value = if is_plain {
            format!("{:.4}", f.value)
        } else {
            format!("{:.3e}", f.value)
        };
        format!("{} {value} {}", f.name, f.unit)
    });
    let mut text = format!("{verdict:<7} {:<34} {}", entry.id, figure.trim_end());
    text.truncate(text.trim_end().len());
    text.push('\n');
    for promise in outcome.promises().iter().filter(|p| !p.is_kept) {
        text += &format!("        broken: {}\n", promise.sentence);
    }
    text
}

fn view(entry: &Entry, outcome: &Outcome) -> AtlasEntry {
    let mut detected: Vec<String> = Vec::new();
    for detection in outcome.detections() {
        if !detected.contains(&detection.name) {
            detected.push(detection.name.clone());
        }
    }
    let told = outcome.detections().iter().map(|d| d.message.clone());
    let told = told.filter(|message| !message.is_empty());
    let promises = outcome.promises().iter();
    AtlasEntry {
        id: entry.id.to_owned(),
        title: entry.title.to_owned(),
        input: entry.input.to_owned(),
        detected,
        told: told.collect(),
        instead: entry.instead.to_owned(),
        promises: promises.map(|p| (p.sentence.clone(), p.is_kept)).collect(),
        figures: outcome.figures().to_vec(),
        charts: outcome.charts().to_vec(),
    }
}

/// The points of a chart, curve after curve.
fn points(chart: &Chart) -> Vec<[String; 3]> {
    let head = ["curve", chart.x.label.as_str(), chart.y.label.as_str()];
    let mut rows = vec![head.map(str::to_owned)];
    for series in &chart.series {
        let name = series.name.clone().unwrap_or_default();
        let points = series.points.iter();
        rows.extend(points.map(|[x, y]| [name.clone(), x.to_string(), y.to_string()]));
    }
    rows
}

fn csv_of<const N: usize>(rows: &[[String; N]]) -> Result<Vec<u8>, csv::Error> {
    let mut out = csv::Writer::from_writer(Vec::new());
    for row in rows {
        out.write_record(row)?;
    }
    out.into_inner().map_err(|error| error.into_error().into())
}
