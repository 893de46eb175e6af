//! `[simulator]`: the program that simulates the designs.

use std::collections::BTreeMap;
use std::time::Duration;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::validate::Source;
use super::{FileError, ResultLine};

/// The kind of simulator.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum SimulatorKind {
    /// The gear model of this program.
    #[default]
    BuiltIn,
    /// A program that every worker starts.
    External,
}

/// `[simulator]`, optional: the program that simulates the designs.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SimulatorSection {
    /// The simulator of a gear campaign. A problem that the file states always has an external one.
    pub kind: SimulatorKind,
    /// The command for `sh -c`. The workers of `run` and `serve` take it; `--exec` stands in its place, and other workers
    /// need `--exec`.
    pub command: Option<String>,
    /// The model of a UM-Bridge server, in the place of a command.
    pub um_bridge: Option<UmBridgeSection>,
    /// The template of the program's input file, relative to the folder of the campaign file: the program reads and
    /// writes files. Given with `result`.
    pub template: Option<String>,
    /// The name of the result file, given with `template`.
    pub result: Option<String>,
    /// Where each response stands in a result file that is neither lines of `name = value` nor JSON, by the responses'
    /// names: `{ line = 'REGULAR EXPRESSION', column = 3 }`, without `column` if a group of the expression is the number.
    /// `refused` is the reason for which a design cannot be simulated.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub read: BTreeMap<String, ResultLine>,
    /// Seconds that the program may take for one answer; 600 if absent.
    pub timeout_s: Option<f64>,
    /// Number of processors that one call of the program uses; 1 if absent. `run` computes fewer jobs at once, and the
    /// program gets it as `OMP_NUM_THREADS`.
    pub processors: Option<u32>,
    /// Variables of the program's environment, besides those of the worker.
    pub environment: BTreeMap<String, String>,
    /// Number of designs that an external program simulates when a worker starts, to verify that
    /// all workers run the same program; 3 if absent. With 0 only the version that the program reports counts,
    /// which is meant for simulations that take very long.
    pub probe_designs: Option<u32>,
    /// Number of times that a failing request is tried before its failure is final; 3 if absent. An
    /// attempt counts only if the program answers something else in between.
    pub attempts: Option<u32>,
    /// Seconds for which all requests may fail before the failures are final and the campaign goes on without these
    /// results; 60 if absent. A shorter outage, such as of a licence server, costs nothing but time.
    pub retry_s: Option<f64>,
}

/// `[simulator.um_bridge]`: a model of a UM-Bridge server. Its inputs are the variables and then the random inputs, its
/// outputs the sampled responses and then the deterministic ones, in the order of the file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "a section with `servers`, `model` and `config`")]
pub struct UmBridgeSection {
    /// The addresses of servers that are alike, such as `http://localhost:4242`.
    pub servers: Vec<String>,
    /// The model's name; the server's only one if absent.
    pub model: Option<String>,
    /// The model's configuration.
    #[serde(default)]
    pub config: BTreeMap<String, serde_json::Value>,
}

impl SimulatorSection {
    /// Maximum number of designs that are simulated for a model digest.
    pub const MAX_PROBE_DESIGNS: u32 = 12;
    /// Default of [`SimulatorSection::probe_designs`].
    const PROBE_DESIGNS: u32 = 3;
    /// Default of [`SimulatorSection::attempts`].
    const ATTEMPTS: u32 = 3;
    /// Default of [`SimulatorSection::retry_s`].
    const RETRY_S: f64 = 60.0;

    /// Number of designs that are simulated for the model digest of an external program.
    #[must_use]
    pub fn probe_designs(&self) -> u32 {
        self.probe_designs.unwrap_or(Self::PROBE_DESIGNS)
    }

    /// Number of times that a failing request is tried.
    #[must_use]
    pub fn attempts(&self) -> u32 {
        self.attempts.unwrap_or(Self::ATTEMPTS)
    }

    /// How long all requests may fail before the campaign goes on without the failing ones.
    #[must_use]
    pub fn retry_for(&self) -> Duration {
        Duration::from_secs_f64(self.retry_s.unwrap_or(Self::RETRY_S))
    }

    /// The keys that results may depend on. The program is identified by its digest instead.
    pub(super) fn of_values(&self) -> Self {
        Self {
            kind: self.kind,
            probe_designs: self.probe_designs,
            ..Self::default()
        }
    }

    /// Number of processors that one call of the program uses.
    #[must_use]
    pub fn processors(&self) -> u32 {
        self.processors.unwrap_or(1)
    }

    /// The variables of the program's environment.
    #[must_use]
    pub fn environment(&self) -> Vec<(String, String)> {
        let threads = self
            .processors
            .map(|count| ("OMP_NUM_THREADS".to_owned(), count.to_string()));
        let stated = self.environment.clone().into_iter();
        threads.into_iter().chain(stated).collect()
    }

    pub(super) fn validate(&self, source: Source<'_>) -> Result<(), FileError> {
        if let Some(attempts) = self.attempts {
            source.count("simulator.attempts", attempts, 1, 1000)?;
        }
        if let Some(seconds) = self.retry_s {
            source.within("simulator.retry_s", seconds, 0.0, 1e6, "s")?;
        }
        source.require(
            self.template.is_some() == self.result.is_some(),
            "simulator.template",
            self.template.as_deref().unwrap_or_default(),
            "given together with result, or neither of them",
        )?;
        for (key, text) in [("command", &self.command), ("result", &self.result)] {
            let is_blank = text.as_ref().is_some_and(|text| text.trim().is_empty());
            source.require(!is_blank, &format!("simulator.{key}"), "", "not empty")?;
        }
        let has_program = self.command.is_some() || self.um_bridge.is_some();
        source.require(
            self.read.is_empty() || self.template.is_some() || !has_program,
            "simulator.read",
            self.read.keys().collect::<Vec<_>>(),
            "absent without template and result: it describes the lines of the result file",
        )?;
        for (name, place) in &self.read {
            place.validate(source, &format!("simulator.read.{name}"))?;
        }
        if let Some(model) = &self.um_bridge {
            let key = "simulator.um_bridge.servers";
            let is_address = |server: &String| server.starts_with("http://");
            source.require(
                !model.servers.is_empty() && model.servers.iter().all(is_address),
                key,
                &model.servers,
                "one or more addresses such as \"http://localhost:4242\"",
            )?;
            source.require(
                self.command.is_none() && self.template.is_none(),
                key,
                &model.servers,
                "absent beside simulator.command: a campaign has one simulator",
            )?;
        }
        if let Some(seconds) = self.timeout_s {
            source.within("simulator.timeout_s", seconds, 0.001, 1e9, "s")?;
        }
        if let Some(processors) = self.processors {
            source.count("simulator.processors", processors, 1, 1024)?;
        }
        let is_variable = |name: &String| {
            let plain = |c: char| c.is_ascii_alphanumeric() || c == '_';
            !name.is_empty() && name.chars().all(plain)
        };
        if let Some(name) = self.environment.keys().find(|name| !is_variable(name)) {
            let expected = "letters, digits and underscores";
            return Err(source.refuse("simulator.environment", name, expected));
        }
        let built_in = Self::default();
        source.require(
            self.kind == SimulatorKind::External || *self == built_in,
            "simulator.kind",
            self.kind,
            "\"external\" beside the other keys of the section, which are about a program",
        )?;
        let most = Self::MAX_PROBE_DESIGNS;
        self.probe_designs.map_or(Ok(()), |found| {
            source.require(
                found <= most,
                "simulator.probe_designs",
                found,
                &format!("a whole number from 0 to {most}"),
            )
        })
    }
}
