//! Faults of the disk: each is refused with a sentence, or survived without losing acknowledged
//! rows. A store is never silently replaced by a new one.

use std::fs::OpenOptions;
use std::io::{Read as _, Seek as _, SeekFrom, Write as _};
use std::path::Path;
use std::process::{Command, Output, Stdio};

use acceptance::{Sandbox, assert_code, binary, errors, printed, small_campaign};

use crate::place::{DB, Place};

/// A campaign long enough to be killed while it samples.
fn long() -> String {
    small_campaign(40, 20_000)
}

fn samples(sandbox: &Sandbox, db: &str) -> u64 {
    let status = sandbox.status(db).expect("the store is there");
    status["samples"]["done"].as_u64().expect("a number")
}

/// Runs a campaign and kills it after some samples. Returns its file and the number of stored
/// samples.
fn killed(sandbox: &Sandbox, db: &str) -> (String, u64) {
    let file = sandbox.write("long.toml", &long());
    let file = file.to_str().unwrap().to_owned();
    let running = sandbox.start("coordinator", &["run", &file, "--db", db]);
    let some = |status: &serde_json::Value| status["samples"]["done"].as_u64() > Some(10_000);
    sandbox.wait_for(db, "some samples", some);
    running.kill();
    let held = samples(sandbox, db);
    (file, held)
}

/// Runs a shell script in the sandbox with the program `coordinator` as `$0`.
pub(crate) fn shell(sandbox: &Sandbox, script: &str) -> Output {
    Command::new("sh")
        .args(["-c", script])
        .arg(binary("coordinator"))
        .current_dir(sandbox.path("."))
        .env("PITCHLINE_LOG", "off")
        .stdin(Stdio::null())
        .output()
        .expect("there is a shell")
}

/// Whether a mount namespace can be created, as root can in most containers.
pub(crate) fn can_unshare() -> bool {
    let probe = Command::new("unshare").args(["-m", "true"]).output();
    probe.is_ok_and(|output| output.status.success())
}

/// Checks for one sentence that contains `text`, the name of the store or of the failure.
fn assert_refused(output: &Output, codes: &[i32], text: &str) {
    let said = errors(output);
    let code = output.status.code().expect("it ended by itself");
    assert!(codes.contains(&code), "{code}: {said}");
    assert!(said.contains(text), "no {text} in {said}");
    assert!(!said.contains("panicked"), "{said}");
}

/// Length of a log, in bytes, above which the store's writer copies it to the file. A shorter log
/// that is cut is simply an earlier state of the store.
const LONG_LOG: u64 = 4 << 20;

/// A store with nearly all of its content in the log, and copies whose logs were cut.
#[test]
fn a_log_that_lost_its_end_is_refused_where_its_commits_are_noted() {
    let sandbox = Sandbox::new();
    let place = Place::new(&sandbox, &small_campaign(40, 200));
    let coordinator = place.serve(&["--keep-serving"]);
    assert_code(&place.work(&[]), 0);
    coordinator.kill();
    let whole = sandbox.status(DB).expect("the store is there");
    assert_eq!(whole["finished"], true, "{whole}");
    let [store, log, note] = ["", "-wal", ".lock"].map(|end| sandbox.path(&format!("{DB}{end}")));
    let length = std::fs::metadata(&log)
        .expect("a killed coordinator leaves its log")
        .len();
    assert!((100_000..LONG_LOG).contains(&length), "{length} bytes");

    for (name, keep) in [("half", length / 2), ("odd", length / 3 + 7), ("none", 0)] {
        let db = format!("{name}.db");
        let [copy, cut, copied_note] =
            ["", "-wal", ".lock"].map(|end| sandbox.path(&format!("{db}{end}")));
        for (from, to) in [(&store, &copy), (&log, &cut), (&note, &copied_note)] {
            std::fs::copy(from, to).unwrap();
        }
        let file = OpenOptions::new().write(true).open(&cut).unwrap();
        file.set_len(keep).unwrap();

        // The lock file has the number of acknowledged commits.
        let before = std::fs::read(&copy).unwrap();
        let run = ["run", &place.file, "--db", &db];
        for command in [&run[..], &["status", "--db", &db]] {
            let refused = sandbox.coordinator(command);
            assert_refused(&refused, &[8], &db);
            assert_refused(&refused, &[8], "acknowledged commits");
        }
        assert_eq!(std::fs::read(&copy).unwrap(), before, "{name} was touched");

        // Without the lock file the campaign continues from the remaining rows, as the message
        // says.
        std::fs::remove_file(&copied_note).unwrap();
        assert!(samples(&sandbox, &db) < samples(&sandbox, DB), "{name}");
        assert_code(&sandbox.coordinator(&run), 0);
        let again = sandbox.status(&db).expect("the store is there");
        assert_eq!(again["samples_digest"], whole["samples_digest"], "{name}");
        assert_eq!(again["optima"], whole["optima"], "{name}");
    }
}

