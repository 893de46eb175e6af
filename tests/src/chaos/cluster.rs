//! A coordinator and its workers, as processes that can be hurt.

use std::fs::File;
use std::net::SocketAddr;
use std::os::unix::process::ExitStatusExt as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, kill_process};

use super::Violation;
use super::plan::{Act, WORKERS, Who};
use super::proxy::{Fault, Proxy};
use crate::free_address;

/// "The same command continues", and "no coordinator answers".
const EXPECTED_OF_COORDINATORS: &[i32] = &[0, 14];
const EXPECTED_OF_WORKERS: &[i32] = &[0, 11, 14];
/// The store is open elsewhere.
const STORE_LOCKED: i32 = 9;
/// Longer than a well-behaved process takes to end when asked to.
const FAREWELL: Duration = Duration::from_secs(20);

/// Longer than a coordinator takes to be refused.
const PATIENCE: Duration = Duration::from_secs(10);

struct Process {
    child: Child,
    name: String,
    stopped: bool,
}

impl Process {
    fn signal(&self, signal: Signal) {
        let id = i32::try_from(self.child.id()).ok().and_then(Pid::from_raw);
        if let Some(id) = id {
            // It has not been waited for, so the id is still its own.
            let _ = kill_process(id, signal);
        }
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// The processes of a round.
pub(crate) struct Cluster {
    folder: PathBuf,
    programs: PathBuf,
    address: SocketAddr,
    proxies: Vec<Proxy>,
    coordinator: Option<Process>,
    workers: Vec<Option<Process>>,
    started: usize,
    /// Whether a coordinator ended by itself and in good order.
    pub(crate) finished: bool,
}

impl Cluster {
    pub(crate) fn start(folder: &Path, programs: &Path) -> Result<Self, Violation> {
        let address = free_address();
        let proxies: Result<Vec<Proxy>, _> = (0..WORKERS).map(|_| Proxy::start(address)).collect();
        let mut cluster = Self {
            folder: folder.to_owned(),
            programs: programs.to_owned(),
            address,
            proxies: proxies.map_err(|error| Violation(format!("no proxy: {error}")))?,
            coordinator: None,
            workers: (0..WORKERS).map(|_| None).collect(),
            started: 0,
            finished: false,
        };
        cluster.act(Act::Start(Who::Coordinator))?;
        for worker in 0..WORKERS {
            cluster.act(Act::Start(Who::Worker(worker)))?;
        }
        Ok(cluster)
    }

    fn command(&self, program: &str) -> Command {
        let mut command = Command::new(self.programs.join(program));
        command
            .current_dir(&self.folder)
            .env("PITCHLINE_LOG", "info");
        command
    }

    fn spawn(&mut self, who: Who) -> Result<Process, Violation> {
        self.started += 1;
        let (name, mut command) = match who {
            Who::Coordinator => {
                let mut command = self.command("coordinator");
                command.args([
                    "serve",
                    "../campaign.toml",
                    "--db",
                    "c.db",
                    "--out",
                    "report",
                ]);
                command.args(["--listen", &self.address.to_string(), "--lease", "5"]);
                (format!("coordinator-{}", self.started), command)
            }
            Who::Worker(worker) => {
                let mut command = self.command("worker");
                let url = format!("http://{}", self.proxies[worker].address());
                command.args(["--connect", &url, "--slots", "1", "--grace", "2"]);
                (format!("worker-{worker}-{}", self.started), command)
            }
        };
        let log = File::create(self.folder.join(format!("{name}.log")))
            .map_err(|error| Violation(format!("no log: {error}")))?;
        let child = command
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(log)
            .spawn();
        Ok(Process {
            child: child.map_err(|error| Violation(format!("{name} does not start: {error}")))?,
            name,
            stopped: false,
        })
    }

    fn place(&mut self, who: Who) -> &mut Option<Process> {
        match who {
            Who::Coordinator => &mut self.coordinator,
            Who::Worker(worker) => &mut self.workers[worker],
        }
    }

    /// Does something to the cluster. What makes no sense just now, such as killing what is not
    /// running, is left out.
    pub(crate) fn act(&mut self, act: Act) -> Result<(), Violation> {
        self.look()?;
        match act {
            Act::Start(who) => {
                let over = self.finished && who == Who::Coordinator;
                if self.place(who).is_none() && !over {
                    let process = self.spawn(who)?;
                    *self.place(who) = Some(process);
                }
            }
            Act::Kill(who) => {
                // Dropped is killed.
                self.place(who).take();
            }
            Act::Terminate(who) => {
                if let Some(mut process) = self.place(who).take() {
                    process.signal(Signal::TERM);
                    process.signal(Signal::CONT);
                    let status = wait(&mut process)?;
                    // One that has just been started knows no better than to end at once.
                    if status.signal() != Some(Signal::TERM.as_raw()) {
                        self.ended(who, &process.name, status)?;
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
        }
        Ok(())
    }

    /// A second coordinator must not get hold of the store of one that lives, asleep or not.
    fn intrude(&mut self) -> Result<(), Violation> {
        let Some(first) = &self.coordinator else {
            return Ok(());
        };
        // One that was stopped before it got hold of the store has nothing to defend.
        let has_lock = holds_a_lock(first.child.id());
        let mut command = self.command("coordinator");
        command.args([
            "serve",
            "../campaign.toml",
            "--db",
            "c.db",
            "--listen",
            "127.0.0.1:0",
        ]);
        let log = self.folder.join("intruder.log");
        let said = File::create(&log).map_err(|error| Violation(format!("no log: {error}")))?;
        let child = command
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(said)
            .spawn();
        let mut intruder = Process {
            child: child.map_err(|error| Violation(format!("no second one: {error}")))?,
            name: "intruder".to_owned(),
            stopped: false,
        };
        // One that opens the store before the first, which has just been started, serves: the first
        // is then refused in its place, and this one ends when it is dropped.
        let status = ended_within(&mut intruder, PATIENCE);
        drop(intruder);
        if status.is_none()
            && let Some(first) = &mut self.coordinator
            && let Ok(Some(ended)) = first.child.try_wait()
            && ended.code() == Some(STORE_LOCKED)
        {
            self.coordinator.take();
        }
        // The first one may have ended, or not have got as far as opening the store.
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

    /// Notices processes that have ended by themselves.
    pub(crate) fn look(&mut self) -> Result<(), Violation> {
        let all = (0..WORKERS).map(Who::Worker).chain([Who::Coordinator]);
        for who in all {
            if let Some(process) = self.place(who)
                && let Ok(Some(status)) = process.child.try_wait()
            {
                let name = process.name.clone();
                self.place(who).take();
                self.ended(who, &name, status)?;
            }
        }
        Ok(())
    }

    fn ended(&mut self, who: Who, name: &str, status: ExitStatus) -> Result<(), Violation> {
        let expected = match who {
            Who::Coordinator => EXPECTED_OF_COORDINATORS,
            Who::Worker(_) => EXPECTED_OF_WORKERS,
        };
        if who == Who::Coordinator && status.code() == Some(0) {
            self.finished = true;
        }
        if status.code().is_some_and(|code| expected.contains(&code)) {
            return Ok(());
        }
        let log = std::fs::read_to_string(self.folder.join(format!("{name}.log")));
        let log = log.unwrap_or_default();
        let last = log.lines().last().unwrap_or_default();
        Err(Violation(format!("{name} ended with {status}: {last}")))
    }

    /// Whether the coordinator runs.
    pub(crate) fn serves(&self) -> bool {
        self.coordinator
            .as_ref()
            .is_some_and(|process| !process.stopped)
    }

    /// Repairs everything: whatever was planned to be repaired later.
    pub(crate) fn heal(&mut self) -> Result<(), Violation> {
        let all = (0..WORKERS).map(Who::Worker).chain([Who::Coordinator]);
        for who in all {
            self.act(Act::Continue(who))?;
            self.act(Act::Start(who))?;
            if let Who::Worker(worker) = who {
                let fault = Fault::None;
                self.act(Act::Network {
                    worker,
                    fault,
                    cut: false,
                })?;
            }
        }
        Ok(())
    }

    /// Sends everybody home, in good order.
    pub(crate) fn end(mut self) -> Result<(), Violation> {
        for worker in 0..WORKERS {
            self.act(Act::Terminate(Who::Worker(worker)))?;
        }
        Ok(())
    }
}

/// Whether a process holds a lock of any file.
fn holds_a_lock(id: u32) -> bool {
    // As in "1: FLOCK  ADVISORY  WRITE 4711 08:02:1234 0 EOF"; one that waits has an arrow.
    let locks = std::fs::read_to_string("/proc/locks").unwrap_or_default();
    let is_its = |line: &str| {
        let fields: Vec<&str> = line.split_whitespace().collect();
        fields.get(1) != Some(&"->") && fields.get(4) == Some(&id.to_string().as_str())
    };
    locks.lines().any(is_its)
}

fn ended_within(process: &mut Process, patience: Duration) -> Option<ExitStatus> {
    let since = Instant::now();
    while since.elapsed() < patience {
        if let Ok(Some(status)) = process.child.try_wait() {
            return Some(status);
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    None
}

fn wait(process: &mut Process) -> Result<ExitStatus, Violation> {
    if let Some(status) = ended_within(process, FAREWELL) {
        return Ok(status);
    }
    let seconds = FAREWELL.as_secs();
    let name = &process.name;
    Err(Violation(format!(
        "{name} did not end within {seconds} s of SIGTERM"
    )))
}
