//! Machines that cannot run the simulator: their faults are not failures of a design.

use acceptance::{Sandbox, assert_all_succeed, assert_code, errors, root};
use serde_json::Value;

use crate::faults::{can_unshare, shell};
use crate::place::{DB, Place};

/// A campaign whose every failure would quarantine something, and the options of its program, which
/// is called through files.
fn through_files(sandbox: &Sandbox) -> (String, [String; 6]) {
    let case = root().join("tests/acceptance/cases/not-a-number/campaign.toml");
    let text = std::fs::read_to_string(case).expect("the case is there");
    let text = acceptance::changed(
        &text,
        &[
            (
                "[sampling]\n",
                "[sampling]\nfailed = \"quarantines-design\"\n",
            ),
            ("evaluations = 200", "evaluations = 60"),
            ("designs = 8", "designs = 20"),
        ],
    );
    let file = sandbox.write("c.toml", &text).display().to_string();
    let template = sandbox.write("in.txt", "{a} {b} {seed}\n");
    let bowl =
        "sleep 0.05; awk '{print \"y = \" ($1-0.3)^2+($2-0.3)^2+($3%1000)/1e4}' in.txt > out.txt";
    let template = template.display().to_string();
    let options = [
        "--exec",
        bowl,
        "--template",
        &template,
        "--result",
        "out.txt",
    ];
    (file, options.map(str::to_owned))
}

/// The environment of a machine without a folder for temporary files.
fn broken(sandbox: &Sandbox) -> String {
    sandbox.path("no-such-disk").display().to_string()
}

fn assert_names_the_disk(said: &str, disk: &str) {
    let cause = format!(
        "this machine cannot run the simulator: no file of a run can be written in {disk}: No such file"
    );
    assert!(said.contains(&cause), "{said}");
    assert!(
        said.contains("; free space there, or set TMPDIR to a folder for temporary files"),
        "{said}"
    );
}

fn assert_undisturbed(status: &Value) {
    assert_eq!(status["finished"], true, "{status}");
    assert_eq!(status["failures"], 0, "{status}");
    assert_eq!(status["designs"]["done"], 20, "{status}");
}

#[test]
fn a_worker_without_a_disk_leaves_and_costs_no_design() {
    let sandbox = Sandbox::new();
    let (file, options) = through_files(&sandbox);
    let options: Vec<&str> = options.iter().map(String::as_str).collect();
    let options = [&["--slots", "2"][..], &options].concat();
    let place = Place::of_file(&sandbox, &file);
    let coordinator = place.serve(&[]);
    sandbox.wait_for(DB, "a store", |_| true);
    let disk = broken(&sandbox);
    let connect = ["--connect", &place.address];
    let arguments = [&connect[..], &options].concat();
    let mut bad = sandbox.start_with("worker", &arguments, &[("TMPDIR", &disk)]);
    // It has jobs, and tries the first one again.
    bad.wait_for_line("this machine cannot run the simulator; trying again");
    let good = place.worker(&options);
    let (ended, said) = bad.finish();
    assert_eq!(ended.code(), Some(4), "{said}");
    assert_names_the_disk(&said, &disk);
    assert_all_succeed([("coordinator", coordinator), ("worker", good)]);
    assert_undisturbed(&sandbox.status(DB).unwrap());
}

#[test]
fn a_run_without_a_disk_ends_and_the_same_command_continues_it() {
    let sandbox = Sandbox::new();
    let (file, options) = through_files(&sandbox);
    let options: Vec<&str> = options.iter().map(String::as_str).collect();
    let run = ["run", &file, "--db", DB, "--workers", "2"];
    let run = [&run[..], &options].concat();
    let disk = broken(&sandbox);
    let ended = sandbox.run_with("coordinator", &run, &[("TMPDIR", &disk)]);
    assert_code(&ended, 4);
    assert_names_the_disk(&errors(&ended), &disk);
    assert_code(&sandbox.coordinator(&run), 0);
    assert_undisturbed(&sandbox.status(DB).unwrap());
}

/// The program fails by itself, since its own file has no space: the machine is at fault all the same.
#[test]
fn a_run_on_a_full_disk_ends_and_the_same_command_continues_it() {
    if !can_unshare() {
        acceptance::skipped("no file system can be mounted here");
        return;
    }
    let sandbox = Sandbox::new();
    let (file, options) = through_files(&sandbox);
    let solver = format!("head -c 200000 /dev/zero > mesh || exit 5; {}", options[1]);
    let solver = sandbox.write("solver.sh", &solver).display().to_string();
    std::fs::create_dir(sandbox.path("small")).unwrap();
    let small = sandbox.path("small").display().to_string();
    let run = format!(
        "run {file} --db {DB} --workers 1 --exec \"sh {solver}\" --template {} --result out.txt",
        options[3]
    );
    let script = format!(
        "unshare -m sh -c 'mount -t tmpfs -o size=96k none small && TMPDIR={small} \"$0\" {run}' \"$0\""
    );
    let ended = shell(&sandbox, &script);
    assert_code(&ended, 4);
    let said = errors(&ended);
    assert!(
        said.contains("this machine cannot run the simulator: "),
        "{said}"
    );
    assert!(said.contains("No space left on device"), "{said}");
    assert_code(&shell(&sandbox, &format!("exec \"$0\" {run}")), 0);
    assert_undisturbed(&sandbox.status(DB).unwrap());
}
