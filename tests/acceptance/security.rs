//! Keys made by `keygen`, programs that use them, and programs without them.

use std::fs;
use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::os::unix::fs::PermissionsExt as _;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use acceptance::{
    Running, Sandbox, assert_code, binary, errors, free_address, printed, small_campaign,
};

/// A campaign that ends at once.
fn tiny() -> String {
    small_campaign(12, 10)
}

/// Time limit for a refusal, even on a busy machine: the program must not wait.
const BOUNDED: Duration = Duration::from_secs(30);

/// A coordinator with its own keys that keeps serving.
struct Guarded {
    sandbox: Sandbox,
    coordinator: Running,
    port: u16,
}

impl Guarded {
    /// Starts a coordinator with all keys of `keygen`. With `client_ca`, workers need a
    /// certificate, too.
    fn start(campaign: &str, client_ca: bool) -> Self {
        let sandbox = Sandbox::new();
        assert_code(&sandbox.coordinator(&["keygen", "keys"]), 0);
        let file = sandbox.write("c.toml", campaign);
        let address = free_address();
        let listen = address.to_string();
        let mut serve = vec![
            "serve",
            file.to_str().unwrap(),
            "--db",
            "c.db",
            "--listen",
            &listen,
            "--keep-serving",
            "--tls-cert",
            "keys/server.pem",
            "--tls-key",
            "keys/server.key",
            "--token-file",
            "keys/coordinator.tokens",
        ];
        if client_ca {
            serve.extend(["--client-ca", "keys/ca.pem"]);
        }
        let coordinator = sandbox.start("coordinator", &serve);
        Self {
            sandbox,
            coordinator,
            port: address.port(),
        }
    }

    fn worker(&self, scheme: &str, more: &[&str]) -> Output {
        let url = format!("{scheme}://localhost:{}", self.port);
        let arguments = [&["--connect", &url, "--slots", "1"], more].concat();
        self.sandbox.run("worker", &arguments)
    }

    /// Checks that a worker is refused permanently, with a sentence that contains all `parts`.
    fn refused(&self, scheme: &str, more: &[&str], code: i32, parts: &[&str]) {
        let since = Instant::now();
        let output = self.worker(scheme, more);
        assert_code(&output, code);
        let message = errors(&output);
        assert_eq!(message.trim().lines().count(), 1, "{message}");
        for part in parts {
            assert!(message.contains(part), "no {part:?} in {message}");
        }
        assert!(since.elapsed() < BOUNDED, "{message} took too long");
        no_secret_in(&self.sandbox, &message);
    }
}

/// Checks that `text` contains no generated token.
fn no_secret_in(sandbox: &Sandbox, text: &str) {
    let tokens = fs::read_to_string(sandbox.path("keys/coordinator.tokens")).unwrap();
    let secrets: Vec<&str> = tokens
        .lines()
        .filter(|line| line.starts_with("pitchline-"))
        .collect();
    assert_eq!(secrets.len(), 2);
    for secret in secrets {
        let digits = secret.rsplit('-').next().unwrap();
        assert!(!text.contains(digits), "a secret in {text}");
    }
}

const CA: [&str; 2] = ["--tls-ca", "keys/ca.pem"];
const TOKEN: [&str; 2] = ["--token-file", "keys/worker.token"];
const CERTIFICATE: [&str; 4] = [
    "--tls-cert",
    "keys/client.pem",
    "--tls-key",
    "keys/client.key",
];

