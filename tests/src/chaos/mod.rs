//! Small real campaigns on real processes with random faults.

mod alone;
mod cluster;
mod course;
mod kinds;
mod outcome;
mod parts;
mod plan;
mod process;
mod programs;
mod progress;
mod proxy;

use std::collections::BTreeMap;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use rand::RngExt as _;

use cluster::{Cluster, Setup};
use course::Course;
pub use kinds::Kind;
use kinds::Reference;
use outcome::Outcome;
use plan::{Purpose, random};
use programs::{DB, Programs};
use progress::Progress;

/// A copy of a round's store, with one bit flipped.
const FLIPPED: &str = "flipped.db";
/// Number of bits that are flipped in copies of a round's store.
const FLIPS: usize = 4;
/// Minimum interval between looks at the progress.
const LOOK: Duration = Duration::from_millis(250);
/// The interval while a certain moment is waited for.
const CLOSE_LOOK: Duration = Duration::from_millis(10);
/// Time limit of a disturbed run as a multiple of the undisturbed one, on a shared machine.
const PATIENCE: u32 = 30;

/// A broken promise.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct Violation(pub(crate) String);

/// The events of a round.
#[derive(Debug, Clone)]
pub struct Round {
    /// The kind of campaign.
    pub kind: Kind,
    /// Number of acts while the campaign ran.
    pub acts: usize,
    /// Number of looks at the progress.
    pub looks: usize,
    /// Number of views that the live page returned.
    pub visits: usize,
    /// Number of results that were dropped because their stream had changed.
    pub stale: usize,
    /// Time from the start of the coordinator to its successful end.
    pub time: Duration,
}

/// A soak: rounds of small campaigns, each disturbed in its own way.
#[derive(Debug)]
pub struct Soak {
    folder: PathBuf,
    programs: Programs,
    seed: u64,
    undisturbed: Mutex<BTreeMap<Kind, Arc<Reference>>>,
    keeps: bool,
}

impl Soak {
    /// Makes a soak in `folder` with the programs in the folder `programs`.
    ///
    /// # Errors
    ///
    /// The folder is not writable.
    pub fn new(folder: &Path, programs: &Path, seed: u64) -> Result<Self, Violation> {
        Ok(Self {
            folder: folder.to_owned(),
            programs: Programs::new(programs, folder)?,
            seed,
            undisturbed: Mutex::default(),
            keeps: false,
        })
    }

    /// Sets whether the folders of successful rounds are kept.
    #[must_use]
    pub const fn keeping(mut self, keeps: bool) -> Self {
        self.keeps = keeps;
        self
    }

    /// Runs a round. Its folder is kept only if a promise was broken. Seed and round determine the
    /// kind of campaign, unless `kind` is given.
    ///
    /// # Errors
    ///
    /// A promise was broken, or the undisturbed run of the same campaign failed.
    pub fn round(&self, round: u64, kind: Option<Kind>) -> Result<Round, Violation> {
        let kind = kind.unwrap_or_else(|| kind_of(self.seed, round));
        let reference = self.reference(kind)?;
        let folder = self.folder.join(format!("round-{round}"));
        std::fs::create_dir(&folder).map_err(|error| Violation(error.to_string()))?;
        let file = &reference.files[0];
        let result = match kind {
            Kind::Sharded => parts::disturbed(&self.programs, &folder, file, self.seed, round)?,
            Kind::Alone => {
                let simulator = self.simulator(&folder, round, kind, &reference);
                alone::disturbed(&self.programs, &folder, file, &simulator, self.seed, round)?
            }
            _ => self.disturb(&folder, round, kind, &reference)?,
        };
        let outcome = Outcome::read(&self.programs, &folder, DB)?;
        outcome.compare(&reference.outcome)?;
        outcome.check_failures(kind)?;
        self.flip(&folder, round, &outcome)?;
        if !self.keeps {
            let _ = std::fs::remove_dir_all(&folder);
        }
        Ok(result)
    }

    /// Flips bits of copies of a store: each is noticed, or changes nothing that is reported.
    fn flip(&self, folder: &Path, round: u64, outcome: &Outcome) -> Result<(), Violation> {
        let io = |error: std::io::Error| Violation(error.to_string());
        let sound = std::fs::read(folder.join(DB)).map_err(io)?;
        let mut rng = random(self.seed, round, Purpose::Bits);
        for _ in 0..FLIPS {
            let (byte, bit) = (rng.random_range(0..sound.len()), rng.random_range(0..8));
            let mut flipped = sound.clone();
            flipped[byte] ^= 1 << bit;
            std::fs::write(folder.join(FLIPPED), flipped).map_err(io)?;
            if let Some(status) = self.programs.check(folder, FLIPPED)? {
                let same = outcome.has_status(&status);
                same.map_err(|why| Violation(format!("bit {bit} of byte {byte}: {why}")))?;
            }
        }
        Ok(())
    }

    /// The undisturbed run of a kind of campaign.
    fn reference(&self, kind: Kind) -> Result<Arc<Reference>, Violation> {
        let mut undisturbed = self
            .undisturbed
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        if let Some(reference) = undisturbed.get(&kind) {
            return Ok(Arc::clone(reference));
        }
        let reference = Reference::run(kind, self.seed, &self.folder, &self.programs)?;
        let reference = Arc::new(reference);
        undisturbed.insert(kind, Arc::clone(&reference));
        Ok(reference)
    }

