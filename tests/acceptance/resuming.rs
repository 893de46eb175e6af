//! Optimiser runs on a slow simulator are shared by workers and continued after a restart.

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use acceptance::{RunningProgram, Sandbox, assert_code};
use ledger::StreamId;
use store::{EvaluationRow, Store};

use crate::example::{program, run_before_designs};
use crate::place::DB;

/// The only job of the campaign until it is done, by its name in the store.
/// The first run without wear.
const RUN: StreamId = StreamId::run(1, 0);

/// The example's program, which logs every request and answers after `seconds`.
fn noting(sandbox: &Sandbox, name: &str, seconds: f64) -> (String, PathBuf) {
    let log = sandbox.path(&format!("{name}.log"));
    let asked = "        pair = Pair(";
    let note = format!(
        "        is_worn = 'hertz_pressure_mpa' not in request.get('responses', [])\n        \
         with open({log:?}, 'a') as log:\n            \
         log.write(('worn' if is_worn else 'unworn') + json.dumps(request['design']) + '\\n')\n        \
         __import__('time').sleep({seconds})\n{asked}"
    );
    let exec = program(sandbox, &format!("{name}.py"), &[(asked, &note)]);
    (exec, log)
}

/// The designs whose analysis without wear the run requested, up to the first request with wear.
fn analysed(log: &PathBuf) -> Vec<String> {
    let text = std::fs::read_to_string(log).unwrap_or_default();
    let whole = text.lines().filter(|line| line.ends_with('}'));
    let of_run = whole.take_while(|line| !line.starts_with("worn"));
    let unworn = of_run.filter_map(|line| line.strip_prefix("unworn"));
    unworn.map(str::to_owned).collect()
}

/// The stored result of the run as JSON, and its stored evaluations.
fn held(sandbox: &Sandbox, db: &str) -> (Option<String>, Vec<EvaluationRow>) {
    let runtime = tokio::runtime::Runtime::new().unwrap();
    runtime.block_on(async {
        let store = Store::open_read_only(&sandbox.path(db)).await.unwrap();
        let runs = store.optimiser_runs().await.unwrap();
        let result = runs.into_iter().find(|run| run.stream == RUN);
        let evaluations = store.evaluations(RUN, 0).await.unwrap();
        store.close().await.unwrap();
        (result.map(|run| run.result_json), evaluations)
    })
}

/// Ends the coordinator and the workers of a run with `end`, continues the run, and compares it
/// with an undisturbed run of one worker.
fn goes_on(end: impl Fn(RunningProgram)) {
    let sandbox = Sandbox::new();
    let file = run_before_designs(&sandbox);
    fn run<'a>(file: &'a str, db: &'a str, workers: &'a str, exec: &'a str) -> [&'a str; 8] {
        [
            "run",
            file,
            "--db",
            db,
            "--workers",
            workers,
            "--exec",
            exec,
        ]
    }
    let (exec, _) = noting(&sandbox, "undisturbed", 0.0);
    assert_code(&sandbox.coordinator(&run(&file, "alone.db", "1", &exec)), 0);
    let expected = held(&sandbox, "alone.db");
    assert!(expected.0.is_some(), "the run is finished");
    assert!(expected.1.len() >= 200, "{} evaluations", expected.1.len());

    let (exec, begun) = noting(&sandbox, "begun", 0.02);
    let running = sandbox.start("coordinator", &run(&file, DB, "3", &exec));
    let since = Instant::now();
    while analysed(&begun).len() < 60 {
        assert!(since.elapsed().as_secs() < 60, "the run did not begin");
        std::thread::sleep(Duration::from_millis(20));
    }
    end(running);
    let (result, kept) = held(&sandbox, DB);
    assert_eq!(result, None, "the run was too short to be disturbed");
    let kept = kept.len();
    assert!(kept >= 50, "{kept} evaluations are stored");

    let (exec, ended) = noting(&sandbox, "ended", 0.0);
    assert_code(&sandbox.coordinator(&run(&file, DB, "3", &exec)), 0);
    assert_eq!(held(&sandbox, DB), expected);
    // Stored evaluations are not requested again.
    let begun: BTreeSet<String> = analysed(&begun).into_iter().collect();
    let ended: BTreeSet<String> = analysed(&ended).into_iter().collect();
    let twice = begun.intersection(&ended).count();
    let (begun, left) = (begun.len(), begun.len().saturating_sub(kept));
    assert!(
        twice <= left,
        "{twice} of {begun} twice, {kept} were stored"
    );
    let optima = |db| {
        let status = sandbox.status(db).expect("the store is there");
        status["optima"].clone()
    };
    assert_eq!(optima(DB), optima("alone.db"));
}

#[test]
fn a_run_on_an_external_simulator_that_is_killed_goes_on() {
    goes_on(RunningProgram::kill);
}

#[test]
fn a_run_on_an_external_simulator_that_is_stopped_goes_on() {
    goes_on(|running| {
        running.terminate();
        let (status, errors) = running.finish();
        assert_eq!(status.code(), Some(14), "{errors}");
    });
}

/// Every evaluation takes a tenth of a second, and ten workers compute the candidates of a
/// generation in parallel.
#[test]
fn the_workers_share_the_candidates_of_a_generation() {
    let sandbox = Sandbox::new();
    let file = run_before_designs(&sandbox);
    let (exec, log) = noting(&sandbox, "shared", 0.1);
    let run = ["run", &file, "--db", DB, "--workers", "10", "--exec", &exec];
    let running = sandbox.start("coordinator", &run);
    let since = Instant::now();
    let mut most = 0;
    // Requests are logged when they begin, so those within one tenth of a second run in parallel.
    while most < 5 {
        assert!(since.elapsed().as_secs() < 60, "{most} at the same time");
        let before = analysed(&log).len();
        std::thread::sleep(Duration::from_millis(80));
        most = most.max(analysed(&log).len() - before);
    }
    running.kill();
}
