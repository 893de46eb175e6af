//! The kriging models of the measures.

use anyhow::Context as _;
use kriging::{Data, Error, Guidance, Names, Response, Settings, Surrogate};
use problem::Criteria;
use problem::formulation::{Design, Problem};
use serde::{Deserialize, Serialize};
use store::{ModelRow, ResponseRow, Store};

use crate::doe::Doe;

/// The summary of a fitted model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ModelSummary {
    /// The covariance function.
    pub kernel: String,
    /// Number of points that the model was fitted to.
    pub points: usize,
    /// The mean µ.
    pub mu: f64,
    /// The process variance σ².
    pub sigma2: f64,
    /// The ranges in the order of the variables; `None` for a variable that the model does not
    /// depend on.
    pub ranges: Vec<Option<f64>>,
    pub negative_log_likelihood: f64,
    /// Q² of leave-one-out predictions.
    pub q2: f64,
    /// Root mean square of the leave-one-out residuals.
    pub rmse: f64,
    /// The share of observations within their leave-one-out 90 % interval.
    pub coverage90: f64,
    /// The leave-one-out residuals (observation minus prediction) by [`Observation::number`].
    pub residuals: Vec<(u64, f64)>,
    /// Those residuals over their standard deviations, in the same order.
    pub standardised: Vec<f64>,
    /// The observations, in the same order.
    pub observed: Vec<f64>,
    /// The variables of the design of the DoE that satisfies every constraint and has the best mean of the model:
    /// the search on the model begins there. `None` without such a design.
    pub best_of_doe: Option<Vec<f64>>,
    /// Warnings about the data and the fit.
    pub warnings: Vec<String>,
    /// CPU time of the fit, seconds.
    pub cpu_seconds: f64,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LeaveOneOutPrediction {
    /// [`Observation::number`].
    pub number: u64,
    /// The observation.
    pub observed: f64,
    /// The prediction from all others.
    pub predicted: f64,
    /// The residual over its standard deviation.
    pub standardised: f64,
}

impl ModelSummary {
    pub fn leave_one_out(&self) -> impl Iterator<Item = LeaveOneOutPrediction> {
        let scaled = self.observed.iter().zip(&self.standardised);
        self.residuals.iter().zip(scaled).map(
            |(&(number, residual), (&observed, &standardised))| LeaveOneOutPrediction {
                number,
                observed,
                predicted: observed - residual,
                standardised,
            },
        )
    }
}

/// The model to show, to predict from and to export: that of the enrichment's end, if there is one, otherwise
/// that of the DoE.
pub async fn latest_model(store: &Store) -> Result<Option<ModelRow>, store::Error> {
    match store.model(ModelRow::ENRICHED).await? {
        Some(model) => Ok(Some(model)),
        None => store.model(ModelRow::DOE).await,
    }
}

/// A response that a model is fitted to.
#[derive(Debug, Clone, PartialEq)]
pub struct Observation {
    /// The number of the design; an infill point has the number of designs in the DoE plus its own.
    pub number: u64,
    /// The variables.
    pub x: Vec<f64>,
    /// The percentile. One that is not finite is left out.
    pub value: f64,
    pub variance: f64,
    /// Number of samples behind it.
    pub samples: u64,
    /// Whether the design satisfies every constraint.
    pub is_feasible: bool,
}

/// The measure with this number, of the designs of the DoE.
#[must_use]
pub fn of_doe(problem: &Problem, base: &Design, doe: &Doe, number: u64) -> Vec<Observation> {
    let samples = u64::from(problem.campaign().sampling.samples_per_design);
    let feasible = doe.feasible(problem, base);
    let of_number = |row: &&ResponseRow| row.number == number;
    let responses = doe.responses.iter().chain(&doe.limited).filter(of_number);
    let observed = responses.filter_map(|response| {
        let row = doe.designs.get(response.design as usize)?;
        Some(Observation {
            number: row.design,
            x: row.x.clone(),
            value: response.measure,
            variance: response.measure_variance,
            samples,
            is_feasible: feasible.contains_key(&row.design),
        })
    });
    observed.collect()
}

/// A fitted model.
#[derive(Debug)]
pub struct FittedModel {
    /// The modelled quantity, as a phrase.
    pub title: String,
    pub row: ModelRow,
    pub summary: ModelSummary,
}

