//! Access files and their secrets: programs that have them, and programs that do not.

use std::fs;
use std::io::{Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::os::unix::fs::PermissionsExt as _;
use std::os::unix::process::ExitStatusExt as _;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use acceptance::{
    RunningProgram, Sandbox, assert_code, binary, errors, free_address, small_campaign,
};

/// A campaign that ends at once.
fn tiny() -> String {
    small_campaign(12, 10)
}

/// Time limit for a refusal, even on a busy machine: the program must not wait.
const BOUNDED: Duration = Duration::from_secs(30);

/// The access file of the coordinators in these tests.
const FILE: &str = "c.access";

/// A coordinator that keeps serving.
struct GuardedCoordinator {
    sandbox: Sandbox,
    coordinator: RunningProgram,
    address: String,
}

impl GuardedCoordinator {
    fn start(campaign: &str) -> Self {
        let sandbox = Sandbox::new();
        let file = sandbox.write("c.toml", campaign);
        let address = free_address().to_string();
        let serve = ["serve", file.to_str().unwrap(), "--db", "c.db"];
        let options = ["--listen", &address, "--access", FILE, "--keep-serving"];
        let coordinator = sandbox.start("coordinator", &[&serve[..], &options].concat());
        let _ = sandbox.wait_for_file(FILE);
        Self {
            sandbox,
            coordinator,
            address,
        }
    }

    /// Writes a copy of the access file after a change.
    fn copy(&self, name: &str, change: impl Fn(&str) -> String) {
        let text = fs::read_to_string(self.sandbox.path(FILE)).unwrap();
        private(&self.sandbox, name, &change(&text));
    }

    /// Writes a copy of the access file without the line that begins with `key`.
    fn copy_without(&self, name: &str, key: &str) {
        self.copy(name, |text| {
            let lines = text.split_inclusive('\n');
            lines.filter(|line| !line.starts_with(key)).collect()
        });
    }

    fn worker(&self, more: &[&str]) -> Output {
        let arguments = [&["--slots", "1"], more].concat();
        self.sandbox.run("worker", &arguments)
    }

    /// Checks that a worker is refused permanently, with a sentence that contains all `parts`.
    fn refused(&self, more: &[&str], code: i32, parts: &[&str]) {
        let since = Instant::now();
        let output = self.worker(more);
        assert_code(&output, code);
        let message = errors(&output);
        assert_eq!(message.trim().lines().count(), 1, "{message}");
        for part in parts {
            assert!(message.contains(part), "no {part:?} in {message}");
        }
        assert!(since.elapsed() < BOUNDED, "{message} took too long");
        self.no_secret_in(&message);
    }

    /// Checks that `text` contains no token.
    fn no_secret_in(&self, text: &str) {
        let access = fs::read_to_string(self.sandbox.path(FILE)).unwrap();
        let secrets: Vec<&str> = access
            .lines()
            .filter_map(|line| line.split_once("_token = "))
            .map(|(_, token)| token.trim_matches('"').rsplit('-').next().unwrap())
            .collect();
        assert_eq!(secrets.len(), 2);
        for secret in secrets {
            assert!(!text.contains(secret), "a secret in {text}");
        }
    }

    /// Ends the coordinator, whose campaign is finished; returns its log.
    fn end(self) -> String {
        self.coordinator.terminate();
        let (status, log) = self.coordinator.finish();
        assert_eq!(status.code(), Some(0), "{log}");
        log
    }
}

/// Writes a file that only its owner can read.
fn private(sandbox: &Sandbox, name: &str, text: &str) {
    let path = sandbox.write(name, text);
    fs::set_permissions(path, fs::Permissions::from_mode(0o600)).unwrap();
}

#[test]
fn a_campaign_finishes_with_a_copy_of_the_access_file() {
    let guarded = GuardedCoordinator::start(&tiny());
    // A worker needs no more than a copy without the token for commands.
    guarded.copy_without("worker.access", "client_token");
    assert_code(&guarded.worker(&["--access", "worker.access"]), 0);
    let status = guarded.sandbox.status("c.db").unwrap();
    assert_eq!(status["finished"], true, "{status}");
    guarded.end();
}

#[test]
fn a_worker_without_the_right_to_is_refused_for_good() {
    let guarded = GuardedCoordinator::start(&tiny());
    let other = GuardedCoordinator::start(&tiny());
    let others = fs::read_to_string(other.sandbox.path(FILE)).unwrap();
    private(&guarded.sandbox, "other.access", &others);

    // The right certificate with another coordinator's token, and the other way round.
    let token = |text: &str| {
        let line = text.lines().find(|line| line.starts_with("worker_token"));
        line.unwrap().to_owned()
    };
    guarded.copy("token.access", |text| {
        text.replace(&token(text), &token(&others))
    });
    let wrong = ["--access", "token.access"];
    guarded.refused(&wrong, 12, &["not one of this coordinator's"]);
    let wrong = ["--access", "other.access", "--connect", &guarded.address];
    guarded.refused(
        &wrong,
        12,
        &["not in the access file", "of this coordinator"],
    );
    guarded.copy_without("client.access", "worker_token");
    let client = ["--access", "client.access"];
    guarded.refused(&client, 12, &["a client's token", "takes a worker's"]);

    private(&guarded.sandbox, "rubbish", "hunter2");
    guarded.refused(&["--access", "rubbish"], 4, &["rubbish", "line 1"]);
    guarded.copy("none.access", |text| {
        let lines = text.split_inclusive('\n');
        lines.filter(|line| !line.contains("_token")).collect()
    });
    guarded.refused(&["--access", "none.access"], 4, &["neither worker_token"]);
    let nowhere = ["--access", "nowhere", "--connect-timeout", "1"];
    guarded.refused(&nowhere, 11, &["nowhere"]);
    let exposed = guarded.sandbox.path("other.access");
    fs::set_permissions(exposed, fs::Permissions::from_mode(0o640)).unwrap();
    let exposed = ["--access", "other.access"];
    guarded.refused(&exposed, 4, &["chmod 600 other.access"]);

    // After all refusals the right worker is still accepted.
    assert_code(&guarded.worker(&["--access", FILE]), 0);
    let access = fs::read_to_string(guarded.sandbox.path(FILE)).unwrap();
    let log = guarded.end();
    assert!(log.contains("refused a call"), "{log}");
    for secret in [token(&access), token(&others)] {
        let secret = secret.rsplit('-').next().unwrap().trim_matches('"');
        assert!(!log.contains(secret), "a secret in {log}");
    }
}

#[test]
fn clients_look_and_steer_with_their_own_token() {
    let guarded = GuardedCoordinator::start(&tiny());
    let ask = |command: &str, file: &str| {
        let arguments = [command, "--access", file];
        guarded.sandbox.coordinator(&arguments)
    };
    guarded.copy_without("worker.access", "client_token");
    guarded.copy_without("client.access", "worker_token");
    for command in ["status", "explain"] {
        assert_code(&ask(command, "client.access"), 0);
    }
    for command in ["status", "explain", "drain"] {
        let output = ask(command, "worker.access");
        assert_code(&output, 12);
        let message = errors(&output);
        assert!(message.contains("a worker's token"), "{message}");
        assert!(message.contains("takes a client's"), "{message}");
        guarded.no_secret_in(&message);
    }
    // The refused drain had no effect.
    assert_code(&guarded.worker(&["--access", "worker.access"]), 0);
    let status = guarded.sandbox.status("c.db").unwrap();
    assert_eq!(status["finished"], true, "{status}");
}

#[test]
fn a_restarted_coordinator_keeps_its_secrets() {
    let guarded = GuardedCoordinator::start(&small_campaign(60, 4000));
    guarded.copy_without("worker.access", "client_token");
    let secrets = || {
        let text = fs::read_to_string(guarded.sandbox.path(FILE)).unwrap();
        let (_, secrets) = text.split_once("worker_token").unwrap();
        secrets.to_owned()
    };
    let before = secrets();
    guarded.coordinator.kill();
    let serve = ["serve", "c.toml", "--db", "c.db", "--access", FILE];
    let options = ["--listen", &guarded.address];
    let coordinator = guarded
        .sandbox
        .start("coordinator", &[&serve[..], &options].concat());
    // A copy from before the restart is as good as the new file.
    let worker = ["--access", "worker.access", "--slots", "1"];
    let worker = guarded.sandbox.start("worker", &worker);
    guarded.sandbox.wait_for("c.db", "some samples", |status| {
        status["samples"]["done"].as_u64() > Some(0)
    });
    assert_eq!(secrets(), before);
    assert_eq!(worker.finish().0.code(), Some(0));
    assert_eq!(coordinator.finish().0.code(), Some(0));
}

#[test]
fn a_secret_does_not_travel_in_clear() {
    let guarded = GuardedCoordinator::start(&tiny());
    // Another program listens at the address.
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let other = std::thread::spawn(move || {
        let (mut stream, _) = listener.accept().unwrap();
        stream
            .write_all(b"HTTP/1.1 400 Bad Request\r\n\r\n")
            .unwrap();
        let mut received = Vec::new();
        stream.read_to_end(&mut received).unwrap();
        String::from_utf8_lossy(&received).into_owned()
    });
    let astray = ["--access", FILE, "--connect", &address];
    guarded.refused(&astray, 12, &["does not speak TLS", &address]);
    let received = other.join().unwrap();
    assert!(!received.is_empty() && !received.contains("Bearer"));
    guarded.no_secret_in(&received);
}

/// A worker that is led to the live page says so.
#[test]
fn the_live_page_is_no_port_for_workers() {
    let sandbox = Sandbox::new();
    let file = sandbox.write("c.toml", &small_campaign(10_000, 4000));
    let page = free_address().to_string();
    let serve = ["serve", file.to_str().unwrap(), "--db", "c.db"];
    let options = ["--listen", "127.0.0.1:0", "--access", FILE, "--http", &page];
    let _coordinator = sandbox.start("coordinator", &[&serve[..], &options].concat());
    let _ = sandbox.wait_for_file(FILE);
    let output = sandbox.run("worker", &["--access", FILE, "--connect", &page]);
    assert_code(&output, 12);
    let message = errors(&output);
    for part in [&page, "the live page", "access file"] {
        assert!(message.contains(part), "no {part:?} in {message}");
    }
}

/// A crash leaves no core dump, which would have the secrets in it.
#[test]
fn no_core_dump_holds_a_secret() {
    let sandbox = Sandbox::new();
    let file = sandbox.write("c.toml", &small_campaign(10_000, 4000));
    // A shell in the background ignores SIGQUIT for its children, but not SIGABRT.
    let unlimited = "ulimit -c unlimited; exec \"$@\"";
    let other = Command::new("/bin/sh")
        .args(["-c", unlimited, "sh", "/bin/sh", "-c", "kill -ABRT $$"])
        .current_dir(sandbox.path(""))
        .status()
        .unwrap();
    if !other.core_dumped() {
        acceptance::skipped("programs that crash here leave no core dumps");
        return;
    }
    let start = |program: &str, arguments: &[&str]| {
        let path = binary(program);
        let shell = ["-c", unlimited, "sh", path.to_str().unwrap()];
        let arguments = [&shell, arguments].concat();
        sandbox.start_with("/bin/sh", &arguments, &[("PITCHLINE_LOG", "info")])
    };
    let serve = ["serve", file.to_str().unwrap(), "--db", "c.db"];
    let options = ["--listen", "127.0.0.1:0", "--access", FILE];
    let coordinator = start("coordinator", &[&serve[..], &options].concat());
    let _ = sandbox.wait_for_file(FILE);
    let mut worker = start("worker", &["--access", FILE, "--slots", "1"]);
    worker.wait_for_line("registered");
    for program in [worker, coordinator] {
        program.signal("ABRT");
        let (status, log) = program.finish();
        assert!(status.signal().is_some(), "{status}: {log}");
        assert!(!status.core_dumped(), "{log}");
    }
}

#[test]
fn an_exposed_secret_or_page_is_refused_and_leaves_nothing_behind() {
    let sandbox = Sandbox::new();
    let file = sandbox.write("tiny.toml", &tiny());
    let file = file.to_str().unwrap();
    let serve = ["serve", file, "--db", "c.db", "--listen", "127.0.0.1:0"];
    let refused = |arguments: &[&str], code: i32, parts: &[&str]| {
        let output = sandbox.coordinator(arguments);
        assert_code(&output, code);
        for part in parts {
            let message = errors(&output);
            assert!(message.contains(part), "no {part:?} in {message}");
        }
    };
    // The live page and the metrics have no protection.
    for command in [
        &serve[..],
        &["run", file, "--db", "c.db"],
        &["view", "--db", "c.db"],
    ] {
        let command = [command, &["--http", "0.0.0.0:9400"]].concat();
        refused(
            &command,
            2,
            &["--http 0.0.0.0:9400", "127.0.0.1:9400", "ssh -L"],
        );
    }
    let host = [&serve[..], &["--host", "https://head"]].concat();
    refused(&host, 2, &["https://head", "head.example.org"]);
    // Both files of an earlier coordinator.
    private(&sandbox, FILE, "");
    private(&sandbox, "c.access.key", "");
    let with_file = [&serve[..], &["--access", FILE]].concat();
    for name in [FILE, "c.access.key"] {
        let path = sandbox.path(name);
        fs::set_permissions(&path, fs::Permissions::from_mode(0o644)).unwrap();
        refused(&with_file, 4, &["chmod 600", name]);
        fs::set_permissions(&path, fs::Permissions::from_mode(0o600)).unwrap();
    }
    refused(&with_file, 4, &["line 1"]);
    assert!(
        !sandbox.path("c.db").exists(),
        "a refused command left a store"
    );
}

#[test]
fn strangers_on_the_port_disturb_nobody() {
    // Some seconds of sampling, during which garbage arrives all the time.
    let longer = small_campaign(60, 4000);
    let guarded = GuardedCoordinator::start(&longer);
    let work = ["--access", FILE, "--slots", "1"];
    let worker = guarded.sandbox.start("worker", &work);
    guarded
        .sandbox
        .wait_for("c.db", "the first samples", |status| {
            status["samples"]["done"].as_u64() > Some(0)
        });

    // Some connections keep half a handshake open as long as possible, others send garbage.
    let mut half_open = Vec::new();
    for index in 0..200_u32 {
        let mut stream = TcpStream::connect(&guarded.address).unwrap();
        let rubbish: Vec<u8> = match index % 4 {
            0 => b"\x16\x03\x01\x40\x00\x01".to_vec(),
            1 => b"POST /pitchline.v1.Campaign/Report HTTP/1.1\r\n\r\n".to_vec(),
            2 => b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n\xff\xff\xff\xff\xff\xff\xff\xff\xff".to_vec(),
            _ => (0..4096).map(|byte| (byte * index % 251) as u8).collect(),
        };
        // The coordinator may have closed the connection already.
        let _ = stream.write_all(&rubbish);
        half_open.push(stream);
    }
    let (status, log) = worker.finish();
    assert_eq!(status.code(), Some(0), "{log}");
    let status = guarded.sandbox.status("c.db").unwrap();
    assert_eq!(status["finished"], true, "{status}");
    assert_eq!(status["failures"], 0, "{status}");

    let since = Instant::now();
    for mut stream in half_open {
        stream.set_read_timeout(Some(BOUNDED)).unwrap();
        // The last bytes and the kind of close do not matter: the connection must end.
        let ended = stream.read_to_end(&mut Vec::new());
        assert!(
            !matches!(&ended, Err(error) if error.kind() == std::io::ErrorKind::WouldBlock),
            "a stranger is still connected"
        );
    }
    assert!(
        since.elapsed() < BOUNDED,
        "strangers were kept for too long"
    );
    let log = guarded.end();
    assert!(log.contains("dropped a connection"), "{log}");
    assert!(
        log.lines().count() < 100,
        "strangers can fill the log:\n{log}"
    );
}

#[test]
fn no_log_is_so_chatty_that_it_tells_a_secret() {
    let sandbox = Sandbox::new();
    sandbox.write("c.toml", &tiny());
    let chatty = |program: &str, arguments: &[&str]| {
        let mut command = Command::new(binary(program));
        command
            .args(arguments)
            .current_dir(sandbox.path(""))
            .env("PITCHLINE_LOG", "trace")
            .stdout(Stdio::null());
        command
    };
    let serve = ["serve", "c.toml", "--db", "c.db", "--access", "c.access"];
    let serve = [&serve[..], &["--listen", "127.0.0.1:0"]].concat();
    let log = fs::File::create(sandbox.path("coordinator.log")).unwrap();
    let mut coordinator = chatty("coordinator", &serve).stderr(log).spawn().unwrap();
    let access = sandbox.wait_for_file("c.access");
    let key = fs::read_to_string(sandbox.path("c.access.key")).unwrap();
    // A copy without the worker's token is refused; the whole file works for all programs.
    let lines = access.lines().filter(|l| !l.starts_with("worker_token"));
    let copy = sandbox.write("copy.access", &lines.collect::<Vec<_>>().join("\n"));
    fs::set_permissions(copy, fs::Permissions::from_mode(0o600)).unwrap();
    let no_secret_in = |text: &str| {
        for line in access.lines().chain(key.lines()) {
            let secret = line.rsplit(['-', ' ']).next().unwrap().trim_matches('"');
            let is_secret = line.contains("_token") || key.contains(line) && line.len() > 40;
            let shown = is_secret && text.contains(secret);
            assert!(!shown, "a secret in {text}");
        }
    };
    for (file, code) in [("copy.access", 12), ("c.access", 0)] {
        let output = chatty("worker", &["--access", file, "--slots", "1"])
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(code), "{}", errors(&output));
        let log = errors(&output);
        assert!(log.contains("TRACE"), "the log is not chatty at all");
        no_secret_in(&log);
    }
    assert!(coordinator.wait().unwrap().success());
    let log = fs::read_to_string(sandbox.path("coordinator.log")).unwrap();
    assert!(log.contains("TRACE"), "the log is not chatty at all");
    no_secret_in(&log);
}
