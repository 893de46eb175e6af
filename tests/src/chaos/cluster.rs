//! A coordinator and its workers as processes to which faults are applied.

use std::io::Write as _;
use std::net::{SocketAddr, TcpStream};
use std::os::unix::process::ExitStatusExt as _;
use std::path::PathBuf;
use std::process::ExitStatus;
use std::time::Duration;

use rustix::process::Signal;

use super::Violation;
use super::plan::{Act, RELIEF, WORKERS, Who};
use super::process::{FAREWELL, Process};
use super::programs::{
    ACCESS, FINISHED, INCOMPLETE, NONE_FEASIBLE, OUTAGE, Programs, ServeArguments,
};
use super::proxy::{Fault, Proxy};
use crate::free_address;
use crate::http::{self, LOCALHOST, VIEWS};

/// Exit code: the store is open elsewhere.
const STORE_LOCKED: i32 = 9;
/// The access file of a second coordinator on the same store, which must be refused because of the
/// store itself.
const INTRUDERS_ACCESS: &str = "intruder.access";
/// Exit code: this machine cannot run the simulator.
const BROKEN_MACHINE: i32 = 4;
/// The beginning of a broken worker's name.
const BROKEN: &str = "broken";
/// Exit code: no coordinator answers.
const UNREACHABLE: i32 = 11;
/// Exit code: the program was asked to leave, or drained.
const INTERRUPTED: i32 = 14;
/// Shorter than a worker waits for a coordinator that does not answer.
const ABSENCE: Duration = Duration::from_secs(25);

/// Longer than the refusal of a coordinator takes.
const PATIENCE: Duration = Duration::from_secs(10);

/// The campaign of a cluster and the programs that run it.
#[derive(Debug, Clone)]
pub(crate) struct Setup {
    /// The folder of the round.
    pub(crate) folder: PathBuf,
    /// The programs.
    pub(crate) programs: Programs,
    /// The campaign file.
    pub(crate) file: PathBuf,
    /// Whether coordinators keep serving when the campaign is finished.
    pub(crate) stays: bool,
    /// The workers' command-line arguments for their simulator.
    pub(crate) simulator: Vec<String>,
    /// Whether that simulator kills workers.
    pub(crate) kills_workers: bool,
}

/// The processes of a round.
pub(crate) struct Cluster {
    pub(crate) setup: Setup,
    address: SocketAddr,
    http: SocketAddr,
    /// Number of views that the page has returned.
    pub(crate) visits: usize,
    proxies: Vec<Proxy>,
    coordinator: Option<Process>,
    workers: Vec<Option<Process>>,
    /// Running commands that steer the coordinator, and broken workers.
    clients: Vec<Process>,
    /// Idle connections to the page.
    strangers: Vec<TcpStream>,
    started: usize,
    is_drained: bool,
    /// Exit code of a coordinator that ended by itself because the campaign is finished.
    pub(crate) ended: Option<i32>,
    /// Whether the simulator may have failed since failures were computed again.
    pub(crate) has_failed: bool,
    /// Whether the next coordinator computes them again.
    pub(crate) retries_failed: bool,
    /// Whether a worker left because the campaign is finished.
    pub(crate) is_dismissed: bool,
    /// Whether the workers are kept disconnected, which [`heal`](Self::heal) does not change.
    pub(crate) is_cut_off: bool,
}

impl Cluster {
    pub(crate) fn start(setup: Setup) -> Result<Self, Violation> {
        let address = free_address();
        let proxies: Result<Vec<Proxy>, _> = (0..=RELIEF).map(|_| Proxy::start(address)).collect();
        let mut cluster = Self {
            setup,
            address,
            http: free_address(),
            visits: 0,
            proxies: proxies.map_err(|error| Violation(format!("no proxy: {error}")))?,
            coordinator: None,
            workers: (0..=RELIEF).map(|_| None).collect(),
            clients: Vec::new(),
            strangers: Vec::new(),
            started: 0,
            is_drained: false,
            ended: None,
            has_failed: false,
            retries_failed: false,
            is_dismissed: false,
            is_cut_off: false,
        };
        cluster.revive()?;
        Ok(cluster)
    }

