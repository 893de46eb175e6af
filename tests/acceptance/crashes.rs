//! A design whose simulation kills the process that computes it: it crashes few processes, and no other design is
//! suspected in the end.

use std::os::unix::process::ExitStatusExt as _;
use std::process::ExitStatus;

use acceptance::{RunningProgram, Sandbox, python};
use serde_json::Value;

use crate::place::{DB, Place};

const DESIGNS: u64 = 30;
const SAMPLES: u64 = 4;

/// A parabola of two variables.
const CAMPAIGN: &str = "kind = \"external\"\nformat = 1\nname = \"deadly\"\nseed = 1\n\n\
    [[variables]]\nname = \"a\"\nlow = 0.0\nhigh = 1.0\n\n\
    [[variables]]\nname = \"b\"\nlow = 0.0\nhigh = 1.0\n\n\
    [[responses]]\nname = \"y\"\nbaseline = true\n\n\
    [doe]\ndesigns = 30\n\n[sampling]\nsamples_per_design = 4\n\n\
    [optimise]\nevaluations = 40\nstarts = 1\n\n[verify]\nsamples = 30\n\n\
    [simulator]\nprobe_designs = 0\n";

/// The program kills the `worker` or `coordinator` above it when a sample of one of the deadly designs is asked for. A
/// Latin hypercube has one design in each thirtieth of a variable.
const PROGRAM: &str = "import json, os, random, sys, time\n\
    def killed():\n    \
        pid = os.getppid()\n    \
        while open(f'/proc/{pid}/comm').read().strip() not in ('worker', 'coordinator'):\n        \
            pid = int(open(f'/proc/{pid}/stat').read().rsplit(')', 1)[1].split()[1])\n    \
        os.kill(pid, 9)\n    \
        time.sleep(60)\n\
    for line in sys.stdin:\n    \
        r = json.loads(line)\n    \
        d = r.get('design', {})\n    \
        if r['request'] == 'describe':\n        a = {'protocol': 2, 'version': '1'}\n    \
        else:\n        \
            y = (d['a'] - 0.3) ** 2 + (d['b'] - 0.6) ** 2\n        \
            if r['request'] == 'evaluate':\n            a = {n: y for n in r['responses']}\n        \
            else:\n            \
                if int(d['a'] * 30) in DEADLY:\n                killed()\n            \
                time.sleep(0.02)\n            \
                seed = sum(w << (32 * i) for i, w in enumerate(r['seed']))\n            \
                a = {'y': y + 0.1 * random.Random(seed).gauss(0, 1)}\n    \
        print(json.dumps({**a, 'id': r['id']}), flush=True)\n";

/// Maximum number of processes that one design may crash.
const CRASHES: usize = 5;
/// The exit code of a campaign with quarantined designs.
const QUARANTINED: i32 = 13;

fn exec(sandbox: &Sandbox, deadly: &[u32]) -> String {
    let program = PROGRAM.replace("DEADLY", &format!("{deadly:?}"));
    python(&sandbox.write("program.py", &program))
}

/// Checks that all designs are computed but the deadly ones, which are quarantined.
fn assert_only_the_deadly(sandbox: &Sandbox, deadly: &[u32]) {
    let status = sandbox.status(DB).expect("the store is there");
    let done = (DESIGNS - deadly.len() as u64) * SAMPLES;
    assert_eq!(status["samples"]["done"], Value::from(done), "{status}");
}

fn was_killed(status: ExitStatus) -> bool {
    status.signal() == Some(9)
}

#[test]
fn a_run_with_a_deadly_design_ends() {
    for workers in ["1", "2", "4"] {
        let sandbox = Sandbox::new();
        let file = sandbox.write("c.toml", CAMPAIGN).display().to_string();
        let deadly = [20];
        let exec = exec(&sandbox, &deadly);
        let run = [
            "run",
            &file,
            "--db",
            DB,
            "--workers",
            workers,
            "--exec",
            &exec,
        ];
        let mut crashes = 0;
        let ended = loop {
            let ended = sandbox.coordinator(&run);
            if !was_killed(ended.status) {
                break ended;
            }
            crashes += 1;
            assert!(crashes <= CRASHES, "{workers} workers: {crashes} crashes");
        };
        acceptance::assert_code(&ended, QUARANTINED);
        assert!(crashes >= 3, "{crashes}");
        assert_only_the_deadly(&sandbox, &deadly);
        let notes = std::fs::read_dir(sandbox.path("")).unwrap();
        let notes = notes.filter(|entry| {
            let name = entry.as_ref().unwrap().file_name();
            name.to_string_lossy().ends_with(".begun")
        });
        assert_eq!(notes.count(), 0, "a run that ends leaves no note");
    }
}

/// Serves the campaign to a worker, which is replaced whenever it crashes. With `has_notes` all of them have the same
/// folder for their notes, otherwise each has a new one, as on another machine. Returns the number of crashes.
fn crashes(sandbox: &Sandbox, slots: &str, deadly: &[u32], has_notes: bool) -> usize {
    let place = Place::new(sandbox, CAMPAIGN);
    let exec = exec(sandbox, deadly);
    let coordinator = place.serve_for("30");
    let mut crashes = 0;
    loop {
        let folder = match has_notes {
            true => "notes".to_owned(),
            false => format!("notes-{crashes}"),
        };
        let worker: RunningProgram = place.worker(&[
            "--slots",
            slots,
            "--exec",
            &exec,
            "--undelivered",
            sandbox.path(&folder).to_str().unwrap(),
        ]);
        let (ended, said) = worker.finish();
        if !was_killed(ended) {
            assert_eq!(ended.code(), Some(0), "{said}");
            break;
        }
        crashes += 1;
        assert!(crashes <= CRASHES * deadly.len(), "{crashes} crashes");
    }
    let (ended, said) = coordinator.finish();
    assert_eq!(ended.code(), Some(QUARANTINED), "{said}");
    assert_only_the_deadly(sandbox, deadly);
    crashes
}

#[test]
fn a_deadly_design_kills_few_workers() {
    for slots in ["1", "8"] {
        for has_notes in [true, false] {
            crashes(&Sandbox::new(), slots, &[20], has_notes);
        }
    }
}

#[test]
fn deadly_designs_quarantine_no_other() {
    for slots in ["1", "16"] {
        crashes(&Sandbox::new(), slots, &[12, 20, 27], false);
    }
}
