//! Simulators from elsewhere: programs that answer one line of JSON for each line they are asked, or
//! read and write files.
//!
//! A slot keeps a process over many requests. A process that dies, answers nonsense or takes too
//! long fails the job that asked, and the next job gets a new one. `campaigns/external/README.md`
//! describes the protocol for whoever writes such a program.

mod files;
mod messages;
mod process;
mod program;
#[cfg(test)]
mod tests;

use std::cell::{Cell, RefCell};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::{Duration, Instant};

use campaign::file::SimulatorKind;
use campaign::formulation::{Design, Problem, Quantity};
use campaign::probe;
use campaign::simulator::{Analysis, NoAnswer, Prepared, Simulator, State};
use rand::Rng as _;
use serde_json::{Map, Value};
use stats::streams::StreamRng;

use crate::error::Error;
pub use files::FileMode;
use messages::{Answer, Content, Described, Numbers};
use program::Program;

/// How long a program may take to get ready, at least.
const START: Duration = Duration::from_secs(30);

/// What both programs' command lines say about an external simulator.
#[derive(Debug, Clone, PartialEq, clap::Args)]
pub struct SimulatorArguments {
    /// The simulator of a campaign whose [simulator] is "external": a command for `sh -c`
    #[arg(long, value_name = "CMD")]
    exec: Option<String>,
    /// How many seconds the external simulator may take for one answer
    #[arg(long, value_name = "SECONDS", default_value = "600", value_parser = seconds)]
    exec_timeout: Duration,
    /// The file that the external simulator reads, with {name} for each variable and {seed}: it is asked
    /// through files instead of lines, a run for each question in a folder of its own ($OLDPWD is this one)
    #[arg(long, value_name = "FILE", requires_all = ["exec", "result"])]
    template: Option<PathBuf>,
    /// The file that it leaves: lines of name = value, or a JSON object
    #[arg(long, value_name = "NAME", requires = "template")]
    result: Option<PathBuf>,
}

impl SimulatorArguments {
    /// The external simulator, if there is one.
    #[must_use]
    pub fn exec(&self) -> Option<Exec> {
        let files = self.template.clone().zip(self.result.clone());
        self.exec.clone().map(|command| Exec {
            command,
            timeout: self.exec_timeout,
            files: files.map(|(template, result)| FileMode { template, result }),
        })
    }
}

fn seconds(text: &str) -> Result<Duration, String> {
    let seconds: f64 = text.parse().map_err(|_| "no number".to_owned())?;
    // Above a century it is no timeout any more, and clocks overflow.
    if seconds > 0.0 && seconds < 3e9 {
        Ok(Duration::from_secs_f64(seconds))
    } else {
        Err("it must be above 0 and below 3e9".to_owned())
    }
}

/// An external simulator, as the command line names it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Exec {
    /// What `sh -c` runs.
    pub command: String,
    /// How long one answer may take.
    pub timeout: Duration,
    /// The files through which it is asked; none where it answers lines.
    pub files: Option<FileMode>,
}

/// What simulates the designs of one campaign on this worker.
#[derive(Debug)]
pub(crate) enum Backend {
    /// The built-in gear model.
    BuiltIn,
    /// A program.
    External(Programs),
}

/// The processes of an external simulator: as many as are asked at once.
#[derive(Debug)]
pub(crate) struct Programs {
    exec: Exec,
    idle: Mutex<Vec<Program>>,
    /// What the first process called itself; the others must be the same program.
    version: OnceLock<String>,
    stop: Arc<AtomicBool>,
    /// How many sessions there are, each of which may hold a process.
    sessions: AtomicUsize,
}

