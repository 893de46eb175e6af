//! The example's program fails: designs are quarantined or tried again, and no other design suffers.

use std::os::unix::process::ExitStatusExt as _;

use acceptance::{SIGABRT, Sandbox, assert_all_succeed, assert_code, errors, printed};

use crate::example::{
    before_samples, campaign, changed_program, finished, path, program, run_before_designs,
    twenty_designs,
};
use crate::place::{DB, Place};

/// 20 strata of the range from −0.3 to 1: exactly one design has an x_p above 0.935.
const ONE_OF_20: &str = "design[\"x_p\"] > 0.935";

#[test]
fn a_design_that_kills_its_workers_at_once_is_quarantined() {
    let sandbox = Sandbox::new();
    let file = twenty_designs(&sandbox);
    // The worker is the parent process of the program.
    let deadly = before_samples(ONE_OF_20, "os.kill(os.getppid(), 9)");
    let exec = changed_program(&sandbox, "deadly.py", &deadly);
    let place = Place::of_file(&sandbox, &file);
    let coordinator = place.serve(&[]);
    sandbox.wait_for(DB, "a store", |_| true);
    let mut crashes = 0;
    let since = std::time::Instant::now();
    loop {
        let worker = place.work(&["--slots", "1", "--exec", &exec]);
        match worker.status.code() {
            Some(0) => break,
            None => crashes += 1,
            Some(code) => panic!("{code}: {}", errors(&worker)),
        }
        let is_patient = since.elapsed().as_secs() < 600;
        assert!(
            is_patient,
            "the deadly design is tried for ever: {crashes} crashes"
        );
    }
    let (ended, errors) = coordinator.finish();
    assert_eq!(ended.code(), Some(13), "{errors}");
    // Three crashes count against the design alone. A crash that is so quick that the coordinator does not
    // know that the job had started does not count, and how many of these there are depends on the load of
    // the machine.
    assert!(crashes >= 3, "{crashes} crashes");
    let status = finished(&sandbox, DB);
    assert_eq!(status["designs"]["done"], 19, "{status}");
}

/// Every coordinator but the last crashes after its first commit and before the acknowledgement.
///
/// The results of a report are committed before its failures, and every coordinator commits again
/// the samples of a design that lacks others: the failure would have to wait until the design lacks
/// no other samples. Therefore the campaign has only one job until it is done, a run of an
/// optimiser, whose first attempt fails. On a busy machine the second attempt may have results
/// before the failure is acknowledged. Then the failure is the second commit.
#[test]
fn a_failure_that_was_not_acknowledged_is_reported_again_and_counts_once() {
    let sandbox = Sandbox::new();
    let file = run_before_designs(&sandbox);
    // The program fails once, when it is asked about the first design.
    let log = path(&sandbox.path("failed"));
    let asked = "        pair = Pair(";
    let failing = format!(
        "        import os\n        if not os.path.exists({log:?}):\n            \
         open({log:?}, 'x').close(); sys.exit('no licence')\n{asked}"
    );
    let exec = program(&sandbox, "failing.py", &[(asked, &failing)]);
    let place = Place::of_file(&sandbox, &file);
    let worker = place.worker(&["--slots", "1", "--exec", &exec]);
    let failures = || {
        sandbox
            .status(DB)
            .map_or(0.into(), |s| s["failures"].clone())
    };
    let mut crashes = 0;
    while failures() == 0 {
        // The commits before it are the wanted generations, the DoE, the model digest, and on a busy machine an
        // evaluation.
        assert!(crashes < 50, "the failure was not stored");
        let point = if crashes < 8 {
            "after_commit"
        } else {
            "after_commit:2"
        };
        let (status, errors) = place.serve_dying(point).finish();
        assert_eq!(status.signal(), Some(SIGABRT), "{status} {errors}");
        crashes += 1;
    }
    assert_all_succeed([("coordinator", place.serve(&[])), ("worker", worker)]);
    let status = finished(&sandbox, DB);
    assert_eq!(status["designs"]["done"], 20, "{status}");
    assert_eq!(status["failures"], 1, "{status}");
}