    fn serving(&self, [listen, http]: [SocketAddr; 2]) -> ServeArguments<'_> {
        ServeArguments {
            file: &self.setup.file,
            listen,
            http,
            stays: self.setup.stays,
            retries_failed: self.retries_failed,
        }
    }

    fn spawn(&mut self, who: Who) -> Result<Process, Violation> {
        self.started += 1;
        let folder = &self.setup.folder;
        let (name, command) = match who {
            Who::Coordinator => {
                let serving = self.serving([self.address, self.http]);
                let command = self.setup.programs.coordinator(folder, ACCESS, serving);
                if std::mem::take(&mut self.retries_failed) {
                    self.has_failed = self.setup.folder.join(OUTAGE).exists();
                }
                (format!("coordinator-{}", self.started), command)
            }
            Who::Worker(worker) => {
                let address = self.proxies[worker].address();
                let simulator = &self.setup.simulator;
                // One of them computes several jobs at once.
                let slots = if worker == 0 { 1 } else { 3 };
                let command = self
                    .setup
                    .programs
                    .worker(folder, address, slots, simulator);
                (format!("worker-{worker}-{}", self.started), command)
            }
        };
        Process::start(command, folder, name)
    }

    /// Starts a command that steers the coordinator. It has no time limit.
    fn steer(&mut self, words: &[&str]) -> Result<(), Violation> {
        self.started += 1;
        let name = format!("{}-{}", words[0], self.started);
        let setup = &self.setup;
        let command = setup.programs.client(&setup.folder, self.address, words);
        self.clients
            .push(Process::start(command, &setup.folder, name)?);
        Ok(())
    }

    /// Retries the quarantined jobs. Returns false if no coordinator answers.
    pub(crate) fn retry(&mut self) -> Result<bool, Violation> {
        self.started += 1;
        let setup = &self.setup;
        let command = setup
            .programs
            .client(&setup.folder, self.address, &["retry"]);
        let name = format!("retry-{}", self.started);
        let mut process = Process::start(command, &setup.folder, name)?;
        match process
            .ended_within(FAREWELL)
            .and_then(|status| status.code())
        {
            Some(FINISHED) => Ok(true),
            Some(UNREACHABLE) | None => Ok(false),
            Some(code) => Err(self.unexpected(&process.name, &format!("code {code}"))),
        }
    }

    fn place(&mut self, who: Who) -> &mut Option<Process> {
        match who {
            Who::Coordinator => &mut self.coordinator,
            Who::Worker(worker) => &mut self.workers[worker],
        }
    }

    /// Applies an act to the cluster. Acts that are impossible at present, such as killing a
    /// process that is not running, are skipped.
    pub(crate) fn act(&mut self, act: Act) -> Result<(), Violation> {
        self.look()?;
        match act {
            Act::Start(who) => {
                let over = self.ended.is_some() && who == Who::Coordinator;
                if self.place(who).is_none() && !over {
                    let process = self.spawn(who)?;
                    *self.place(who) = Some(process);
                }
            }
            Act::Kill(who) => {
                // A dropped process is killed.
                self.place(who).take();
            }
            Act::Terminate(who) => {
                if let Some(mut process) = self.place(who).take() {
                    process.is_asked = true;
                    process.signal(Signal::TERM);
                    process.signal(Signal::CONT);
                    let status = process.farewell()?;
                    // A process that has just been started may not handle the signal yet.
                    if status.signal() != Some(Signal::TERM.as_raw()) {
                        self.note_end(who, &process, status)?;
                    }
                }
            }
            Act::Stop(who) => {
                if let Some(process) = self.place(who) {
                    process.signal(Signal::STOP);
                    process.stopped = true;
                }
            }
            Act::Continue(who) => {
                if let Some(process) = self.place(who) {
                    process.signal(Signal::CONT);
                    process.stopped = false;
                }
            }
            Act::Network { worker, fault, cut } => self.proxies[worker].set(fault, cut),
            Act::Intrude => self.intrude()?,
            Act::Drain => {
                self.is_drained = true;
                self.steer(&["drain"])?;
            }
            Act::Resume => self.steer(&["drain", "--resume"])?,
            Act::Retry => self.steer(&["retry"])?,
            Act::Broken => self.add_broken_worker()?,
            Act::Strangers => self.annoy(),
            Act::Outage(share) => {
                self.has_failed = true;
                self.outage(Some(share))?;
            }
            Act::Repair { retries } => {
                self.outage(None)?;
                if retries {
                    self.steer(&["retry"])?;
                }
            }
        }
        Ok(())
    }

    /// Starts a worker that cannot run the simulator, and must leave.
    fn add_broken_worker(&mut self) -> Result<(), Violation> {
        let Setup {
            programs,
            folder,
            simulator,
            ..
        } = &self.setup;
        if let Some(command) = programs.broken_worker(folder, self.address, simulator) {
            self.started += 1;
            let name = format!("{BROKEN}-{}", self.started);
            self.clients.push(Process::start(command, folder, name)?);
        }
        Ok(())
    }

    /// Opens more connections to the page than it has places, in place of the last ones. A coordinator that is stopped
    /// accepts none beyond its backlog.
    fn annoy(&mut self) {
        let open = |_| {
            let mut stream =
                TcpStream::connect_timeout(&self.http, Duration::from_millis(300)).ok()?;
            stream.write_all(b"GET / HTTP/1.1\r\nHost:").ok()?;
            Some(stream)
        };
        self.strangers = (0..300).map_while(open).collect();
    }

    /// Begins or ends an outage of the external simulator.
    pub(crate) fn outage(&self, share: Option<u64>) -> Result<(), Violation> {
        let file = self.setup.folder.join(OUTAGE);
        match share {
            Some(share) => std::fs::write(file, share.to_string()),
            None if file.exists() => std::fs::remove_file(file),
            None => Ok(()),
        }
        .map_err(|error| Violation(error.to_string()))
    }

    /// A second coordinator must not open the store of a living one, even if that one is stopped.
    fn intrude(&mut self) -> Result<(), Violation> {
        let Some(first) = &self.coordinator else {
            return Ok(());
        };
        // A coordinator that was stopped before it locked the store has nothing to protect.
        let has_lock = first.holds_a_lock();
        let anywhere = SocketAddr::from(([127, 0, 0, 1], 0));
        let (programs, folder) = (&self.setup.programs, &self.setup.folder);
        let command = programs.coordinator(folder, INTRUDERS_ACCESS, self.serving([anywhere; 2]));
        let log = folder.join("intruder.log");
        let mut intruder = Process::start(command, folder, "intruder".to_owned())?;
        // The intruder may open the store before a coordinator that has just been started. Then
        // that one is refused instead, and the intruder ends when it is dropped.
        let status = intruder.ended_within(PATIENCE);
        drop(intruder);
        if status.is_none()
            && let Some(first) = &mut self.coordinator
            && let Ok(Some(ended)) = first.ended()
            && ended.code() == Some(STORE_LOCKED)
        {
            self.coordinator.take();
        }
        // The first coordinator may have ended, or may not have opened the store yet.
        self.look()?;
        let first = self.coordinator.as_ref();
        let is_refused = status.is_some_and(|status| status.code() == Some(STORE_LOCKED));
        if first.is_some() && has_lock && !is_refused {
            let said = std::fs::read_to_string(&log).unwrap_or_default();
            let status = status.map_or("it serves".to_owned(), |status| status.to_string());
            return Err(Violation(format!(
                "a second coordinator on the same store was not refused: {status}: {said}"
            )));
        }
        Ok(())
    }

    /// Requests the next view of the page. An answer must always be a view.
    pub(crate) fn visit(&mut self) -> Result<(), Violation> {
        if !self.serves() {
            return Ok(());
        }
        let path = format!("/api/v1/{}", VIEWS[self.visits % VIEWS.len()]);
        // The coordinator may be starting or ending.
        let Ok(answer) = http::get(self.http, LOCALHOST, &path, PATIENCE) else {
            return Ok(());
        };
        if answer.code == 200 && answer.json()["schema_version"].is_u64() {
            self.visits += 1;
            return Ok(());
        }
        Err(Violation(format!(
            "{path} is {} {}",
            answer.code, answer.body
        )))
    }

    /// Records processes that have ended by themselves.
    pub(crate) fn look(&mut self) -> Result<(), Violation> {
        let all = (0..=RELIEF).map(Who::Worker).chain([Who::Coordinator]);
        for who in all {
            if let Some(process) = self.place(who)
                && let Ok(Some(status)) = process.ended()
                && let Some(process) = self.place(who).take()
            {
                self.note_end(who, &process, status)?;
                if status.code().is_none() {
                    let process = self.spawn(who)?;
                    *self.place(who) = Some(process);
                }
            }
        }
        let (mut over, mut open) = (Vec::new(), Vec::new());
        for mut client in std::mem::take(&mut self.clients) {
            match client.ended() {
                Ok(Some(status)) => over.push((client, status)),
                _ => open.push(client),
            }
        }
        self.clients = open;
        for (client, status) in over {
            let may_be_broken = client.name.starts_with(BROKEN)
                && matches!(status.code(), Some(BROKEN_MACHINE | INTERRUPTED));
            if !may_be_broken && !matches!(status.code(), Some(FINISHED | UNREACHABLE)) {
                return Err(self.unexpected(&client.name, &status.to_string()));
            }
        }
        Ok(())
    }

    /// Records how a process ended, if that is permitted.
    fn note_end(
        &mut self,
        who: Who,
        process: &Process,
        status: ExitStatus,
    ) -> Result<(), Violation> {
        let is_expected = match (who, status.code()) {
            (Who::Coordinator, Some(FINISHED | NONE_FEASIBLE)) => {
                self.ended = Some(FINISHED);
                true
            }
            (Who::Coordinator, Some(INCOMPLETE)) => {
                self.ended = Some(INCOMPLETE);
                true
            }
            (Who::Worker(_), Some(FINISHED)) => {
                self.is_dismissed = true;
                true
            }
            (_, Some(INTERRUPTED)) => process.is_asked || self.is_drained,
            // The worker's simulator has killed the worker.
            (Who::Worker(_), None) => {
                self.setup.kills_workers && status.signal() == Some(Signal::KILL.as_raw())
            }
            // The coordinator of a finished campaign does not return.
            (Who::Worker(_), Some(UNREACHABLE)) => {
                process.is_asked || self.ended.is_some() || process.since.elapsed() > ABSENCE
            }
            _ => false,
        };
        if is_expected {
            return Ok(());
        }
        Err(self.unexpected(&process.name, &status.to_string()))
    }

    fn unexpected(&self, name: &str, status: &str) -> Violation {
        let log = std::fs::read_to_string(self.setup.folder.join(format!("{name}.log")));
        let log = log.unwrap_or_default();
        let last = log.lines().last().unwrap_or_default();
        Violation(format!("{name} ended with {status}: {last}"))
    }

    /// Whether the coordinator is running and not stopped.
    pub(crate) fn serves(&self) -> bool {
        self.coordinator
            .as_ref()
            .is_some_and(|process| !process.stopped)
    }

    /// Ends all faults, including those that were to end later.
    pub(crate) fn heal(&mut self) -> Result<(), Violation> {
        self.outage(None)?;
        self.act(Act::Continue(Who::Coordinator))?;
        let workers = if self.is_cut_off { 0..0 } else { 0..WORKERS };
        for worker in workers {
            self.proxies[worker].set(Fault::None, false);
            self.act(Act::Continue(Who::Worker(worker)))?;
        }
        self.revive()
    }

    /// Starts all processes that are not running, for example after a drain.
    pub(crate) fn revive(&mut self) -> Result<(), Violation> {
        self.act(Act::Start(Who::Coordinator))?;
        for worker in 0..WORKERS {
            self.act(Act::Start(Who::Worker(worker)))?;
        }
        Ok(())
    }

    /// Ends all workers with SIGTERM.
    pub(crate) fn end(mut self) -> Result<(), Violation> {
        for worker in 0..=RELIEF {
            self.act(Act::Terminate(Who::Worker(worker)))?;
        }
        Ok(())
    }
}
