//! A study of a finished campaign, whose workers are killed and stopped while they compute.

use std::path::Path;
use std::time::{Duration, Instant};

use rand::RngExt as _;
use rustix::process::Signal;

use super::Violation;
use super::cluster::Process;
use super::plan::{Purpose, WORKERS, random};
use super::programs::{DB, Programs};

/// The folder of a study's tables.
const OUT: &str = "pareto";
/// The access file of a study.
pub(crate) const ACCESS: &str = "study.access";
/// Number of acts in a study. Afterwards it runs undisturbed.
const ACTS: usize = 12;
/// Time limit of a study on a shared machine.
const PATIENCE: Duration = Duration::from_secs(180);

/// The table of an undisturbed study.
pub(crate) fn undisturbed(
    programs: &Programs,
    folder: &Path,
    file: &Path,
    db: &str,
) -> Result<String, Violation> {
    programs.study_alone(folder, file, db, OUT)?;
    read(folder)
}

/// The table of the same study with workers in other processes that are killed and stopped.
pub(crate) fn disturbed(
    programs: &Programs,
    folder: &Path,
    file: &Path,
    seed: u64,
    round: u64,
) -> Result<String, Violation> {
    let mut rng = random(seed, round, Purpose::Study);
    let study = programs.study(folder, file, DB, OUT);
    let mut study = Process::start(study, folder, "study".to_owned())?;
    let since = Instant::now();
    let mut started = 0;
    let mut start = || {
        started += 1;
        let name = format!("study-worker-{started}");
        Process::start(programs.study_worker(folder), folder, name)
    };
    while !folder.join(ACCESS).exists() && study.ended()?.is_none() {
        std::thread::sleep(Duration::from_millis(20));
    }
    let mut workers = (0..WORKERS)
        .map(|_| start())
        .collect::<Result<Vec<_>, _>>()?;
    let mut acts = 0;
    let status = loop {
        if let Some(status) = study.ended()? {
            break status;
        }
        if since.elapsed() > PATIENCE {
            return Err(Violation("a study does not end".to_owned()));
        }
        let mut moment = |low, high| Duration::from_millis(rng.random_range(low..high));
        std::thread::sleep(moment(100, 900));
        if acts == ACTS {
            continue;
        }
        acts += 1;
        let sleep = moment(100, 1500);
        let worker = &mut workers[rng.random_range(0..WORKERS)];
        if rng.random_bool(0.6) {
            // The previous worker is killed when it is dropped.
            *worker = start()?;
        } else {
            worker.signal(Signal::STOP);
            std::thread::sleep(sleep);
            worker.signal(Signal::CONT);
        }
    };
    if !status.success() {
        return Err(Violation(format!("a study ended with {status}")));
    }
    read(folder)
}

fn read(folder: &Path) -> Result<String, Violation> {
    let table = folder.join(OUT).join("pareto.csv");
    std::fs::read_to_string(table).map_err(|error| Violation(format!("no table: {error}")))
}
