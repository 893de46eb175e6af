//! The summary of a fitted model: parameters, validation and warnings.

use std::fmt::Write as _;

use kriging::Settings;
use serde::Serialize;

use crate::modelling::table::{SkippedRows, UnusedColumn};
use crate::modelling::{ModelFile, Quantity, Table};

/// The parameters and the validation of a model that was fitted to a table. Quantities of the response are
/// in its unit; with a model of ln y, those marked "modelled scale" are of ln y.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Summary {
    /// The table's file, as the user named it.
    pub file: String,
    /// How the table was read, if it is not plain CSV.
    pub format: Vec<String>,
    pub response: Quantity,
    /// The column of noise variances.
    pub variance: Option<String>,
    pub inputs: Vec<InputSummary>,
    /// Columns of the table that the model does not use, and why.
    pub unused: Vec<UnusedColumn>,
    /// Rows that were left out, by the column that has no value there.
    pub skipped: Vec<SkippedRows>,
    /// Number n of observations.
    pub observations: usize,
    /// Number of points, nearly equal ones counted once.
    pub points: usize,
    /// The covariance function.
    pub kernel: String,
    /// Whether predictions use the nearest observations only.
    pub is_approximate: bool,
    /// The criterion that the parameters maximise.
    pub estimator: kriging::Estimator,
    pub trend: kriging::Trend,
    /// Whether the response or its logarithm is modelled.
    pub response_scale: kriging::Response,
    /// The mean µ, modelled scale.
    pub mean: f64,
    /// The process variance σ², modelled scale.
    pub process_variance: f64,
    /// Whether the nugget was estimated.
    pub nugget_is_estimated: bool,
    /// The nugget, a noise variance on top of the known ones, modelled scale; zero if none was estimated.
    pub nugget_variance: f64,
    /// The factor of the predicted variances: 1 unless they were calibrated.
    pub calibration: f64,
    /// −ln L.
    pub negative_log_likelihood: f64,
    pub leave_one_out: Validation,
    /// Warnings, by column and line.
    pub warnings: Vec<String>,
}

/// An input of the model.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct InputSummary {
    /// The column's name.
    pub name: String,
    /// The column's unit, if its name says it.
    pub unit: Option<String>,
    /// The lowest value seen.
    pub low: f64,
    /// The highest value seen.
    pub high: f64,
    /// The estimated range, in the unit of the input; `None` if the model does not depend on the
    /// input.
    pub range: Option<f64>,
    /// The slope of a linear trend, modelled scale per unit of the input.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub slope: Option<f64>,
}

/// Errors of the predictions of each observation from all other points.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Validation {
    /// Root mean square of the residuals, in the unit of the response.
    pub rmse: f64,
    /// 1 − Σ residual²/Σ (y − ȳ)²: 1 for perfect predictions, 0 for those of the mean.
    pub q2: f64,
    /// The fraction of observations within their 95 % prediction interval.
    pub coverage95: f64,
    /// The observation that lies furthest from its prediction, in standard deviations.
    pub largest: LargestResidual,
}

/// The largest standardised residual.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LargestResidual {
    /// The observation's line in the file, from 1.
    pub line: u64,
    /// Observation minus prediction over its standard deviation.
    pub standardised: f64,
}

/// The data of a fit.
pub(crate) struct Origin<'a> {
    /// The table, without the rows that were left out.
    pub(crate) table: &'a Table,
    /// The column of noise variances.
    pub(crate) variance: Option<String>,
    pub(crate) unused: Vec<UnusedColumn>,
    pub(crate) skipped: Vec<SkippedRows>,
    pub(crate) warnings: Vec<String>,
}

pub(crate) fn of(model: &ModelFile, settings: &Settings, origin: Origin<'_>) -> Summary {
    let table = origin.table;
    let surrogate = &model.surrogate;
    let leave_one_out = surrogate.leave_one_out();
    let parameters = surrogate.parameters();
    let inputs = model
        .inputs
        .iter()
        .enumerate()
        .map(|(j, input)| InputSummary {
            name: input.name.clone(),
            unit: input.unit.clone(),
            low: input.low,
            high: input.high,
            range: Some(parameters.ranges[j]).filter(|range| range.is_finite()),
            slope: parameters.slopes.get(j).copied(),
        });
    Summary {
        file: table.file().to_owned(),
        format: table.format().to_vec(),
        response: model.response.clone(),
        variance: origin.variance,
        inputs: inputs.collect(),
        unused: origin.unused,
        skipped: origin.skipped,
        observations: table.len(),
        points: leave_one_out.points,
        kernel: surrogate.kernel().to_string(),
        is_approximate: surrogate.vecchia().is_some(),
        estimator: settings.fit.estimator,
        trend: settings.fit.trend,
        response_scale: surrogate.response(),
        mean: parameters.mu,
        process_variance: parameters.sigma2,
        nugget_is_estimated: settings.fit.nugget == kriging::Nugget::Estimated,
        nugget_variance: parameters.nugget,
        calibration: surrogate.calibration(),
        negative_log_likelihood: surrogate.negative_log_likelihood(),
        leave_one_out: validation(&leave_one_out, table),
        warnings: origin.warnings,
    }
}

