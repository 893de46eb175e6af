//! A small real campaign on real processes, to which bad things happen at random.

mod cluster;
mod plan;
mod proxy;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::small_campaign;
use cluster::Cluster;

/// How often progress is looked at, unless looking itself takes long.
const LOOK: Duration = Duration::from_millis(250);
/// How many undisturbed runs a disturbed one may take on a machine that others use, too.
const PATIENCE: u32 = 30;

/// A promise that was not kept.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct Violation(pub(crate) String);

/// What a round did.
#[derive(Debug, Clone)]
pub struct Round {
    /// Acts that were done while the campaign ran.
    pub acts: usize,
    /// Looks at the progress.
    pub looks: usize,
    /// From the start of the coordinator to its good end.
    pub time: Duration,
}

/// A soak: rounds of the same campaign, each disturbed in its own way.
#[derive(Debug)]
pub struct Soak {
    folder: PathBuf,
    programs: PathBuf,
    seed: u64,
    undisturbed: Value,
    /// What the undisturbed run took.
    span: Duration,
}

impl Soak {
    /// Runs the campaign once without disturbing it, in `folder`, with the programs in the folder
    /// `programs`.
    ///
    /// # Errors
    ///
    /// The undisturbed run does not end well.
    pub fn new(folder: &Path, programs: &Path, seed: u64) -> Result<Self, Violation> {
        // It samples for some seconds on two cores.
        let shipped = small_campaign(40, 9000);
        // Both laws of wear and both ways to share the load, by turns.
        let text = if seed.is_multiple_of(2) {
            shipped
        } else {
            shipped
                .replacen("\"whole-face-beam\"", "\"hertz-beam\"", 1)
                .replacen("law = \"signed\"", "law = \"archard\"", 1)
                .replacen("coefficient_per_mpa = 3.5e-7", "max_depth_um = 3.5", 1)
        };
        let file = folder.join("campaign.toml");
        std::fs::write(&file, text).map_err(|error| Violation(error.to_string()))?;
        let run = [
            "run",
            "campaign.toml",
            "--db",
            "undisturbed.db",
            "--out",
            "undisturbed-report",
        ];
        let since = Instant::now();
        coordinator(programs, folder, &run)?;
        let span = since.elapsed().max(Duration::from_secs(2));
        let undisturbed = status(programs, folder, "undisturbed.db")?;
        if undisturbed["finished"] != true {
            return Err(Violation(format!("not even undisturbed: {undisturbed}")));
        }
        Ok(Self {
            folder: folder.to_owned(),
            programs: programs.to_owned(),
            seed,
            undisturbed,
            span,
        })
    }

    /// Runs a round; its folder stays behind only when a promise was broken.
    ///
    /// # Errors
    ///
    /// A promise was broken.
    pub fn round(&self, round: u64) -> Result<Round, Violation> {
        let folder = self.folder.join(format!("round-{round}"));
        std::fs::create_dir(&folder).map_err(|error| Violation(error.to_string()))?;
        let result = self.disturb(&folder, round)?;
        self.verify(&folder)?;
        let _ = std::fs::remove_dir_all(&folder);
        Ok(result)
    }

    fn disturb(&self, folder: &Path, round: u64) -> Result<Round, Violation> {
        let mut cluster = Cluster::start(folder, &self.programs)?;
        let since = Instant::now();
        let mut plan = plan::plan(self.seed, round, self.span)
            .into_iter()
            .peekable();
        let mut progress = Progress::default();
        let (mut acts, mut looks, mut healed) = (0, 0, false);
        let mut next_look = LOOK;
        while !cluster.finished {
            let now = since.elapsed();
            if now > self.span * PATIENCE {
                let last = progress.last;
                return Err(Violation(format!("no end in sight; at last: {last:?}")));
            }
            if let Some((_, act)) = plan.next_if(|(at, _)| *at <= now) {
                cluster.act(act)?;
                acts += 1;
                continue;
            }
            if plan.peek().is_none() && !healed {
                cluster.heal()?;
                healed = true;
            }
            // A coordinator that is down or asleep is looked at, too: its store must be readable.
            if now >= next_look && folder.join("c.db").exists() {
                if let Ok(status) = status(&self.programs, folder, "c.db") {
                    progress.advance(&status)?;
                    looks += 1;
                } else if !cluster.serves() && progress.last.is_some() {
                    status_or_violation(&self.programs, folder, &mut progress)?;
                }
                // Most of the time is the campaign's.
                let took = since.elapsed() - now;
                next_look = since.elapsed() + LOOK.max(4 * took);
            }
            cluster.look()?;
            std::thread::sleep(Duration::from_millis(10));
        }
        let time = since.elapsed();
        cluster.heal()?;
        cluster.end()?;
        progress.advance(&status(&self.programs, folder, "c.db")?)?;
        Ok(Round { acts, looks, time })
    }

