//! A simulator that is a model of a UM-Bridge server: requests are HTTP posts of JSON.
//!
//! L. Seelinger, V. Cheng-Seelinger, A. Davis, M. Parno, A. Reinarz, "UM-Bridge: Uncertainty quantification and
//! modeling bridge", Journal of Open Source Software 8 (2023) 4748; protocol version 1.0. The model's inputs are the
//! campaign's variables and then its random inputs, in the order of the file, cut into the lists that the model takes.
//! Its outputs are the sampled responses and then the deterministic ones.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::{Duration, Instant};

use serde_json::{Map, Value, json};

use super::fault::Fault;
use super::numbers::{Numbers, with_quoted_numbers};
use super::requests::{PROTOCOL, Request};
use problem::file::SimulatorSection;

/// Interval at which a request in progress checks whether to stop.
const LOOK: Duration = Duration::from_millis(20);

/// A model on one server.
#[derive(Debug)]
pub(super) struct UmBridge {
    server: String,
    model: Option<String>,
    config: Value,
    /// The names of the inputs, and the lengths of the lists that the model takes.
    inputs: Vec<String>,
    sizes: Vec<usize>,
    /// The names of the outputs, and how many of them are sampled responses.
    outputs: Vec<String>,
    sampled: usize,
    agent: ureq::Agent,
    stop: Arc<AtomicBool>,
}

impl UmBridge {
    /// The model of the campaign's section on a server such as `http://localhost:4242`.
    pub(super) fn new(server: &str, section: &SimulatorSection, stop: Arc<AtomicBool>) -> Self {
        let model = section.um_bridge.as_ref();
        let config = ureq::Agent::config_builder().http_status_as_error(false);
        Self {
            server: server.trim_end_matches('/').to_owned(),
            model: model.and_then(|model| model.model.clone()),
            config: model.map_or_else(|| json!({}), |model| json!(model.config)),
            inputs: Vec::new(),
            sizes: Vec::new(),
            outputs: Vec::new(),
            sampled: 0,
            agent: ureq::Agent::new_with_config(config.build()),
            stop,
        }
    }

    /// Answers a request.
    pub(super) fn ask(
        &mut self,
        request: Map<String, Value>,
        timeout: Duration,
    ) -> Result<Map<String, Value>, Fault> {
        match Request::read(request)? {
            Request::Describe {
                variables,
                responses,
                sampled,
                random,
            } => {
                if random.is_empty() {
                    let text = "a UM-Bridge model gives the same numbers for the same inputs: state what is random in \
                                sections [[random]]";
                    return Err(Fault::Program(text.to_owned()));
                }
                let is_new = |name: &String| !sampled.contains(name);
                let deterministic = responses.into_iter().filter(is_new).collect::<Vec<_>>();
                self.inputs = [variables, random].concat();
                self.sampled = sampled.len();
                self.outputs = [sampled, deterministic].concat();
                self.describe(timeout)
            }
            Request::Evaluate {
                design,
                responses,
                random,
            } => self.evaluate(&[design, random], &responses, timeout),
            Request::Sample { design, random, .. } => {
                let sampled = &self.outputs[..self.sampled];
                self.evaluate(&[design, random], sampled, timeout)
            }
        }
    }

    /// Finds the model, and compares its sizes with the campaign's.
    fn describe(&mut self, timeout: Duration) -> Result<Map<String, Value>, Fault> {
        let info = self.call("Info", None, timeout)?;
        let names: Vec<&str> = strings(&info["models"]);
        let server = &self.server;
        let all = names.join(", ");
        let model = match (&self.model, &names[..]) {
            (Some(model), _) if names.contains(&&**model) => model.clone(),
            (Some(model), _) => {
                let text =
                    format!("the UM-Bridge server {server} has no model {model:?}; it has: {all}");
                return Err(Fault::Program(text));
            }
            (None, [one]) => (*one).to_owned(),
            (None, _) => {
                let text = format!(
                    "the UM-Bridge server {server} has several models ({all}): name one with \
                     simulator.um_bridge.model"
                );
                return Err(Fault::Program(text));
            }
        };
        self.model = Some(model);
        let of_model = json!({ "config": self.config });
        let sizes = |what: &str, key: &str| -> Result<Vec<usize>, Fault> {
            let answer = self.call(what, Some(of_model.clone()), timeout)?;
            let sizes = answer[key].as_array().into_iter().flatten();
            let sizes: Option<Vec<usize>> = sizes
                .map(|size| usize::try_from(size.as_u64()?).ok())
                .collect();
            sizes.ok_or_else(|| Fault::Program(format!("{key} of the model are {}", answer[key])))
        };
        let (inputs, outputs) = (
            sizes("InputSizes", "inputSizes")?,
            sizes("OutputSizes", "outputSizes")?,
        );
        for (sizes, ours, what) in [
            (
                &inputs,
                &self.inputs,
                "inputs: its variables and random inputs",
            ),
            (
                &outputs,
                &self.outputs,
                "outputs: its sampled responses and constraints",
            ),
        ] {
            let count: usize = sizes.iter().sum();
            if count != ours.len() {
                let text = format!(
                    "the UM-Bridge model has {count} numbers in lists of {sizes:?}, but the campaign has {} {what} ({})",
                    ours.len(),
                    ours.join(", ")
                );
                return Err(Fault::Program(text));
            }
        }
        self.sizes = inputs;
        Ok(Map::from_iter([("protocol".to_owned(), PROTOCOL.into())]))
    }