/// Fits a model to every measure, that of the objective first, and to every [modelled](Problem::modelled) quantity, as
/// rows named `name`.
pub fn fit_all(
    problem: &Problem,
    base: &Design,
    doe: &Doe,
    name: &str,
) -> anyhow::Result<Vec<FittedModel>> {
    let settings = problem.campaign().kriging.settings(problem.campaign().seed);
    let of_constraint = Settings {
        // The quantity of a constraint may be negative.
        response: Response::Plain,
        noise: problem.campaign().limit_noise(),
        ..settings
    };
    let mut fitted: Vec<FittedModel> = Vec::new();
    let mut fit_one = |title: String, observed: &[Observation]| {
        let number = fitted.len() as u64;
        let fitted_one = match number {
            0 => fit(problem, observed),
            _ => fit_with(problem, observed, &of_constraint),
        };
        let (model, summary) = fitted_one.context(title.clone())?;
        let row = model_row(name, number, &model, &summary)?;
        fitted.push(FittedModel {
            title,
            row,
            summary,
        });
        anyhow::Ok(())
    };
    for (number, measured) in (0..).zip(problem.measures()) {
        let title = match number {
            0 => measured.title(),
            _ => format!(
                "constraint {}, {}",
                measured.quantity.name,
                measured.title()
            ),
        };
        fit_one(title, &of_doe(problem, base, doe, number))?;
    }
    let evaluated = doe.evaluated(problem, base);
    for (place, quantity) in problem.modelled().iter().enumerate() {
        let exact = |(number, criteria): (&u64, &Criteria)| {
            Some(Observation {
                number: *number,
                x: doe.designs.get(*number as usize)?.x.clone(),
                value: *criteria.values().get(place)?,
                variance: 0.0,
                samples: 1,
                is_feasible: false,
            })
        };
        let observed: Vec<Observation> = evaluated.iter().filter_map(exact).collect();
        let title = format!("constraint {}", quantity.name);
        fit_one(title, &observed).context(
            "mark the constraints cheap = true to have the program evaluate every candidate",
        )?;
    }
    Ok(fitted)
}

/// Fits the kriging model of the objective as the campaign's `[kriging]` says; `cpu_seconds` is left zero.
pub fn fit(
    problem: &Problem,
    observed: &[Observation],
) -> anyhow::Result<(Surrogate, ModelSummary)> {
    let settings = problem.campaign().kriging.settings(problem.campaign().seed);
    let (model, mut summary) = fit_with(problem, observed, &settings)?;
    let beyond = beyond_probability(problem, &summary);
    summary.warnings.extend(beyond);
    Ok((model, summary))
}

/// The distance by which a predicted probability must leave its bounds to be warned of.
const BEYOND: f64 = 0.01;

/// A warning if the objective is a probability and its model, which knows no bounds, leaves them.
fn beyond_probability(problem: &Problem, summary: &ModelSummary) -> Option<String> {
    if !problem.campaign().sampling.objective.is_probability() {
        return None;
    }
    let bounds = -BEYOND..=1.0 + BEYOND;
    let is_beyond = |one: &LeaveOneOutPrediction| !bounds.contains(&one.predicted);
    let beyond = summary.leave_one_out().filter(is_beyond).count();
    (beyond > 0).then(|| {
        format!(
            "from the other points, the model predicts a probability below 0 or above 1 at {beyond} of {} points, because \
             it knows no bounds: read such values as 0 and 1. A percentile as the objective (measure = \"percentile\") \
             has no such bounds",
            summary.residuals.len()
        )
    })
}