#[test]
fn keygen_makes_private_files_names_them_and_overwrites_nothing() {
    let sandbox = Sandbox::new();
    let output = sandbox.coordinator(&["keygen", "keys", "--host", "head.example.org"]);
    assert_code(&output, 0);
    let described = printed(&output);
    let mode = |name: &str| {
        fs::metadata(sandbox.path(name))
            .unwrap()
            .permissions()
            .mode()
            & 0o777
    };
    assert_eq!(mode("keys"), 0o700);
    for name in ["ca.pem", "server.pem", "client.pem"] {
        assert!(described.contains(name), "no {name} in {described}");
        assert!(sandbox.path("keys").join(name).exists());
    }
    for name in [
        "ca.key",
        "server.key",
        "client.key",
        "coordinator.tokens",
        "worker.token",
        "client.token",
    ] {
        let name = format!("keys/{name}");
        assert_eq!(mode(&name), 0o600, "{name}");
        assert!(described.contains(&name), "no {name} in {described}");
        let secret = fs::read_to_string(sandbox.path(&name)).unwrap();
        for line in secret.lines().filter(|line| line.len() > 40) {
            let shown = described.contains(line) && !line.starts_with('#');
            assert!(!shown, "{name} is printed");
        }
    }
    for part in [
        "coordinator serve",
        "worker",
        "https://head.example.org:7400",
    ] {
        assert!(described.contains(part), "no {part:?} in {described}");
    }

    let before = fs::read(sandbox.path("keys/worker.token")).unwrap();
    let again = sandbox.coordinator(&["keygen", "keys"]);
    assert_code(&again, 4);
    assert!(
        errors(&again).contains("nothing is overwritten"),
        "{}",
        errors(&again)
    );
    assert_eq!(fs::read(sandbox.path("keys/worker.token")).unwrap(), before);
    assert_code(
        &sandbox.coordinator(&["keygen", "more", "--host", "no host"]),
        2,
    );
    assert!(!sandbox.path("more").exists());
}

#[test]
fn a_campaign_finishes_over_tls_with_tokens() {
    for client_ca in [false, true] {
        let guarded = Guarded::start(&tiny(), client_ca);
        let mut shown = [CA, TOKEN].concat();
        if client_ca {
            shown.extend(CERTIFICATE);
        }
        assert_code(&guarded.worker("https", &shown), 0);
        let status = guarded.sandbox.status("c.db").unwrap();
        assert_eq!(status["finished"], true, "{status}");
        guarded.coordinator.terminate();
        let (status, log) = guarded.coordinator.finish();
        assert_eq!(status.code(), Some(0), "{log}");
    }
}

#[test]
fn a_worker_without_the_right_to_is_refused_for_good() {
    let guarded = Guarded::start(&tiny(), false);
    let sandbox = &guarded.sandbox;
    assert_code(&sandbox.coordinator(&["keygen", "others"]), 0);
    let with_token = |file: &'static str| [&CA[..], &["--token-file", file]].concat();

    guarded.refused("https", &CA, 12, &["a token is needed", "--token-file"]);
    let wrong = with_token("others/worker.token");
    guarded.refused("https", &wrong, 12, &["not one of this coordinator's"]);
    let client = with_token("keys/client.token");
    guarded.refused(
        "https",
        &client,
        12,
        &["a client's token", "takes a worker's"],
    );
    let astray = [&["--tls-ca", "others/ca.pem"], &TOKEN[..]].concat();
    guarded.refused("https", &astray, 12, &["no reason to trust", "ca.pem"]);
    guarded.refused("http", &TOKEN, 12, &["TLS only", "https://"]);
    guarded.refused("https", &TOKEN, 2, &["--tls-ca"]);

    fs::write(sandbox.path("rubbish"), "hunter2").unwrap();
    fs::set_permissions(sandbox.path("rubbish"), fs::Permissions::from_mode(0o600)).unwrap();
    guarded.refused("https", &with_token("rubbish"), 4, &["line 1 is no token"]);
    guarded.refused("https", &with_token("nowhere"), 4, &["nowhere"]);
    let exposed = sandbox.path("others/worker.token");
    fs::set_permissions(exposed, fs::Permissions::from_mode(0o640)).unwrap();
    guarded.refused("https", &wrong, 4, &["chmod 600 others/worker.token"]);

    // After all refusals the right worker is still accepted.
    assert_code(&guarded.worker("https", &[CA, TOKEN].concat()), 0);
    guarded.coordinator.terminate();
    let (status, log) = guarded.coordinator.finish();
    assert_eq!(status.code(), Some(0), "{log}");
    assert!(log.contains("refused a call"), "{log}");
    no_secret_in(sandbox, &log);
}

