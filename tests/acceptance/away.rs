//! Workers whose coordinator is away: no sample is thrown away, and none is computed twice.

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use acceptance::{
    RunningProgram, Sandbox, assert_all_succeed, assert_code, changed, errors, printed, python,
    root,
};

use crate::example::path;
use crate::place::{DB, Place};

/// Number of samples of the campaign's designs.
const SAMPLES: usize = 60;

/// A small external campaign, and the command of its program, which takes `seconds` for a sample
/// and notes each in a file.
fn slow(sandbox: &Sandbox, seconds: &str) -> (String, String) {
    let case = |name| {
        let file = root()
            .join("tests/acceptance/cases/stdout-and-buffering")
            .join(name);
        std::fs::read_to_string(file).expect("the case's files")
    };
    let campaign = changed(
        &case("bowl.toml"),
        &[
            ("samples_per_design = 25", "samples_per_design = 6"),
            ("probe_designs = 1", "probe_designs = 0"),
        ],
    );
    let calls = sandbox.path("calls").display().to_string();
    let note = format!(
        "open({calls:?}, 'a').write(str(r['design']) + str(r['seed']) + '\\n'); time.sleep({seconds})"
    );
    let program = changed(&case("bowl.py"), &[("if slp: time.sleep(slp)", &note)]);
    (
        path(&sandbox.write("bowl.toml", &campaign)),
        python(&sandbox.write("slow.py", &program)),
    )
}

/// The number of samples that were begun. Asserts that each was begun only once.
fn calls(sandbox: &Sandbox) -> usize {
    let text = std::fs::read_to_string(sandbox.path("calls")).unwrap_or_default();
    let samples: BTreeSet<&str> = text.lines().collect();
    assert_eq!(
        samples.len(),
        text.lines().count(),
        "samples were computed twice: {text}"
    );
    samples.len()
}

/// The files of undelivered results.
fn files(sandbox: &Sandbox) -> Vec<PathBuf> {
    let folder = std::fs::read_dir(sandbox.path("pitchline/undelivered"));
    let files = folder.into_iter().flatten().filter_map(Result::ok);
    files
        .map(|file| file.path())
        .filter(|path| path.extension().is_some_and(|ending| ending == "part"))
        .collect()
}

fn done(sandbox: &Sandbox) -> u64 {
    let status = sandbox.status(DB).expect("a store");
    status["samples"]["done"].as_u64().expect("a number")
}

/// Starts a coordinator and a worker, and kills the coordinator while samples are computed.
fn worker_without_coordinator(
    place: &Place<'_>,
    sandbox: &Sandbox,
    work: &[&str],
) -> RunningProgram {
    let coordinator = place.serve(&[]);
    let worker = place.worker(work);
    sandbox.wait_for(DB, "some samples", |status| {
        status["samples"]["done"].as_u64() > Some(4)
    });
    coordinator.kill();
    worker
}

fn finish(place: &Place<'_>, sandbox: &Sandbox, work: &[&str]) -> String {
    let coordinator = place.serve(&[]);
    let log = [("PITCHLINE_LOG", "info"), ("NO_COLOR", "1")];
    let connect = ["--connect", &place.address];
    let worker = sandbox.start_with("worker", &[&connect, work].concat(), &log);
    let (status, said) = worker.finish();
    assert_eq!(status.code(), Some(0), "{said}");
    let (status, errors) = coordinator.finish();
    assert_eq!(status.code(), Some(0), "{errors}");
    assert!(calls(sandbox) >= SAMPLES, "{}", calls(sandbox));
    assert!(files(sandbox).is_empty(), "{:?}", files(sandbox));
    said
}

#[test]
fn what_a_worker_cannot_deliver_before_it_leaves_is_merged() {
    let sandbox = Sandbox::new();
    let (file, exec) = slow(&sandbox, "0.3");
    let place = Place::of_file(&sandbox, &file);
    let work = ["--slots", "2", "--give-up-after", "1", "--exec", &exec];
    let worker = worker_without_coordinator(&place, &sandbox, &work);
    let (status, said) = worker.finish();
    assert_eq!(status.code(), Some(11), "{said}");
    let left = files(&sandbox);
    assert_eq!(left.len(), 1, "{said}");
    assert!(said.contains(&*left[0].to_string_lossy()), "{said}");

    let before = done(&sandbox);
    for _ in 0..2 {
        let merged = sandbox.coordinator(&["merge", "--db", DB, &path(&left[0])]);
        assert_code(&merged, 0);
        assert!(printed(&merged).contains("merged"), "{}", errors(&merged));
        assert!(done(&sandbox) > before);
        assert_eq!(done(&sandbox), calls(&sandbox) as u64, "all that was begun");
    }
    finish(&place, &sandbox, &["--slots", "2", "--exec", &exec]);
}

