//! Small real campaigns on real processes, to which bad things happen at random.

mod cluster;
mod course;
mod kinds;
mod outcome;
mod plan;
mod programs;
mod progress;
mod proxy;
mod study;

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

/// How often progress is looked at, unless looking itself takes long.
const LOOK: Duration = Duration::from_millis(250);
/// The same while a certain moment is waited for.
const CLOSE_LOOK: Duration = Duration::from_millis(10);
/// How many undisturbed runs a disturbed one may take on a machine that others use, too.
const PATIENCE: u32 = 30;

/// A promise that was not kept.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct Violation(pub(crate) String);

/// What a round did.
#[derive(Debug, Clone)]
pub struct Round {
    /// The kind of campaign.
    pub kind: Kind,
    /// Acts that were done while the campaign ran.
    pub acts: usize,
    /// Looks at the progress.
    pub looks: usize,
    /// Views that the live page gave.
    pub visits: usize,
    /// Results that came when their stream had changed, and were dropped.
    pub stale: usize,
    /// From the start of the coordinator to its good end.
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
    /// A soak in `folder`, with the programs in the folder `programs`.
    ///
    /// # Errors
    ///
    /// The folder cannot be written.
    pub fn new(folder: &Path, programs: &Path, seed: u64) -> Result<Self, Violation> {
        Ok(Self {
            folder: folder.to_owned(),
            programs: Programs::new(programs, folder)?,
            seed,
            undisturbed: Mutex::default(),
            keeps: false,
        })
    }

    /// Whether the folders of rounds stay that went well.
    #[must_use]
    pub const fn keeping(mut self, keeps: bool) -> Self {
        self.keeps = keeps;
        self
    }

    /// Runs a round; its folder stays behind only when a promise was broken. The kind of campaign
    /// follows from seed and round unless it is given.
    ///
    /// # Errors
    ///
    /// A promise was broken, or the undisturbed run of the same campaign does not end well.
    pub fn round(&self, round: u64, kind: Option<Kind>) -> Result<Round, Violation> {
        let kind = kind.unwrap_or_else(|| kind_of(self.seed, round));
        let reference = self.reference(kind)?;
        let folder = self.folder.join(format!("round-{round}"));
        std::fs::create_dir(&folder).map_err(|error| Violation(error.to_string()))?;
        let result = self.disturb(&folder, round, kind, &reference)?;
        let outcome = Outcome::read(&self.programs, &folder, DB)?;
        outcome.compare(&reference.outcome)?;
        outcome.check_failures(kind)?;
        if let Some(undisturbed) = &reference.study {
            let file = &reference.files[0];
            let table = study::disturbed(&self.programs, &folder, file, self.seed, round)?;
            if table != *undisturbed {
                return Err(Violation(format!(
                    "a study found\n{table}\nbut undisturbed\n{undisturbed}"
                )));
            }
        }
        if !self.keeps {
            let _ = std::fs::remove_dir_all(&folder);
        }
        Ok(result)
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

    /// What the workers' command lines say of a round's simulator.
    fn simulator(&self, round: u64, kind: Kind, reference: &Reference) -> Vec<String> {
        if !kind.is_unreliable() {
            let name = kind.simulator();
            return name.map_or_else(Vec::new, |name| self.programs.simulator(name, ""));
        }
        let mut arguments = format!("{}-{round}", self.seed);
        if kind == Kind::Licence {
            let mut rng = random(self.seed, round, Purpose::Simulator);
            // A design that gets samples; all of these fail, or so few that the first ones pass, but that
            // none of 200 fails in one campaign of 30 000 only.
            let designs = reference.outcome.column("responses", "design");
            let x_p = reference.outcome.column("designs", "x_p");
            let number = &designs[rng.random_range(0..designs.len())];
            let number: usize = number.parse().expect("a design's number");
            let share = if rng.random_bool(0.5) { 1.0 } else { 0.05 };
            arguments = format!("{arguments} {} {share}", x_p[number]);
        }
        self.programs.simulator("unreliable.py", &arguments)
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
            simulator: self.simulator(round, kind, reference),
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
                // A drained coordinator leaves, and so do its workers.
                cluster.revive()?;
            }
            // A coordinator that is down or asleep is looked at, too: its store must be readable.
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
                    // What was there once stays readable; it may be in the middle of ending.
                    std::thread::sleep(LOOK);
                    let status = self.programs.status(folder, DB)?;
                    progress.advance(&status, course.takes_turn())?;
                }
                let took = since.elapsed() - now;
                let pause = if course.is_waiting() {
                    CLOSE_LOOK
                } else {
                    // Most of the time is the campaign's.
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

/// The kind of campaign of a round.
fn kind_of(seed: u64, round: u64) -> Kind {
    let mut rng = random(seed, round, Purpose::Kind);
    Kind::ALL[rng.random_range(0..Kind::ALL.len())]
}

/// How many stale results the logs of a round's coordinators report.
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
    fn sixty_rounds_have_every_kind_of_campaign() {
        for seed in 1..10 {
            let drawn: Vec<Kind> = (0..60).map(|round| kind_of(seed, round)).collect();
            for kind in Kind::ALL {
                let count = drawn.iter().filter(|drawn| **drawn == kind).count();
                assert!(count >= 3, "seed {seed}: {count} rounds of {kind:?}");
            }
        }
    }
}
