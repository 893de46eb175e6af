//! The programs under test, with one function for each command that starts them.

use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

use super::Violation;
use crate::{python, root};

/// Exit code: the store is damaged.
const UNUSABLE_STORE: i32 = 8;
/// Exit code: the file is no store.
const NOT_A_STORE: i32 = 7;
/// Exit code: the campaign is finished.
pub(crate) const FINISHED: i32 = 0;
/// Exit code: the campaign is finished, and no optimum keeps every limit.
pub(crate) const NONE_FEASIBLE: i32 = 16;
/// Exit code: the campaign is finished except for quarantined jobs, or parts lack results.
pub(crate) const INCOMPLETE: i32 = 13;
/// The store of a round.
pub(crate) const DB: &str = "c.db";
/// The access file of a round's coordinator.
pub(crate) const ACCESS: &str = "c.access";

/// The arguments of a coordinator.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ServeArguments<'a> {
    /// The campaign file.
    pub(crate) file: &'a Path,
    /// The address to listen on.
    pub(crate) listen: SocketAddr,
    /// The address of its page.
    pub(crate) http: SocketAddr,
    /// Whether the coordinator keeps serving when the campaign is finished.
    pub(crate) stays: bool,
    /// Whether failures that are results are computed again.
    pub(crate) retries_failed: bool,
}

/// A file in the folder of a round that says for which share of its designs the external simulator fails.
pub(crate) const OUTAGE: &str = "outage";

/// The name of the simulator of a campaign with a direct search.
pub(crate) const DIRECT: &str = "ishigami.py";

/// The name of the simulator that reads `beam.in` and writes `beam.out`.
pub(crate) const BEAM: &str = "beam";

/// The folders of the programs and of the external simulators.
#[derive(Debug, Clone)]
pub(crate) struct Programs {
    folder: PathBuf,
    simulators: PathBuf,
}

impl Programs {
    /// Writes the external simulators to a folder within `soak`.
    pub(crate) fn new(folder: &Path, soak: &Path) -> Result<Self, Violation> {
        let simulators = soak.join("simulators");
        let copied = std::fs::create_dir(&simulators).and_then(|()| {
            for (example, name) in [("external", "simulator.py"), ("ishigami", DIRECT)] {
                let example = root().join(format!("campaigns/{example}/simulator.py"));
                std::fs::copy(example, simulators.join(name))?;
            }
            let beam = |name: &str| root().join("campaigns/cantilever").join(name);
            std::fs::copy(beam("beam.in"), simulators.join("beam.in"))?;
            let mut compile = Command::new("cc");
            compile.arg("-O2").arg("-o").arg(simulators.join(BEAM));
            let compiled = compile.arg(beam("beam.c")).arg("-lm").status()?;
            if !compiled.success() {
                return Err(std::io::Error::other("cc does not compile beam.c"));
            }
            let written = [
                ("unreliable.py", include_str!("unreliable.py")),
                ("outage.py", include_str!("outage.py")),
            ];
            let mut written = written.into_iter();
            written.try_for_each(|(name, text)| std::fs::write(simulators.join(name), text))
        });
        copied.map_err(|error| Violation(format!("no external simulator: {error}")))?;
        Ok(Self {
            folder: folder.to_owned(),
            simulators,
        })
    }

    /// The command-line arguments for an external simulator.
    pub(crate) fn simulator(&self, name: &str, arguments: &str) -> Vec<String> {
        let path = self.simulators.join(name).display().to_string();
        let template = format!("{path}.in");
        let words = match name {
            BEAM => [
                "--exec",
                &path,
                "--template",
                &template,
                "--result",
                "beam.out",
            ]
            .to_vec(),
            _ => {
                let exec = python(&self.simulators.join(name));
                return vec!["--exec".to_owned(), format!("{exec} {arguments}")];
            }
        };
        words.into_iter().map(str::to_owned).collect()
    }

