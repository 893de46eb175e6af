//! The kriging model: its quality, its parameters and its predictions.

use stages::fitting::ModelSummary;

use super::figure::{Figure, figure};
use crate::number::{count, fixed, percent, significant, with_unit};
use crate::report::charts;
use crate::report::contents::Report;
use crate::report::error::Error;
use crate::report::model::VariableIndices;
use crate::report::quantity::variable_name;
use crate::snapshot::Snapshot;

pub(super) struct KrigingView<'a> {
    pub(super) title: String,
    pub(super) model: &'a ModelSummary,
    /// Label and value.
    pub(super) quality: Vec<(&'static str, String)>,
    /// Name, value and unit.
    pub(super) parameters: Vec<[String; 3]>,
    pub(super) figure: Figure,
    pub(super) residuals: Figure,
    pub(super) slices: Vec<Figure>,
    pub(super) indices: &'a [VariableIndices],
}

impl<'a> KrigingView<'a> {
    /// `None` without a model.
    pub(super) fn new(report: &'a Report) -> Result<Option<Self>, Error> {
        let snapshot = &report.snapshot;
        let Some((model, _)) = &snapshot.model else {
            return Ok(None);
        };
        let unit = &*snapshot.problem.measured().unit;
        let slices = report.slices.iter().map(|slice| {
            let name = format!("kriging-{}", slice.variable);
            figure(&name, charts::slice(slice, unit))
        });
        Ok(Some(Self {
            title: format!(
                "{} over {}",
                snapshot.measure_name(),
                observations(snapshot, model)
            ),
            model,
            quality: quality(model, unit),
            parameters: parameters(snapshot, model),
            figure: figure("kriging-leave-one-out", charts::leave_one_out(model, unit))?,
            residuals: figure("kriging-residuals", charts::residuals(model))?,
            slices: slices.collect::<Result<_, _>>()?,
            indices: &report.indices,
        }))
    }

    pub(super) fn figures(&self) -> impl Iterator<Item = &Figure> {
        [&self.figure, &self.residuals]
            .into_iter()
            .chain(&self.slices)
    }

    /// Whether the table of indices shows a negative number.
    pub(super) fn has_negative_index(&self) -> bool {
        let shown = self.indices.iter().flat_map(|row| [row.first, row.total]);
        shown
            .map(|index| fixed(index, 2))
            .any(|text| text.starts_with('−'))
    }
}

/// The observations that the model was fitted to, in words.
fn observations(snapshot: &Snapshot, model: &ModelSummary) -> String {
    let is_of_doe = |(number, _): &&(u64, f64)| *number < snapshot.designs.len() as u64;
    let designs = model.residuals.iter().filter(is_of_doe).count();
    match model.residuals.len() - designs {
        0 => format!("{} designs", model.points),
        infill => format!("{designs} designs and {infill} infill points"),
    }
}

fn quality(model: &ModelSummary, unit: &str) -> Vec<(&'static str, String)> {
    let largest = model
        .leave_one_out()
        .max_by(|a, b| a.standardised.abs().total_cmp(&b.standardised.abs()));
    let largest = largest.map(|point| {
        let residual = fixed(point.standardised, 1);
        format!("{residual} (design {})", point.number)
    });
    let quality = [
        ("Q²", fixed(model.q2, 3)),
        ("RMSE", with_unit(model.rmse, 3, unit)),
        ("Within the 90 % interval", percent(model.coverage90)),
        ("Observations", count(model.residuals.len() as u64)),
    ];
    let largest = largest.map(|text| ("Largest standardised residual", text));
    quality.into_iter().chain(largest).collect()
}

fn parameters(snapshot: &Snapshot, model: &ModelSummary) -> Vec<[String; 3]> {
    let problem = &snapshot.problem;
    let unit = &*problem.measured().unit;
    let squared = match unit {
        "" => String::new(),
        unit => format!("{unit}²"),
    };
    let row = |name: &str, value: f64, unit: &str| {
        [name.to_owned(), significant(value, 4), unit.to_owned()]
    };
    let ranges = problem
        .free_names()
        .zip(&model.ranges)
        .map(|(name, range)| {
            let name = format!("range in {}", variable_name(problem, name));
            row(&name, range.unwrap_or(f64::NAN), "")
        });
    [
        row("µ", model.mu, unit),
        row("σ²", model.sigma2, &squared),
        row("−log likelihood", model.negative_log_likelihood, ""),
    ]
    .into_iter()
    .chain(ranges)
    .collect()
}
