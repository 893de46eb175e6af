//! How busy a campaign with enrichment and searches keeps the slots of a program.

use std::fs::{self, File};
use std::io::{BufRead as _, Write as _};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, SystemTime};

use anyhow::{Context as _, ensure};
use serde_json::{Value, json};

/// Slots of the worker.
const SLOTS: usize = 16;
/// Seconds of a call above which the campaign has few samples.
const LONG: f64 = 0.5;

/// A campaign of four variables: a DoE, a search without random effects, and one on the model. If a call takes long,
/// there are up to 20 rounds of infill, too; otherwise the decisions take longer than the calls. Nothing is asked before
/// the work begins (`probe_designs = 0`).
fn campaign(seconds: f64) -> String {
    let is_long = seconds > LONG;
    let [designs, per_design, verified] = match is_long {
        true => [40, 10, 200],
        false => [500, 100, 4000],
    };
    let rounds = match is_long {
        true => {
            "[enrichment]\nsamples = 1200\nrounds = 20\npoints_per_round = 12\nsamples_per_point = 10\ntolerance = 0.0001\n"
        }
        false => "",
    };
    let variables = ["a", "b", "c", "d"];
    let variables =
        variables.map(|name| format!("[[variables]]\nname = {name:?}\nlow = -2.0\nhigh = 2.0\n"));
    format!(
        "kind = \"external\"\nformat = 1\nname = \"busy\"\nseed = 1\n{}\
         [[constraints]]\nname = \"distance\"\nmax = 1.5\n\
         [[responses]]\nname = \"depth\"\nunit = \"mm\"\nbaseline = true\n\
         [doe]\ndesigns = {designs}\n\
         [sampling]\nsamples_per_design = {per_design}\nestimator = \"normal\"\n\
         [simulator]\nprobe_designs = 0\n\
         [optimise]\npopulation = 10\nparents = 5\nstep = 0.3\nevaluations = 200\nrestarts = \"ipop\"\nstarts = 1\n\
         [verify]\nsamples = {verified}\n\
         {rounds}",
        variables.concat()
    )
}

/// Runs the campaign with a program whose calls take `seconds`, and prints the share of the slots' time that the
/// program was busy, from the first call to the last.
pub(super) fn busy(seconds: f64) -> anyhow::Result<()> {
    let folder = tempfile::tempdir()?;
    let file = folder.path().join("busy.toml");
    fs::write(&file, campaign(seconds))?;
    let calls = folder.path().join("calls");
    fs::create_dir(&calls)?;
    let exe = std::env::current_exe()?;
    let exec = format!("exec {exe:?} sleep {seconds} {calls:?}");
    let mut run = Command::new(env!("CARGO_BIN_EXE_coordinator"));
    run.arg("run").arg(&file).args(["--exec", &exec]);
    run.args(["--workers", &SLOTS.to_string()]);
    run.arg("--db").arg(folder.path().join("busy.db"));
    run.arg("--out").arg(folder.path().join("report"));
    let status = run.stdout(Stdio::null()).stderr(Stdio::null()).status()?;
    ensure!(status.success(), "the campaign ended with {status}");

    let (mut evaluations, mut samples) = (0_u64, 0_u64);
    let (mut first, mut last, mut sum) = (f64::INFINITY, 0.0_f64, 0.0);
    for entry in fs::read_dir(&calls)? {
        for line in fs::read_to_string(entry?.path())?.lines() {
            let mut words = line.split(' ');
            let kind = words.next().unwrap_or_default();
            *(if kind == "sample" {
                &mut samples
            } else {
                &mut evaluations
            }) += 1;
            let mut number = || -> anyhow::Result<f64> {
                Ok(words.next().context("a time is missing")?.parse()?)
            };
            let (begin, end) = (number()?, number()?);
            (first, last) = (first.min(begin), last.max(end));
            sum += end - begin;
        }
    }
    let wall = last - first;
    println!(
        "{evaluations} evaluations and {samples} samples of {seconds} s in {SLOTS} slots: {wall:.1} s, busy {:.1} %",
        100.0 * sum / (SLOTS as f64 * wall)
    );
    Ok(())
}

/// The program: it answers after `seconds`, and writes the times of its calls to a file in `folder`.
pub(super) fn sleep(seconds: f64, folder: &Path) -> anyhow::Result<()> {
    let now = || -> anyhow::Result<f64> {
        let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH)?;
        Ok(since.as_secs_f64())
    };
    let mut log = File::create(folder.join(std::process::id().to_string()))?;
    let mut out = std::io::stdout().lock();
    for line in std::io::stdin().lock().lines() {
        let request: Value = serde_json::from_str(&line?)?;
        let kind = request["request"].as_str().unwrap_or_default();
        let id = &request["id"];
        if kind == "describe" {
            writeln!(
                out,
                "{}",
                json!({"id": id, "protocol": 2, "version": "busy 1"})
            )?;
            continue;
        }
        let begin = now()?;
        std::thread::sleep(Duration::from_secs_f64(seconds));
        let at = |name: &str| request["design"][name].as_f64().unwrap_or_default();
        let x = ["a", "b", "c", "d"].map(at);
        let bowl = |(i, x): (i32, &f64)| (x - 0.3 * f64::from(i)).powi(2);
        let depth = 1.3 + 0.3 * (4.0 * x[0]).sin() + (0..).zip(&x).map(bowl).sum::<f64>();
        let distance = x.iter().map(|x| x * x).sum::<f64>().sqrt();
        let answer = match kind {
            // A uniform random factor that follows from the seed.
            "sample" => {
                let word = request["seed"][0].as_u64().unwrap_or_default() as u32;
                json!({"id": id, "depth": depth * (0.9 + 0.2 * f64::from(word) / f64::from(u32::MAX))})
            }
            _ => json!({"id": id, "depth": depth, "distance": distance}),
        };
        writeln!(log, "{kind} {begin} {}", now()?)?;
        writeln!(out, "{answer}")?;
    }
    Ok(())
}