    /// Like [`simulator`](Self::simulator), with outages of the share that the file [`OUTAGE`] in the round's
    /// folder names. A program that reads files fails for all designs.
    pub(crate) fn with_outages(
        &self,
        folder: &Path,
        name: &str,
        arguments: &str,
        seed: &str,
    ) -> Vec<String> {
        let mut words = self.simulator(name, arguments);
        let program = &mut words[1];
        let proxy = python(&self.simulators.join("outage.py"));
        *program = match name {
            BEAM => {
                let outage = folder.join(OUTAGE);
                format!("test ! -e {} || exit 7; exec {program}", outage.display())
            }
            _ => {
                let program = program.trim_start_matches("exec ");
                format!("{proxy} {seed} {program}")
            }
        };
        words
    }

    fn command(&self, program: &str, folder: &Path, log: &str) -> Command {
        let mut command = Command::new(self.folder.join(program));
        command.current_dir(folder).env("PITCHLINE_LOG", log);
        command
    }

    /// The command of a coordinator that serves workers.
    pub(crate) fn coordinator(
        &self,
        folder: &Path,
        access: &str,
        serving: ServeArguments<'_>,
    ) -> Command {
        // Stale results are logged at this level.
        let mut command = self.command("coordinator", folder, "info,runner=debug");
        command.arg("serve").arg(serving.file);
        command.args(["--db", DB, "--out", "report", "--lease", "3"]);
        command.args(["--access", access, "--listen", &serving.listen.to_string()]);
        command.args(["--http", &serving.http.to_string()]);
        if serving.stays {
            command.arg("--keep-serving");
        }
        if serving.retries_failed {
            command.arg("--retry-failed");
        }
        command
    }

    /// The command of a worker with these arguments for its simulator.
    pub(crate) fn worker(
        &self,
        folder: &Path,
        address: SocketAddr,
        slots: u32,
        simulator: &[String],
    ) -> Command {
        let mut command = self.command("worker", folder, "info");
        command.args(["--access", ACCESS, "--connect"]);
        command.arg(address.to_string());
        command.args(["--slots", &slots.to_string(), "--grace", "2"]);
        // Notes of crashed workers and undelivered results stay in the round's folder.
        command.args(["--undelivered", "undelivered"]);
        command.args(simulator);
        command
    }

    /// The command of a worker that has neither the simulator nor a folder for its runs; `None` for the built-in
    /// simulator.
    pub(crate) fn broken_worker(
        &self,
        folder: &Path,
        address: SocketAddr,
        simulator: &[String],
    ) -> Option<Command> {
        let mut simulator = simulator.to_vec();
        let has_files = simulator.iter().any(|word| word == "--template");
        let program = simulator.get_mut(1)?;
        if !has_files {
            *program = "/nonexistent/simulator".to_owned();
        }
        let mut command = self.worker(folder, address, 1, &simulator);
        command.env("TMPDIR", "/nonexistent");
        Some(command)
    }

    /// The status of a store with its check; `None` if the check finds damage.
    pub(crate) fn check(&self, folder: &Path, db: &str) -> Result<Option<Value>, Violation> {
        let mut command = self.command("coordinator", folder, "off");
        command.args(["status", "--db", db, "--check", "--json"]);
        let output = command
            .output()
            .map_err(|error| Violation(error.to_string()))?;
        match output.status.code() {
            Some(0) => serde_json::from_slice(&output.stdout)
                .map(Some)
                .map_err(|error| Violation(format!("no JSON: {error}"))),
            Some(UNUSABLE_STORE | NOT_A_STORE) => Ok(None),
            _ => Err(Violation(format!(
                "{command:?} ended with {}: {}",
                output.status,
                String::from_utf8_lossy(&output.stderr)
            ))),
        }
    }

