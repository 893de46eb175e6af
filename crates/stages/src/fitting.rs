//! The kriging model of P90.

use campaign::file::Noise;
use campaign::formulation::Problem;
use kriging::{Data, Error, Guidance, Names, Surrogate};
use serde::{Deserialize, Serialize};
use store::{DesignRow, ModelRow, ResponseRow};

/// The name of the model of P90 in the store.
pub const P90_MODEL: &str = "p90";

/// The summary of a fitted model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ModelSummary {
    /// The covariance function.
    pub kernel: String,
    /// Number of points that the model was fitted to.
    pub points: usize,
    /// The mean µ, µm.
    pub mu_um: f64,
    /// The process variance σ², µm².
    pub sigma2_um2: f64,
    /// The ranges in the order of the variables; `None` for a variable that the model does not
    /// depend on.
    pub ranges: Vec<Option<f64>>,
    /// −log likelihood.
    pub negative_log_likelihood: f64,
    /// Q² of leave-one-out predictions.
    pub q2: f64,
    /// Root mean square of the leave-one-out residuals, µm.
    pub rmse_um: f64,
    /// The share of observations within their leave-one-out 90 % interval.
    pub coverage90: f64,
    /// The leave-one-out residuals (observation minus prediction) by design, µm.
    pub residuals_um: Vec<(u64, f64)>,
    /// Those residuals over their standard deviations, in the same order; empty in stores of earlier
    /// versions.
    #[serde(default)]
    pub standardised: Vec<f64>,
    /// The variables of the design of the DoE that satisfies every constraint and has the best mean of the model:
    /// the search on the model begins there. `None` without such a design.
    #[serde(default)]
    pub best_of_doe: Option<Vec<f64>>,
    /// Warnings about the data and the fit.
    pub warnings: Vec<String>,
    /// CPU time of the fit, seconds.
    pub cpu_seconds: f64,
}

/// Fits the kriging model of P90 as the campaign's `[kriging]` says; `cpu_seconds` is left zero. `is_feasible` tells
/// whether a design satisfies every constraint.
///
/// # Errors
///
/// The data cannot be fitted: too few designs with a response, for example.
pub fn fit(
    problem: &Problem,
    designs: &[DesignRow],
    responses: &[ResponseRow],
    is_feasible: impl Fn(&DesignRow) -> bool,
) -> anyhow::Result<(Surrogate, ModelSummary)> {
    let campaign = problem.campaign();
    let d = problem.dimension();
    let is_left_out = |design: u64| {
        let mut left_out = campaign.kriging.leave_out.iter();
        left_out.any(|&number| u64::from(number) == design)
    };
    let points: Vec<(&DesignRow, &ResponseRow)> = responses
        .iter()
        .filter(|response| !is_left_out(response.design))
        // Too many of its samples have failed.
        .filter(|response| response.p90_um.is_finite())
        .filter_map(|response| Some((designs.get(response.design as usize)?, response)))
        .collect();
    let x: Vec<f64> = points
        .iter()
        .flat_map(|(design, _)| design.x.iter().copied())
        .collect();
    let y: Vec<f64> = points.iter().map(|(_, response)| response.p90_um).collect();
    let noise: Vec<f64> = points
        .iter()
        .map(|(_, response)| response.p90_variance_um2)
        .collect();
    let noise = match campaign.kriging.noise {
        Noise::Own => noise,
        Noise::Smoothed => {
            let freedom = campaign.sampling.degrees_of_freedom();
            kriging::smoothed_noise(&x, d, &noise, freedom, campaign.seed)?
        }
    };
    let data = Data {
        x: &x,
        d,
        y: &y,
        noise_variance: &noise,
    };
    let design = |observation: usize| points[observation].1.design;
    let settings = campaign.kriging.settings(campaign.seed)?;
    let model =
        Surrogate::fit(&data, &settings).map_err(|error| explained(problem, error, design))?;
    let feasible = responses
        .iter()
        .filter_map(|row| designs.get(row.design as usize));
    let feasible: Vec<&DesignRow> = feasible.filter(|row| is_feasible(row)).collect();
    let at: Vec<f64> = feasible
        .iter()
        .flat_map(|row| row.x.iter().copied())
        .collect();
    let best = model.means(&at)?.into_iter().zip(feasible);
    let best = best.min_by(|(a, _), (b, _)| problem.cost(*a).total_cmp(&problem.cost(*b)));
    let validation = model.leave_one_out();
    let parameters = model.parameters();
    let residuals = validation.observations.iter().zip(&validation.residuals);
    let summary = ModelSummary {
        kernel: model.kernel().to_string(),
        points: model.points(),
        mu_um: parameters.mu,
        sigma2_um2: parameters.sigma2,
        ranges: parameters
            .ranges
            .iter()
            .map(|range| range.is_finite().then_some(*range))
            .collect(),
        negative_log_likelihood: model.negative_log_likelihood(),
        q2: validation.q2,
        rmse_um: validation.rmse,
        coverage90: validation.coverage90,
        residuals_um: residuals.map(|(&i, r)| (design(i), *r)).collect(),
        standardised: validation.standardised,
        best_of_doe: best.map(|(_, row)| row.x.clone()),
        warnings: guided(problem, design, |guidance| {
            let warnings = model.warnings().iter();
            warnings.map(|warning| guidance.warning(warning)).collect()
        }),
        cpu_seconds: 0.0,
    };
    Ok((model, summary))
}