#[test]
fn a_campaign_that_was_killed_ends_as_one_that_was_not() {
    let sandbox = Sandbox::new();
    let (file, held) = killed(&sandbox, "killed.db");
    assert!(sandbox.path("killed.db-wal").exists());
    let [killed, whole] = ["killed.db", "whole.db"].map(|db| {
        assert_code(&sandbox.coordinator(&["run", &file, "--db", db]), 0);
        sandbox.status(db).expect("the store is there")
    });
    let done = killed["samples"]["done"].as_u64();
    assert!(done > Some(held), "killed too late");
    assert_eq!(whole["finished"], true, "{whole}");
    for key in ["samples_digest", "samples", "optima", "failures"] {
        assert_eq!(killed[key], whole[key], "{key}");
    }
    let table = ["--table", "failures", "--out", "-"];
    let exported = sandbox.coordinator(&[&["export", "--db", "killed.db"], &table[..]].concat());
    assert_code(&exported, 0);
    let failures = printed(&exported);
    assert_eq!(failures.lines().count(), 1, "{failures}");
}

#[test]
fn a_damaged_page_is_refused_and_left_as_it_is() {
    let sandbox = Sandbox::new();
    let file = sandbox.write("tiny.toml", &small_campaign(12, 10));
    let file = file.to_str().unwrap();
    assert_code(&sandbox.coordinator(&["run", file, "--db", "d.db"]), 0);
    let path = sandbox.path("d.db");
    let whole = std::fs::read(&path).unwrap();
    // Damage to the first page is reported as a file that is not a store, so the others are tested.
    let pages = whole.len() / 4096;
    assert!(pages > 8, "{pages} pages");
    let mut refused = 0;
    for page in [pages / 4, pages / 2, 3 * pages / 4] {
        let mut store = OpenOptions::new().write(true).open(&path).unwrap();
        store.seek(SeekFrom::Start(4096 * page as u64)).unwrap();
        store.write_all(&[0x5a; 4096]).unwrap();
        drop(store);
        let damaged = std::fs::read(&path).unwrap();
        let output = sandbox.coordinator(&["run", file, "--db", "d.db"]);
        if output.status.code() != Some(0) {
            assert_refused(&output, &[8], "d.db");
            assert_eq!(
                std::fs::read(&path).unwrap(),
                damaged,
                "a refused store was touched"
            );
            refused += 1;
        }
        std::fs::write(&path, &whole).unwrap();
    }
    assert_eq!(refused, 3, "a page full of nonsense was not noticed");
    assert_code(&sandbox.coordinator(&["run", file, "--db", "d.db"]), 0);
}

#[test]
fn a_store_that_cannot_be_written_is_refused_and_loses_nothing() {
    if !can_unshare() {
        // Root ignores permissions, and only root can create a mount namespace.
        read_only_by_permissions();
        return;
    }
    let sandbox = Sandbox::new();
    let folder = sandbox.path("kept");
    std::fs::create_dir(&folder).unwrap();
    let (file, held) = killed(&sandbox, "kept/r.db");
    let script = format!(
        "unshare -m sh -c 'mount --bind kept kept && mount -o remount,ro,bind kept kept && \
         \"$0\" run {file} --db kept/r.db' \"$0\""
    );
    let output = shell(&sandbox, &script);
    assert_refused(&output, &[4], "r.db");
    // The attempt lost nothing.
    assert_eq!(samples(&sandbox, "kept/r.db"), held);
    assert_code(
        &sandbox.coordinator(&["run", &file, "--db", "kept/r.db"]),
        0,
    );
}

fn read_only_by_permissions() {
    use std::os::unix::fs::PermissionsExt as _;
    let sandbox = Sandbox::new();
    let (file, held) = killed(&sandbox, "r.db");
    let mode = |path: &Path, mode| {
        std::fs::set_permissions(path, std::fs::Permissions::from_mode(mode)).unwrap();
    };
    for name in ["r.db", "r.db-wal", "r.db-shm", "r.db.lock"] {
        mode(&sandbox.path(name), 0o444);
    }
    let output = sandbox.coordinator(&["run", &file, "--db", "r.db"]);
    assert_refused(&output, &[4], "r.db");
    for name in ["r.db", "r.db-wal", "r.db-shm", "r.db.lock"] {
        mode(&sandbox.path(name), 0o644);
    }
    assert!(samples(&sandbox, "r.db") >= held);
}

/// A file that must not grow behaves like a full disk.
#[test]
fn a_full_disk_ends_the_campaign_with_a_sentence_and_loses_nothing() {
    let sandbox = Sandbox::new();
    let (file, held) = killed(&sandbox, "f.db");
    let size = ["f.db", "f.db-wal"]
        .map(|name| std::fs::metadata(sandbox.path(name)).map_or(0, |file| file.len()));
    // Blocks of 512 bytes, with space for a little more than the present size.
    let blocks = (size.iter().max().unwrap() + 300_000) / 512;
    let script = format!("ulimit -f {blocks}; exec \"$0\" run {file} --db f.db");
    let output = shell(&sandbox, &script);
    // SQLite reports a file that must not grow as not writable.
    assert_refused(&output, &[1, 4], "disk");
    let left = samples(&sandbox, "f.db");
    assert!(left >= held, "{left} of {held} samples are left");
    // With space again, the campaign continues.
    assert_code(&sandbox.coordinator(&["run", &file, "--db", "f.db"]), 0);
    let status = sandbox.status("f.db").unwrap();
    assert_eq!(status["finished"], true, "{status}");
}

