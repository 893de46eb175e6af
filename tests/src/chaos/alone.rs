//! A campaign on one machine, whose coordinator is killed at times by its own simulator and at times from outside.

use std::os::unix::process::ExitStatusExt as _;
use std::path::Path;
use std::time::{Duration, Instant};

use rand::RngExt as _;
use rustix::process::Signal;

use super::plan::{Purpose, random};
use super::process::Process;
use super::programs::{DB, FINISHED, INCOMPLETE, NONE_FEASIBLE, Programs};
use super::progress::Progress;
use super::{Kind, Round, Violation};

/// Number of times that it is killed from outside: fewer than what quarantines a design.
const KILLS: u32 = 2;
/// A process is killed at most after this time, in milliseconds.
const LATEST_KILL: u64 = 4000;
/// Time limit of a process on a shared machine.
const PATIENCE: Duration = Duration::from_secs(300);
/// Most runs of the same command. Each crash that the simulator causes happens once.
const RUNS: usize = 40;

/// Gives the same command until the campaign is finished.
pub(crate) fn disturbed(
    programs: &Programs,
    folder: &Path,
    file: &Path,
    simulator: &[String],
    seed: u64,
    round: u64,
) -> Result<Round, Violation> {
    let mut rng = random(seed, round, Purpose::Course);
    let mut progress = Progress::default();
    let mut kills = 0;
    let since = Instant::now();
    for number in 0..RUNS {
        let command = programs.alone(folder, file, DB, simulator);
        let mut process = Process::start(command, folder, format!("run-{number}"))?;
        let is_doomed = kills < KILLS && rng.random_bool(0.3);
        let limit = match is_doomed {
            true => Duration::from_millis(rng.random_range(0..LATEST_KILL)),
            false => PATIENCE,
        };
        let begun = Instant::now();
        let status = loop {
            if let Some(status) = process.ended()? {
                break Some(status);
            }
            if begun.elapsed() > limit {
                break None;
            }
            std::thread::sleep(Duration::from_millis(5));
        };
        match status {
            None if is_doomed => {
                process.signal(Signal::KILL);
                kills += 1;
            }
            None => return Err(Violation(format!("run {number} does not end"))),
            Some(status) => match (status.code(), status.signal()) {
                (Some(FINISHED | NONE_FEASIBLE), _) => {
                    progress.advance(&programs.status(folder, DB)?, true)?;
                    return Ok(Round {
                        kind: Kind::Alone,
                        acts: number,
                        looks: number,
                        visits: 0,
                        stale: 0,
                        time: since.elapsed(),
                    });
                }
                (Some(INCOMPLETE), _) => {}
                (None, Some(signal)) if signal == Signal::KILL.as_raw() => {}
                _ => return Err(Violation(format!("run {number} ended with {status}"))),
            },
        }
        // Waits for the end of the killed process.
        drop(process);
        if folder.join(DB).exists() {
            progress.advance(&programs.status(folder, DB)?, true)?;
        }
    }
    Err(Violation(format!("no end after {RUNS} runs")))
}
