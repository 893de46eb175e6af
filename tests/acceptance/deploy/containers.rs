//! The image and the cluster under `deploy/docker`, with Debian's own Docker.

use std::fs::Permissions;
use std::os::unix::fs::{MetadataExt as _, PermissionsExt as _};
use std::path::Path;
use std::process::{Command, Output};
use std::time::{Duration, Instant};

use acceptance::isolated::IsolatedScript;
use acceptance::{Sandbox, assert_code, errors, printed, programs, root, skipped};

struct Engine<'s> {
    sandbox: &'s Sandbox,
    daemon: IsolatedScript,
}

impl Engine<'_> {
    /// Runs a command where the engine is; a machine may have another Docker, too.
    fn run(&self, command: &[&str]) -> String {
        let output = self.attempt(command);
        assert!(
            output.status.success(),
            "{command:?}: {}{}",
            printed(&output),
            errors(&output)
        );
        printed(&output)
    }

    /// Runs a command where the engine is, which may fail.
    fn attempt(&self, command: &[&str]) -> Output {
        let host = self.sandbox.path("engine/docker.sock");
        let host = format!("DOCKER_HOST=unix://{}", host.display());
        let environment = [
            "env",
            &host,
            "PATH=/usr/sbin:/usr/bin:/sbin:/bin",
            "DOCKER_BUILDKIT=1",
            "CAMPAIGN=quick.toml",
        ];
        self.daemon
            .run(self.sandbox, &[&environment, command].concat())
    }

    fn compose(&self, arguments: &[&str]) -> String {
        let file = root().join("deploy/docker/compose.yaml");
        let file = file.to_str().expect("UTF-8");
        let compose = ["docker-compose", "--file", file, "--project-name=test"];
        self.run(&[&compose, arguments].concat())
    }

    /// Waits until `docker inspect` shows these restarts, this status and this exit code, for example
    /// "1 exited 0".
    fn wait_for(&self, container: &str, wanted: &str) {
        let state = "{{.RestartCount}} {{.State.Status}} {{.State.ExitCode}}";
        let inspect = ["docker", "inspect", container, "--format", state];
        let since = Instant::now();
        loop {
            let now = self.run(&inspect);
            if now.trim() == wanted {
                return;
            }
            assert!(since.elapsed() < Duration::from_secs(90), "{now}");
            std::thread::sleep(Duration::from_millis(200));
        }
    }
}

/// Debian as in the image of that name, as far as the Dockerfile needs it; `None` where no Debian packages are
/// available.
fn debian(sandbox: &Sandbox) -> Option<String> {
    let archive = sandbox.path("debian.tar").display().to_string();
    let packages = "base-files,libc6,libc-bin,libgcc-s1,bash,dash,coreutils,grep,findutils";
    let made = Command::new("mmdebstrap")
        .args(["--quiet", "--variant=extract", "--mode=root"])
        .arg(format!("--include={packages}"))
        .arg("--customize-hook=ln -sf dash \"$1/bin/sh\"")
        .args(["bookworm", &archive])
        .output()
        .expect("mmdebstrap runs");
    if made.status.success() {
        return Some(archive);
    }
    skipped(&format!("no Debian packages: {}", errors(&made).trim()));
    None
}

/// Copies both programs without their symbols; returns their size in bytes.
fn strip_into(from: &Path, to: &Path) -> u64 {
    let sizes = ["coordinator", "worker"].map(|program| {
        let copy = to.join(program);
        let strip = Command::new("strip")
            .arg("-o")
            .args([&copy, &from.join(program)])
            .status();
        assert!(strip.expect("strip runs").success(), "{}", from.display());
        std::fs::metadata(copy).expect("it was written").len()
    });
    sizes.iter().sum()
}

/// Starts a worker as `deploy/kubernetes/workers.yaml` does: a mounted secret belongs to root, and the
/// pod's group can read it.
fn a_copied_secret_is_the_workers_alone(sandbox: &Sandbox, engine: &Engine<'_>) {
    let file = sandbox.campaign("secret.toml", &[]);
    let serve = ["serve", file.to_str().unwrap(), "--db", "secret.db"];
    let options = ["--listen", "127.0.0.1:0", "--access", "secret.access"];
    let coordinator = sandbox.start("coordinator", &[&serve[..], &options].concat());
    let secret = sandbox.path("secret/campaign.access");
    std::fs::create_dir(sandbox.path("secret")).unwrap();
    std::fs::write(&secret, sandbox.wait_for_file("secret.access")).unwrap();
    std::os::unix::fs::chown(&secret, Some(0), Some(1000)).unwrap();
    std::fs::set_permissions(&secret, Permissions::from_mode(0o440)).unwrap();

    let manifest = std::fs::read_to_string(root().join("deploy/kubernetes/workers.yaml")).unwrap();
    let (_, copy) = manifest.split_once("command: [sh, -c, \"").unwrap();
    let (copy, _) = copy.split_once('"').unwrap();
    let volume = format!("{}:/secret:ro", sandbox.path("secret").display());
    let access = "--tmpfs=/access:uid=0,gid=1000,mode=2770";
    let image = ["docker", "run", "--rm", access, "--volume", &volume];
    for (file, code) in [
        ("/access/campaign.access", 11),
        ("/secret/campaign.access", 4),
    ] {
        // No coordinator answers in a container.
        let worker = format!("worker --access={file} --connect=127.0.0.1:1 --connect-timeout=0");
        let command = format!("{copy} && {worker}");
        let shell = ["pitchline:0.1.0", "sh", "-c", &command];
        assert_code(&engine.attempt(&[&image[..], &shell].concat()), code);
    }
    coordinator.kill();
}

