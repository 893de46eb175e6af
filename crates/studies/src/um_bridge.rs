//! The gear model of a campaign as a UM-Bridge model, for other programs of uncertainty quantification.
//!
//! L. Seelinger, V. Cheng-Seelinger, A. Davis, M. Parno, A. Reinarz, "UM-Bridge: Uncertainty quantification and
//! modeling bridge", Journal of Open Source Software 8 (2023) 4748; protocol version 1.0.
//!
//! The model takes two lists: the variables of a design in the campaign's units, and the standard normal coefficients
//! of its random wear and deviations of manufacture. It gives two lists: the sampled responses, and the deterministic
//! ones. Coefficients of zero are the mean wear.

use problem::formulation::{Design, Problem};
use problem::simulator::{NoAnswer, Simulator as _, State};
use problem::{Approach, Campaign, Quantity};
use serde_json::{Value, json};

use crate::refusal::{ExternalSimulator, require_built_in};

/// The name of the model.
pub const NAME: &str = "gear-pair";
/// The key of a configuration with the length of the second list.
const COEFFICIENTS: &str = "coefficients";
/// Number of designs from which the default length of the second list is taken.
const SURVEY: usize = 256;

/// The model that a campaign describes.
#[derive(Debug)]
pub struct Model {
    problem: Problem,
    /// The most coefficients that a design of the survey has.
    coefficients: usize,
}

/// A request that gets no numbers.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{message}")]
pub struct Refusal {
    /// The protocol's name for the kind of error.
    pub kind: &'static str,
    pub message: String,
}

fn invalid(message: String) -> Refusal {
    Refusal {
        kind: "InvalidInput",
        message,
    }
}

impl Model {
    /// The model of a campaign's gears.
    ///
    /// # Errors
    ///
    /// The campaign is simulated by an external program.
    pub fn new(campaign: Campaign) -> Result<Self, ExternalSimulator> {
        require_built_in(&campaign)?;
        let mut model = Self {
            problem: Problem::new(campaign),
            coefficients: 0,
        };
        model.coefficients = model.most_coefficients();
        Ok(model)
    }

    /// The largest number of coefficients of the surveyed designs. The number depends on the path of contact, and so on
    /// the design.
    fn most_coefficients(&self) -> usize {
        let designs = self.simulable();
        let modes = designs.filter_map(|design| Some(self.problem.prepare(&design).ok()?.modes()));
        modes.max().unwrap_or_default()
    }

    /// Designs across the campaign's ranges that can be simulated.
    fn simulable(&self) -> impl Iterator<Item = Design> {
        let problem = &self.problem;
        let dimension = problem.dimension_of(Approach::Nominal);
        let points = doe::random_lhs(SURVEY, dimension, problem.campaign().seed);
        let points = points
            .into_iter()
            .flat_map(|points| (0..SURVEY).map(move |i| points.point(i).to_vec()));
        let designs = points.filter_map(|at| problem.point(Approach::Nominal, &at, problem.base()));
        designs.filter(|design| problem.prepare(design).is_ok())
    }

    /// The names and units of both inputs and both outputs, a line for each list.
    #[must_use]
    pub fn describe(&self) -> String {
        let listed = |quantities: &[Quantity]| {
            let named = quantities.iter().map(|one| match &*one.unit {
                "" => one.name.to_string(),
                unit => format!("{} in {unit}", one.name),
            });
            named.collect::<Vec<_>>().join(", ")
        };
        format!(
            "input 1   {}\ninput 2   {} standard normal coefficients of the random wear and deviations; zeros are the mean wear\n\
             output 1  {}\noutput 2  {}\n",
            listed(self.problem.variables()),
            self.coefficients,
            listed(self.problem.sampled()),
            listed(self.problem.responses()),
        )
    }

    /// The answer to a request for `path`, such as `Evaluate`, with this content.
    ///
    /// # Errors
    ///
    /// No such request or model, an input of another shape, or a design that cannot be simulated.
    pub fn answer(&self, path: &str, content: &Value) -> Result<Value, Refusal> {
        if path == "Info" {
            return Ok(json!({ "protocolVersion": 1.0, "models": [NAME] }));
        }
        let name = &content["name"];
        if name != NAME {
            return Err(Refusal {
                kind: "ModelNotFound",
                message: format!("there is no model {name}; this server has \"{NAME}\""),
            });
        }
        match path {
            "ModelInfo" => Ok(json!({ "support": {
                "Evaluate": true, "Gradient": false, "ApplyJacobian": false, "ApplyHessian": false,
            } })),
            "InputSizes" => Ok(json!({ "inputSizes": self.input_sizes(&content["config"])? })),
            "OutputSizes" => {
                let sizes = [self.problem.sampled().len(), self.problem.responses().len()];
                Ok(json!({ "outputSizes": sizes }))
            }
            "Evaluate" => {
                let sizes = self.input_sizes(&content["config"])?;
                let [design, coefficients] = input(&content["input"], sizes)?;
                Ok(json!({ "output": self.evaluate(design, &coefficients)? }))
            }
            _ => Err(Refusal {
                kind: "UnsupportedFeature",
                message: format!(
                    "this server does not answer {path}: it evaluates, without derivatives"
                ),
            }),
        }
    }

    /// The lengths of both input lists.
    fn input_sizes(&self, config: &Value) -> Result<[usize; 2], Refusal> {
        if !(config.is_object() || config.is_null()) {
            return Err(invalid(format!(
                "config must be an object, and is {config}"
            )));
        }
        let mut sizes = [self.problem.variables().len(), self.coefficients];
        for (key, value) in config.as_object().into_iter().flatten() {
            let length = value.as_u64().and_then(|value| usize::try_from(value).ok());
            match length {
                Some(length) if key == COEFFICIENTS => sizes[1] = length,
                _ => {
                    let text = format!(
                        "config has {key:?}: {value}; it may only have {COEFFICIENTS:?}, the length of the second input"
                    );
                    return Err(invalid(text));
                }
            }
        }
        Ok(sizes)
    }

