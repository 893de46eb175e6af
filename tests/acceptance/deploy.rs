//! The files in `deploy/` agree with the programs, and its scripts run.

mod containers;
mod release;
mod services;
mod slurm;
mod ssh;

use acceptance::{Sandbox, assert_code, free_address, printed, root, skipped};
use runner::exit;

/// Exit codes after which a restart cannot help.
const FINAL_FOR_COORDINATOR: [u8; 11] = [
    exit::USAGE,
    exit::BAD_FILE,
    exit::FILE_ACCESS,
    exit::OTHER_CAMPAIGN,
    exit::NOT_A_STORE,
    exit::UNUSABLE_STORE,
    exit::STORE_LOCKED,
    exit::INCOMPLETE,
    exit::NOT_SIMULABLE,
    exit::NONE_FEASIBLE,
    exit::OVER_BUDGET,
];
const FINAL_FOR_WORKER: [u8; 3] = [exit::USAGE, exit::FILE_ACCESS, exit::REFUSED];

fn read(name: &str) -> String {
    std::fs::read_to_string(root().join("deploy").join(name)).expect("the file is shipped")
}

/// The numbers on the line that begins with `key`.
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
    let text = read("kubernetes/workers.yaml");
    let of = |values: &[u8]| text.matches(&format!("values: {values:?}")).count();
    assert_eq!(of(&FINAL_FOR_WORKER), 1);
    assert_eq!(of(&[exit::INTERRUPTED]), 1);
}

/// The word that follows `mark`, for each line that contains it.
fn words_after<'a>(text: &'a str, mark: &str) -> Vec<&'a str> {
    let rest = text
        .lines()
        .filter_map(|line| Some(line.split_once(mark)?.1));
    rest.filter_map(|rest| {
        rest.split([' ', ',', '}', '"'])
            .find(|word| !word.is_empty())
    })
    .collect()
}

/// Contradictions in Kubernetes manifests that are well formed.
fn contradictions(manifests: &str, readme: &str) -> Vec<String> {
    let mut wrong = Vec::new();
    for image in words_after(manifests, "image: ") {
        if image != "pitchline:0.1.0" {
            wrong.push(format!("image {image}"));
        }
    }
    for secret in words_after(manifests, "secretName: ") {
        if !readme.contains(&format!("secret generic {secret} ")) {
            wrong.push(format!("secret {secret} is not made"));
        }
    }
    let mounted = words_after(manifests, "- { name: ");
    for volume in words_after(manifests, "        - name: ") {
        let is_container = ["copy", "coordinator", "worker"].contains(&volume);
        if !is_container && !mounted.contains(&volume) {
            wrong.push(format!("volume {volume} is not mounted"));
        }
    }
    let folders = words_after(manifests, "mountPath: ");
    for file in words_after(manifests, "- --access=") {
        let (folder, _) = file.rsplit_once('/').unwrap_or_default();
        if !folders.contains(&folder) {
            wrong.push(format!("{file} is in no mounted folder"));
        }
        // Kubernetes would let the group read all files of a volume at every start.
        if folder == "/data" && !manifests.contains("fsGroupChangePolicy: OnRootMismatch") {
            wrong.push(format!("{file} is exposed"));
        }
    }
    let (parallelism, completions) = (
        words_after(manifests, "parallelism: "),
        words_after(manifests, "completions: "),
    );
    if parallelism != completions {
        wrong.push(format!(
            "{parallelism:?} pods at a time, {completions:?} in all"
        ));
    }
    wrong
}

#[test]
fn manifests_do_not_contradict_each_other() {
    let files = ["coordinator.yaml", "workers.yaml", "network.yaml"];
    let manifests: String = files
        .map(|file| read(&format!("kubernetes/{file}")))
        .concat();
    let readme = read("README.md");
    assert_eq!(contradictions(&manifests, &readme), [""; 0]);
    // The check finds mistakes.
    for (from, to) in [
        ("image: pitchline:0.1.0", "image: pitchline:0.2.0"),
        (
            "secretName: pitchline-access",
            "secretName: pitchline-accesses",
        ),
        ("--access=/access/", "--access=/secret/keys/"),
        (
            "fsGroupChangePolicy: OnRootMismatch",
            "fsGroupChangePolicy: Always",
        ),
        ("completions: 4", "completions: 5"),
        (
            "{ name: campaign, mountPath",
            "{ name: campaigns, mountPath",
        ),
    ] {
        let planted = manifests.replacen(from, to, 1);
        assert_ne!(planted, manifests, "{from}");
        assert!(!contradictions(&planted, &readme).is_empty(), "{from}");
    }
    // The container files use the same image tag.
    let compose = read("docker/compose.yaml");
    let images = words_after(&compose, "image: ");
    assert!(
        images.iter().all(|image| *image == "pitchline:0.1.0"),
        "{images:?}"
    );
    assert!(read("kubernetes/kustomization.yaml").contains("newTag: 0.1.0"));
}

