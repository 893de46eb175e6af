//! The service files under `deploy/`, as far as they repeat what the programs say.

use acceptance::root;
use protocol::exit;

/// What cannot get better by starting the program again.
const FINAL_FOR_COORDINATOR: [u8; 8] = [
    exit::USAGE,
    exit::BAD_FILE,
    exit::FILE_ACCESS,
    exit::OTHER_CAMPAIGN,
    exit::NOT_A_STORE,
    exit::UNUSABLE_STORE,
    exit::STORE_LOCKED,
    exit::INCOMPLETE,
];
const FINAL_FOR_WORKER: [u8; 3] = [exit::USAGE, exit::FILE_ACCESS, exit::REFUSED];

fn read(name: &str) -> String {
    std::fs::read_to_string(root().join("deploy").join(name)).expect("the file is shipped")
}

/// The numbers of the line that begins with `key`.
fn numbers_of(text: &str, key: &str) -> Vec<u8> {
    let mut lines = text.lines().filter_map(|line| line.strip_prefix(key));
    let (line, another) = (lines.next(), lines.next());
    let line = line.unwrap_or_else(|| panic!("no line begins with {key:?}"));
    assert!(another.is_none(), "two lines begin with {key:?}");
    line.split_whitespace()
        .map(|number| number.parse().expect("a number"))
        .collect()
}

#[test]
fn systemd_starts_nothing_again_that_cannot_get_better() {
    let coordinator = read("systemd/pitchline-coordinator.service");
    let prevented = numbers_of(&coordinator, "RestartPreventExitStatus=");
    assert_eq!(prevented, FINAL_FOR_COORDINATOR);
    let success = numbers_of(&coordinator, "SuccessExitStatus=");
    assert_eq!(success, [exit::INTERRUPTED]);
    let worker = read("systemd/pitchline-worker.service");
    let prevented = numbers_of(&worker, "RestartPreventExitStatus=");
    assert_eq!(prevented, FINAL_FOR_WORKER);
    let success = numbers_of(&worker, "SuccessExitStatus=");
    assert_eq!(success, [exit::INTERRUPTED]);
}

#[test]
fn kubernetes_agrees_with_systemd() {
    let text = read("kubernetes/pitchline.yaml");
    for final_codes in [&FINAL_FOR_COORDINATOR[..], &FINAL_FOR_WORKER] {
        let values = format!("values: {final_codes:?}");
        assert_eq!(text.matches(&values).count(), 1, "{values}");
    }
}