/// Calls `with` with guidance in the names of the campaign and the keys of its file.
fn guided<T>(
    problem: &Problem,
    design: impl Fn(usize) -> u64,
    with: impl FnOnce(&Guidance<'_>) -> T,
) -> T {
    let names: Vec<&str> = problem.free_names().collect();
    let unit = match &*problem.sampled().unit {
        "" => String::new(),
        unit => format!(" {unit}"),
    };
    with(&Guidance {
        names: Names {
            coordinate: &|j| names[j].to_owned(),
            observation: &|i| format!("design {}", design(i)),
        },
        responses: "percentiles",
        unit: &unit,
        setting: &|key, value| format!("kriging.{key} = {value:?}"),
        without: &|observations| {
            let designs: Vec<u64> = observations.iter().map(|&i| design(i)).collect();
            format!("kriging.leave_out = {designs:?}")
        },
        more_points: "more designs (doe.designs)",
        less_noise: "more samples (sampling.samples_per_design)",
    })
}

/// An error in the names of the campaign, with the keys of its file that help.
fn explained(problem: &Problem, error: Error, design: impl Fn(usize) -> u64) -> anyhow::Error {
    match guided(problem, design, |guidance| guidance.error(&error)) {
        Some(text) => anyhow::Error::msg(text),
        None => error.into(),
    }
}

/// The row of a fitted model.
///
/// # Errors
///
/// The model cannot be written as JSON: one of its numbers is not finite.
pub fn model_row(model: &Surrogate, summary: &ModelSummary) -> anyhow::Result<ModelRow> {
    Ok(ModelRow {
        name: P90_MODEL.to_owned(),
        json: model.to_json()?,
        summary_json: serde_json::to_string(summary)?,
    })
}

#[cfg(test)]
mod tests {
    use campaign::Campaign;

    use super::*;
    use crate::designs;

    #[test]
    fn a_model_that_is_no_better_than_noise_is_refused() {
        let mut campaign = Campaign::parse("paper.toml", Campaign::PAPER).unwrap();
        campaign.doe.designs = 40;
        let problem = Problem::new(campaign);
        let rows = designs::make(&problem, &[]).unwrap();
        let fitted = |slope: f64| {
            let response = |row: &DesignRow| {
                // Scatter with a standard deviation of about 0.6, and what depends on the design.
                let scatter = (17.0 * row.design as f64).sin() + (29.0 * row.design as f64).cos();
                ResponseRow {
                    design: row.design,
                    mean_um: 1.0,
                    sd_um: 1.0,
                    p90_um: 5.0 + 0.6 * scatter + slope * row.x[0],
                    p90_variance_um2: 0.36,
                    lilliefors_p: None,
                }
            };
            let responses: Vec<ResponseRow> = rows.iter().map(response).collect();
            fit(&problem, &rows, &responses, |_| true)
        };
        let refusal = fitted(0.0).unwrap_err().to_string();
        assert!(refusal.contains("no dependence on x"), "{refusal}");
        let (_, summary) = fitted(20.0).unwrap();
        assert!(summary.q2 > 0.9, "{}", summary.q2);
    }

    /// An outlier is named by its design, and the key that the warning names removes it.
    #[test]
    fn an_outlier_is_left_out_by_its_key() {
        let mut campaign = Campaign::parse("paper.toml", Campaign::PAPER).unwrap();
        campaign.doe.designs = 80;
        let problem = Problem::new(campaign.clone());
        let rows = designs::make(&problem, &[]).unwrap();
        // Designs without a response make numbers of rows and of designs differ.
        let responses: Vec<ResponseRow> = rows
            .iter()
            .filter(|row| row.design >= 10)
            .map(|row| ResponseRow {
                design: row.design,
                mean_um: 1.0,
                sd_um: 1.0,
                p90_um: 5.0 + 20.0 * row.x[0] + if row.design == 41 { 30.0 } else { 0.0 },
                p90_variance_um2: 1e-4,
                lilliefors_p: None,
            })
            .collect();
        let (_, summary) = fit(&problem, &rows, &responses, |_| true).unwrap();
        let named = |text: &&String| text.contains("design 41 lies");
        let warning = summary.warnings.iter().find(named).unwrap();
        assert!(warning.contains("kriging.leave_out = [41]"), "{warning}");
        campaign.kriging.leave_out = vec![41];
        let problem = Problem::new(campaign);
        let (_, summary) = fit(&problem, &rows, &responses, |_| true).unwrap();
        assert_eq!(summary.points, 69);
        assert!(summary.residuals_um.iter().all(|(design, _)| *design != 41));
        assert!(!summary.warnings.iter().any(|text| text.contains("41")));
        assert!(summary.rmse_um < 0.1, "{}", summary.rmse_um);
    }
}
