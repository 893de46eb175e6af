//! The page of the stability atlas.

use askama::Template;

use super::figure::{Figure, figure};
use crate::number::{count, with_unit};
use crate::report::atlas::{AtlasEntry, AtlasPage};
use crate::report::error::Error;
use crate::report::quantity::NamedValue;
use crate::report::svg;

/// The stability atlas as one HTML page that loads nothing and runs nothing.
///
/// # Errors
/// [`Error::Template`] if the template fails.
pub fn render_atlas(data: &AtlasPage) -> Result<String, Error> {
    let all = || data.methods.iter().flat_map(|method| &method.entries);
    let kept = all().filter(|entry| entry.is_kept()).count();
    let entries = all().count();
    let page = Page {
        program_version: &data.program_version,
        page_css: super::PAGE_STYLE,
        chart_css: svg::CSS,
        headline: if kept == entries {
            format!("All {entries} entries keep what they promise.")
        } else {
            format!("{} of {entries} entries break a promise.", entries - kept)
        },
        tiles: [
            ("Entries", entries),
            (
                "Promises",
                all().map(|entry| entry.promises.len()).sum::<usize>(),
            ),
            (
                "Figures",
                all().map(|entry| entry.figures.len()).sum::<usize>(),
            ),
        ]
        .map(|(name, value)| (name, count(value as u64))),
        methods: data
            .methods
            .iter()
            .map(|method| {
                let views = method.entries.iter().map(View::new);
                Ok((method.name.as_str(), views.collect::<Result<_, _>>()?))
            })
            .collect::<Result<_, Error>>()?,
    };
    Ok(page.render()?)
}

#[derive(Template)]
#[template(path = "atlas.html")]
struct Page<'a> {
    program_version: &'a str,
    page_css: &'static str,
    chart_css: &'static str,
    headline: String,
    tiles: [(&'static str, String); 3],
    methods: Vec<(&'a str, Vec<View<'a>>)>,
}

struct View<'a> {
    entry: &'a AtlasEntry,
    is_kept: bool,
    figures: Vec<(&'a str, String)>,
    charts: Vec<Figure>,
}

impl<'a> View<'a> {
    fn new(entry: &'a AtlasEntry) -> Result<Self, Error> {
        let drawn = entry.charts.iter().map(|chart| {
            figure(
                &entry.id,
                chart.draw().ok_or(Error::NothingToDraw {
                    chart: "chart of the atlas",
                    why: "no curve has a finite value",
                }),
            )
        });
        Ok(Self {
            entry,
            is_kept: entry.is_kept(),
            figures: entry
                .figures
                .iter()
                .map(|figure| (figure.name.as_str(), value_of(figure)))
                .collect(),
            charts: drawn.collect::<Result<_, _>>()?,
        })
    }
}

/// A figure with three digits; a whole number of things has no decimals.
fn value_of(figure: &NamedValue) -> String {
    let is_whole = figure.value.fract() == 0.0 && figure.value.abs() < 1e6;
    with_unit(figure.value, if is_whole { 1 } else { 3 }, &figure.unit)
}
