//! A campaign in shards, whose planner, workers and merges are killed.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use rand::RngExt as _;
use rand::rngs::ChaCha8Rng;
use rustix::process::Signal;

use super::plan::{Purpose, random};
use super::process::Process;
use super::programs::{DB, FINISHED, INCOMPLETE, NONE_FEASIBLE, Programs};
use super::progress::Progress;
use super::{Kind, Round, Violation};

/// Number of shards of each plan.
const SHARDS: u32 = 3;
/// A process is killed at most after this time, in milliseconds.
const LATEST_KILL: u64 = 300;
/// Time limit of a process on a shared machine.
const PATIENCE: Duration = Duration::from_secs(120);

/// Runs a campaign as shards. Every process is killed at times and started again, and some shards
/// are left to the next plan.
pub(crate) fn disturbed(
    programs: &Programs,
    folder: &Path,
    file: &Path,
    seed: u64,
    round: u64,
) -> Result<Round, Violation> {
    let mut run = Run {
        folder,
        rng: random(seed, round, Purpose::Course),
        started: 0,
        kills: 0,
    };
    let mut progress = Progress::default();
    let mut looks = 0;
    let since = Instant::now();
    loop {
        if since.elapsed() > PATIENCE * 3 {
            let last = progress.last;
            return Err(Violation(format!("no end in sight; at last: {last:?}")));
        }
        let out = run.until_ended("plan", |attempt| {
            let out = folder.join(format!("stage{looks}-{attempt}"));
            (programs.plan(folder, file, SHARDS, &out), out)
        })?;
        let shards: Vec<PathBuf> = (1..=SHARDS)
            .map(|number| out.join(format!("{number}.json")))
            .filter(|shard| shard.exists())
            .collect();
        if shards.is_empty() {
            return Ok(Round {
                kind: Kind::Sharded,
                acts: run.kills,
                looks,
                visits: 0,
                stale: 0,
                time: since.elapsed(),
            });
        }
        let mut parts = Vec::new();
        for shard in shards {
            let part = shard.with_extension("part");
            let is_patient = run.rng.random_bool(0.8);
            let worker = || programs.shard_worker(folder, &shard, &part);
            if is_patient {
                run.until_ended("worker", |_| (worker(), ()))?;
            } else {
                run.once("worker", worker())?;
            }
            // A worker that was killed early has not begun its part.
            if part.exists() {
                parts.push(part);
            }
        }
        if !parts.is_empty() {
            run.until_ended("merge", |_| (programs.merge(folder, &parts), ()))?;
        }
        progress.advance(&programs.status(folder, DB)?, false)?;
        looks += 1;
    }
}

/// The processes of a round, one after the other.
struct Run<'a> {
    folder: &'a Path,
    rng: ChaCha8Rng,
    started: usize,
    kills: usize,
}

impl Run<'_> {
    /// Repeats a command until it ends by itself. Returns the value that came with its last attempt.
    fn until_ended<T>(
        &mut self,
        name: &str,
        command: impl Fn(usize) -> (Command, T),
    ) -> Result<T, Violation> {
        let mut attempt = 0;
        loop {
            let (command, with) = command(attempt);
            if self.once(name, command)? {
                return Ok(with);
            }
            attempt += 1;
        }
    }

    /// Runs a command and perhaps kills it. Returns whether it ended by itself.
    fn once(&mut self, name: &str, command: Command) -> Result<bool, Violation> {
        self.started += 1;
        let log = format!("{name}-{}", self.started);
        let mut process = Process::start(command, self.folder, log)?;
        let since = Instant::now();
        let limit = if self.rng.random_bool(0.4) {
            Duration::from_millis(self.rng.random_range(0..LATEST_KILL))
        } else {
            PATIENCE
        };
        loop {
            if let Some(status) = process.ended()? {
                return match status.code() {
                    Some(FINISHED | NONE_FEASIBLE) => Ok(true),
                    Some(INCOMPLETE) if name == "merge" => Ok(true),
                    _ => Err(Violation(format!("{name} ended with {status}"))),
                };
            }
            if since.elapsed() > limit {
                if limit == PATIENCE {
                    return Err(Violation(format!("{name} does not end")));
                }
                process.signal(Signal::KILL);
                self.kills += 1;
                // The process is waited for when it is dropped.
                return Ok(false);
            }
            std::thread::sleep(Duration::from_millis(2));
        }
    }
}
