//! Programs that read a file and write a file. Each request is a run of the command in a separate
//! folder, which holds the filled template. The answer is read from the result file.
//!
//! The rest of [`exec`](super) treats such a program like one that answers lines.

use std::collections::{BTreeMap, VecDeque};
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use std::{fs, io};

use problem::file::ResultLine;
use serde_json::{Map, Value, json};
use sha2::{Digest as _, Sha256};

use super::fault::Fault;
use super::numbers::Numbers;
use super::output::Line;
use super::process::Process;
use super::requests::{PROTOCOL, Request};
use super::results::Results;

/// The name of a sample's seed in a template.
const SEED: &str = "seed";
/// Maximum number of folders of failed runs that a worker keeps.
const KEPT: usize = 20;
/// Size of the file that shows whether a disk has space, in bytes.
const SPACE: usize = 1 << 16;

/// A program that is run for each request.
#[derive(Debug)]
pub(super) struct Files {
    command: String,
    environment: Vec<(String, String)>,
    /// The text of the template, and the name of its file.
    template: (String, OsString),
    result: PathBuf,
    /// The place of each response in the result file, if the campaign states it.
    read: BTreeMap<String, ResultLine>,
    /// The campaign's names of the sampled responses.
    sampled: Vec<String>,
    stop: Arc<AtomicBool>,
    failed_runs: Arc<FailedRuns>,
}

/// The folders of a worker's last failed runs, oldest first.
#[derive(Debug, Default)]
pub(super) struct FailedRuns(Mutex<VecDeque<PathBuf>>);

impl FailedRuns {
    /// Adds a folder and removes the oldest beyond [`KEPT`].
    fn add(&self, folder: PathBuf) {
        // A panic cannot leave the list half changed.
        let mut folders = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        folders.push_back(folder);
        while folders.len() > KEPT {
            let oldest = folders.pop_front();
            // The user may have removed it.
            let _ = oldest.map(fs::remove_dir_all);
        }
    }
}

impl Files {
    /// Creates a program that runs this command in this environment, with a template of its input file.
    pub(super) fn new(
        (command, environment): (&str, &[(String, String)]),
        path: &Path,
        (result, read): (&Path, &BTreeMap<String, ResultLine>),
        stop: Arc<AtomicBool>,
        failed_runs: &Arc<FailedRuns>,
    ) -> Result<Self, Fault> {
        let cannot = |why: &dyn std::fmt::Display| {
            Fault::Machine(format!(
                "template {}: {why}; give --template a file that this machine can read",
                path.display()
            ))
        };
        let text = fs::read_to_string(path).map_err(|error| cannot(&error))?;
        let name = path.file_name().ok_or_else(|| cannot(&"has no name"))?;
        Ok(Self {
            command: command.to_owned(),
            environment: environment.to_vec(),
            template: (text, name.to_owned()),
            result: result.to_owned(),
            read: read.clone(),
            sampled: Vec::new(),
            stop,
            failed_runs: Arc::clone(failed_runs),
        })
    }

    /// Answers a request.
    ///
    /// # Errors
    ///
    /// After a failed run of the program, its folder is kept and named.
    pub(super) fn ask(
        &mut self,
        request: Map<String, Value>,
        timeout: Duration,
    ) -> Result<Map<String, Value>, Fault> {
        match Request::read(request)? {
            Request::Describe {
                variables,
                sampled,
                random,
                ..
            } => {
                self.sampled = sampled;
                self.describe(&variables, &random).map_err(Fault::Program)
            }
            Request::Evaluate {
                design,
                responses,
                random,
            } => self.run(&[design, random], 0, &responses, timeout),
            Request::Sample {
                design,
                seed,
                random,
            } => {
                let wanted = self.sampled.clone();
                self.run(&[design, random], small(seed), &wanted, timeout)
            }
        }
    }

    /// Checks that the template has every name: a misspelt one would stay in the file unfilled.
    fn describe(
        &self,
        variables: &[String],
        random: &[String],
    ) -> Result<Map<String, Value>, String> {
        let (text, name) = &self.template;
        let seed = random.is_empty().then_some(SEED);
        let named = variables.iter().chain(random).map(String::as_str);
        let names = named.chain(seed);
        let lacks = names.into_iter().find(|name| !text.contains(&place(name)));
        if let Some(lacks) = lacks {
            let what = match lacks {
                SEED => "the place of a sample's seed, 0 for the response without random effects",
                _ => "the place of a variable or random input of the campaign",
            };
            let file = Path::new(name).display();
            return Err(format!("the template {file} has no {{{lacks}}}, {what}"));
        }
        let result = self.result.as_os_str().as_encoded_bytes();
        let read = if self.read.is_empty() {
            String::new()
        } else {
            json!(self.read).to_string()
        };
        let parts = [
            self.command.as_bytes(),
            text.as_bytes(),
            result,
            read.as_bytes(),
        ]
        .concat();
        let digest = hex::encode(&Sha256::digest(parts)[..8]);
        Ok(Map::from_iter([
            ("protocol".to_owned(), PROTOCOL.into()),
            ("version".to_owned(), format!("files {digest}").into()),
        ]))
    }