#[test]
fn a_design_that_was_quarantined_gets_another_chance_when_it_is_asked_for() {
    let sandbox = Sandbox::new();
    let file = twenty_designs(&sandbox);
    let licence = path(&sandbox.path("licence"));
    let condition = format!("{ONE_OF_20} and not os.path.exists({licence:?})");
    let failing = before_samples(&condition, "sys.exit('no licence')");
    let exec = changed_program(&sandbox, "failing.py", &failing);
    let place = Place::of_file(&sandbox, &file);
    let coordinator = place.serve(&["--keep-serving"]);
    sandbox.wait_for(DB, "a store", |_| true);
    let work = ["--slots", "2", "--exec", &exec];
    assert_code(&place.work(&work), 0);
    let spoilt = finished(&sandbox, DB);
    assert_eq!(spoilt["designs"]["done"], 19, "{spoilt}");

    std::fs::write(&licence, "paid").unwrap();
    let retried = place.ask(&["retry"]);
    assert!(retried.starts_with("design-"), "{retried}");
    assert_code(&place.work(&work), 0);
    let whole = finished(&sandbox, DB);
    assert_eq!(whole["designs"]["done"], 20, "{whole}");
    let again = place.ask(&["retry"]);
    assert!(again.contains("nothing was quarantined"), "{again}");
    coordinator.terminate();
    assert_eq!(coordinator.finish().0.code(), Some(0));

    // The store equals that of an undisturbed campaign.
    let run = ["run", &file, "--db", "alone.db", "--exec", &exec];
    assert_code(&sandbox.coordinator(&run), 0);
    let alone = finished(&sandbox, "alone.db");
    assert_eq!(whole["samples_digest"], alone["samples_digest"]);
    assert_eq!(whole["optima"], alone["optima"]);
}

/// The exit status and the log of a coordinator.
fn told(sandbox: &Sandbox, arguments: &[&str]) -> (std::process::ExitStatus, String) {
    let log = [("PITCHLINE_LOG", "info"), ("NO_COLOR", "1")];
    sandbox.start_with("coordinator", arguments, &log).finish()
}

/// All but the first samples of one design always fail. The response is computed once from those,
/// and the campaign ends without the others and reports it, however often it is started.
#[test]
fn samples_that_always_fail_end_a_campaign_that_wants_more_of_them() {
    let sandbox = Sandbox::new();
    let file = campaign(
        &sandbox,
        &[
            ("designs = 60", "designs = 20"),
            ("probe_designs = 3", "probe_designs = 0\nretry_s = 2.0"),
            (
                "samples_per_design = 25",
                "samples_per_design = 25\nprecision = 0.001\nsamples_max = 60\n\
                 failed = \"quarantines-design\"",
            ),
        ],
    );
    let log = path(&sandbox.path("asked"));
    let action = format!(
        "open({log:?}, 'a').write(str(seed) + '\\n'); \
         len(set(open({log:?}))) > 55 and sys.exit('no licence')"
    );
    let exec = changed_program(&sandbox, "failing.py", &before_samples(ONE_OF_20, &action));
    let run = ["run", &file, "--db", DB, "--exec", &exec];
    for _ in 0..2 {
        let (ended, said) = told(&sandbox, &run);
        assert_eq!(ended.code(), Some(13), "{said}");
        let computed = said.matches("responses computed").count();
        assert!(computed <= 1, "computed {computed} times: {said}");
        assert!(said.contains("quarantined streams=design-"), "{said}");
    }
}

