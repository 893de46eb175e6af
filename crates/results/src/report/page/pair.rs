//! The page of one gear pair.

use askama::Template;

use super::figure::{Figure, figure};
use crate::report::charts;
use crate::report::data::PairPage;
use crate::report::error::Error;
use crate::report::summary::with_unit;
use crate::report::svg;

/// One gear pair as one HTML page that loads nothing and runs nothing.
///
/// # Errors
/// [`Error::LengthMismatch`] if lists of one curve differ in length, [`Error::Template`] if the
/// template fails.
pub fn render_pair(data: &PairPage) -> Result<String, Error> {
    let page = Page {
        data,
        page_css: super::PAGE_STYLE,
        chart_css: svg::CSS,
        constraints: data
            .constraints
            .iter()
            .map(|constraint| Row {
                name: &constraint.name,
                value: with_unit(constraint.value, 5, &constraint.unit),
                limit: format!(
                    "{} {}",
                    constraint.bound.sign(),
                    with_unit(constraint.limit, 5, &constraint.unit)
                ),
                holds: constraint.holds(),
            })
            .collect(),
        section: figure("section", charts::gears(&data.drawing))?,
        ste: figure("ste", charts::ste(&data.ste))?,
        solid: figure("axonometric", charts::solid(&data.drawing))?,
        pressure: figure("pressure", charts::pressure(&data.pressure))?,
        contact: figure("contact", charts::contact(&data.contact))?,
        wear: match &data.wear {
            Some(profiles) => {
                let chart = figure("wear", charts::wear(profiles, charts::HALF))?;
                Some(chart.with_sentence(&profiles.subject))
            }
            None => None,
        },
    };
    Ok(page.render()?)
}

#[derive(Template)]
#[template(path = "pair.html")]
struct Page<'a> {
    data: &'a PairPage,
    page_css: &'static str,
    chart_css: &'static str,
    constraints: Vec<Row<'a>>,
    section: Figure,
    ste: Figure,
    solid: Figure,
    pressure: Figure,
    contact: Figure,
    wear: Option<Figure>,
}

struct Row<'a> {
    name: &'a str,
    value: String,
    limit: String,
    holds: bool,
}