    /// Runs the program for a design and its random inputs, and returns the `wanted` numbers.
    fn run(
        &self,
        inputs: &[Numbers; 2],
        seed: u32,
        wanted: &[String],
        timeout: Duration,
    ) -> Result<Map<String, Value>, Fault> {
        let folder = tempfile::Builder::new().prefix("pitchline-").tempdir();
        let folder = folder.map_err(|error| no_space(&error))?;
        let ran = self.run_in(folder.path(), inputs, seed, wanted, timeout);
        ran.map_err(|fault| {
            // The folder is not kept, because it would take up the missing space.
            if let Fault::Machine(_) = fault {
                return fault;
            }
            if let Err(error) = try_space(folder.path()) {
                return no_space(&error);
            }
            let folder = folder.keep();
            let note = format!("\nthe files of this run are kept in {}", folder.display());
            self.failed_runs.add(folder);
            match fault {
                Fault::NotRun { text, of_machine } => Fault::NotRun {
                    text: text + &note,
                    of_machine,
                },
                fault => Fault::Program(fault.text() + &note),
            }
        })
    }

    fn run_in(
        &self,
        folder: &Path,
        inputs: &[Numbers; 2],
        seed: u32,
        wanted: &[String],
        timeout: Duration,
    ) -> Result<Map<String, Value>, Fault> {
        let (template, name) = &self.template;
        let mut filled = template.replace(&place(SEED), &seed.to_string());
        for (name, value) in inputs.iter().flatten() {
            filled = filled.replace(&place(name), &format!("{value:?}"));
        }
        fs::write(folder.join(name), filled).map_err(|error| no_space(&error))?;
        self.execute(folder, timeout)?;
        self.read_result(folder, wanted).map_err(Fault::Program)
    }

    /// Reads the `wanted` numbers, or the reason for a refusal, from the result file.
    fn read_result(&self, folder: &Path, wanted: &[String]) -> Result<Map<String, Value>, String> {
        let file = self.result.display();
        let bytes = fs::read(folder.join(&self.result))
            .map_err(|error| format!("the command has left no readable {file}: {error}"))?;
        // Numbers are ASCII, whatever other encoding the text has.
        let text = String::from_utf8_lossy(&bytes);
        let results = Results::read(&text, &self.read, wanted);
        results
            .and_then(|results| results.answer(wanted))
            .map_err(|why| format!("{file}{why}"))
    }

    /// Runs the command in `folder` to its end. Its output is quoted in an error.
    fn execute(&self, folder: &Path, timeout: Duration) -> Result<(), Fault> {
        let quoted = folder.display().to_string().replace('\'', r"'\''");
        // The last line of a command may be a comment.
        let command = format!(
            "cd '{quoted}' && (\n{}\n) </dev/null >&2; echo $?",
            self.command
        );
        let mut process = Process::start(&command, &self.environment, Arc::clone(&self.stop))?;
        let asked = format!("{} in {}", self.command, folder.display());
        let status = |line: &[u8]| Line::Answer(String::from_utf8_lossy(line).into_owned(), true);
        match &*process.ask("", timeout, &status)? {
            "0" => Ok(()),
            status => {
                let text = process.obituary(&format!("ended with status {status}"), &asked);
                Err(match status {
                    "126" => Fault::not_run(126, text),
                    "127" => Fault::not_run(127, text),
                    _ => Fault::Program(text),
                })
            }
        }
    }
}

/// Checks that files can be written: a program that has failed may have found no space.
fn try_space(folder: &Path) -> io::Result<()> {
    let file = folder.join(".pitchline-space");
    fs::write(&file, [0; SPACE])?;
    fs::remove_file(file)
}

fn no_space(error: &io::Error) -> Fault {
    Fault::Machine(format!(
        "no file of a run can be written in {}: {error}; free space there, or set TMPDIR to a \
         folder for temporary files",
        std::env::temp_dir().display()
    ))
}

fn place(name: &str) -> String {
    format!("{{{name}}}")
}

/// Reduces a seed to the range that every program accepts: 1 to 2³¹ − 1.
fn small(seed: [u32; 4]) -> u32 {
    let mixed = seed.into_iter().fold(0, |mixed: u64, word| {
        (mixed.rotate_left(32) ^ u64::from(word)).wrapping_mul(0x9e37_79b9_7f4a_7c15)
    });
    // The product's upper bits depend on all bits of the seed.
    1 + ((mixed >> 33) as u32) % (i32::MAX as u32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_word_of_a_seed_counts() {
        let seeds: std::collections::BTreeSet<u32> = (0..4_u32)
            .flat_map(|word| (0..1000_u32).map(move |value| (word, value)))
            .filter(|(word, value)| *word == 0 || *value > 0)
            .map(|(word, value)| {
                let mut seed = [0; 4];
                seed[word as usize] = value;
                small(seed)
            })
            .collect();
        assert_eq!(seeds.len(), 3997);
        assert!(
            seeds
                .iter()
                .all(|seed| (1..=i32::MAX as u32).contains(seed))
        );
    }
}