#[test]
fn a_worker_without_a_certificate_is_refused_where_one_is_wanted() {
    let guarded = Guarded::start(&tiny(), true);
    assert_code(&guarded.sandbox.coordinator(&["keygen", "others"]), 0);
    let shown = [CA, TOKEN].concat();
    guarded.refused(
        "https",
        &shown,
        12,
        &["asks for a certificate", "--tls-cert"],
    );
    let others = [
        "--tls-cert",
        "others/client.pem",
        "--tls-key",
        "others/client.key",
    ];
    let wrong = [&shown[..], &others].concat();
    guarded.refused("https", &wrong, 12, &["does not accept the certificate"]);
    // A certificate does not replace the token.
    let no_token = [&CA[..], &CERTIFICATE].concat();
    guarded.refused("https", &no_token, 12, &["a token is needed"]);
    let half = [&shown[..], &CERTIFICATE[..2]].concat();
    let output = guarded.worker("https", &half);
    assert_code(&output, 2);
}

#[test]
fn clients_look_and_steer_with_their_own_token() {
    let guarded = Guarded::start(&tiny(), true);
    let url = format!("https://localhost:{}", guarded.port);
    let ask = |command: &str, token: &str| {
        let token = ["--token-file", token];
        let arguments = [&[command, "--connect", &url][..], &CA, &CERTIFICATE, &token].concat();
        guarded.sandbox.coordinator(&arguments)
    };
    // The port opens before the store exists.
    guarded.sandbox.wait_for("c.db", "the store", |_| true);
    for command in ["status", "explain"] {
        assert_code(&ask(command, "keys/client.token"), 0);
    }
    for command in ["status", "explain", "drain"] {
        let output = ask(command, "keys/worker.token");
        assert_code(&output, 12);
        let message = errors(&output);
        assert!(message.contains("a worker's token"), "{message}");
        assert!(message.contains("takes a client's"), "{message}");
        no_secret_in(&guarded.sandbox, &message);
    }
    // The refused drain had no effect.
    let shown = [&CA[..], &TOKEN, &CERTIFICATE].concat();
    assert_code(&guarded.worker("https", &shown), 0);
    let status = guarded.sandbox.status("c.db").unwrap();
    assert_eq!(status["finished"], true, "{status}");
}

#[test]
fn a_secret_does_not_travel_in_clear() {
    let sandbox = Sandbox::new();
    assert_code(&sandbox.coordinator(&["keygen", "keys"]), 0);
    // An address reserved for documentation: nothing must be sent there.
    let url = "http://192.0.2.1:7400";
    let output = sandbox.run("worker", &["--connect", url, TOKEN[0], TOKEN[1]]);
    assert_code(&output, 2);
    let message = errors(&output);
    for part in ["in clear", "https://", url] {
        assert!(message.contains(part), "no {part:?} in {message}");
    }
    let output = sandbox.run("worker", &["--connect", "http://127.0.0.1:1", CA[0], CA[1]]);
    assert_code(&output, 2);
}

