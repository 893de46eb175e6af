//! Optimiser runs on a slow simulator that go on where they were when their worker ends.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use acceptance::{Running, Sandbox, assert_code};
use campaign::optimise::RunResult;
use store::{RunStateRow, Store};

use crate::external::{campaign, program};
use crate::place::{DB, Place};

/// The only job of the campaign until it is done, as the store calls it.
const RUN: &str = "run no-wear 0";

/// The example's program, which notes every question before it answers after `seconds`.
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

/// The designs whose analysis without wear was asked for by the run: before the first worn one.
fn analysed(log: &PathBuf) -> Vec<String> {
    let text = std::fs::read_to_string(log).unwrap_or_default();
    let whole = text.lines().filter(|line| line.ends_with('}'));
    let of_run = whole.take_while(|line| !line.starts_with("worn"));
    let unworn = of_run.filter_map(|line| line.strip_prefix("unworn"));
    unworn.map(str::to_owned).collect()
}

/// What the store holds of the run: its result as JSON, and where it is.
fn held(sandbox: &Sandbox, db: &str) -> (Option<String>, Option<RunStateRow>) {
    let runtime = tokio::runtime::Runtime::new().unwrap();
    runtime.block_on(async {
        let store = Store::open_read_only(&sandbox.path(db)).await.unwrap();
        let runs = store.optimiser_runs().await.unwrap();
        let result = runs.into_iter().find(|run| run.approach == "no-wear");
        let state = store.run_state(RUN).await.unwrap();
        store.close().await.unwrap();
        (result.map(|run| run.result_json), state)
    })
}

fn eventually(what: &str, holds: impl Fn() -> bool) {
    let since = Instant::now();
    while !holds() {
        assert!(since.elapsed().as_secs() < 60, "waited in vain for {what}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// Ends the first worker of a run by `end`, has a second one end the campaign, and compares with a run
/// that nothing disturbed.
fn goes_on(lease: &str, end: impl Fn(&Sandbox, &PathBuf, Running)) {
    let sandbox = Sandbox::new();
    let file = campaign(
        &sandbox,
        &[
            ("probe_designs = 3", "probe_designs = 0"),
            ("from = \"printed\"", "from = \"deterministic\""),
            ("designs = 60", "designs = 20"),
            ("starts = 2", "starts = 1"),
        ],
    );
    let (exec, log) = noting(&sandbox, "undisturbed", 0.0);
    let run = [
        "run",
        &file,
        "--db",
        "alone.db",
        "--workers",
        "1",
        "--exec",
        &exec,
    ];
    assert_code(&sandbox.coordinator(&run), 0);
    let (expected, left) = held(&sandbox, "alone.db");
    assert_eq!(left, None, "a finished run leaves no state");
    let whole = analysed(&log);
    let expected = expected.expect("the run is finished");
    let evaluations = serde_json::from_str::<RunResult>(&expected)
        .unwrap()
        .evaluations;

    let place = Place::of_file(&sandbox, &file);
    let coordinator = place.serve_for(lease);
    sandbox.wait_for(DB, "a store", |_| true);
    let (exec, begun) = noting(&sandbox, "begun", 0.01);
    let worker = place.worker(&["--slots", "1", "--grace", "2", "--exec", &exec]);
    end(&sandbox, &begun, worker);
    let (result, state) = held(&sandbox, DB);
    assert_eq!(result, None, "the run was too short to be disturbed");
    let done = state.expect("the run has left its state").evaluations;

    let (exec, ended) = noting(&sandbox, "ended", 0.0);
    assert_code(&place.work(&["--slots", "1", "--exec", &exec]), 0);
    let (status, errors) = coordinator.finish();
    assert_eq!(status.code(), Some(0), "{errors}");

    let (begun, ended) = (analysed(&begun), analysed(&ended));
    assert!(whole.starts_with(&begun), "the first worker began the run");
    assert!(whole.ends_with(&ended), "the second worker ended the run");
    assert!(done >= 50 && ended.len() as u64 <= evaluations - done);
    assert!(
        ended.len() < whole.len() && begun.len() + ended.len() >= whole.len(),
        "{} and {} calls for {}",
        begun.len(),
        ended.len(),
        whole.len()
    );
    assert_eq!(held(&sandbox, DB), (Some(expected), None));
    let optima = |db| sandbox.status(db).expect("the store is there")["optima"].clone();
    assert_eq!(optima(DB), optima("alone.db"));
}

#[test]
fn a_run_whose_worker_is_killed_goes_on_at_another_one() {
    goes_on("2", |sandbox, _, worker| {
        eventually("a state", || held(sandbox, DB).1.is_some());
        worker.kill();
    });
}

#[test]
fn a_run_whose_worker_is_asked_to_leave_goes_on_at_another_one() {
    goes_on("30", |sandbox, log, worker| {
        eventually("half of the run", || analysed(log).len() > 60);
        assert_eq!(held(sandbox, DB).1, None, "nothing was told yet");
        worker.terminate();
        let (status, errors) = worker.finish();
        assert_eq!(status.code(), Some(14), "{errors}");
    });
}