    /// The sampled responses with these coefficients, and the deterministic ones.
    fn evaluate(&self, design: Vec<f64>, coefficients: &[f64]) -> Result<[Vec<f64>; 2], Refusal> {
        let refused = |why: NoAnswer| invalid(why.to_string());
        let problem = &self.problem;
        let mut design = problem.prepare(&Design::new(design)).map_err(refused)?;
        let modes = design.modes();
        if modes > coefficients.len() {
            return Err(invalid(format!(
                "the random wear of this design has {modes} coefficients, and the second input {}: ask with config \
                 {{\"{COEFFICIENTS}\": {modes}}}",
                coefficients.len()
            )));
        }
        let nominal = design.analyse(State::Nominal).map_err(refused)?;
        let baseline = design.analyse(State::Baseline).map_err(refused)?;
        let responses = problem.responses_of(&nominal, &baseline);
        let sample = design.sample_at(&coefficients[..modes]).map_err(refused)?;
        let checked = match responses.iter().all(|value| value.is_finite()) {
            true => problem.check_responses(&responses),
            false => Err("a response is not a number".to_owned()),
        };
        checked.map_err(|message| Refusal {
            kind: "InvalidOutput",
            message,
        })?;
        problem
            .check_sample(&sample)
            .map_err(|(name, why)| Refusal {
                kind: "InvalidOutput",
                message: format!("{name} {why}"),
            })?;
        Ok([sample, responses])
    }
}

/// Two lists of numbers of these lengths.
fn input(given: &Value, sizes: [usize; 2]) -> Result<[Vec<f64>; 2], Refusal> {
    let lists = given.as_array().map_or(&[][..], Vec::as_slice);
    let numbers =
        |list: &Value| -> Option<Vec<f64>> { list.as_array()?.iter().map(Value::as_f64).collect() };
    match lists {
        [first, second] => numbers(first).zip(numbers(second)),
        _ => None,
    }
    .map(|(first, second)| [first, second])
    .filter(|lists| lists.each_ref().map(Vec::len) == sizes)
    .ok_or_else(|| {
        let [variables, coefficients] = sizes;
        invalid(format!(
            "the input must be two lists, of {variables} and of {coefficients} numbers"
        ))
    })
}

#[cfg(test)]
mod tests {
    use problem::Campaign;

    use super::*;

    fn model() -> Model {
        let campaign = Campaign::parse("paper.toml", Campaign::PAPER).unwrap();
        Model::new(campaign).unwrap()
    }

    #[test]
    fn coefficients_of_a_random_stream_give_its_sample_and_zeros_the_baseline() {
        let model = model();
        let problem = &model.problem;
        let design = model.simulable().next().unwrap();
        let mut prepared = problem.prepare(&design).unwrap();
        let modes = prepared.modes();
        assert!(modes <= model.coefficients, "{modes}");
        let stream = || stats::streams::stream(1, stats::streams::Purpose::Verify, 2, 3);
        let mut padded = gear::draw_coefficients(&mut stream(), modes).collect::<Vec<_>>();
        padded.resize(model.coefficients, 7.0);
        let ask = |coefficients: &[f64]| {
            let content =
                json!({ "name": NAME, "input": [design.values(), coefficients], "config": {} });
            model.answer("Evaluate", &content).unwrap()["output"].clone()
        };
        let drawn = prepared.sample(&mut stream()).unwrap();
        assert_eq!(ask(&padded)[0], json!(drawn));
        let zeros = ask(&vec![0.0; model.coefficients]);
        let baseline = prepared.analyse(State::Baseline).unwrap().value;
        let difference = zeros[0][0].as_f64().unwrap() - baseline;
        assert!(difference.abs() < 1e-9, "{difference}");
    }

    #[test]
    fn what_is_not_asked_for_as_it_should_be_is_refused_with_what_would_be_right() {
        let model = model();
        let design = model.simulable().next().unwrap();
        let refused = |path: &str, content: Value| model.answer(path, &content).unwrap_err();
        let here =
            |input: Value, config: Value| json!({ "name": NAME, "input": input, "config": config });
        let other = refused("InputSizes", json!({ "name": "beam" }));
        assert_eq!(other.kind, "ModelNotFound");
        assert!(other.message.contains("has \"gear-pair\""), "{other}");
        let gradient = refused("Gradient", here(json!([]), json!({})));
        assert_eq!(gradient.kind, "UnsupportedFeature");
        let short = refused("Evaluate", here(json!([[1.0], []]), json!({})));
        assert!(short.message.contains("two lists, of 11 and of"), "{short}");
        let key = refused("InputSizes", here(json!([]), json!({ "mesh": 3 })));
        assert!(
            key.message.contains("it may only have \"coefficients\""),
            "{key}"
        );
        let few = refused(
            "Evaluate",
            here(json!([design.values(), [0.0]]), json!({ COEFFICIENTS: 1 })),
        );
        assert!(
            few.message.contains("ask with config {\"coefficients\": "),
            "{few}"
        );
        let nothing = vec![0.0; model.problem.variables().len()];
        let zeros = vec![0.0; model.coefficients];
        let impossible = refused("Evaluate", here(json!([nothing, zeros]), json!({})));
        assert_eq!(impossible.kind, "InvalidInput");
        assert!(impossible.message.contains("root_radius"), "{impossible}");
    }
}