fn fit_with(
    problem: &Problem,
    observed: &[Observation],
    settings: &Settings,
) -> anyhow::Result<(Surrogate, ModelSummary)> {
    let campaign = problem.campaign();
    let d = problem.dimension();
    let left_out = &campaign.kriging.leave_out;
    let is_left_out = |number: u64| left_out.iter().any(|&out| u64::from(out) == number);
    let points: Vec<&Observation> = observed
        .iter()
        .filter(|point| !is_left_out(point.number))
        // The measure is not finite if too many samples of the design have failed.
        .filter(|point| point.value.is_finite())
        .collect();
    let variables = |of: &[&Observation]| -> Vec<f64> {
        let x = of.iter().flat_map(|point| point.x.iter().copied());
        x.collect()
    };
    let x = variables(&points);
    let y: Vec<f64> = points.iter().map(|point| point.value).collect();
    let own: Vec<f64> = points.iter().map(|point| point.variance).collect();
    let samples: Vec<f64> = points.iter().map(|point| point.samples as f64).collect();
    let freedom = campaign.sampling.degrees_of_freedom();
    let smoothed = settings
        .noise
        .variances(&x, d, own.clone(), &samples, freedom, campaign.seed);
    let noise = match smoothed {
        // If smoothing fails and the file does not ask for it, the variances stay as they are.
        Err(_) if campaign.kriging.noise.is_none() => own,
        noise => noise?,
    };
    let data = Data {
        x: &x,
        d,
        y: &y,
        noise_variance: &noise,
    };
    let number = |observation: usize| points[observation].number;
    let model =
        Surrogate::fit(&data, settings).map_err(|error| explained(problem, error, number))?;
    let feasible: Vec<&Observation> = observed.iter().filter(|point| point.is_feasible).collect();
    let means = model.means(&variables(&feasible))?;
    let best = means.into_iter().zip(feasible);
    let best = best.min_by(|(a, _), (b, _)| problem.cost(*a).total_cmp(&problem.cost(*b)));
    let validation = model.leave_one_out();
    let parameters = model.parameters();
    let residuals = validation.observations.iter().zip(&validation.residuals);
    let summary = ModelSummary {
        kernel: model.kernel().to_string(),
        points: model.points(),
        mu: parameters.mu,
        sigma2: parameters.sigma2,
        ranges: parameters
            .ranges
            .iter()
            .map(|range| range.is_finite().then_some(*range))
            .collect(),
        negative_log_likelihood: model.negative_log_likelihood(),
        q2: validation.q2,
        rmse: validation.rmse,
        coverage90: validation.coverage90,
        residuals: residuals.map(|(&i, r)| (number(i), *r)).collect(),
        standardised: validation.standardised,
        observed: validation.observations.iter().map(|&i| y[i]).collect(),
        best_of_doe: best.map(|(_, point)| point.x.clone()),
        warnings: guided(problem, number, |guidance| {
            let warnings = model.warnings().iter();
            warnings.map(|warning| guidance.warning(warning)).collect()
        }),
        cpu_seconds: 0.0,
    };
    Ok((model, summary))
}

/// The name of an observation in messages.
fn called(problem: &Problem, number: u64) -> String {
    match number.checked_sub(problem.campaign().doe.designs.into()) {
        None => format!("design {number}"),
        Some(infill) => format!("infill point {infill}"),
    }
}

