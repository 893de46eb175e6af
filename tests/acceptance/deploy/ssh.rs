//! The lines for two machines of `deploy/README.md`, typed against an sshd on loopback.

use std::os::unix::fs::symlink;

use acceptance::isolated::{IsolatedScript, documented};
use acceptance::{Sandbox, assert_code, errors, programs, small_campaign};

#[test]
fn three_lines_start_a_worker_on_another_machine() {
    let sandbox = Sandbox::new();
    let Some(machine) = IsolatedScript::start("sshd.sh", &sandbox.path("node"), &[]) else {
        return;
    };
    let named = small_campaign(60, 50).replacen("name = \"quick\"", "name = \"my\"", 1);
    let file = sandbox.write("my.toml", &named);
    std::fs::create_dir(sandbox.path("target")).unwrap();
    symlink(programs(), sandbox.path("target/release")).unwrap();
    // As for a user, the coordinator runs before the lines are typed.
    let commands = documented("Two machines and ssh");
    assert_eq!(commands.lines().count(), 3, "{commands}");
    let typed = format!(
        "set -e
         coordinator serve my.toml --db my.db & coordinator=$!
         trap 'kill $coordinator 2>/dev/null || true' EXIT
         until [ -e ~/.local/state/pitchline/my.access ]; do sleep 0.1; kill -0 $coordinator; done
         {commands}
         wait $coordinator"
    );
    let output = machine.run(&sandbox, &["bash", "-c", &typed]);
    assert_code(&output, 0);
    // The log of the other machine comes through ssh.
    assert!(
        errors(&output).contains("finished=true"),
        "{}",
        errors(&output)
    );
    let local = ["run", file.to_str().unwrap(), "--db", "local.db"];
    assert_code(&sandbox.coordinator(&local), 0);
    let (served, local) = (
        sandbox.status("my.db").unwrap(),
        sandbox.status("local.db").unwrap(),
    );
    assert_eq!(served["finished"], true, "{served}");
    assert_eq!(served["samples_digest"], local["samples_digest"]);
}