#[test]
fn half_of_a_guard_is_refused_and_leaves_nothing_behind() {
    let sandbox = Sandbox::new();
    assert_code(&sandbox.coordinator(&["keygen", "keys"]), 0);
    let file = sandbox.write("tiny.toml", &tiny());
    let file = file.to_str().unwrap();
    let serve = ["serve", file, "--db", "c.db", "--listen", "127.0.0.1:0"];
    let tls = [
        "--tls-cert",
        "keys/server.pem",
        "--tls-key",
        "keys/server.key",
    ];
    let tokens = ["--token-file", "keys/coordinator.tokens"];
    for (more, part) in [
        (&tls[..], "--token-file"),
        (&tokens[..], "--tls-cert"),
        (&[tokens[0], tokens[1], "--insecure"], "--insecure"),
    ] {
        let output = sandbox.coordinator(&[&serve[..], more].concat());
        assert_code(&output, 2);
        assert!(errors(&output).contains(part), "{}", errors(&output));
    }
    // The live page and the metrics have no protection.
    for command in [
        &serve[..],
        &["run", file, "--db", "c.db"],
        &["view", "--db", "c.db"],
    ] {
        let output = sandbox.coordinator(&[command, &["--http", "0.0.0.0:9400"]].concat());
        assert_code(&output, 2);
        for part in ["--http 0.0.0.0:9400", "127.0.0.1:9400", "--insecure"] {
            let message = errors(&output);
            assert!(message.contains(part), "no {part:?} in {message}");
        }
    }
    let half = [&serve[..], &tls, &["--token-file", "keys/worker.token"]].concat();
    let output = sandbox.coordinator(&half);
    assert_code(&output, 4);
    assert!(
        errors(&output).contains("no client's token"),
        "{}",
        errors(&output)
    );
    let path = sandbox.path("keys/coordinator.tokens");
    fs::set_permissions(path, fs::Permissions::from_mode(0o644)).unwrap();
    let output = sandbox.coordinator(&[&serve[..], &tls, &tokens].concat());
    assert_code(&output, 4);
    assert!(errors(&output).contains("chmod 600"), "{}", errors(&output));
    assert!(
        !sandbox.path("c.db").exists(),
        "a refused command left a store"
    );
}