    /// The workers' command-line arguments for a round's simulator.
    fn simulator(
        &self,
        folder: &Path,
        round: u64,
        kind: Kind,
        reference: &Reference,
    ) -> Vec<String> {
        let seed = format!("{}-{round}", self.seed);
        if !kind.is_unreliable() {
            let with_outages = |name| self.programs.with_outages(folder, name, "", &seed);
            return kind.simulator().map_or_else(Vec::new, with_outages);
        }
        let mut arguments = seed.clone();
        if kind == Kind::Licence {
            let mut rng = random(self.seed, round, Purpose::Simulator);
            // A design that gets samples. Either all of its samples fail, or so few that the first
            // ones succeed; in the second case, none of 200 fails in only one of 30 000 campaigns.
            let designs = reference.outcome.column("responses", "design");
            let x_p = reference.outcome.column("designs", "x_p");
            let number = &designs[rng.random_range(0..designs.len())];
            let number: usize = number.parse().expect("a design's number");
            let share = if rng.random_bool(0.5) { 1.0 } else { 0.05 };
            arguments = format!("{arguments} {} {share}", x_p[number]);
        }
        let name = "unreliable.py";
        self.programs.with_outages(folder, name, &arguments, &seed)
    }

    fn disturb(
        &self,
        folder: &Path,
        round: u64,
        kind: Kind,
        reference: &Reference,
    ) -> Result<Round, Violation> {
        let mut course = Course::new(kind, self.seed, round);
        let mut cluster = Cluster::start(Setup {
            folder: folder.to_owned(),
            programs: self.programs.clone(),
            file: reference.files[0].clone(),
            stays: course.stays(),
            simulator: self.simulator(folder, round, kind, reference),
            kills_workers: kind.is_unreliable(),
        })?;
        let mut diary = std::fs::File::create(folder.join("acts.log"))
            .map_err(|error| Violation(error.to_string()))?;
        let since = Instant::now();
        let mut plan = plan::plan(self.seed, round, reference.span)
            .into_iter()
            .peekable();
        let mut progress = Progress::default();
        let (mut acts, mut looks, mut healed) = (0, 0, false);
        let (mut next_look, mut next_visit) = (LOOK, LOOK);
        let time = loop {
            let now = since.elapsed();
            if let Some(code) = cluster.ended.take() {
                let _ = writeln!(diary, "{now:.3?} the coordinator ended with {code}");
                if course.is_over(code, &mut cluster, reference)? {
                    cluster.ended = Some(code);
                    break now;
                }
                // The coordinator that is started next removes failed samples.
                progress.will_go_back |= cluster.retries_failed;
            }
            if now > reference.span * PATIENCE {
                let last = progress.last;
                return Err(Violation(format!("no end in sight; at last: {last:?}")));
            }
            if let Some((_, act)) = plan.next_if(|(at, _)| *at <= now) {
                let _ = writeln!(diary, "{now:.3?} {act:?}");
                cluster.act(act)?;
                acts += 1;
                continue;
            }
            if plan.peek().is_none() {
                if !healed {
                    cluster.heal()?;
                    healed = true;
                }
                // A drained coordinator and its workers leave.
                cluster.revive()?;
            }
            // The store must be readable even while the coordinator is down or stopped.
            if now >= next_look && folder.join(DB).exists() {
                if let Ok(status) = self.programs.status(folder, DB) {
                    progress.advance(&status, course.takes_turn())?;
                    looks += 1;
                    let was_waiting = course.is_waiting();
                    course.look(now, &status, &mut cluster, reference)?;
                    if was_waiting && !course.is_waiting() {
                        let _ = writeln!(diary, "{now:.3?} {course:?}");
                    }
                } else if !cluster.serves() && progress.last.is_some() {
                    // An existing store stays readable; the coordinator may just be ending.
                    std::thread::sleep(LOOK);
                    let status = self.programs.status(folder, DB)?;
                    progress.advance(&status, course.takes_turn())?;
                }
                let took = since.elapsed() - now;
                let pause = if course.is_waiting() {
                    CLOSE_LOOK
                } else {
                    // Most of the time should go to the campaign.
                    LOOK.max(4 * took)
                };
                next_look = since.elapsed() + pause;
            }
            if now >= next_visit {
                cluster.visit()?;
                next_visit = since.elapsed() + LOOK;
            }
            cluster.look()?;
            if std::mem::take(&mut cluster.is_dismissed) && !course.takes_turn() {
                let status = self.programs.status(folder, DB)?;
                if status["finished"] != true {
                    return Err(Violation(format!(
                        "a worker ended as if the campaign were finished: {status}"
                    )));
                }
            }
            std::thread::sleep(Duration::from_millis(10));
        };
        let visits = cluster.visits;
        cluster.end()?;
        progress.advance(&self.programs.status(folder, DB)?, course.takes_turn())?;
        Ok(Round {
            kind,
            acts,
            looks,
            visits,
            stale: stale(folder),
            time,
        })
    }
}

/// The random kind of campaign of a round.
fn kind_of(seed: u64, round: u64) -> Kind {
    let mut rng = random(seed, round, Purpose::Kind);
    Kind::ALL[rng.random_range(0..Kind::ALL.len())]
}

/// The number of stale results in the logs of a round's coordinators.
fn stale(folder: &Path) -> usize {
    let Ok(entries) = std::fs::read_dir(folder) else {
        return 0;
    };
    entries
        .filter_map(|entry| std::fs::read_to_string(entry.ok()?.path()).ok())
        .map(|log| log.matches("a stale result").count())
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hundred_rounds_have_every_kind_of_campaign() {
        for seed in 1..10 {
            let drawn: Vec<Kind> = (0..100).map(|round| kind_of(seed, round)).collect();
            for kind in Kind::ALL {
                let count = drawn.iter().filter(|drawn| **drawn == kind).count();
                assert!(count >= 3, "seed {seed}: {count} rounds of {kind:?}");
            }
        }
    }
}
