//! External simulators: programs that answer each line of JSON with a line, or read and write
//! files.
//!
//! A slot keeps a process over many requests. A process that crashes, sends a malformed answer or takes too long fails
//! the current job, and the next job gets a new process. Output that is not an answer is skipped.
//! `campaigns/external/README.md` describes the protocol for authors of such programs.

mod answers;
mod design;
mod ending;
mod fault;
mod files;
mod numbers;
mod object;
mod output;
mod probing;
mod process;
mod program;
mod repeated;
mod requests;
mod results;
mod slot;
#[cfg(test)]
mod tests;
mod trial;
mod um_bridge;

use std::cell::{Cell, RefCell};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::{Duration, Instant};

use problem::file::{SimulatorKind, SimulatorSection};
use problem::formulation::{Design, Problem};
use problem::probe;
use problem::simulator::{NoAnswer, PreparedDesign, Simulator};
use serde_json::{Map, Value};
use tokio::sync::watch;

use crate::outside;
use crate::worker::error::Error;
use answers::{Answer, Content, Description};
use design::ExternalDesign;
pub(crate) use fault::Ability;
use fault::{Fault, PAUSES, patiently};
use files::FailedRuns;
use numbers::Numbers;
use program::Program;
use slot::Slots;
pub use trial::{Trial, trial};

/// The variable with the folder of the campaign file, for the campaign's command.
const FOLDER: &str = "CAMPAIGN_FOLDER";
/// Default time limit of an answer.
const TIMEOUT: Duration = Duration::from_secs(600);
/// Minimum time limit for the start of a program.
const START: Duration = Duration::from_secs(30);

/// The arguments of both programs for an external simulator.
#[derive(Debug, Clone, PartialEq, clap::Args)]
pub struct SimulatorArguments {
    /// The simulator of a campaign whose [simulator] is "external": a command for `sh -c`
    #[arg(long, value_name = "CMD")]
    exec: Option<String>,
    /// Seconds that the external simulator may take for one answer [default: the campaign's, or 600]
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    exec_timeout: Option<Duration>,
    /// The template of the external simulator's input file, with {name} for each variable and
    /// {seed} or, with [[random]], {name} for each random input: the command is then run once for
    /// each request, in a new folder ($OLDPWD is the folder of this program)
    #[arg(long, value_name = "FILE", requires_all = ["exec", "result"])]
    template: Option<PathBuf>,
    /// The result file that the external simulator writes: lines of name = value, or a JSON object
    #[arg(long, value_name = "NAME", requires = "template")]
    result: Option<PathBuf>,
    /// The address of a UM-Bridge server, http://HOST:PORT, whose model is the simulator; repeated for servers
    /// that are alike
    #[arg(long, value_name = "URL", conflicts_with = "exec")]
    um_bridge: Vec<String>,
}

impl SimulatorArguments {
    /// The external simulator of the arguments, if there is one.
    #[must_use]
    pub fn exec(&self) -> Option<Exec> {
        let files = self.template.clone().zip(self.result.clone());
        let interface = match &self.exec {
            Some(command) => Interface::of_command(command, files),
            None if self.um_bridge.is_empty() => return None,
            None => Interface::UmBridge(self.um_bridge.clone()),
        };
        Some(Exec {
            interface,
            timeout: self.exec_timeout.unwrap_or(TIMEOUT),
            environment: Vec::new(),
        })
    }

    /// The external simulator of the arguments, or else of the campaign, whose file lies in `folder`.
    #[must_use]
    pub fn exec_or(&self, section: &SimulatorSection, folder: &Path) -> Option<Exec> {
        let files = section.template.as_ref().zip(section.result.as_ref());
        let files = files.map(|(template, result)| (folder.join(template), result.into()));
        let of_command = section.command.as_ref();
        let of_command = of_command.map(|command| Interface::of_command(command, files));
        let of_servers = section.um_bridge.as_ref();
        let of_servers = of_servers.map(|model| Interface::UmBridge(model.servers.clone()));
        let of_file = of_command.or(of_servers).map(|interface| Exec {
            interface,
            timeout: TIMEOUT,
            environment: Vec::new(),
        });
        let stated = section.timeout_s.map(Duration::from_secs_f64);
        let place = std::path::absolute(folder).unwrap_or_else(|_| folder.to_owned());
        let place = (FOLDER.to_owned(), place.display().to_string());
        self.exec().or(of_file).map(|exec| Exec {
            timeout: self.exec_timeout.or(stated).unwrap_or(TIMEOUT),
            environment: std::iter::once(place)
                .chain(section.environment())
                .collect(),
            ..exec
        })
    }
}

