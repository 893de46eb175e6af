//! The units under `deploy/systemd` in a user's service manager, installed as the guide says.

use std::os::unix::fs::{PermissionsExt as _, symlink};
use std::time::{Duration, Instant};

use acceptance::isolated::{IsolatedScript, documented};
use acceptance::{Sandbox, assert_code, errors, printed, programs, root, small_campaign};

/// Time limit of every operation of a service manager.
const PATIENCE: Duration = Duration::from_secs(300);

/// Where a user's state is for systemd before 254; `systemd.sh` tells later ones to keep it there, too.
const DB: &str = "user/home/.config/pitchline/campaign.db";

const BOTH: [&str; 2] = ["pitchline-coordinator", "pitchline-worker"];

struct Manager<'s> {
    sandbox: &'s Sandbox,
    daemon: IsolatedScript,
}

impl Manager<'_> {
    /// Runs a command as the user whose manager it is.
    fn run(&self, command: &[&str]) -> String {
        let home = self.sandbox.path("user/home");
        let home = format!("HOME={}", home.display());
        let user = ["setpriv", "--reuid=1000", "--regid=1000", "--clear-groups"];
        let environment = ["env", &home, "XDG_RUNTIME_DIR=/run/user/1000"];
        let command = [&user, &environment[..], command].concat();
        let output = self.daemon.run(self.sandbox, &command);
        let log = || std::fs::read_to_string(self.sandbox.path("user/manager.log"));
        assert!(
            output.status.success(),
            "{command:?}: {}{}",
            errors(&output),
            log().expect("the log can be read")
        );
        printed(&output)
    }

    fn systemctl(&self, arguments: &[&str]) -> String {
        self.run(&[&["systemctl", "--user"], arguments].concat())
    }

    /// A property of a unit.
    fn property(&self, unit: &str, name: &str) -> String {
        let shown = self.systemctl(&["show", unit, "--value", "--property", name]);
        shown.trim().to_owned()
    }

    fn wait_for(&self, unit: &str, name: &str, value: &str) {
        let since = Instant::now();
        while self.property(unit, name) != value {
            let status = || self.property(unit, name);
            assert!(since.elapsed() < PATIENCE, "{unit}: {name}={}", status());
            std::thread::sleep(Duration::from_millis(50));
        }
    }

    fn wait_for_samples(&self, more_than: u64) {
        self.sandbox.wait_for(DB, "more samples", |status| {
            status["samples"]["done"].as_u64() > Some(more_than)
        });
    }
}

#[test]
fn user_services_survive_kills_stops_and_restarts() {
    let sandbox = Sandbox::new();
    // The user must be able to enter the folder.
    let open = std::fs::Permissions::from_mode(0o755);
    std::fs::set_permissions(sandbox.path("."), open).unwrap();
    let Some(daemon) = IsolatedScript::start("systemd.sh", &sandbox.path("user"), &[]) else {
        return;
    };
    let manager = Manager {
        sandbox: &sandbox,
        daemon,
    };
    sandbox.write("my.toml", &small_campaign(300, 6000));
    symlink(root().join("deploy"), sandbox.path("deploy")).unwrap();
    // The user may not enter the folder of the programs.
    std::fs::create_dir_all(sandbox.path("target/release")).unwrap();
    for program in ["coordinator", "worker"] {
        let copy = sandbox.path("target/release").join(program);
        std::fs::copy(programs().join(program), copy).unwrap();
    }
    manager.run(&["bash", "-ec", &documented("systemd")]);

    // Notified: when `start` returns, the coordinator listens and its access file is there.
    assert!(
        sandbox
            .path("user/home/.config/pitchline/campaign.access")
            .exists()
    );
    manager.wait_for_samples(1_000);
    for unit in BOTH {
        manager.systemctl(&["kill", "--signal=KILL", unit]);
        manager.wait_for(unit, "NRestarts", "1");
        manager.wait_for(unit, "ActiveState", "active");
    }
    manager.wait_for_samples(100_000);
    // Both end well when they are stopped; otherwise the unit would be "failed".
    for unit in BOTH {
        manager.systemctl(&["stop", unit]);
        assert_eq!(manager.property(unit, "ActiveState"), "inactive", "{unit}");
    }
    let stopped = sandbox.status(DB).unwrap();
    assert_eq!(stopped["finished"], false, "the campaign was too short");
    manager.systemctl(&[&["start"], &BOTH[..]].concat());
    for unit in BOTH {
        manager.wait_for(unit, "ActiveState", "inactive");
    }
    assert_code(
        &sandbox.coordinator(&["run", "my.toml", "--db", "local.db"]),
        0,
    );
    let (served, local) = (
        sandbox.status(DB).unwrap(),
        sandbox.status("local.db").unwrap(),
    );
    assert_eq!(served["finished"], true, "{served}");
    assert_eq!(served["samples_digest"], local["samples_digest"]);
    // The crash of a worker that was killed while it held jobs.
    let groups = served["failure_groups"].as_array().unwrap();
    assert!(
        groups.iter().all(|group| group["kind"] == "crash"),
        "{served}"
    );
}