    /// The command that queries or steers a coordinator.
    pub(crate) fn client(&self, folder: &Path, address: SocketAddr, words: &[&str]) -> Command {
        let mut command = self.command("coordinator", folder, "off");
        command.args(words);
        command.args(["--access", ACCESS, "--connect"]);
        command.arg(address.to_string());
        command
    }

    /// Runs a campaign to its end on this machine alone.
    pub(crate) fn run_alone(
        &self,
        folder: &Path,
        file: &Path,
        db: &str,
        simulator: Option<&str>,
    ) -> Result<(), Violation> {
        let simulator = simulator.map_or_else(Vec::new, |name| self.simulator(name, ""));
        let command = self.alone(folder, file, db, &simulator);
        ended_with(command, &[FINISHED, NONE_FEASIBLE]).map(drop)
    }

    /// The command that runs a campaign on this machine alone, with these arguments for its simulator.
    pub(crate) fn alone(
        &self,
        folder: &Path,
        file: &Path,
        db: &str,
        simulator: &[String],
    ) -> Command {
        let mut command = self.command("coordinator", folder, "info");
        let report = format!("{db}-report");
        command.arg("run").arg(file);
        command.args(["--db", db, "--out", &report, "--workers", "2"]);
        command.args(simulator);
        command
    }

    /// The command that writes the remaining jobs of a campaign as shards.
    pub(crate) fn plan(&self, folder: &Path, file: &Path, shards: u32, out: &Path) -> Command {
        let mut command = self.command("coordinator", folder, "info");
        command.arg("plan").arg(file);
        command.args(["--db", DB, "--report", "report", "--shards"]);
        command.arg(shards.to_string()).arg("--out").arg(out);
        command
    }

    /// The command of a worker that computes a shard.
    pub(crate) fn shard_worker(&self, folder: &Path, shard: &Path, part: &Path) -> Command {
        let mut command = self.command("worker", folder, "info");
        command.arg("--shard").arg(shard).arg("--out").arg(part);
        command.args(["--slots", "1"]);
        command
    }

    /// The command that stores the results in parts.
    pub(crate) fn merge(&self, folder: &Path, parts: &[PathBuf]) -> Command {
        let mut command = self.command("coordinator", folder, "info");
        command.args(["merge", "--db", DB]).args(parts);
        command
    }

    /// The campaign's status, read from its store.
    pub(crate) fn status(&self, folder: &Path, db: &str) -> Result<Value, Violation> {
        let mut command = self.command("coordinator", folder, "off");
        command.args(["status", "--db", db, "--json"]);
        let printed = finish(command)?;
        serde_json::from_slice(&printed).map_err(|error| Violation(format!("no JSON: {error}")))
    }

    /// The text of an exported table.
    pub(crate) fn export(&self, folder: &Path, db: &str, table: &str) -> Result<String, Violation> {
        let out = folder.join(format!("{db}.{table}.csv"));
        // Export does not overwrite files.
        let _ = std::fs::remove_file(&out);
        let mut command = self.command("coordinator", folder, "off");
        command.args(["export", "--db", db, "--table", table]);
        command.arg("--out").arg(&out);
        finish(command)?;
        std::fs::read_to_string(&out).map_err(|error| Violation(error.to_string()))
    }
}

/// Runs a command, which must succeed, and returns its output.
fn finish(command: Command) -> Result<Vec<u8>, Violation> {
    ended_with(command, &[FINISHED])
}

/// Runs a command, which must end with one of these exit codes, and returns its output.
fn ended_with(mut command: Command, codes: &[i32]) -> Result<Vec<u8>, Violation> {
    let output = command
        .output()
        .map_err(|error| Violation(format!("{command:?} does not start: {error}")))?;
    if !output
        .status
        .code()
        .is_some_and(|code| codes.contains(&code))
    {
        let said = String::from_utf8_lossy(&output.stderr);
        let status = output.status;
        return Err(Violation(format!(
            "{command:?} ended with {status}: {said}"
        )));
    }
    Ok(output.stdout)
}
