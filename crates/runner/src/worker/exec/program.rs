//! The program of a session: a process that is kept, or a command that is run for each request.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use problem::file::SimulatorSection;
use serde_json::{Map, Value};

use super::fault::Fault;
use super::files::{FailedRuns, Files};
use super::process::Process;
use super::slot::Slot;
use super::um_bridge::UmBridge;
use super::{Exec, Interface, answers, requests};

/// A simulator that accepts requests.
#[derive(Debug)]
pub(super) struct Program {
    kind: Kind,
    /// The id of the last request. It is never used again, whatever job asks: the answer to a
    /// former request may still be on its way.
    id: u64,
    /// The last request, for messages.
    line: String,
    /// The last field, so that the number is freed only after the program has ended.
    _slot: Slot,
}

/// The environment variable with the program's number, from 0, among the programs that its worker runs at the same
/// time.
const SLOT: &str = "CAMPAIGN_SLOT";

#[derive(Debug)]
enum Kind {
    /// A process that answers lines with lines.
    Lines(Process),
    /// A command that answers files with files.
    Files(Files),
    /// A model on a UM-Bridge server.
    UmBridge(Box<UmBridge>),
}

impl Program {
    /// Starts the program of `exec` for a campaign with this `[simulator]` section. The number selects one of several
    /// servers. Once `stop` is set, the program is ended, and no answer is waited for. The folders of failed runs are
    /// added to `failed_runs`.
    ///
    /// # Errors
    ///
    /// The machine cannot run it.
    pub(super) fn start(
        exec: &Exec,
        (section, number): (&SimulatorSection, usize),
        slot: Slot,
        stop: Arc<AtomicBool>,
        failed_runs: &Arc<FailedRuns>,
    ) -> Result<Self, Fault> {
        let mut environment = exec.environment.clone();
        environment.push((SLOT.to_owned(), slot.number.to_string()));
        let environment = &environment;
        let kind = match &exec.interface {
            Interface::Lines(command) => Kind::Lines(Process::start(command, environment, stop)?),
            Interface::Files {
                command,
                template,
                result,
            } => {
                let command = (&**command, &**environment);
                let result = (&**result, &section.read);
                Kind::Files(Files::new(command, template, result, stop, failed_runs)?)
            }
            Interface::UmBridge(servers) => {
                let server = &servers[number % servers.len()];
                Kind::UmBridge(Box::new(UmBridge::new(server, section, stop)))
            }
        };
        Ok(Self {
            kind,
            id: 0,
            line: String::new(),
            _slot: slot,
        })
    }

    pub(super) fn has_ended(&self) -> bool {
        match &self.kind {
            Kind::Lines(process) => process.has_ended(),
            Kind::Files(_) | Kind::UmBridge(_) => false,
        }
    }

    /// Sends a request and returns the answer. After an error, the program must not be used again.
    ///
    /// # Errors
    ///
    /// The fault, with the end of the program's standard error.
    pub(super) fn ask(
        &mut self,
        request: Map<String, Value>,
        timeout: Duration,
    ) -> Result<Map<String, Value>, Fault> {
        self.id += 1;
        let id = self.id;
        match &mut self.kind {
            Kind::Lines(process) => {
                self.line = requests::line(request, id);
                process.ask(&self.line, timeout, &|line| answers::hear(line, id))
            }
            Kind::Files(files) => files.ask(request, timeout),
            Kind::UmBridge(model) => model.ask(request, timeout),
        }
    }

    /// Ends the program, whose `answer` is malformed, and returns the error.
    pub(super) fn refute(&mut self, answer: &str, reason: &str) -> String {
        match &mut self.kind {
            Kind::Lines(process) => process.refute(answer, reason, &self.line),
            Kind::Files(_) | Kind::UmBridge(_) => {
                format!("the simulator's results cannot be used: {reason}")
            }
        }
    }
}