    /// Calls the model and returns the `wanted` outputs.
    fn evaluate(
        &self,
        given: &[Numbers],
        wanted: &[String],
        timeout: Duration,
    ) -> Result<Map<String, Value>, Fault> {
        let number = |name: &String| given.iter().find_map(|numbers| numbers.get(name)).copied();
        let values: Option<Vec<f64>> = self.inputs.iter().map(number).collect();
        let mut values = values
            .ok_or_else(|| Fault::Program("a request lacks an input".to_owned()))?
            .into_iter();
        let lists: Vec<Vec<f64>> = self
            .sizes
            .iter()
            .map(|size| values.by_ref().take(*size).collect())
            .collect();
        let content = json!({ "input": lists, "config": self.config });
        let answer = self.call("Evaluate", Some(content), timeout)?;
        let lists = answer["output"].as_array().into_iter().flatten();
        let output: Vec<&Value> = lists.filter_map(Value::as_array).flatten().collect();
        if output.len() != self.outputs.len() {
            let text = format!("the UM-Bridge model answered {}", answer["output"]);
            return Err(Fault::Program(text));
        }
        let named = self.outputs.iter().zip(output);
        let named = named.filter(|(name, _)| wanted.contains(name));
        Ok(named
            .map(|(name, value)| (name.clone(), value.clone()))
            .collect())
    }

    /// Posts `content` with the model's name to an address of the server, or sends a GET request if there is no
    /// content.
    fn call(&self, what: &str, content: Option<Value>, timeout: Duration) -> Result<Value, Fault> {
        let url = format!("{}/{what}", self.server);
        let content = content.map(|mut content| {
            content["name"] = json!(self.model);
            content
        });
        let (sender, receiver) = mpsc::channel();
        let (agent, address) = (self.agent.clone(), url.clone());
        // A request cannot be interrupted, but its answer need not be waited for.
        std::thread::spawn(move || sender.send(post(&agent, &address, content.as_ref())));
        let since = Instant::now();
        loop {
            match receiver.recv_timeout(LOOK) {
                Ok(answer) => return answer,
                Err(RecvTimeoutError::Disconnected) => {
                    return Err(Fault::Program(format!("the request to {url} ended")));
                }
                Err(RecvTimeoutError::Timeout) if self.stop.load(Ordering::Relaxed) => {
                    return Err(Fault::Program("the worker is stopping".to_owned()));
                }
                Err(RecvTimeoutError::Timeout) if since.elapsed() > timeout => {
                    let seconds = timeout.as_secs_f64();
                    let text =
                        format!("the UM-Bridge server has not answered {url} within {seconds} s");
                    return Err(Fault::Program(text));
                }
                Err(RecvTimeoutError::Timeout) => {}
            }
        }
    }
}

/// Sends a POST request with `content`, or a GET request without any.
fn post(agent: &ureq::Agent, url: &str, content: Option<&Value>) -> Result<Value, Fault> {
    let sent = match content {
        Some(content) => agent.post(url).send_json(content),
        None => agent.get(url).call(),
    };
    let unreachable = |error: ureq::Error| {
        let text = format!("no UM-Bridge server answers at {url}: {error}");
        Fault::NotRun {
            of_machine: format!("{text}; start it, or correct its address"),
            text,
        }
    };
    let mut response = sent.map_err(unreachable)?;
    let text = response.body_mut().read_to_string().map_err(unreachable)?;
    let answer: Value = serde_json::from_str(&with_quoted_numbers(&text))
        .map_err(|error| Fault::Program(format!("the answer of {url} is not JSON: {error}")))?;
    match answer.get("error") {
        None => Ok(answer),
        Some(error) => {
            let message = error["message"].as_str().unwrap_or("no message");
            Err(Fault::Program(format!(
                "the UM-Bridge model says: {message}"
            )))
        }
    }
}

fn strings(list: &Value) -> Vec<&str> {
    let list = list.as_array().into_iter().flatten();
    list.filter_map(Value::as_str).collect()
}