fn seconds(text: &str) -> Result<Duration, String> {
    let seconds: f64 = text.parse().map_err(|_| "it must be a number".to_owned())?;
    // A timeout of more than a century has no effect and overflows clocks.
    if seconds > 0.0 && seconds < 3e9 {
        Ok(Duration::from_secs_f64(seconds))
    } else {
        Err("it must be above 0 and below 3e9".to_owned())
    }
}

/// How an external simulator is called.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Interface {
    /// A command for `sh -c` that answers lines.
    Lines(String),
    /// A command for `sh -c` that is run for each request.
    Files {
        /// The command.
        command: String,
        /// The template of its input file, with `{name}` for each variable and random input, and `{seed}` without
        /// random inputs.
        template: PathBuf,
        /// The name of its result file.
        result: PathBuf,
    },
    /// The addresses of UM-Bridge servers that are alike.
    UmBridge(Vec<String>),
}

impl Interface {
    /// The interface of a command, through a template and a result file if there are any.
    fn of_command(command: &str, files: Option<(PathBuf, PathBuf)>) -> Self {
        let command = command.to_owned();
        match files {
            None => Self::Lines(command),
            Some((template, result)) => Self::Files {
                command,
                template,
                result,
            },
        }
    }
}

/// The external simulator of a worker.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Exec {
    /// How it is called.
    pub interface: Interface,
    /// Time limit of an answer.
    pub timeout: Duration,
    /// Variables of its environment, besides those of this program.
    pub environment: Vec<(String, String)>,
}

/// The simulator of a campaign on this worker.
#[derive(Debug)]
pub(crate) enum Backend {
    /// The built-in gear model.
    BuiltIn,
    /// An external simulator.
    External(Box<Programs>),
}

/// The processes of an external simulator, one for each simultaneous job.
#[derive(Debug)]
pub(crate) struct Programs {
    exec: Exec,
    idle: Mutex<Vec<Program>>,
    /// The version that the first process named; the others must name the same.
    version: OnceLock<String>,
    /// Number of programs that were started.
    started: AtomicUsize,
    slots: Slots,
    stop: Arc<AtomicBool>,
    /// Number of sessions, each of which may hold a process.
    sessions: AtomicUsize,
    /// Whether the command was run with success on this machine.
    has_answered: AtomicBool,
    ability: watch::Sender<Ability>,
    /// Pauses before a machine at fault is tried again.
    pauses: &'static [Duration],
    failed_runs: Arc<FailedRuns>,
}

impl Backend {
    /// Returns the simulator that the campaign needs. It tells `ability` whether this machine can
    /// run it.
    pub(crate) fn choose(
        problem: &Problem,
        exec: Option<&Exec>,
        ability: watch::Sender<Ability>,
    ) -> Result<Self, Error> {
        let campaign = problem.campaign();
        let name = &campaign.name;
        match (campaign.simulator.kind, exec) {
            (SimulatorKind::BuiltIn, None) => Ok(Self::BuiltIn),
            (SimulatorKind::External, Some(exec)) => Ok(Self::External(Box::new(Programs {
                exec: exec.clone(),
                idle: Mutex::new(Vec::new()),
                version: OnceLock::new(),
                started: AtomicUsize::new(0),
                slots: Slots::default(),
                stop: Arc::new(AtomicBool::new(false)),
                sessions: AtomicUsize::new(0),
                has_answered: AtomicBool::new(false),
                ability,
                pauses: &PAUSES,
                failed_runs: Arc::default(),
            }))),
            (SimulatorKind::External, None) => Err(Error::WrongSimulator {
                reason: format!(
                    "campaign {name} is simulated by an external program: start this worker with \
                     --exec 'CMD' or --um-bridge URL"
                ),
            }),
            (SimulatorKind::BuiltIn, Some(_)) => Err(Error::WrongSimulator {
                reason: format!(
                    "campaign {name} is simulated by the built-in model: start this worker without \
                     --exec, or give the campaign a section [simulator] with kind = \"external\""
                ),
            }),
        }
    }