#[test]
fn containers_with_two_workers_give_the_samples_of_a_local_run() {
    let sandbox = Sandbox::new();
    let Some(daemon) = IsolatedScript::start("docker.sh", &sandbox.path("engine"), &[]) else {
        return;
    };
    let engine = Engine {
        sandbox: &sandbox,
        daemon,
    };
    let Some(archive) = debian(&sandbox) else {
        return;
    };
    engine.run(&["docker", "import", &archive, "debian:bookworm-slim"]);
    // The image takes the programs under test, because compiling them in it would take minutes.
    std::fs::create_dir_all(sandbox.path("context/dist")).unwrap();
    let context = sandbox.path("context");
    let programs_size = strip_into(&programs(), &context.join("dist"));
    let file = root().join("deploy/docker/Dockerfile");
    let file = file.to_str().unwrap();
    let context = context.display().to_string();
    let build = ["docker", "build", "--tag=pitchline:0.1.0", "--file", file];
    let ready = ["--build-arg=PROGRAMS=ready", context.as_str()];
    engine.run(&[&build[..], &ready].concat());
    let inspect = ["docker", "image", "inspect", "pitchline:0.1.0"];
    let size = engine.run(&[&inspect[..], &["--format={{.Size}}"]].concat());
    let size: u64 = size.trim().parse().unwrap();
    let around = size - programs_size;
    // A shell, `cat`, and the libraries of all four programs.
    assert!(around < 7_000_000, "{around} bytes besides the programs");

    a_copied_secret_is_the_workers_alone(&sandbox, &engine);

    // Docker restarts a coordinator that is killed. No worker runs yet, so the campaign cannot end before the
    // kill. Workers that survive such a restart are tested in `fail_points.rs`.
    let up = ["up", "--no-build", "--detach", "--scale"];
    engine.compose(&[&up[..], &["worker=0"]].concat());
    let coordinator = engine.compose(&["ps", "--quiet", "coordinator"]);
    let coordinator = coordinator.trim();
    let inside = "until [ -e data/campaign.db ]; do :; done; kill -9 -1";
    // It ends with the container, with success or without.
    let _ = engine.attempt(&["docker", "exec", coordinator, "sh", "-c", inside]);
    engine.wait_for(coordinator, "1 running 0");
    engine.compose(&[&up[..], &["worker=2"]].concat());
    engine.wait_for(coordinator, "1 exited 0");
    let workers = engine.compose(&["ps", "--quiet", "worker"]);
    assert_eq!(workers.lines().count(), 2, "{workers}");
    let workers: Vec<_> = workers.lines().collect();
    // A worker that starts late may miss the end of so short a campaign and then waits a minute in vain. The
    // other worker has done the work.
    let state = ["docker", "inspect", "--format"];
    let ended = ["{{.State.Status}} {{.State.ExitCode}}"];
    let since = Instant::now();
    while !engine
        .run(&[&state[..], &ended, &workers].concat())
        .contains("exited 0")
    {
        assert!(since.elapsed() < Duration::from_secs(20), "{workers:?}");
        std::thread::sleep(Duration::from_millis(200));
    }
    // The volume is the user's, and nobody else's.
    let volume = sandbox.path("engine/data/volumes/test_data/_data");
    let owner = std::fs::metadata(&volume).unwrap();
    assert_eq!((owner.uid(), owner.mode() & 0o777), (1000, 0o700));
    assert!(volume.join("report/report.html").exists());

    let quick = root().join("campaigns/quick.toml");
    let quick = quick.to_str().unwrap();
    assert_code(&sandbox.coordinator(&["run", quick, "--db", "local.db"]), 0);
    let store = volume.join("campaign.db");
    let served = sandbox.status(store.to_str().unwrap()).unwrap();
    let local = sandbox.status("local.db").unwrap();
    assert_eq!(served["finished"], true, "{served}");
    assert_eq!(served["samples_digest"], local["samples_digest"]);
    assert_eq!(served["failures"], 0, "{served}");
    engine.compose(&["down", "--volumes"]);
}
