//! A kriging model: how well it predicts, and what it says.

use super::figure::{Figure, figure};
use crate::report::charts;
use crate::report::data::KrigingFit;
use crate::report::error::Error;
use crate::report::number::{count, fixed, percent, significant};
use crate::report::summary::with_unit;

pub(super) struct KrigingView {
    pub(super) title: String,
    pub(super) kernel: String,
    pub(super) quality: Vec<(String, String)>,
    pub(super) warnings: Vec<String>,
    pub(super) parameters: Vec<(String, String, String)>,
    pub(super) figure: Figure,
    pub(super) residuals: Figure,
    pub(super) slices: Vec<Figure>,
    /// Variable, first-order and total index.
    pub(super) indices: Vec<[String; 3]>,
}

impl KrigingView {
    pub(super) fn figures(&self) -> impl Iterator<Item = &Figure> {
        [&self.figure, &self.residuals]
            .into_iter()
            .chain(&self.slices)
    }
}

/// The section of one model.
pub(super) fn kriging_view(fit: &KrigingFit) -> Result<KrigingView, Error> {
    let standardised = fit.leave_one_out.iter();
    let standardised = standardised.map(|p| (p.design, p.standardised));
    let largest = standardised.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
    let largest = largest.map(|(design, residual)| {
        (
            "Largest standardised residual".to_owned(),
            format!("{} (design {design})", fixed(residual, 1)),
        )
    });
    Ok(KrigingView {
        title: fit.title.clone(),
        kernel: fit.kernel.clone(),
        warnings: fit.warnings.clone(),
        quality: [
            ("Q²".to_owned(), fixed(fit.q2, 3)),
            ("RMSE".to_owned(), with_unit(fit.rmse, 3, &fit.unit)),
            (
                "Within the 90 % interval".to_owned(),
                percent(fit.coverage_90),
            ),
            (
                "Observations".to_owned(),
                count(fit.leave_one_out.len() as u64),
            ),
        ]
        .into_iter()
        .chain(largest)
        .collect(),
        parameters: fit
            .parameters
            .iter()
            .map(|p| (p.name.clone(), significant(p.value, 4), p.unit.clone()))
            .collect(),
        figure: figure("kriging-leave-one-out", charts::leave_one_out(fit))?,
        residuals: figure("kriging-residuals", charts::residuals(fit))?,
        slices: fit
            .slices
            .iter()
            .map(|slice| {
                figure(
                    &format!("kriging-{}", slice.variable),
                    charts::slice(slice, fit),
                )
            })
            .collect::<Result<_, _>>()?,
        indices: fit
            .indices
            .iter()
            .map(|one| {
                [
                    one.variable.clone(),
                    fixed(one.first, 2),
                    fixed(one.total, 2),
                ]
            })
            .collect(),
    })
}
