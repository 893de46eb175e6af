//! A process of an external simulator, which answers each line with a line.
//!
//! The process leads its own process group, which is killed as a whole, so that programs started by
//! a shell end with it. A second small process, the guard, holds the other end of a pipe that only
//! this program keeps open. If this program is killed, the pipe closes, and the guard kills the
//! group.

use std::collections::VecDeque;
use std::io::{self, ErrorKind, Read, Write as _};
use std::os::unix::process::CommandExt as _;
use std::process::{Child, ChildStderr, ChildStdin, ChildStdout, Command, ExitStatus, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::{Errno, ioctl_fionbio};
use rustix::process::{Pid, Signal, WaitId, WaitIdOptions, kill_process_group, waitid};

/// Length of the end of the standard error that is kept, in bytes.
const TAIL: usize = 16 * 1024;
/// Maximum length of an answer, in bytes.
const MAX_ANSWER: usize = 1024 * 1024;
/// Maximum length of a quoted request or answer, in bytes.
const QUOTE: usize = 1000;
/// Interval at which a wait for an answer checks whether to stop.
const PATIENCE: Duration = Duration::from_millis(100);
/// Time for a process that closed its output to end by itself.
const LAST_WORDS: Duration = Duration::from_millis(500);
/// The guard's command: wait until its input ends, then kill the group.
const GUARD: &str = r#"read -r _; kill -s KILL -- "-$1""#;

/// A running simulator.
#[derive(Debug)]
pub(super) struct Process {
    child: Child,
    guard: Child,
    group: Pid,
    input: ChildStdin,
    output: ChildStdout,
    errors: Option<ChildStderr>,
    /// Bytes read from the output that are not part of an answer yet.
    pending: Vec<u8>,
    tail: Tail,
    /// Whether the process was reaped; its id may then belong to another process.
    reaped: bool,
    /// Set by other threads when no answer is needed any more.
    stop: Arc<AtomicBool>,
}

/// The end of what a process wrote to its standard error.
#[derive(Debug, Default)]
struct Tail {
    bytes: VecDeque<u8>,
    cut: bool,
}

/// The reason for a missing answer.
enum Silence {
    Ended,
    Timeout,
    Stopped,
    TooLong,
    System(io::Error),
}

impl Process {
    /// Starts `sh -c command`. Once `stop` is set, the process is ended instead of waited for.
    ///
    /// # Errors
    ///
    /// A sentence.
    pub(super) fn start(command: &str, stop: Arc<AtomicBool>) -> Result<Self, String> {
        let cannot = |error: io::Error| format!("the simulator cannot be started: {error}");
        let mut child = Command::new("sh")
            .args(["-c", command])
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
                kill(group);
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
            input,
            output,
            errors: Some(errors),
            pending: Vec::new(),
            tail: Tail::default(),
            reaped: false,
            stop,
        };
        // From here on, dropping the process ends it.
        ioctl_fionbio(&process.input, true)
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

    /// Whether the process has ended.
    pub(super) fn has_ended(&self) -> bool {
        let options = WaitIdOptions::EXITED | WaitIdOptions::NOHANG | WaitIdOptions::NOWAIT;
        // The process is not reaped: its id must not name another process while the group may be
        // killed.
        !matches!(waitid(WaitId::Pid(self.group), options), Ok(None))
    }

    /// Sends a line and waits for the answer. After an error, the process must not be used again.
    ///
    /// # Errors
    ///
    /// A sentence with the end of the process's standard error.
    pub(super) fn ask(&mut self, line: &str, timeout: Duration) -> Result<Vec<u8>, String> {
        if !self.pending.is_empty() {
            let said = std::mem::take(&mut self.pending);
            let why = format!("said what nobody had asked for: {}", quote(&said));
            return Err(self.obituary(&why, line));
        }
        self.exchange(line, timeout).map_err(|silence| {
            let why = match silence {
                Silence::Ended => self.last_words(),
                Silence::Timeout => format!(
                    "gave no answer within {} s and was killed",
                    timeout.as_secs_f64()
                ),
                Silence::Stopped => "was ended because the worker stops".to_owned(),
                Silence::TooLong => format!("gave an answer of more than {MAX_ANSWER} bytes"),
                Silence::System(error) => format!("cannot be talked to: {error}"),
            };
            self.obituary(&why, line)
        })
    }

    /// Ends the process, whose `answer` is malformed, and returns the error.
    pub(super) fn refute(&mut self, answer: &[u8], reason: &str, line: &str) -> String {
        let why = format!("answered with nonsense ({reason}): {}", quote(answer));
        self.obituary(&why, line)
    }

    fn exchange(&mut self, line: &str, timeout: Duration) -> Result<Vec<u8>, Silence> {
        let deadline = Instant::now() + timeout;
        let mut unsent = line.as_bytes();
        loop {
            // Writing first saves a call in the usual case of a pipe with room.
            while !unsent.is_empty() {
                match self.input.write(unsent) {
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
            let [output, errors] = self.wait(!unsent.is_empty(), left.min(PATIENCE))?;
            if errors {
                self.drain_errors();
            }
            if output && let Some(answer) = self.read_answer()? {
                return Ok(answer);
            }
        }
    }

    /// Waits until something can be read (or written, if `writing`). Returns whether the output and
    /// the standard error can be read.
    fn wait(&self, writing: bool, left: Duration) -> Result<[bool; 2], Silence> {
        let mut files = vec![PollFd::new(&self.output, PollFlags::IN)];
        if let Some(errors) = &self.errors {
            files.push(PollFd::new(errors, PollFlags::IN));
        }
        if writing {
            files.push(PollFd::new(&self.input, PollFlags::OUT));
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

    /// Returns the next line of the output once it is complete.
    fn read_answer(&mut self) -> Result<Option<Vec<u8>>, Silence> {
        let mut buffer = [0_u8; 4096];
        loop {
            match self.output.read(&mut buffer) {
                Ok(0) => return Err(Silence::Ended),
                Ok(count) => {
                    self.pending.extend_from_slice(&buffer[..count]);
                    if let Some(end) = buffer[..count].iter().position(|byte| *byte == b'\n') {
                        let rest = self.pending.split_off(self.pending.len() - count + end + 1);
                        let mut answer = std::mem::replace(&mut self.pending, rest);
                        answer.pop();
                        return Ok(Some(answer));
                    }
                    if self.pending.len() > MAX_ANSWER {
                        return Err(Silence::TooLong);
                    }
                }
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) if error.kind() == ErrorKind::WouldBlock => return Ok(None),
                Err(error) => return Err(Silence::System(error)),
            }
        }
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

    /// Describes the end of a process that closed its output.
    fn last_words(&mut self) -> String {
        let since = Instant::now();
        while !self.has_ended() {
            if since.elapsed() > LAST_WORDS {
                return "closed its standard output and was killed".to_owned();
            }
            std::thread::sleep(Duration::from_millis(2));
        }
        match self.end() {
            Ok(status) => {
                let unfinished = if self.pending.is_empty() {
                    String::new()
                } else {
                    format!(" in the middle of the answer {}", quote(&self.pending))
                };
                format!("ended ({status}) before it had answered{unfinished}")
            }
            Err(error) => format!("ended before it had answered ({error})"),
        }
    }

    /// Kills the rest of the group, and waits for its leader.
    fn end(&mut self) -> io::Result<ExitStatus> {
        if !self.reaped {
            kill(self.group);
            self.reaped = true;
        }
        self.child.wait()
    }

    /// Ends the group. Returns the reason, the request and the end of the standard error.
    pub(super) fn obituary(&mut self, why: &str, line: &str) -> String {
        // The exit status is part of `why` if it matters.
        let _ = self.end();
        // All output is in the pipe now; 16 rounds of the drain empty any pipe.
        for _ in 0..16 {
            self.drain_errors();
        }
        let asked = quote(line.trim_end().as_bytes());
        let mut text = format!("the simulator {why}\nasked: {asked}");
        if self.tail.bytes.is_empty() {
            text += "\nits standard error was empty";
        } else {
            text += "\nthe end of its standard error:\n";
            text += self.tail.text().trim_end();
        }
        text
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // The guard ends before the process is reaped: it must not kill a group whose id was
        // reused.
        let _ = self.guard.kill();
        let _ = self.guard.wait();
        let _ = self.end();
    }
}

fn kill(group: Pid) {
    // The group may have ended already.
    let _ = kill_process_group(group, Signal::KILL);
}

impl Tail {
    fn push(&mut self, bytes: &[u8]) {
        self.bytes.extend(bytes);
        if self.bytes.len() > TAIL {
            self.cut = true;
            self.bytes.drain(..self.bytes.len() - TAIL);
        }
    }

    fn text(&self) -> String {
        let (front, back) = self.bytes.as_slices();
        let text = [front, back].concat();
        let text = String::from_utf8_lossy(&text);
        if self.cut {
            format!("… {text}")
        } else {
            text.into_owned()
        }
    }
}

/// Bytes of another program as a short text in one line.
fn quote(bytes: &[u8]) -> String {
    let shown = &bytes[..bytes.len().min(QUOTE)];
    let text: String = String::from_utf8_lossy(shown)
        .chars()
        .map(|c| if c.is_control() { ' ' } else { c })
        .collect();
    if shown.len() < bytes.len() {
        format!("{text} …")
    } else {
        text
    }
}