/// Runs systemd-analyze; `None` if it is not installed.
fn systemd_analyze(arguments: &[&str]) -> Option<std::process::Output> {
    let output = std::process::Command::new("systemd-analyze")
        .args(arguments)
        .output();
    match output {
        Ok(output) => Some(output),
        Err(_) => {
            skipped("systemd-analyze is not installed");
            None
        }
    }
}

#[test]
fn systemd_takes_the_units_and_they_expose_little() {
    let sandbox = Sandbox::new();
    for (program, unit) in [
        ("coordinator", "pitchline-coordinator.service"),
        ("worker", "pitchline-worker.service"),
    ] {
        let text = read(&format!("systemd/{unit}"));
        let installed = format!("/usr/local/bin/{program}");
        let built = acceptance::binary(program);
        let text = text.replace(&installed, built.to_str().expect("UTF-8"));
        let file = sandbox.write(unit, &text);
        let file = file.to_str().expect("UTF-8");
        let Some(verified) = systemd_analyze(&["verify", file]) else {
            return;
        };
        assert_code(&verified, 0);
        // The threshold is in tenths: 10.0 means unconfined.
        let security = ["security", "--offline=yes", "--threshold=25", file];
        let security = systemd_analyze(&security).expect("it is installed");
        assert!(security.status.success(), "{}", printed(&security));
    }
}

#[test]
fn a_service_manager_hears_when_the_coordinator_is_ready_and_that_it_lives() {
    let sandbox = Sandbox::new();
    let socket = sandbox.path("notify");
    let manager = std::os::unix::net::UnixDatagram::bind(&socket).expect("a socket");
    manager
        .set_read_timeout(Some(std::time::Duration::from_secs(60)))
        .expect("a time limit");
    let hear = || {
        let mut message = [0; 256];
        let length = manager.recv(&mut message).expect("a message in time");
        String::from_utf8_lossy(&message[..length])
            .trim()
            .to_owned()
    };
    let campaign = sandbox.campaign("c.toml", &[]);
    let campaign = campaign.to_str().expect("UTF-8");
    let address = free_address().to_string();
    let serve = ["serve", campaign, "--db", "c.db", "--listen", &address];
    let path = socket.to_str().expect("UTF-8");
    let variables = [("NOTIFY_SOCKET", path), ("WATCHDOG_USEC", "900000")];
    let running = sandbox.start_with("coordinator", &serve, &variables);
    assert_eq!(hear(), "READY=1");
    for _ in 0..3 {
        assert_eq!(hear(), "WATCHDOG=1");
    }
    // If the port is in use, the start fails and only the exit code is reported.
    let other = [
        "serve",
        campaign,
        "--db",
        "d.db",
        "--listen",
        &address,
        "--access",
        "other.access",
    ];
    let refused = sandbox.run_with("coordinator", &other, &[("NOTIFY_SOCKET", path)]);
    assert_code(&refused, exit::CANNOT_LISTEN.into());
    running.kill();
    manager.set_nonblocking(true).expect("a socket");
    let mut message = [0; 256];
    while let Ok(length) = manager.recv(&mut message) {
        assert!(!message[..length].starts_with(b"READY"), "a taken port");
    }
}

#[test]
fn batch_scripts_are_bash() {
    for script in ["slurm/coordinator.sbatch", "slurm/workers.sbatch"] {
        let checked = std::process::Command::new("bash")
            .arg("-n")
            .arg(root().join("deploy").join(script))
            .status();
        assert!(checked.expect("bash").success(), "{script}");
    }
}
