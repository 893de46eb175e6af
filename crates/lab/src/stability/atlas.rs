//! The atlas: all entries with their outcomes, as a page, as tables, as JSON, and as lines of text.

use results::report::{AtlasEntry, AtlasMethod, AtlasPage, Chart};
use results::row;
use results::table::{Column, Table};
use serde_json::{Value, json};

use crate::stability::{Entry, Method, Outcome, entries};

/// All entries with their outcomes.
#[derive(Debug, Clone)]
pub struct Atlas {
    entries: Vec<(Entry, Outcome)>,
}

impl Atlas {
    /// Runs all entries in their order.
    #[must_use]
    pub fn run() -> Self {
        let entries = entries().into_iter().map(|entry| (entry, entry.run()));
        Self {
            entries: entries.collect(),
        }
    }

    /// Whether every promise is kept.
    #[must_use]
    pub fn is_kept(&self) -> bool {
        self.entries.iter().all(|(_, outcome)| outcome.is_kept())
    }

    /// The page, one HTML file without external parts.
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
        let own = self.entries.iter();
        let own = own.filter(|(entry, _)| entry.method == method);
        AtlasMethod {
            name: method.name().to_owned(),
            entries: own.map(|(entry, outcome)| view(entry, outcome)).collect(),
        }
    }

    /// The tables as CSV, by the names of their files: `promises.csv`, `figures.csv`, and one for each chart.
    ///
    /// # Errors
    ///
    /// A row does not fit its table.
    pub fn tables(&self) -> anyhow::Result<Vec<(String, Vec<u8>)>> {
        let mut promises = Table::new(vec![
            Column::text("entry"),
            Column::text("method"),
            Column::text("promise"),
            Column::whole("kept"),
        ]);
        let mut figures = Table::new(vec![
            Column::text("entry"),
            Column::text("figure"),
            Column::number("value"),
            Column::text("unit"),
        ]);
        let mut tables = Vec::new();
        for (entry, outcome) in &self.entries {
            let (id, method) = (entry.id, entry.method.name());
            for promise in outcome.promises() {
                let row = row![id, method, promise.sentence.clone(), promise.is_kept];
                promises.rows.push(row.to_vec());
            }
            for figure in outcome.figures() {
                let row = row![id, figure.name.clone(), figure.value, figure.unit.clone()];
                figures.rows.push(row.to_vec());
            }
            for (number, chart) in (1..).zip(outcome.charts()) {
                let name = match outcome.charts().len() {
                    1 => format!("{id}.csv"),
                    _ => format!("{id}-{number}.csv"),
                };
                tables.push((name, points(chart).csv()?));
            }
        }
        tables.push(("promises.csv".to_owned(), promises.csv()?));
        tables.push(("figures.csv".to_owned(), figures.csv()?));
        Ok(tables)
    }

    /// One line for each entry, and a last one for all.
    #[must_use]
    pub fn describe(&self) -> String {
        let mut text: String = self
            .entries
            .iter()
            .map(|(entry, o)| line(entry, o))
            .collect();
        let broken = self
            .entries
            .iter()
            .filter(|(_, outcome)| !outcome.is_kept());
        let broken = broken.count();
        let all = self.entries.len();
        text += &match broken {
            0 => format!("all {all} entries keep their promises\n"),
            _ => format!("{broken} of {all} entries break a promise\n"),
        };
        text
    }

    /// The entries as JSON.
    #[must_use]
    pub fn to_json(&self) -> Value {
        let entries = self.entries.iter().map(|(entry, outcome)| {
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

/// The line of an entry, such as `kept    kriging-outlier    error without it 1.2e-3`, and its broken promises.
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

/// The points of a chart, one curve after the other.
fn points(chart: &Chart) -> Table {
    let mut table = Table::new(vec![
        Column::text("curve"),
        Column::number(&*chart.x.label),
        Column::number(&*chart.y.label),
    ]);
    for series in &chart.series {
        let name = series.name.clone().unwrap_or_default();
        let rows = series
            .points
            .iter()
            .map(|[x, y]| row![name.clone(), *x, *y].to_vec());
        table.rows.extend(rows);
    }
    table
}