/// Calls `with` with guidance in the names of the campaign and the keys of its file.
fn guided<T>(
    problem: &Problem,
    number: impl Fn(usize) -> u64,
    with: impl FnOnce(&Guidance<'_>) -> T,
) -> T {
    let names: Vec<&str> = problem.free_names().collect();
    let unit = match &*problem.measured().unit {
        "" => String::new(),
        unit => format!(" {unit}"),
    };
    with(&Guidance {
        names: Names {
            coordinate: &|j| names[j].to_owned(),
            observation: &|i| called(problem, number(i)),
        },
        responses: "percentiles",
        unit: &unit,
        setting: &|key, value| format!("kriging.{key} = {value:?}"),
        without: &|observations| {
            let numbers: Vec<u64> = observations.iter().map(|&i| number(i)).collect();
            let designs = u64::from(problem.campaign().doe.designs);
            // Infill points cannot be left out, because they follow from the other points.
            let can_be_left_out = numbers.iter().all(|number| *number < designs);
            can_be_left_out.then(|| format!("kriging.leave_out = {numbers:?}"))
        },
        nugget: problem.campaign().kriging.nugget,
        more_points: "more designs (doe.designs)",
        less_noise: "more samples (sampling.samples_per_design)",
    })
}

/// An error in the names of the campaign, with the keys of its file that help.
fn explained(problem: &Problem, error: Error, number: impl Fn(usize) -> u64) -> anyhow::Error {
    match guided(problem, number, |guidance| guidance.error(&error)) {
        Some(text) => anyhow::Error::msg(text),
        None => error.into(),
    }
}

/// The row named `name` of a model fitted to the measure with this number.
pub fn model_row(
    name: &str,
    number: u64,
    model: &Surrogate,
    summary: &ModelSummary,
) -> anyhow::Result<ModelRow> {
    Ok(ModelRow {
        name: name.to_owned(),
        number,
        json: model.to_json()?,
        summary_json: serde_json::to_string(summary)?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::designs;
    use problem::Campaign;
    use store::DesignRow;

    fn observed(row: &DesignRow, value: f64, variance: f64) -> Observation {
        Observation {
            number: row.design,
            x: row.x.clone(),
            value,
            variance,
            samples: 500,
            is_feasible: true,
        }
    }

    #[test]
    fn a_model_that_is_no_better_than_noise_is_refused() {
        let mut campaign = Campaign::parse("paper.toml", Campaign::PAPER).unwrap();
        campaign.doe.designs = 40;
        let problem = Problem::new(campaign);
        let rows = designs::make(&problem, &[]).unwrap();
        let fitted = |slope: f64| {
            let value = |row: &DesignRow| {
                // Scatter with a standard deviation of about 0.6, and a part that depends on the design.
                let scatter = (17.0 * row.design as f64).sin() + (29.0 * row.design as f64).cos();
                5.0 + 0.6 * scatter + slope * row.x[0]
            };
            let observed: Vec<Observation> = rows
                .iter()
                .map(|row| observed(row, value(row), 0.36))
                .collect();
            fit(&problem, &observed)
        };
        let refusal = fitted(0.0).unwrap_err().to_string();
        assert!(refusal.contains("no dependence on the inputs"), "{refusal}");
        let (_, summary) = fitted(20.0).unwrap();
        assert!(summary.q2 > 0.9, "{}", summary.q2);
    }

    #[test]
    fn a_model_of_a_probability_that_leaves_its_bounds_says_so() {
        let text = include_str!("../../../campaigns/ishigami/campaign.toml");
        let with = |measure: &str| {
            let text = text.replace("measure = \"percentile\"", measure);
            let text = text.replace("level = 0.9 ", "# ");
            Problem::new(Campaign::parse("c.toml", &text).unwrap())
        };
        let warned = |measure: &str, value: fn(f64) -> f64| {
            let problem = with(measure);
            let rows = designs::make(&problem, &[]).unwrap();
            let observed: Vec<Observation> = rows
                .iter()
                .map(|row| observed(row, value(row.x[0]), 1e-8))
                .collect();
            let (_, summary) = fit(&problem, &observed).unwrap();
            summary
                .warnings
                .iter()
                .any(|text| text.contains("knows no bounds"))
        };
        let probability = "measure = \"exceedance\"\nlimit = 5.0";
        // A step is overshot at both of its ends.
        let step = |x: f64| f64::from(u8::from(x > 0.5));
        assert!(warned(probability, step));
        assert!(!warned(probability, |x| 0.5 + 0.1 * x.sin()));
        // Rounding and noise around 0 are no news.
        assert!(!warned(probability, |x| 0.004 * (x.sin() - 1.0)));
        assert!(!warned("measure = \"mean\"", step));
    }

    /// An outlier is named by its design, and the key that the warning names removes it.
    #[test]
    fn an_outlier_is_left_out_by_its_key() {
        let mut campaign = Campaign::parse("paper.toml", Campaign::PAPER).unwrap();
        campaign.doe.designs = 80;
        let problem = Problem::new(campaign.clone());
        let rows = designs::make(&problem, &[]).unwrap();
        // Designs without a response make numbers of rows and of designs differ.
        let with_response = rows.iter().filter(|row| row.design >= 10);
        let observed: Vec<Observation> = with_response
            .map(|row| {
                let outlier = if row.design == 41 { 30.0 } else { 0.0 };
                observed(row, 5.0 + 20.0 * row.x[0] + outlier, 1e-4)
            })
            .collect();
        let (_, summary) = fit(&problem, &observed).unwrap();
        let named = |text: &&String| text.contains("design 41 lies");
        let warning = summary.warnings.iter().find(named).unwrap();
        assert!(warning.contains("kriging.leave_out = [41]"), "{warning}");
        campaign.kriging.leave_out = vec![41];
        let problem = Problem::new(campaign);
        let (_, summary) = fit(&problem, &observed).unwrap();
        assert_eq!(summary.points, 69);
        assert!(summary.residuals.iter().all(|(design, _)| *design != 41));
        assert!(!summary.warnings.iter().any(|text| text.contains("41")));
        assert!(summary.rmse < 0.1, "{}", summary.rmse);
    }
}
