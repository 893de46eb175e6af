//! A folder for one test, and the programs that run in it.

use std::io::Read as _;
use std::path::PathBuf;
use std::process::{Child, Command, ExitStatus, Output, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;
use tempfile::TempDir;

use crate::{PATIENCE, binary, quick_campaign};

/// A test's own folder, with helpers that run programs in it. The programs' access files are there,
/// too.
pub struct Sandbox {
    folder: TempDir,
}

impl Default for Sandbox {
    fn default() -> Self {
        Self::new()
    }
}

impl Sandbox {
    /// A new, empty folder.
    ///
    /// # Panics
    ///
    /// The folder cannot be created.
    #[must_use]
    pub fn new() -> Self {
        Self {
            folder: tempfile::tempdir().expect("a temporary folder"),
        }
    }

    /// The path of a file in the folder.
    #[must_use]
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Writes a file and returns its path.
    ///
    /// # Panics
    ///
    /// The file cannot be written.
    pub fn write(&self, name: &str, text: &str) -> PathBuf {
        let path = self.path(name);
        std::fs::write(&path, text).expect("the file can be written");
        path
    }

    /// Writes the quick campaign after `changes` (the text to replace, and its replacement).
    ///
    /// # Panics
    ///
    /// The text to replace is missing.
    pub fn campaign(&self, name: &str, changes: &[(&str, &str)]) -> PathBuf {
        self.write(name, &quick_campaign(changes))
    }

    /// Runs `coordinator` to its end.
    ///
    /// # Panics
    ///
    /// The program cannot be started.
    #[must_use]
    pub fn coordinator(&self, arguments: &[&str]) -> Output {
        self.run("coordinator", arguments)
    }

    /// Runs a program to its end.
    ///
    /// # Panics
    ///
    /// The program cannot be started.
    #[must_use]
    pub fn run(&self, program: &str, arguments: &[&str]) -> Output {
        self.run_with(program, arguments, &[])
    }

    /// Runs a program to its end with additional environment variables.
    ///
    /// # Panics
    ///
    /// The program cannot be started.
    #[must_use]
    pub fn run_with(
        &self,
        program: &str,
        arguments: &[&str],
        variables: &[(&str, &str)],
    ) -> Output {
        Command::new(binary(program))
            .args(arguments)
            .current_dir(self.folder.path())
            .env("XDG_STATE_HOME", self.folder.path())
            .env("PITCHLINE_LOG", "off")
            .envs(variables.iter().copied())
            .output()
            .expect("the program starts")
    }

    /// Starts a program, which is killed when the handle is dropped.
    ///
    /// # Panics
    ///
    /// The program cannot be started.
    #[must_use]
    pub fn start(&self, program: &str, arguments: &[&str]) -> RunningProgram {
        self.start_with(program, arguments, &[])
    }

    /// Starts a coordinator that crashes at a fail point, written as for `store::FailPoint`.
    ///
    /// # Panics
    ///
    /// The program cannot be started.
    #[must_use]
    pub fn start_dying(&self, point: &str, arguments: &[&str]) -> RunningProgram {
        let arguments = [&["--fail-point", point], arguments].concat();
        self.start("coordinator", &arguments)
    }

    /// Starts a program with additional environment variables.
    ///
    /// # Panics
    ///
    /// The program cannot be started.
    #[must_use]
    pub fn start_with(
        &self,
        program: &str,
        arguments: &[&str],
        variables: &[(&str, &str)],
    ) -> RunningProgram {
        let child = Command::new(binary(program))
            .args(arguments)
            .current_dir(self.folder.path())
            .env("XDG_STATE_HOME", self.folder.path())
            .env("PITCHLINE_LOG", "warn")
            .envs(variables.iter().copied())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the program starts");
        RunningProgram { child }
    }

    /// The campaign's status; `None` before the store exists.
    ///
    /// # Panics
    ///
    /// The status is not JSON.
    #[must_use]
    pub fn status(&self, db: &str) -> Option<Value> {
        let output = self.coordinator(&["status", "--db", db, "--json"]);
        output
            .status
            .success()
            .then(|| serde_json::from_slice(&output.stdout).expect("the status is JSON"))
    }

    /// Waits until the campaign's status satisfies `condition`, and returns the status.
    ///
    /// # Panics
    ///
    /// The condition does not hold in time.
    pub fn wait_for(&self, db: &str, what: &str, condition: impl Fn(&Value) -> bool) -> Value {
        let since = Instant::now();
        loop {
            if let Some(status) = self.status(db)
                && condition(&status)
            {
                return status;
            }
            assert!(since.elapsed() < PATIENCE, "waiting in vain for {what}");
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// Waits until a file exists, and returns its text.
    ///
    /// # Panics
    ///
    /// The file does not appear in time.
    #[must_use]
    pub fn wait_for_file(&self, name: &str) -> String {
        let since = Instant::now();
        loop {
            if let Ok(text) = std::fs::read_to_string(self.path(name)) {
                return text;
            }
            assert!(since.elapsed() < PATIENCE, "waiting in vain for {name}");
            std::thread::sleep(Duration::from_millis(20));
        }
    }
}

/// A started program.
pub struct RunningProgram {
    child: Child,
}

impl RunningProgram {
    /// Kills the program at once, as `kill -9` does.
    ///
    /// # Panics
    ///
    /// The program ended before, so that the test would be void.
    pub fn kill(mut self) {
        let ended = self.child.try_wait().expect("the process can be asked");
        assert!(
            ended.is_none(),
            "the process ended before it could be killed: {ended:?}"
        );
        self.child.kill().expect("the process can be killed");
        self.child.wait().expect("the process can be waited for");
    }

    /// Sends SIGTERM, as `kill` does.
    ///
    /// # Panics
    ///
    /// The signal cannot be sent.
    pub fn terminate(&self) {
        self.signal("TERM");
    }

    /// Sends a signal, such as `STOP`.
    ///
    /// # Panics
    ///
    /// The program has ended.
    pub fn signal(&self, name: &str) {
        let id = self.child.id().to_string();
        let status = Command::new("kill")
            .args([&format!("-{name}"), &id])
            .status()
            .expect("kill runs");
        assert!(
            status.success(),
            "the process ended before it could be sent SIG{name}"
        );
    }

    /// Waits until the program has written a line that contains `text` to standard error.
    ///
    /// # Panics
    ///
    /// The program ends before.
    pub fn wait_for_line(&mut self, text: &str) {
        let pipe = self.child.stderr.as_mut().expect("it is captured");
        let (mut line, mut byte) = (Vec::new(), [0]);
        loop {
            // Byte by byte, so that the rest is left for `finish`.
            let read = pipe.read(&mut byte).expect("standard error can be read");
            assert!(read > 0, "the process ended without having said {text:?}");
            if byte != *b"\n" {
                line.push(byte[0]);
                continue;
            }
            if String::from_utf8_lossy(&line).contains(text) {
                return;
            }
            line.clear();
        }
    }

    /// Waits for the program's end and returns its status and its standard error.
    ///
    /// # Panics
    ///
    /// The program does not end in time.
    #[must_use]
    pub fn finish(mut self) -> (ExitStatus, String) {
        // Read while the program runs: it would wait for ever once the pipe is full.
        let errors = self.child.stderr.take().map(|mut pipe| {
            std::thread::spawn(move || {
                let mut errors = String::new();
                pipe.read_to_string(&mut errors)
                    .expect("standard error is text");
                errors
            })
        });
        let since = Instant::now();
        let status = loop {
            if let Some(status) = self.child.try_wait().expect("the process can be asked") {
                break status;
            }
            assert!(since.elapsed() < PATIENCE, "the process does not end");
            std::thread::sleep(Duration::from_millis(10));
        };
        let errors = errors.map(|reader| reader.join().expect("the reader does not panic"));
        (status, errors.unwrap_or_default())
    }
}

impl Drop for RunningProgram {
    fn drop(&mut self) {
        // It fails if the program has already ended.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
