//! Programs on one machine: they find each other through the folder of access files, and strangers do not.

use std::fs;
use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::os::unix::fs::PermissionsExt as _;

use acceptance::{
    Sandbox, assert_all_succeed, assert_code, errors, free_address, printed, small_campaign,
};

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
    // A campaign that ends at once.
    let file = sandbox.write("c.toml", &small_campaign(12, 10));
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
    let connect = ["--connect", &address];
    let patience = ["--connect-timeout", "1"];
    assert_code(&stranger.run("worker", &[connect, patience].concat()), 11);
    assert_code(
        &stranger.coordinator(&[&["drain"][..], &connect].concat()),
        11,
    );
    // A client made by hand.
    let mut stream = TcpStream::connect(&address).unwrap();
    stream
        .write_all(b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n")
        .unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).unwrap();
    assert!(answer.starts_with("HTTP/1.1 400 "), "{answer}");
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
    assert_all_succeed([("coordinator", coordinator), ("worker", worker)]);
    let [alone, both] = ["alone.db", "c.db"].map(|db| sandbox.status(db).unwrap());
    assert_eq!(both["samples_digest"], alone["samples_digest"]);
    assert_eq!(both["optima"], alone["optima"]);
}
