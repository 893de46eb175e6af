//! The requests to an external simulator: one JSON object per line.

use problem::formulation::Problem;
use serde::Deserialize;
use serde_json::{Map, Value, json};

use super::fault::Fault;
use super::numbers::Numbers;

/// The version of the protocol, which both sides name at the start.
pub(super) const PROTOCOL: u32 = 2;

/// The key of the values of random inputs.
const RANDOM: &str = "random";

/// A request, as read for a simulator that does not read lines itself.
#[derive(Deserialize)]
#[serde(tag = "request", rename_all = "kebab-case")]
pub(super) enum Request {
    Describe {
        variables: Vec<String>,
        responses: Vec<String>,
        sampled: Vec<String>,
        /// The names of the random inputs, whose values a sample gets instead of a seed.
        #[serde(default)]
        random: Vec<String>,
    },
    Evaluate {
        design: Numbers,
        responses: Vec<String>,
        #[serde(default)]
        random: Numbers,
    },
    Sample {
        design: Numbers,
        #[serde(default)]
        seed: [u32; 4],
        #[serde(default)]
        random: Numbers,
    },
}

impl Request {
    pub(super) fn read(request: Map<String, Value>) -> Result<Self, Fault> {
        serde_json::from_value(Value::Object(request))
            .map_err(|error| Fault::Program(error.to_string()))
    }
}

/// The first request of a process, without its id.
pub(super) fn describe(problem: &Problem) -> Result<Map<String, Value>, String> {
    let campaign = problem.campaign();
    let campaign_value: Value = serde_json::from_str(&campaign.to_json())
        .map_err(|error| format!("the campaign cannot be written: {error}"))?;
    let variables = problem.variables().iter().map(|variable| &variable.name);
    let mut request = object(json!({
        "request": "describe",
        "protocol": PROTOCOL,
        "campaign": campaign_value,
        "variables": variables.collect::<Vec<_>>(),
        "responses": evaluated(problem),
        "sampled": sampled(problem),
    }));
    if let Some(random) = problem.random() {
        let names: Vec<&str> = random.quantities().iter().map(|one| &*one.name).collect();
        request.insert(RANDOM.to_owned(), json!(names));
    }
    if let Some(sections) = campaign.gears() {
        request.insert("teeth".to_owned(), json!(sections.pair.teeth()));
    }
    Ok(request)
}

/// The names of the values of a sample, as the program knows them.
pub(super) fn sampled(problem: &Problem) -> Vec<&str> {
    problem.sampled().iter().map(|one| &*one.name).collect()
}

/// The names of the responses of `evaluate`, as the program knows them.
pub(super) fn evaluated(problem: &Problem) -> Vec<&str> {
    let responses = problem.responses().iter();
    responses.map(|response| &*response.name).collect()
}

/// Named numbers, such as a design, in the form of the requests.
pub(super) fn numbers(told: &[(&str, f64)]) -> Value {
    let named = |(name, value): &(&str, f64)| ((*name).to_owned(), Value::from(*value));
    Value::Object(told.iter().map(named).collect())
}

/// A request for a design's responses, without its id. `random` has the means of the random inputs, if the campaign
/// states any.
pub(super) fn evaluate(
    design: &Value,
    random: Option<Value>,
    wanted: &[&str],
) -> Map<String, Value> {
    let mut request =
        object(json!({ "request": "evaluate", "design": design, "responses": wanted }));
    request.extend(random.map(|values| (RANDOM.to_owned(), values)));
    request
}

/// The source of a sample's random effects.
pub(super) enum Randomness {
    /// The program draws them from a seed.
    Seed([u32; 4]),
    /// The values of the campaign's random inputs, by name.
    Values(Value),
}

/// A request for a sample, without its id.
pub(super) fn sample(design: &Value, from: Randomness) -> Map<String, Value> {
    let mut request = object(json!({ "request": "sample", "design": design }));
    let (key, value) = match from {
        Randomness::Seed(seed) => ("seed", json!(seed)),
        Randomness::Values(values) => (RANDOM, values),
    };
    request.insert(key.to_owned(), value);
    request
}

/// A request as a line, with its newline.
pub(super) fn line(mut request: Map<String, Value>, id: u64) -> String {
    request.insert("id".to_owned(), Value::from(id));
    let mut line = Value::Object(request).to_string();
    line.push('\n');
    line
}

fn object(value: Value) -> Map<String, Value> {
    match value {
        Value::Object(object) => object,
        _ => Map::new(),
    }
}
