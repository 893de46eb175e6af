//! A worker on another host from the kernel's point of view: two network namespaces, connected by a
//! cable that is pulled for longer than a lease. Needs root and `ip`; skipped where namespaces
//! cannot be created.

use std::process::{Command, Output, Stdio};

use acceptance::{Sandbox, assert_code, binary, errors, printed, small_campaign};

/// Makes the namespace `far` and a cable to it, from 10.77.0.1 to 10.77.0.2. Everything disappears
/// with the shell that runs this, which has its own network and its own /run.
const CABLE: &str = "set -e
mount -t tmpfs none /run
mkdir /run/netns
ip netns add far
ip link add near type veth peer name away netns far
ip addr add 10.77.0.1/24 dev near
ip link set near up
ip netns exec far ip addr add 10.77.0.2/24 dev away
ip netns exec far ip link set away up
";

/// Runs a shell script after [`CABLE`], with the programs `coordinator` as `$0` and `worker` as `$1`.
fn joined(sandbox: &Sandbox, script: &str) -> Output {
    Command::new("unshare")
        .args(["-n", "-m", "sh", "-c", &format!("{CABLE}{script}")])
        .args([binary("coordinator"), binary("worker")])
        .current_dir(sandbox.path("."))
        .env("PITCHLINE_LOG", "warn")
        .stdin(Stdio::null())
        .output()
        .expect("unshare runs")
}

fn can_make_namespaces() -> bool {
    let probe = Command::new("unshare")
        .args(["-n", "-m", "sh", "-c", CABLE])
        .output();
    probe.is_ok_and(|output| output.status.success())
}

#[test]
fn a_cable_pulled_for_longer_than_a_lease_loses_nothing() {
    if !can_make_namespaces() {
        acceptance::skipped("no network namespaces can be made here");
        return;
    }
    let sandbox = Sandbox::new();
    let file = sandbox.write("far.toml", &small_campaign(300, 4000));
    let file = file.to_str().unwrap();
    assert_code(
        &sandbox.coordinator(&["run", file, "--db", "undisturbed.db"]),
        0,
    );
    let output = joined(
        &sandbox,
        r#"
held() { "$0" status --db far.db --json | tr -d '\n ' | sed 's/.*"samples":{"per_design":4000,"done":\([0-9]*\).*/\1/'; }
"$0" serve far.toml --db far.db --listen 10.77.0.1:7400 --access far.access --lease 5 >&2 & coordinator=$!
ip netns exec far "$1" --access far.access >&2 & worker=$!
tries=0
while [ ! -e far.db ] || [ "$(held)" -lt 20000 ]; do
    tries=$((tries + 1)); [ $tries -lt 600 ]; sleep 0.1
done
ip link set near down
sleep 1; echo "pulled at $(held)"; sleep 7; echo "joined at $(held)"
ip link set near up
code=0; wait $worker || code=$?; echo "worker $code"
code=0; wait $coordinator || code=$?; echo "coordinator $code"
"#,
    );
    let said = printed(&output);
    assert_code(&output, 0);
    let held = |mark: &str| -> u64 {
        let line = said.lines().find_map(|line| line.strip_prefix(mark));
        let line = line.unwrap_or_else(|| panic!("no {mark:?} in {said}"));
        line.trim().parse().expect("a number")
    };
    assert_eq!(
        held("pulled at"),
        held("joined at"),
        "nothing comes through a cable that is not there"
    );
    assert_eq!(held("worker"), 0, "{}", errors(&output));
    assert_eq!(held("coordinator"), 0, "{}", errors(&output));
    let (whole, cut) = (
        sandbox.status("undisturbed.db").unwrap(),
        sandbox.status("far.db").unwrap(),
    );
    assert!(held("pulled at") < whole["samples"]["done"].as_u64().unwrap());
    assert_eq!(cut["finished"], true, "{cut}");
    assert_eq!(cut["samples_digest"], whole["samples_digest"]);
    assert_eq!(cut["samples"], whole["samples"]);
}