    /// The end is the undisturbed one: nothing lost, nothing twice, nothing else.
    fn verify(&self, folder: &Path) -> Result<(), Violation> {
        let disturbed = status(&self.programs, folder, "c.db")?;
        for key in ["finished", "samples", "samples_digest", "designs", "optima"] {
            if disturbed[key] != self.undisturbed[key] {
                return Err(Violation(format!(
                    "{key} is {}, and undisturbed it was {}",
                    disturbed[key], self.undisturbed[key]
                )));
            }
        }
        // Percentiles and intervals of the fresh samples, too, but for what was measured.
        let optima = |folder: &Path, db: &str| -> Result<Vec<String>, Violation> {
            let out = folder.join(format!("{db}.optima.csv"));
            let _ = std::fs::remove_file(&out);
            let name = out.display().to_string();
            let export = ["export", "--db", db, "--table", "optima", "--out", &name];
            coordinator(&self.programs, folder, &export)?;
            without_times(&out)
        };
        let (held, expected) = (
            optima(folder, "c.db")?,
            optima(&self.folder, "undisturbed.db")?,
        );
        if held != expected {
            return Err(Violation(format!(
                "the optima are {held:?}, and undisturbed they were {expected:?}"
            )));
        }
        let export = [
            "export", "--db", "c.db", "--table", "samples", "--out", "s.csv",
        ];
        coordinator(&self.programs, folder, &export)?;
        let text = std::fs::read_to_string(folder.join("s.csv"))
            .map_err(|error| Violation(error.to_string()))?;
        let mut seen = BTreeSet::new();
        for line in text.lines().skip(1) {
            let mut fields = line.split(',');
            let key = (fields.next(), fields.next());
            if !seen.insert(key) {
                return Err(Violation(format!("a sample is there twice: {line}")));
            }
        }
        if Some(seen.len() as u64) != disturbed["samples"]["done"].as_u64() {
            let rows = seen.len();
            let counted = &disturbed["samples"]["done"];
            return Err(Violation(format!(
                "{rows} samples exported, {counted} counted"
            )));
        }
        Ok(())
    }
}

/// How far the campaign has been seen to be.
#[derive(Debug, Default)]
struct Progress {
    /// Samples, designs, optimiser runs, samples at optima.
    last: Option<[u64; 4]>,
}

impl Progress {
    fn advance(&mut self, status: &Value) -> Result<(), Violation> {
        let number = |value: &Value| value.as_u64().unwrap_or(0);
        let verified = status["optima"].as_array().map_or(0, |optima| {
            let done = optima.iter().map(|one| number(&one["verified"]["done"]));
            done.sum()
        });
        let now = [
            number(&status["samples"]["done"]),
            number(&status["designs"]["done"]),
            number(&status["optimiser_runs"]["done"]),
            verified,
        ];
        if let Some(before) = self.last
            && before.iter().zip(&now).any(|(before, now)| now < before)
        {
            return Err(Violation(format!(
                "progress went back from {before:?} to {now:?} (samples, designs, optimiser runs, \
                 samples at optima)"
            )));
        }
        self.last = Some(now);
        Ok(())
    }
}

/// The rows of a table without processor times.
fn without_times(path: &Path) -> Result<Vec<String>, Violation> {
    let text = std::fs::read_to_string(path).map_err(|error| Violation(error.to_string()))?;
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().unwrap_or_default().split(',').collect();
    let kept = |line: &str| {
        let fields = line.split(',').zip(&header);
        let fields = fields.filter(|(_, name)| !name.contains("cpu"));
        fields.map(|(field, _)| field).collect::<Vec<_>>().join(",")
    };
    Ok(lines.map(kept).collect())
}

/// A store that was there once stays readable when its coordinator is gone; it may be in the middle
/// of ending.
fn status_or_violation(
    programs: &Path,
    folder: &Path,
    progress: &mut Progress,
) -> Result<(), Violation> {
    std::thread::sleep(LOOK);
    progress.advance(&status(programs, folder, "c.db")?)
}

fn status(programs: &Path, folder: &Path, db: &str) -> Result<Value, Violation> {
    let printed = coordinator(programs, folder, &["status", "--db", db, "--json"])?;
    serde_json::from_slice(&printed).map_err(|error| Violation(format!("no JSON: {error}")))
}

/// Runs `coordinator` to its good end and returns what it printed.
fn coordinator(programs: &Path, folder: &Path, arguments: &[&str]) -> Result<Vec<u8>, Violation> {
    let output = Command::new(programs.join("coordinator"))
        .args(arguments)
        .current_dir(folder)
        .env("PITCHLINE_LOG", "off")
        .output()
        .map_err(|error| Violation(format!("coordinator does not start: {error}")))?;
    if !output.status.success() {
        let said = String::from_utf8_lossy(&output.stderr);
        let what = arguments[0];
        return Err(Violation(format!(
            "{what} ended with {}: {said}",
            output.status
        )));
    }
    Ok(output.stdout)
}