fn validation(found: &kriging::LeaveOneOut, table: &Table) -> Validation {
    let residuals = found.standardised.iter().zip(&found.observations);
    let largest = residuals.max_by(|(a, _), (b, _)| a.abs().total_cmp(&b.abs()));
    let (standardised, observation) = largest.map_or((0.0, 0), |(z, i)| (*z, *i));
    Validation {
        rmse: found.rmse,
        q2: found.q2,
        coverage95: found.coverage(0.95),
        largest: LargestResidual {
            line: table.line(observation),
            standardised,
        },
    }
}

/// The summary as text.
#[must_use]
pub fn describe(summary: &Summary) -> String {
    let mut text = String::new();
    let unit = summary.response.spaced_unit();
    let Validation {
        rmse,
        q2,
        coverage95,
        largest,
    } = &summary.leave_one_out;
    let logarithm = match summary.response_scale {
        kriging::Response::Plain => "",
        kriging::Response::Log => " (of its logarithm)",
    };
    let method = if summary.is_approximate {
        "approximate: nearest observations"
    } else {
        "exact"
    };
    let noise = match (&summary.variance, summary.nugget_is_estimated) {
        (None, true) => format!(
            "estimated, since no variances are known: nugget {:.4e}",
            summary.nugget_variance
        ),
        (None, false) => "none: the observations are taken as exact".to_owned(),
        (Some(column), false) => format!("known variances, column {column:?}"),
        (Some(column), true) => format!(
            "known variances, column {column:?}, and an estimated nugget of {:.4e}",
            summary.nugget_variance
        ),
    };
    // Writing to a string does not fail.
    let mut line = |name: &str, value: String| {
        let _ = writeln!(text, "{name:<21}{value}");
    };
    let format = match &summary.format[..] {
        [] => String::new(),
        parts => format!(" ({})", parts.join(", ")),
    };
    line("table", format!("{}{format}", summary.file));
    line("response", format!("{}{logarithm}", summary.response.name));
    line(
        "observations",
        format!(
            "{} at {} points in {} inputs",
            summary.observations,
            summary.points,
            summary.inputs.len()
        ),
    );
    for input in &summary.inputs {
        let range = match input.range {
            Some(range) => format!("range {range:.4e}"),
            None => "no influence".to_owned(),
        };
        let slope = input.slope.map(|slope| format!(", slope {slope:.4e}"));
        line(
            "input",
            format!(
                "{:<20} {} to {}, {range}{}",
                input.name,
                input.low,
                input.high,
                slope.unwrap_or_default()
            ),
        );
    }
    for UnusedColumn { column, reason } in &summary.unused {
        line("not used", format!("{column}: {reason}"));
    }
    for SkippedRows { column, lines } in &summary.skipped {
        let count = lines.len();
        let listed: Vec<String> = lines.iter().take(20).map(u64::to_string).collect();
        let more = if count > listed.len() { ", …" } else { "" };
        let rows = if count == 1 { "row" } else { "rows" };
        let listed = listed.join(", ");
        line(
            "left out",
            format!("{count} {rows} without a value in {column}: line {listed}{more}"),
        );
    }
    line("model", format!("{}, {method}", summary.kernel));
    line("noise", noise);
    line("mean", format!("{:.6}", summary.mean));
    line(
        "process variance",
        format!("{:.4e}", summary.process_variance),
    );
    if summary.calibration != 1.0 {
        line("calibration", format!("{:.3}", summary.calibration));
    }
    line("-ln L", format!("{:.3}", summary.negative_log_likelihood));
    line("leave-one-out RMSE", format!("{rmse:.4e}{unit}"));
    line("leave-one-out Q²", format!("{q2:.4}"));
    line(
        "95 % intervals",
        format!("cover {:.1} % of the observations", 100.0 * coverage95),
    );
    line(
        "largest residual",
        format!(
            "{:.2} standard deviations, line {}",
            largest.standardised, largest.line
        ),
    );
    for warning in &summary.warnings {
        let _ = writeln!(text, "warning: {warning}");
    }
    text
}