/// Impossible results of a simulator are refused with a message, and correct results afterwards are
/// accepted.
#[test]
fn numbers_that_cannot_be_are_refused_and_the_mended_simulator_goes_on() {
    let sandbox = Sandbox::new();
    // Each candidate of a search fails, too: a short search.
    let file = campaign(
        &sandbox,
        &[
            ("designs = 60", "method = \"random\"\ndesigns = 20"),
            (
                "probe_designs = 3",
                "probe_designs = 0\nretry_s = 1.0\nattempts = 1",
            ),
            ("evaluations = 300 ", "evaluations = 20 "),
            ("restart_at = 150", "restart_at = 10"),
            (
                "[sampling]\n",
                "[sampling]\nfailed = \"quarantines-design\"\n",
            ),
        ],
    );
    let mended = path(&sandbox.path("mended"));
    let absurd = [
        (
            "import random\n".to_owned(),
            "import os\nimport random\n".to_owned(),
        ),
        (
            "            \"delta_ste_um\": self.unworn_ste_um(),".to_owned(),
            format!(
                "            \"delta_ste_um\": -5.0 if not os.path.exists({mended:?}) else \
                 self.unworn_ste_um(),"
            ),
        ),
    ];
    let exec = changed_program(&sandbox, "absurd.py", &absurd);
    let run = ["run", &file, "--db", DB, "--exec", &exec];
    let (ended, said) = told(&sandbox, &run);
    assert_eq!(ended.code(), Some(13), "{said}");
    let refused = "-5e0 µm, but a ΔSTE lies between 0";
    assert!(said.contains(refused), "{said}");
    let status = sandbox.status(DB).unwrap();
    assert_eq!(status["samples"]["done"], 0, "{status}");

    std::fs::write(&mended, "").unwrap();
    // The store has only the finding of the first attempt, that there is no optimum without
    // samples. The samples are now taken.
    let (_, said) = told(&sandbox, &run);
    let status = sandbox.status(DB).unwrap();
    assert!(status["samples"]["done"].as_u64() > Some(0), "{status}");
    assert!(!said.contains(refused), "{said}");
}

/// A licence server that is down for two seconds does not end the campaign.
#[test]
fn a_simulator_that_fails_for_two_seconds_costs_nothing_but_time() {
    let sandbox = Sandbox::new();
    let file = twenty_designs(&sandbox);
    let began = path(&sandbox.path("began"));
    let action = format!(
        "now = __import__('time').time(); \
         os.path.exists({began:?}) or open({began:?}, 'w').write(str(now)); \
         now < float(open({began:?}).read()) + 2.0 and sys.exit('no licence')"
    );
    let exec = changed_program(&sandbox, "away.py", &before_samples("True", &action));
    let run = ["run", &file, "--db", DB, "--workers", "1", "--exec", &exec];
    let (ended, said) = told(&sandbox, &run);
    assert_eq!(ended.code(), Some(0), "{said}");
    assert!(said.contains("no licence again_in="), "{said}");
    assert!(finished(&sandbox, DB)["failures"].as_u64() > Some(0));
}

#[test]
fn a_program_that_fails_on_one_design_spoils_no_other() {
    let sandbox = Sandbox::new();
    let file = twenty_designs(&sandbox);
    let failing = before_samples(
        ONE_OF_20,
        "sys.stderr.write('the mesher gave up\\n'); sys.exit(7)",
    );
    let exec = changed_program(&sandbox, "failing.py", &failing);
    let run = ["run", &file, "--db", "store.db", "--exec", &exec];
    assert_code(&sandbox.coordinator(&run), 13);
    let status = finished(&sandbox, "store.db");
    let table = ["export", "--db", "store.db", "--table", "failures"];
    let table = [&table[..], &["--out", "failures.csv"]].concat();
    assert_code(&sandbox.coordinator(&table), 0);
    let failures = std::fs::read_to_string(sandbox.path("failures.csv")).unwrap();
    for part in [
        "exit status: 7",
        "the mesher gave up",
        "sample 0",
        "quarantine",
    ] {
        assert!(failures.contains(part), "no {part:?} in {failures}");
    }
    assert_eq!(status["designs"]["done"], 19, "{status}");
    let simulable = status["designs"]["simulable"].as_u64().unwrap();
    assert_eq!(status["samples"]["done"], 25 * simulable);
    // The row of the design without samples contains the reason.
    let table = [
        "export", "--db", "store.db", "--table", "designs", "--out", "-",
    ];
    let designs = sandbox.coordinator(&table);
    assert_code(&designs, 0);
    let designs = printed(&designs);
    let quarantined = designs.lines().filter(|row| row.contains("quarantined: "));
    let quarantined: Vec<&str> = quarantined.collect();
    assert_eq!(quarantined.len(), 1, "{designs}");
    assert!(quarantined[0].contains(",,,0,"), "{quarantined:?}");
    assert!(quarantined[0].contains("exit status: 7"), "{quarantined:?}");
}
