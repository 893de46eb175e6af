//! A process of an external simulator, which answers each line with a line.
//!
//! The process leads its own process group, which [`ending`](super::ending) ends as a whole, so
//! that programs started by a shell end with it. A second small process, the guard, holds the other
//! end of a pipe that only this program keeps open. If this program is killed, the pipe closes, and
//! the guard ends the group.
//!
//! Lines of the output that are not answers are skipped, up to a limit, and the first one of a
//! process is a warning.

mod words;

use std::collections::VecDeque;
use std::io::{self, ErrorKind, Read, Write as _};
use std::os::unix::process::CommandExt as _;
use std::process::{Child, ChildStderr, ChildStdin, ChildStdout, Command, ExitStatus, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::{Errno, ioctl_fionbio};
use rustix::process::{Pid, Signal};
use tracing::warn;

use super::ending::{self, AFTER_INPUT, AFTER_TERM, GUARD};
use super::fault::Fault;
use super::output::{ForeignOutput, Line, Tail, malformed, quote};

/// Maximum size of the output up to an answer, in bytes, the answer included.
const MAX_OUTPUT: usize = 16 * 1024 * 1024;
/// Interval at which a wait for an answer checks whether to stop.
const PATIENCE: Duration = Duration::from_millis(100);
/// Time without the first answer of a process after which the log says so.
const SLOW_START: Duration = Duration::from_secs(10);
/// Number of reads that empty any pipe.
const WHOLE_PIPE: usize = 16;
/// Advice for programs whose answers do not arrive.
const FLUSH: &str = "flush standard output after every line (python -u, print(…, flush=True), \
                     fflush(stdout))";

/// A running simulator.
#[derive(Debug)]
pub(super) struct Process {
    child: Child,
    guard: Child,
    group: Pid,
    /// None once the input was closed.
    input: Option<ChildStdin>,
    output: ChildStdout,
    errors: Option<ChildStderr>,
    /// Bytes read from the output that are not a whole line yet.
    pending: Vec<u8>,
    /// Whole lines that were read and not looked at yet, oldest first.
    lines: VecDeque<Vec<u8>>,
    /// Output skipped since the last answer.
    skipped: ForeignOutput,
    /// Whether a skipped line was reported.
    has_warned: bool,
    has_answered: bool,
    /// Whether the output has ended.
    is_silent: bool,
    tail: Tail,
    /// The exit status, once the process was reaped; its id may then belong to another process.
    status: Option<ExitStatus>,
    /// Set by other threads when no answer is needed any more.
    stop: Arc<AtomicBool>,
}

/// The reason for a missing answer.
enum Silence {
    Ended,
    Timeout,
    Stopped,
    TooLong,
    /// The line and its fault.
    Malformed(Vec<u8>, String),
    System(io::Error),
}

impl Process {
    /// Starts `sh -c command` with these variables of its environment. Once `stop` is set, the process is ended, and no
    /// answer is waited for.
    ///
    /// # Errors
    ///
    /// The machine has no shell, or not enough processes, memory or open files.
    pub(super) fn start(
        command: &str,
        environment: &[(String, String)],
        stop: Arc<AtomicBool>,
    ) -> Result<Self, Fault> {
        let cannot = |error: io::Error| {
            Fault::Machine(format!(
                "the shell sh cannot be started: {error}; allow more processes, memory and open \
                 files, or fewer --slots"
            ))
        };
        let mut child = Command::new("sh")
            .args(["-c", command])
            .envs(environment.iter().cloned())
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .process_group(0)
            .spawn()
            .map_err(cannot)?;
        let group = Pid::from_child(&child);
        let guard = Command::new("sh")
            .args(["-c", GUARD, "sh", &group.as_raw_nonzero().to_string()])
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            // A signal from the terminal must reach this program only, which then ends the others.
            .process_group(0)
            .spawn();
        let pipes = (child.stdin.take(), child.stdout.take(), child.stderr.take());
        let (guard, input, output, errors) = match (guard, pipes) {
            (Ok(guard), (Some(input), Some(output), Some(errors))) => {
                (guard, input, output, errors)
            }
            (guard, _) => {
                ending::signal(group, Signal::KILL);
                // An error is ignored: the process was just started.
                let _ = child.wait();
                let error = guard.err().unwrap_or_else(|| io::Error::other("no pipes"));
                return Err(cannot(error));
            }
        };
        let process = Self {
            child,
            guard,
            group,
            input: Some(input),
            output,
            errors: Some(errors),
            pending: Vec::new(),
            lines: VecDeque::new(),
            skipped: ForeignOutput::default(),
            has_warned: false,
            has_answered: false,
            is_silent: false,
            tail: Tail::default(),
            status: None,
            stop,
        };
        // From here on, dropping the process ends it.
        process
            .input
            .as_ref()
            .map_or(Ok(()), |input| ioctl_fionbio(input, true))
            .and_then(|()| ioctl_fionbio(&process.output, true))
            .and_then(|()| {
                process
                    .errors
                    .as_ref()
                    .map_or(Ok(()), |e| ioctl_fionbio(e, true))
            })
            .map_err(|error| cannot(error.into()))?;
        Ok(process)
    }

    /// Whether the process has ended, or at least its output.
    pub(super) fn has_ended(&self) -> bool {
        self.is_silent || ending::has_ended(self.group)
    }

    /// Sends a line and waits for the answer, which `read` recognises. Other lines, and lines that were written before
    /// the question, are skipped. After an error, the process must not be used again. If `line` is empty, the answer is
    /// the end of a command.
    ///
    /// # Errors
    ///
    /// A sentence with the end of the process's standard error.
    pub(super) fn ask<T>(
        &mut self,
        line: &str,
        timeout: Duration,
        read: &dyn Fn(&[u8]) -> Line<T>,
    ) -> Result<T, Fault> {
        self.exchange(line, timeout, read).map_err(|silence| {
            let is_machine = matches!(silence, Silence::System(_));
            let why = match silence {
                Silence::Ended => self.last_words(),
                Silence::Timeout if line.is_empty() => {
                    format!(
                        "did not end within {} s and was ended",
                        timeout.as_secs_f64()
                    )
                }
                Silence::Timeout => self.late_words(timeout, read),
                Silence::Stopped => "was ended because the worker stops".to_owned(),
                Silence::TooLong => format!(
                    "wrote more than {MAX_OUTPUT} bytes to its standard output without an answer"
                ),
                Silence::Malformed(line, reason) => malformed(&line, &reason),
                Silence::System(error) => {
                    format!("cannot be read or written: {error}; allow more memory and open files")
                }
            };
            // None unless the process has ended by itself.
            let status = self.status.and_then(|status| status.code());
            let skipped = self.skipped.note();
            let text = self.obituary(&format!("{why}{skipped}"), line);
            match status {
                _ if is_machine => {
                    Fault::Machine(text.lines().next().unwrap_or_default().to_owned())
                }
                Some(status @ (126 | 127)) => Fault::not_run(status, text),
                Some(0) if self.has_answered && self.pending.is_empty() => Fault::Left(text),
                _ => Fault::Program(text),
            }
        })
    }

    fn exchange<T>(
        &mut self,
        line: &str,
        timeout: Duration,
        read: &dyn Fn(&[u8]) -> Line<T>,
    ) -> Result<T, Silence> {
        self.skipped = ForeignOutput::default();
        if !line.is_empty() {
            // The end of the process shows below.
            let _ = self.read_lines();
            while let Some(stale) = self.lines.pop_front() {
                self.skip(&stale);
            }
        }
        let began = Instant::now();
        let deadline = began + timeout;
        let mut has_complained = self.has_answered;
        let mut unsent = line.as_bytes();
        loop {
            // Writing first saves a call in the usual case of a pipe with room.
            while let Some(input) = &mut self.input
                && !unsent.is_empty()
            {
                match input.write(unsent) {
                    Ok(sent) => unsent = &unsent[sent..],
                    Err(error) if error.kind() == ErrorKind::Interrupted => {}
                    Err(error) if error.kind() == ErrorKind::WouldBlock => break,
                    // The output shows whether the process has ended.
                    Err(_) => unsent = &[],
                }
            }
            let left = deadline.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Err(Silence::Timeout);
            }
            if self.stop.load(Ordering::Relaxed) {
                return Err(Silence::Stopped);
            }
            if began.elapsed() > SLOW_START && !has_complained && !line.is_empty() {
                has_complained = true;
                warn!(
                    limit_s = timeout.as_secs_f64(),
                    "the simulator has not answered its first request for {} s: if it has answered, \
                     it must {FLUSH}",
                    SLOW_START.as_secs()
                );
            }
            let [output, errors] = self.wait(!unsent.is_empty(), left.min(PATIENCE))?;
            // All output of a process that has ended is in the pipe. A program that it has started
            // may keep the pipe open.
            let has_ended = ending::has_ended(self.group);
            if errors {
                self.drain_errors();
            }
            if output || has_ended {
                let rounds = if has_ended { WHOLE_PIPE } else { 1 };
                let end = (0..rounds).find_map(|_| self.read_lines().err());
                let end = end.or_else(|| has_ended.then_some(Silence::Ended));
                if let Some(answer) = self.answer(read, end.is_some())? {
                    return Ok(answer);
                }
                if let Some(end) = end {
                    return Err(end);
                }
            }
        }
    }

    /// Looks for the answer among the lines that were read. At the end of the output the last line
    /// may lack its newline.
    fn answer<T>(
        &mut self,
        read: &dyn Fn(&[u8]) -> Line<T>,
        is_end: bool,
    ) -> Result<Option<T>, Silence> {
        while let Some(line) = self.lines.pop_front() {
            match read(&line) {
                Line::Answer(answer, is_alone) => {
                    if !is_alone {
                        self.skip(&line);
                    }
                    self.has_answered = true;
                    return Ok(Some(answer));
                }
                Line::Malformed(reason) => return Err(Silence::Malformed(line, reason)),
                Line::Foreign => self.skip(&line),
                Line::Nothing => {}
            }
            if self.skipped.bytes > MAX_OUTPUT {
                return Err(Silence::TooLong);
            }
        }
        if is_end
            && !self.pending.is_empty()
            && let Line::Answer(answer, _) = read(&self.pending)
        {
            return Ok(Some(answer));
        }
        Ok(None)
    }

    /// Counts a line that is not an answer. The first one of a process is reported.
    fn skip(&mut self, line: &[u8]) {
        let line = line.trim_ascii();
        if line.is_empty() {
            return;
        }
        self.skipped.lines += 1;
        self.skipped.bytes += line.len();
        self.skipped.last = quote(line);
        if !std::mem::replace(&mut self.has_warned, true) {
            warn!(
                line = self.skipped.last,
                "a line of the simulator's standard output without the \"id\" of the request is not an answer and is \
                 skipped, as others will be: write messages to standard error"
            );
        }
    }

    /// Waits until something can be read (or written, if `writing`). Returns whether the output and
    /// the standard error can be read.
    fn wait(&self, writing: bool, left: Duration) -> Result<[bool; 2], Silence> {
        let mut files = vec![PollFd::new(&self.output, PollFlags::IN)];
        if let Some(errors) = &self.errors {
            files.push(PollFd::new(errors, PollFlags::IN));
        }
        if let Some(input) = &self.input
            && writing
        {
            files.push(PollFd::new(input, PollFlags::OUT));
        }
        let left = Timespec {
            tv_sec: i64::try_from(left.as_secs()).unwrap_or(i64::MAX),
            tv_nsec: left.subsec_nanos().into(),
        };
        match poll(&mut files, Some(&left)) {
            Ok(_) => {}
            Err(Errno::INTR) => return Ok([false; 2]),
            Err(error) => return Err(Silence::System(error.into())),
        }
        let ready = |index: usize| !files[index].revents().is_empty();
        Ok([ready(0), self.errors.is_some() && ready(1)])
    }

    /// Reads the output that is available, as much as a pipe holds, and cuts it into lines.
    fn read_lines(&mut self) -> Result<(), Silence> {
        let mut buffer = [0_u8; 4096];
        for _ in 0..64 {
            match self.output.read(&mut buffer) {
                Ok(0) => {
                    self.is_silent = true;
                    return Err(Silence::Ended);
                }
                Ok(count) => {
                    let mut parts = buffer[..count].split(|byte| *byte == b'\n');
                    self.pending.extend(parts.next().unwrap_or_default());
                    for part in parts {
                        let line = std::mem::replace(&mut self.pending, part.to_vec());
                        self.lines.push_back(line);
                    }
                    if self.pending.len() > MAX_OUTPUT {
                        return Err(Silence::TooLong);
                    }
                }
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) if error.kind() == ErrorKind::WouldBlock => break,
                Err(error) => return Err(Silence::System(error)),
            }
        }
        Ok(())
    }

    /// Reads the available part of the standard error.
    fn drain_errors(&mut self) {
        let mut buffer = [0_u8; 4096];
        // A process that floods its standard error must not keep its answer from being read.
        for _ in 0..64 {
            let Some(errors) = &mut self.errors else {
                return;
            };
            match errors.read(&mut buffer) {
                Ok(0) => self.errors = None,
                Ok(count) => self.tail.push(&buffer[..count]),
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) if error.kind() == ErrorKind::WouldBlock => return,
                Err(_) => self.errors = None,
            }
        }
    }

    /// Ends the group, and waits for its leader.
    fn end(&mut self) -> io::Result<ExitStatus> {
        if let Some(status) = self.status {
            return Ok(status);
        }
        self.input = None;
        for (patience, signal) in [(AFTER_INPUT, Signal::TERM), (AFTER_TERM, Signal::KILL)] {
            if self.is_gone_within(patience) {
                break;
            }
            ending::signal(self.group, signal);
        }
        let status = self.child.wait()?;
        self.status = Some(status);
        Ok(status)
    }

    /// Waits for the end of the group. Its output is read meanwhile, since a full pipe would hold
    /// it up.
    fn is_gone_within(&mut self, patience: Duration) -> bool {
        let since = Instant::now();
        let mut pause = Duration::from_millis(1);
        loop {
            if ending::has_ended(self.group) && !ending::has_members(self.group) {
                return true;
            }
            if since.elapsed() > patience {
                return false;
            }
            std::thread::sleep(pause);
            pause = (2 * pause).min(Duration::from_millis(20));
            let _ = self.read_lines();
            self.lines.clear();
            self.drain_errors();
        }
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.end();
        // The guard is the last to go: the group ends even if this program is killed meanwhile. It
        // ends before this function does, so that it kills no group whose id was reused.
        let _ = self.guard.kill();
        let _ = self.guard.wait();
    }
}