    /// Returns the digest of the answers to the probe questions, which `slots` programs answer at the same time.
    pub(crate) fn model_digest(&self, problem: &Problem, slots: usize) -> Result<String, Error> {
        match self {
            Self::BuiltIn => Ok(probe::model_digest(problem)),
            Self::External(programs) => programs.model_digest(problem, slots),
        }
    }

    /// Runs `work` with the simulator. Returns its result and the seconds that a program took to
    /// answer, which no CPU clock of this process counts.
    pub(crate) fn with<T>(
        &self,
        problem: &Problem,
        work: impl FnOnce(&dyn Simulator) -> T,
    ) -> (T, f64) {
        match self {
            Self::BuiltIn => (work(problem), 0.0),
            Self::External(programs) => {
                let session = programs.session(problem);
                let result = work(&session);
                (result, session.waited.get().as_secs_f64())
            }
        }
    }

    /// Whether the simulator is an external program.
    pub(crate) const fn is_external(&self) -> bool {
        matches!(self, Self::External(_))
    }

    /// Whether [`Self::stop`] was called.
    pub(crate) fn is_stopped(&self) -> bool {
        matches!(self, Self::External(programs) if programs.stop.load(Ordering::Relaxed))
    }

    /// Ends all programs, and waits for the idle ones. [`Self::is_busy`] says whether others are still ending.
    pub(crate) fn stop(&self) {
        if let Self::External(programs) = self {
            programs.stop.store(true, Ordering::Relaxed);
            let idle = std::mem::take(&mut *programs.idle());
            std::thread::scope(|scope| {
                // The end of each may take seconds.
                for program in idle {
                    scope.spawn(|| drop(program));
                }
            });
        }
    }

    /// Whether a program is still working on a request, or about to be ended.
    pub(crate) fn is_busy(&self) -> bool {
        matches!(self, Self::External(programs) if programs.sessions.load(Ordering::Acquire) > 0)
    }
}

impl Programs {
    fn session<'a>(&'a self, problem: &'a Problem) -> Session<'a> {
        self.sessions.fetch_add(1, Ordering::Relaxed);
        Session {
            programs: self,
            problem,
            process: RefCell::new(None),
            waited: Cell::new(Duration::ZERO),
        }
    }

    fn idle(&self) -> std::sync::MutexGuard<'_, Vec<Program>> {
        // A panic cannot leave the list half changed.
        self.idle.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The use of a program by one job.
#[derive(Debug)]
struct Session<'a> {
    programs: &'a Programs,
    problem: &'a Problem,
    /// Taken out during a request, so that a failed request ends the process.
    process: RefCell<Option<Program>>,
    waited: Cell<Duration>,
}