/// The same on a file system that is really full.
#[test]
fn a_full_file_system_ends_the_campaign_with_a_sentence() {
    if !can_unshare() {
        acceptance::skipped("no file system can be mounted here");
        return;
    }
    let sandbox = Sandbox::new();
    let file = sandbox.write("long.toml", &long());
    let file = file.to_str().unwrap();
    std::fs::create_dir(sandbox.path("small")).unwrap();
    // The contents of the small disk are kept when it is full, and continued where there is space.
    let script = format!(
        "unshare -m sh -c 'mount -t tmpfs -o size=1500k none small && {{ \"$0\" run {file} --db \
         small/s.db; code=$?; cp small/s.db* .; exit $code; }}' \"$0\""
    );
    let output = shell(&sandbox, &script);
    assert_refused(&output, &[1, 4], "the disk is full");
    let held = samples(&sandbox, "s.db");
    assert!(held > 0, "nothing was stored before the disk was full");
    assert_code(&sandbox.coordinator(&["run", file, "--db", "s.db"]), 0);
    let status = sandbox.status("s.db").unwrap();
    assert_eq!(status["finished"], true, "{status}");
}

/// A result that is stored but not found again, as after damage to the pages that lead to it, does not make the
/// coordinator compute it for ever.
#[test]
fn a_result_that_is_not_found_again_ends_the_run() {
    let sandbox = Sandbox::new();
    let file = sandbox.write("tiny.toml", &small_campaign(12, 10));
    let file = file.to_str().unwrap();
    let run = ["run", file, "--db", "t.db"];
    assert_code(&sandbox.coordinator(&run), 0);
    let lose = "import sqlite3
store = sqlite3.connect('t.db')
store.executescript('''DELETE FROM derivation WHERE name = 'responses';
CREATE TRIGGER lost AFTER INSERT ON derivation WHEN new.name = 'responses'
BEGIN DELETE FROM derivation WHERE name = 'responses'; END''')
store.close()
";
    let script = sandbox.write("lose.py", lose);
    let lost = shell(&sandbox, &acceptance::python(&script));
    assert!(lost.status.success(), "{}", errors(&lost));
    let output = sandbox.coordinator(&run);
    assert_refused(
        &output,
        &[8],
        "t.db is damaged (computing responses was done 2 times",
    );
}

#[test]
fn a_report_that_does_not_fit_on_the_disk_is_an_error_of_files() {
    let sandbox = Sandbox::new();
    let file = sandbox.write("tiny.toml", &small_campaign(12, 400));
    let file = file.to_str().unwrap();
    assert_code(&sandbox.coordinator(&["run", file, "--db", "w.db"]), 0);
    // Blocks of 512 bytes: SQLite's index of the log fits, a report or a table of the samples does not.
    let script = "ulimit -f 100; exec \"$0\" report --db w.db --out w";
    assert_refused(&shell(&sandbox, script), &[4], "cannot write");
    let script = "ulimit -f 100; exec \"$0\" export --db w.db --table samples --out w.csv";
    assert_refused(&shell(&sandbox, script), &[4], "cannot write");
    assert!(!sandbox.path("w.csv").exists(), "a part of a table is left");
    let script = "exec \"$0\" status --db w.db > /dev/full";
    assert_refused(&shell(&sandbox, script), &[4], "space");
}

#[test]
fn a_reader_says_that_it_waits_for_another_program() {
    let sandbox = Sandbox::new();
    let file = sandbox.write("tiny.toml", &small_campaign(12, 10));
    let file = file.to_str().unwrap();
    assert_code(&sandbox.coordinator(&["run", file, "--db", "b.db"]), 0);
    let hold = "import sqlite3, sys
store = sqlite3.connect('b.db', isolation_level=None)
store.execute('PRAGMA locking_mode = EXCLUSIVE')
store.execute('BEGIN EXCLUSIVE')
print('held', flush=True)
sys.stdin.read()
";
    let script = sandbox.write("hold.py", hold);
    let mut holder = Command::new("sh")
        .args(["-c", &acceptance::python(&script)])
        .current_dir(sandbox.path("."))
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .expect("there is a shell");
    let mut held = [0; 4];
    let said = holder.stdout.as_mut().expect("it is captured");
    said.read_exact(&mut held).expect("it says that it holds");
    let log = [("PITCHLINE_LOG", "info")];
    let mut reader = sandbox.start_with("coordinator", &["status", "--db", "b.db"], &log);
    reader.wait_for_line("another program that has locked the store");
    drop(holder.stdin.take());
    assert!(holder.wait().expect("it ends").success());
    let (status, said) = reader.finish();
    assert_eq!(status.code(), Some(0), "{said}");
}