/// Ends a worker whose coordinator is away by `end`, and asserts that the next worker delivers its results.
fn delivered_after(end: impl FnOnce(&Sandbox, RunningProgram)) {
    let sandbox = Sandbox::new();
    let (file, exec) = slow(&sandbox, "0.3");
    let place = Place::of_file(&sandbox, &file);
    let work = ["--slots", "2", "--exec", &exec];
    let worker = worker_without_coordinator(&place, &sandbox, &work);
    end(&sandbox, worker);
    let said = finish(&place, &sandbox, &work);
    assert!(
        said.contains("delivering the results of a former worker"),
        "{said}"
    );
}

#[test]
fn what_a_stopped_worker_leaves_is_delivered_by_the_next_one() {
    delivered_after(|sandbox, worker| {
        worker.terminate();
        let (status, said) = worker.finish();
        assert_eq!(status.code(), Some(14), "{said}");
        assert!(
            said.contains(&*files(sandbox)[0].to_string_lossy()),
            "{said}"
        );
    });
}

#[test]
fn what_a_killed_worker_leaves_is_delivered_by_the_next_one() {
    delivered_after(|sandbox, worker| {
        // After a while, the results are in a file in any case: behind its first line, which is written before them.
        let has_results = |file: &PathBuf| {
            let text = std::fs::read(file).unwrap_or_default();
            let header = text.iter().position(|byte| *byte == b'\n');
            header.is_some_and(|end| text.len() > end + 1)
        };
        let since = Instant::now();
        while !files(sandbox).iter().any(has_results) {
            assert!(since.elapsed().as_secs() < 120, "no file");
            std::thread::sleep(Duration::from_millis(50));
        }
        worker.kill();
    });
}

/// The next coordinator serves a larger version of the campaign: what its workers have computed is part of it.
#[test]
fn what_was_computed_before_the_campaign_grew_is_delivered_to_its_coordinator() {
    let sandbox = Sandbox::new();
    let (file, exec) = slow(&sandbox, "0.3");
    let place = Place::of_file(&sandbox, &file);
    let worker = worker_without_coordinator(&place, &sandbox, &["--slots", "2", "--exec", &exec]);
    let small = std::fs::read_to_string(&file).unwrap();
    let samples = ("samples_per_design = 6", "samples_per_design = 7");
    std::fs::write(&file, changed(&small, &[samples])).unwrap();
    // Time for about twenty samples.
    std::thread::sleep(Duration::from_secs(3));
    let coordinator = place.serve(&[]);
    assert_all_succeed([("coordinator", coordinator), ("worker", worker)]);
    assert_eq!(done(&sandbox), SAMPLES as u64 / 6 * 7);
    assert!(files(&sandbox).is_empty(), "{:?}", files(&sandbox));
    // Only the samples that were being computed are begun again: in each slot one, and the next if that was begun, too.
    let begun = std::fs::read_to_string(sandbox.path("calls")).unwrap();
    let samples: BTreeSet<&str> = begun.lines().collect();
    let again = begun.lines().count() - samples.len();
    assert!(again <= 4, "{again} samples were begun again");
}

/// A sample that takes longer than the coordinator is away outlives it, however short the time
/// limit of the worker is.
#[test]
fn a_worker_waits_for_its_coordinator_as_long_as_it_computes() {
    let sandbox = Sandbox::new();
    let (file, exec) = slow(
        &sandbox,
        "8 if not os.path.exists('long') and os.path.exists('away') and not open('long', 'w').close() else 0.1",
    );
    let place = Place::of_file(&sandbox, &file);
    let work = ["--slots", "1", "--give-up-after", "1", "--exec", &exec];
    let coordinator = place.serve(&[]);
    let worker = place.worker(&work);
    sandbox.wait_for(DB, "some samples", |status| {
        status["samples"]["done"].as_u64() > Some(4)
    });
    std::fs::write(sandbox.path("away"), "").unwrap();
    let since = Instant::now();
    while !sandbox.path("long").exists() {
        assert!(since.elapsed().as_secs() < 60, "no long sample");
        std::thread::sleep(Duration::from_millis(10));
    }
    coordinator.kill();
    std::thread::sleep(Duration::from_secs(4));
    let coordinator = place.serve(&[]);
    assert_all_succeed([("coordinator", coordinator), ("worker", worker)]);
    assert!(calls(&sandbox) >= SAMPLES);
}
