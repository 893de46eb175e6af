//! Daemons in Linux namespaces of their own: processes, mounts and network. They cannot meet those of
//! another test, and end with the test, however it ends.

use std::fs::File;
use std::io::{BufRead as _, BufReader};
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use crate::{Sandbox, programs, root, skipped};

/// Time limit for the end of a script.
const LAST_MOMENTS: Duration = Duration::from_secs(20);

/// The processes that a script of `tests/deploy` started, in namespaces of their own.
#[derive(Debug)]
pub struct IsolatedScript {
    /// `unshare`: the namespaces end with it.
    child: Child,
    /// The script, which is the first process of its namespaces.
    first: String,
    variables: Vec<(String, String)>,
}

impl IsolatedScript {
    /// Starts `tests/deploy/SCRIPT FOLDER` and waits until it says `ready`. `None`, with a message, if it says
    /// `skipped: WHY` or namespaces cannot be created.
    ///
    /// # Panics
    ///
    /// When the script fails.
    #[must_use]
    pub fn start(script: &str, folder: &Path, variables: &[(&str, &str)]) -> Option<Self> {
        std::fs::create_dir_all(folder).expect("the folder can be made");
        let log = folder.join("script.log");
        let mut child = Command::new("unshare")
            .args(["--mount", "--pid", "--net", "--fork", "--kill-child"])
            .arg("--mount-proc")
            .arg(root().join("tests/deploy").join(script))
            .arg(folder)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(File::create(&log).expect("the folder is new"))
            .spawn()
            .expect("unshare runs");
        let said = child.stdout.take().expect("it is captured");
        let mut line = String::new();
        BufReader::new(said)
            .read_line(&mut line)
            .expect("a line of text");
        let end = |mut child: Child| {
            let _ = child.kill();
            child.wait().expect("it can be waited for");
            std::fs::read_to_string(&log).expect("the log can be read")
        };
        if line == "ready\n" {
            let id = child.id();
            let children = std::fs::read_to_string(format!("/proc/{id}/task/{id}/children"));
            let first = children.expect("it runs").trim().to_owned();
            let variables = variables.iter();
            return Some(Self {
                child,
                first,
                variables: variables
                    .map(|(name, value)| ((*name).to_owned(), (*value).to_owned()))
                    .collect(),
            });
        }
        let errors = end(child);
        if let Some(why) = line.strip_prefix("skipped: ") {
            skipped(why.trim());
        } else if errors.starts_with("unshare: ") {
            skipped(&format!(
                "no namespaces can be made here: {}",
                errors.trim()
            ));
        } else {
            panic!("{script} failed: {line}{errors}");
        }
        None
    }

    /// Runs a command in the namespaces to its end, in the sandbox's folder and with the programs
    /// under test in the `PATH`.
    ///
    /// # Panics
    ///
    /// When it cannot be started.
    #[must_use]
    pub fn run(&self, sandbox: &Sandbox, command: &[&str]) -> Output {
        let path = std::env::var("PATH").expect("PATH is set");
        Command::new("nsenter")
            .args(["--target", &self.first, "--mount", "--pid", "--net"])
            .arg(format!("--wd={}", sandbox.path(".").display()))
            .arg("--")
            .args(command)
            .env("PATH", format!("{}:{path}", programs().display()))
            .envs(self.variables.iter().map(|(name, value)| (name, value)))
            .stdin(Stdio::null())
            .output()
            .expect("nsenter runs")
    }
}

impl Drop for IsolatedScript {
    fn drop(&mut self) {
        // At the end of its input a script clears what outlives its processes, such as control groups.
        drop(self.child.stdin.take());
        let since = Instant::now();
        while since.elapsed() < LAST_MOMENTS && matches!(self.child.try_wait(), Ok(None)) {
            std::thread::sleep(Duration::from_millis(20));
        }
        // The kernel ends all processes of a namespace with its first one.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// The commands of a section of `deploy/README.md`: its indented lines.
///
/// # Panics
///
/// When there is no such section, or it has no commands.
#[must_use]
pub fn documented(section: &str) -> String {
    let text = std::fs::read_to_string(root().join("deploy/README.md")).expect("it is shipped");
    let heading = format!("## {section}\n");
    let (_, rest) = text.split_once(&heading).expect("the section");
    let section = rest.split("\n## ").next().unwrap_or(rest);
    let lines = section.lines().filter_map(|line| line.strip_prefix("    "));
    let commands: String = lines.map(|line| format!("{line}\n")).collect();
    assert!(!commands.is_empty(), "{heading} has no commands");
    commands
}