impl Session<'_> {
    /// Starts a process, or takes an idle one, unless the session has one.
    fn start(&self) -> Result<(), Fault> {
        // A process that ended after its last answer is replaced, and fails no request.
        let ended = self.process.borrow_mut().take_if(|one| one.has_ended());
        drop(ended);
        if self.process.borrow().is_some() {
            return Ok(());
        }
        while let Some(process) = self.programs.idle().pop() {
            // A process that ended while idle fails no job.
            if !process.has_ended() {
                *self.process.borrow_mut() = Some(process);
                return Ok(());
            }
        }
        let stop = Arc::clone(&self.programs.stop);
        let number = self.programs.started.fetch_add(1, Ordering::Relaxed);
        let of = (&self.problem.campaign().simulator, number);
        let slot = self.programs.slots.take();
        let process = Program::start(
            &self.programs.exec,
            of,
            slot,
            stop,
            &self.programs.failed_runs,
        )?;
        *self.process.borrow_mut() = Some(process);
        let request = requests::describe(self.problem).map_err(Fault::Program)?;
        let timeout = self.programs.exec.timeout.max(START);
        let check = |described: &Description| described.check(self.problem);
        let described = match self.exchange(request, timeout, check)? {
            Answer::Given(described) => described,
            Answer::Refused(reason) | Answer::Error(reason) => {
                self.process.borrow_mut().take();
                return Err(Fault::Program(format!(
                    "the simulator did not start: {reason}"
                )));
            }
        };
        if !matches!(self.programs.exec.interface, Interface::Files { .. }) {
            self.programs.has_answered.store(true, Ordering::Relaxed);
        }
        let first = self
            .programs
            .version
            .get_or_init(|| described.version.clone());
        if *first != described.version {
            self.process.borrow_mut().take();
            return Err(Fault::Program(format!(
                "the version of the simulator was {first:?} before and is {:?} now: it must not \
                 change during a campaign",
                described.version
            )));
        }
        Ok(())
    }

    /// Sends a request for the `wanted` numbers of a design. The answer may also hold some of
    /// `others`.
    fn ask(
        &self,
        question: Map<String, Value>,
        wanted: &[&str],
        others: &[&str],
    ) -> Result<Numbers, NoAnswer> {
        let timeout = self.programs.exec.timeout;
        let check = |numbers: &Numbers| answers::check(numbers, wanted, others);
        let ask = || {
            self.start()?;
            self.exchange(question.clone(), timeout, check)
        };
        let answer = self.patiently(|| match ask() {
            // It ended after its last answer and before it read this request.
            Err(Fault::Left(_)) => ask(),
            answer => answer,
        })?;
        self.programs.has_answered.store(true, Ordering::Relaxed);
        match answer {
            Answer::Given(answer) => Ok(answer),
            Answer::Refused(reason) => Err(NoAnswer::Refused(outside::line(&reason))),
            Answer::Error(error) => {
                let error = Fault::Program(format!("the simulator says: {error}"));
                Err(error.into())
            }
        }
    }

    /// Makes a request again while this machine cannot run the program, for a few seconds.
    fn patiently<T>(&self, request: impl Fn() -> Result<T, Fault>) -> Result<T, Fault> {
        let programs = self.programs;
        let pause = |pause: Duration| {
            let since = Instant::now();
            while since.elapsed() < pause && !programs.stop.load(Ordering::Relaxed) {
                std::thread::sleep(pause.min(Duration::from_millis(50)));
            }
            !programs.stop.load(Ordering::Relaxed)
        };
        patiently(&programs.ability, programs.pauses, pause, || {
            let has_answered = || programs.has_answered.load(Ordering::Relaxed);
            request().map_err(|fault| fault.judged(has_answered()))
        })
    }

    fn exchange<T: Content>(
        &self,
        request: Map<String, Value>,
        timeout: Duration,
        check: impl FnOnce(&T) -> Result<(), String>,
    ) -> Result<Answer<T>, Fault> {
        let Some(mut process) = self.process.borrow_mut().take() else {
            let text = "the simulator was asked before it was started".to_owned();
            return Err(Fault::Program(text));
        };
        let since = Instant::now();
        let answer = process.ask(request, timeout);
        self.waited.set(self.waited.get() + since.elapsed());
        let answer = answer?;
        let read = answers::read(answer.clone()).and_then(|read| {
            if let Answer::Given(given) = &read {
                check(given)?;
            }
            Ok(read)
        });
        match read {
            Ok(read) => {
                *self.process.borrow_mut() = Some(process);
                Ok(read)
            }
            Err(reason) => {
                let answer = Value::Object(answer).to_string();
                Err(Fault::Program(process.refute(&answer, &reason)))
            }
        }
    }
}

impl Drop for Session<'_> {
    fn drop(&mut self) {
        if let Some(process) = self.process.borrow_mut().take()
            && !self.programs.stop.load(Ordering::Relaxed)
        {
            self.programs.idle().push(process);
        }
        // Decremented last: a process that is not kept has ended by now.
        self.programs.sessions.fetch_sub(1, Ordering::Release);
    }
}

impl Simulator for Session<'_> {
    fn problem(&self) -> &Problem {
        self.problem
    }

    fn version(&self) -> Option<String> {
        self.programs.version.get().cloned()
    }

    fn prepare<'a>(&'a self, design: &Design) -> Result<Box<dyn PreparedDesign + 'a>, NoAnswer> {
        let told = self.problem.told(design).map_err(NoAnswer::Refused)?;
        Ok(Box::new(ExternalDesign::new(self, design, &told)))
    }
}
