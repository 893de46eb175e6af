//! The kriging model of P90.

use campaign::Campaign;
use campaign::formulation::ROBUST_VARIABLES;
use kriging::{Data, FitOptions, Model};
use serde::{Deserialize, Serialize};
use store::{DesignRow, ModelRow, ResponseRow};

/// The name of the model of P90 in the store.
pub const P90_MODEL: &str = "p90";

/// What a reader wants to know of a fitted model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ModelSummary {
    /// The covariance function.
    pub kernel: String,
    /// How many points it was fitted to.
    pub points: usize,
    /// The mean µ, µm.
    pub mu_um: f64,
    /// The process variance σ², µm².
    pub sigma2_um2: f64,
    /// The ranges in the order of the variables; none where the response does not depend on one.
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
    /// What a user ought to know.
    pub warnings: Vec<String>,
    /// CPU time of the fit, seconds.
    pub cpu_seconds: f64,
}

/// Fits the kriging model of P90; `cpu_seconds` is left zero.
///
/// # Errors
///
/// The data cannot be fitted: too few feasible designs, for example.
pub fn fit(
    campaign: &Campaign,
    designs: &[DesignRow],
    responses: &[ResponseRow],
) -> anyhow::Result<(Model, ModelSummary)> {
    let points: Vec<(&DesignRow, &ResponseRow)> = responses
        .iter()
        .filter_map(|response| Some((designs.get(response.design as usize)?, response)))
        .collect();
    let x: Vec<f64> = points
        .iter()
        .flat_map(|(design, _)| design.point())
        .collect();
    let y: Vec<f64> = points.iter().map(|(_, response)| response.p90_um).collect();
    let noise: Vec<f64> = points
        .iter()
        .map(|(_, response)| response.p90_variance_um2)
        .collect();
    let data = Data {
        x: &x,
        d: ROBUST_VARIABLES,
        y: &y,
        noise_variance: &noise,
    };
    let options = FitOptions {
        kernel: campaign.kriging.kernel.parse()?,
        seed: campaign.seed,
        // The optimum of a model that is no better than noise would be a matter of luck.
        refuse_no_structure: true,
        ..FitOptions::default()
    };
    let model = kriging::fit(&data, &options)?;
    let validation = model.leave_one_out();
    let parameters = model.parameters();
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
        residuals_um: points
            .iter()
            .map(|(_, response)| response.design)
            .zip(validation.residuals.iter().copied())
            .collect(),
        warnings: model.warnings().iter().map(ToString::to_string).collect(),
        cpu_seconds: 0.0,
    };
    Ok((model, summary))
}

/// The row of a fitted model.
///
/// # Errors
///
/// The model cannot be written as JSON: one of its numbers is not finite.
pub fn model_row(model: &Model, summary: &ModelSummary) -> anyhow::Result<ModelRow> {
    Ok(ModelRow {
        name: P90_MODEL.to_owned(),
        json: model.to_json()?,
        summary_json: serde_json::to_string(summary)?,
    })
}

#[cfg(test)]
mod tests {
    use campaign::formulation::Problem;

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
                    p90_um: 5.0 + 0.6 * scatter + slope * row.x_p,
                    p90_variance_um2: 0.36,
                    lilliefors_p: None,
                }
            };
            let responses: Vec<ResponseRow> = rows.iter().map(response).collect();
            fit(problem.campaign(), &rows, &responses)
        };
        let refusal = fitted(0.0).unwrap_err().to_string();
        assert!(refusal.contains("no dependence on x"), "{refusal}");
        let (_, summary) = fitted(20.0).unwrap();
        assert!(summary.q2 > 0.9, "{}", summary.q2);
    }
}