#[test]
fn strangers_on_the_port_disturb_nobody() {
    // Some seconds of sampling, during which garbage arrives all the time.
    let longer = small_campaign(60, 4000);
    let guarded = Guarded::start(&longer, false);
    let url = format!("https://localhost:{}", guarded.port);
    let work = [&["--connect", &url, "--slots", "1"][..], &CA, &TOKEN].concat();
    let worker = guarded.sandbox.start("worker", &work);
    guarded
        .sandbox
        .wait_for("c.db", "the first samples", |status| {
            status["samples"]["done"].as_u64() > Some(0)
        });

    // Some connections keep half a handshake open as long as possible, others send garbage.
    let mut half_open = Vec::new();
    for index in 0..200_u32 {
        let mut stream = TcpStream::connect(("127.0.0.1", guarded.port)).unwrap();
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
    guarded.coordinator.terminate();
    let (status, log) = guarded.coordinator.finish();
    assert_eq!(status.code(), Some(0), "{log}");
    assert!(log.contains("dropped a connection"), "{log}");
    assert!(
        log.lines().count() < 100,
        "strangers can fill the log:\n{log}"
    );
}

#[test]
fn no_log_is_so_chatty_that_it_tells_a_secret() {
    let sandbox = Sandbox::new();
    assert_code(&sandbox.coordinator(&["keygen", "keys"]), 0);
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
    let since = Instant::now();
    let access = loop {
        match fs::read_to_string(sandbox.path("c.access")) {
            Ok(text) => break text,
            Err(_) => std::thread::sleep(Duration::from_millis(20)),
        }
        assert!(since.elapsed() < BOUNDED, "no access file is written");
    };
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

/// The access files in a sandbox's default folder.
fn access_files(sandbox: &Sandbox) -> Vec<String> {
    let Ok(entries) = fs::read_dir(sandbox.path("pitchline")) else {
        return Vec::new();
    };
    let names = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let mut names: Vec<String> = names.filter(|name| name.ends_with(".access")).collect();
    names.sort_unstable();
    names
}

#[test]
fn programs_on_one_machine_find_each_other_without_a_word() {
    let sandbox = Sandbox::new();
    let file = sandbox.write("c.toml", &tiny());
    let serve = ["serve", file.to_str().unwrap(), "--db", "c.db"];
    let serve = [&serve[..], &["--listen", "127.0.0.1:0", "--keep-serving"]].concat();
    // Workers may be started first.
    let worker = sandbox.start("worker", &["--slots", "1"]);
    let coordinator = sandbox.start("coordinator", &serve);
    let (status, said) = worker.finish();
    assert_eq!(status.code(), Some(0), "{said}");
    assert_eq!(access_files(&sandbox), ["quick.access"]);
    let path = sandbox.path("pitchline/quick.access");
    for path in [&path, &sandbox.path("pitchline/quick.access.key")] {
        let mode = fs::metadata(path).unwrap().permissions().mode() & 0o777;
        assert_eq!(mode, 0o600, "{}", path.display());
    }
    let output = sandbox.coordinator(&["status", "--json"]);
    assert_code(&output, 0);
    assert!(printed(&output).contains("\"finished\":true"));

    // A second coordinator must not take over the first one's file. With two files, a program
    // without --access cannot choose.
    let again = ["serve", file.to_str().unwrap(), "--db", "d.db"];
    let again = [&again[..], &["--listen", "127.0.0.1:0"]].concat();
    let output = sandbox.coordinator(&again);
    assert_code(&output, 10);
    assert!(errors(&output).contains("quick.access"));
    assert!(!sandbox.path("d.db").exists());
    fs::copy(&path, sandbox.path("pitchline/other.access")).unwrap();
    let output = sandbox.run("worker", &[]);
    assert_code(&output, 2);
    assert!(
        errors(&output).contains("other.access"),
        "{}",
        errors(&output)
    );
    fs::remove_file(sandbox.path("pitchline/other.access")).unwrap();

    coordinator.terminate();
    assert_eq!(coordinator.finish().0.code(), Some(0));
    assert!(
        access_files(&sandbox).is_empty(),
        "a finished coordinator leaves no access file"
    );
    let output = sandbox.run("worker", &["--connect-timeout", "0"]);
    assert_code(&output, 11);
    assert!(errors(&output).contains("pitchline"), "{}", errors(&output));
}

/// Another user of the machine can reach the port on loopback, but has no access file.
#[test]
fn on_loopback_too_a_call_without_a_token_is_refused() {
    let sandbox = Sandbox::new();
    let file = sandbox.write("c.toml", &small_campaign(60, 4000));
    let address = free_address().to_string();
    let serve = ["serve", file.to_str().unwrap(), "--db", "c.db"];
    let serve = [&serve[..], &["--listen", &address]].concat();
    let _coordinator = sandbox.start("coordinator", &serve);
    sandbox.wait_for("c.db", "the store", |_| true);
    let stranger = Sandbox::new();
    for url in [format!("http://{address}"), format!("https://{address}")] {
        let code = if url.starts_with("https") { 11 } else { 12 };
        let connect = ["--connect", &url];
        let output = stranger.run(
            "worker",
            &[&connect[..], &["--connect-timeout", "1"]].concat(),
        );
        assert_code(&output, code);
        let output = stranger.coordinator(&[&["drain"][..], &connect].concat());
        assert_code(&output, code);
    }
    let status = sandbox.status("c.db").unwrap();
    assert_eq!(status["failures"], 0, "{status}");
    // The owner's command is accepted.
    assert_code(&sandbox.coordinator(&["drain"]), 0);
}

#[test]
fn a_coordinator_computes_itself_and_admits_others() {
    let sandbox = Sandbox::new();
    let file = sandbox.write("c.toml", &small_campaign(100, 4000));
    let file = file.to_str().unwrap();
    assert_code(&sandbox.coordinator(&["run", file, "--db", "alone.db"]), 0);
    let serve = ["serve", file, "--db", "c.db", "--listen", "127.0.0.1:0"];
    let coordinator = sandbox.start("coordinator", &[&serve[..], &["--workers", "1"]].concat());
    sandbox.wait_for("c.db", "some samples", |status| {
        status["samples"]["done"].as_u64() > Some(0)
    });
    let worker = sandbox.start("worker", &["--slots", "1"]);
    for (name, process) in [("coordinator", coordinator), ("worker", worker)] {
        let (status, said) = process.finish();
        assert_eq!(status.code(), Some(0), "{name}: {said}");
    }
    let [alone, both] = ["alone.db", "c.db"].map(|db| sandbox.status(db).unwrap());
    assert_eq!(both["samples_digest"], alone["samples_digest"]);
    assert_eq!(both["optima"], alone["optima"]);
}