impl Backend {
    /// What the campaign asks for, if this worker has it.
    ///
    /// # Errors
    ///
    /// The campaign needs an external simulator and there is none, or the other way round.
    pub(crate) fn choose(problem: &Problem, exec: Option<&Exec>) -> Result<Self, Error> {
        let campaign = problem.campaign();
        let name = &campaign.name;
        match (campaign.simulator.kind, exec) {
            (SimulatorKind::BuiltIn, None) => Ok(Self::BuiltIn),
            (SimulatorKind::External, Some(exec)) => Ok(Self::External(Programs {
                exec: exec.clone(),
                idle: Mutex::new(Vec::new()),
                version: OnceLock::new(),
                stop: Arc::new(AtomicBool::new(false)),
                sessions: AtomicUsize::new(0),
            })),
            (SimulatorKind::External, None) => Err(Error::WrongSimulator {
                reason: format!(
                    "campaign {name} is simulated by an external program: start this worker with \
                     --exec 'CMD'"
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

    /// The digest of the answers to the fixed questions. It may take as long as they do.
    ///
    /// # Errors
    ///
    /// The program fails on them.
    pub(crate) fn model_digest(&self, problem: &Problem) -> Result<String, Error> {
        match self {
            Self::BuiltIn => Ok(probe::model_digest(problem)),
            Self::External(programs) => {
                let questions = problem.campaign().simulator.probe_designs();
                let session = programs.session(problem);
                session
                    .start()
                    .and_then(|()| probe::digest_of(&session, questions))
                    .map_err(|reason| Error::Program { reason })
            }
        }
    }

    /// Lets `work` ask the simulator. Returns its result, and how many seconds a program took to
    /// answer: no clock of this process counts them.
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

    /// Whether a program is asked.
    pub(crate) const fn is_external(&self) -> bool {
        matches!(self, Self::External(_))
    }

    /// Whether [`Self::stop`] was called.
    pub(crate) fn is_stopped(&self) -> bool {
        matches!(self, Self::External(programs) if programs.stop.load(Ordering::Relaxed))
    }

    /// Ends all programs, also those that are being waited for.
    pub(crate) fn stop(&self) {
        if let Self::External(programs) = self {
            programs.stop.store(true, Ordering::Relaxed);
            programs.idle().clear();
        }
    }

    /// Whether a program is still asked something, or about to be ended.
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
            requests: Cell::new(0),
            waited: Cell::new(Duration::ZERO),
        }
    }

    fn idle(&self) -> std::sync::MutexGuard<'_, Vec<Program>> {
        // A list of processes is never half changed.
        self.idle.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A program for the length of one job.
#[derive(Debug)]
struct Session<'a> {
    programs: &'a Programs,
    problem: &'a Problem,
    /// Taken out while it is asked, so that what goes wrong there ends it.
    process: RefCell<Option<Program>>,
    /// Numbers the requests.
    requests: Cell<u64>,
    waited: Cell<Duration>,
}

impl Session<'_> {
    /// Makes sure that there is a process that is ready to be asked.
    fn start(&self) -> Result<(), String> {
        if self.process.borrow().is_some() {
            return Ok(());
        }
        while let Some(process) = self.programs.idle().pop() {
            // One that died while nobody asked it is nobody's failure.
            if !process.has_ended() {
                *self.process.borrow_mut() = Some(process);
                return Ok(());
            }
        }
        let stop = Arc::clone(&self.programs.stop);
        let process = Program::start(&self.programs.exec, stop)?;
        *self.process.borrow_mut() = Some(process);
        let request = messages::describe(self.problem)?;
        let timeout = self.programs.exec.timeout.max(START);
        let check = |described: &Described| described.check(self.problem);
        let described = match self.exchange(request, timeout, check)? {
            Answer::Given(described) => described,
            Answer::Refused(reason) | Answer::Error(reason) => {
                self.process.borrow_mut().take();
                return Err(format!("the simulator did not start: {reason}"));
            }
        };
        let first = self
            .programs
            .version
            .get_or_init(|| described.version.clone());
        if *first != described.version {
            self.process.borrow_mut().take();
            return Err(format!(
                "the simulator called itself {first:?} before and {:?} now: it must not change \
                 during a campaign",
                described.version
            ));
        }
        Ok(())
    }

    /// Asks about a design for the numbers of these names; the answer may hold some of `others`, too.
    fn ask(
        &self,
        question: Map<String, Value>,
        wanted: &[&str],
        others: &[&str],
    ) -> Result<Numbers, NoAnswer> {
        self.start().map_err(NoAnswer::Failed)?;
        let timeout = self.programs.exec.timeout;
        let check = |numbers: &Numbers| messages::check(numbers, wanted, others);
        match self.exchange(question, timeout, check) {
            Ok(Answer::Given(answer)) => Ok(answer),
            Ok(Answer::Refused(reason)) => Err(NoAnswer::Refused(reason)),
            Ok(Answer::Error(error)) => {
                Err(NoAnswer::Failed(format!("the simulator says: {error}")))
            }
            Err(error) => Err(NoAnswer::Failed(error)),
        }
    }

    fn exchange<T: Content>(
        &self,
        request: Map<String, Value>,
        timeout: Duration,
        check: impl FnOnce(&T) -> Result<(), String>,
    ) -> Result<Answer<T>, String> {
        let Some(mut process) = self.process.borrow_mut().take() else {
            return Err("the simulator was asked before it was started".to_owned());
        };
        let id = self.requests.get() + 1;
        self.requests.set(id);
        let line = messages::line(request, id);
        let since = Instant::now();
        let answer = process.ask(&line, timeout);
        self.waited.set(self.waited.get() + since.elapsed());
        let answer = answer?;
        let read = messages::read(&answer, id).and_then(|read| {
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
            Err(reason) => Err(process.refute(&answer, &reason, &line)),
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
        // After a process that is not kept has ended and was waited for.
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

    fn prepare<'a>(&'a self, design: &Design) -> Result<Box<dyn Prepared + 'a>, NoAnswer> {
        let told = self.problem.told(design).map_err(NoAnswer::Refused)?;
        Ok(Box::new(Asked {
            session: self,
            told: messages::design(&told),
            design: design.clone(),
            responses: vec![f64::NAN; self.problem.responses().len()],
            was_evaluated: false,
        }))
    }
}

/// A design that a program is asked about.
struct Asked<'a> {
    session: &'a Session<'a>,
    design: Design,
    told: Value,
    /// What the program has answered so far; the others are NaN.
    responses: Vec<f64>,
    was_evaluated: bool,
}

impl Asked<'_> {
    /// Asks for those of the responses at `places` that are not known yet.
    fn evaluate(&mut self, places: &[usize]) -> Result<(), NoAnswer> {
        let problem = self.session.problem;
        let known: Vec<&Quantity> = problem.responses().iter().collect();
        let asked = |place: usize| problem.asked(known[place]).0;
        let missing = places
            .iter()
            .filter(|place| self.responses[**place].is_nan());
        let wanted: Vec<&str> = missing.map(|place| asked(*place)).collect();
        // Where nothing is wanted the program may still refuse the design, once.
        if wanted.is_empty() && self.was_evaluated {
            return Ok(());
        }
        let others: Vec<&str> = (0..known.len()).map(asked).collect();
        let question = messages::evaluate(&self.told, &wanted);
        let numbers = self.session.ask(question, &wanted, &others)?;
        for (response, quantity) in self.responses.iter_mut().zip(known) {
            let (name, factor) = problem.asked(quantity);
            if let Some(number) = numbers.get(name) {
                *response = factor * number;
            }
        }
        self.was_evaluated = true;
        Ok(())
    }
}

impl Prepared for Asked<'_> {
    fn analyse(&mut self, state: State) -> Result<Analysis, NoAnswer> {
        let problem = self.session.problem;
        let wanted: Vec<usize> = problem.wanted(state).collect();
        self.evaluate(&wanted)?;
        let analysis = problem.analysis(&self.design, &self.responses, state);
        let analysis = analysis.ok_or_else(|| {
            NoAnswer::Failed("the responses are not those of the campaign".to_owned())
        })?;
        if problem.has_baseline() {
            // An optimiser would take a number that cannot be for a find.
            problem.check_sample(analysis.value_um).map_err(|why| {
                let name = &problem.sampled().name;
                NoAnswer::Failed(format!("the simulator's {name} {why}"))
            })?;
        }
        Ok(analysis)
    }

    fn sample(&mut self, rng: &mut StreamRng) -> Result<f64, String> {
        // 128 bits of the stream, in words that every program's numbers can hold.
        let [low, high] = [rng.next_u64(), rng.next_u64()];
        let seed = [low, low >> 32, high, high >> 32].map(|word| word as u32);
        let problem = self.session.problem;
        let (name, factor) = problem.asked(problem.sampled());
        let question = messages::sample(&self.told, seed);
        let answer = self.session.ask(question, &[name], &[name]);
        let numbers = answer.map_err(|error| match error {
            NoAnswer::Refused(reason) => format!(
                "the simulator refused a sample ({reason}): refuse the design when it is \
                 evaluated, or answer with an error"
            ),
            NoAnswer::Failed(error) => error,
        })?;
        Ok(factor * numbers[name])
    }
}
