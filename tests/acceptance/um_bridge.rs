//! Models of UM-Bridge servers, which the Python package `umbridge` runs.

use std::net::{SocketAddr, TcpStream};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use acceptance::{Sandbox, assert_code, errors, free_address, printed, root, skipped};

const MODEL: &str = include_str!("cases/um-bridge/model.py");

/// A server, which ends with the test.
struct Server {
    address: SocketAddr,
    process: Child,
}

impl Server {
    /// Starts the model; `None` without the package.
    fn start(sandbox: &Sandbox) -> Option<Self> {
        let has_package = Command::new("python3")
            .args(["-c", "import umbridge"])
            .stderr(Stdio::null())
            .status();
        if !has_package.is_ok_and(|status| status.success()) {
            skipped("the Python package umbridge is not installed");
            return None;
        }
        let file = sandbox.path("model.py");
        std::fs::write(&file, MODEL).expect("a file");
        let address = free_address();
        let process = Command::new("python3")
            .arg(&file)
            .arg(address.port().to_string())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .expect("Python starts");
        let this = Self { address, process };
        let since = Instant::now();
        while TcpStream::connect(address).is_err() {
            assert!(since.elapsed() < Duration::from_secs(120), "no server");
            std::thread::sleep(Duration::from_millis(50));
        }
        Some(this)
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// The campaign and the program of the guide.
fn bracket(sandbox: &Sandbox) -> String {
    let page = std::fs::read_to_string(root().join("docs/guide/src/robust.md")).expect("a page");
    let block = |begin: &str| {
        let (_, rest) = page.split_once(begin).expect("the block");
        rest.split("```")
            .next()
            .expect("its end")
            .trim_start()
            .to_owned()
    };
    let program = block("```python file=bracket.py");
    std::fs::write(sandbox.path("bracket.py"), program).expect("a file");
    block("```toml file=bracket.toml")
}

#[test]
fn a_model_of_a_server_gives_the_samples_of_the_same_program() {
    let sandbox = Sandbox::new();
    let (Some(one), Some(other)) = (Server::start(&sandbox), Server::start(&sandbox)) else {
        return;
    };
    let text = bracket(&sandbox);
    let run = |name: &str, text: &str| {
        let (file, db, out) = (
            format!("{name}.toml"),
            format!("{name}.db"),
            format!("{name}-report"),
        );
        std::fs::write(sandbox.path(&file), text).expect("a file");
        assert_code(
            &sandbox.coordinator(&["run", &file, "--db", &db, "--out", &out]),
            0,
        );
        sandbox.status(&db).expect("the store is there")
    };
    let of_program = run("program", &text);
    let command = "command = 'exec python3 \"$CAMPAIGN_FOLDER\"/bracket.py'";
    let served = |servers: &[String], more: &str| {
        let servers: Vec<String> = servers.iter().map(|one| format!("\"{one}\"")).collect();
        let section = format!(
            "\n[simulator.um_bridge]\nservers = [{}]\nconfig = {{ length = 200.0 }}\n{more}",
            servers.join(", ")
        );
        assert!(text.contains(command));
        text.replace(command, &section)
    };
    let url = |address: SocketAddr| format!("http://{address}");
    let both = [url(one.address), url(other.address)];
    let of_model = run("model", &served(&both, ""));
    assert_eq!(of_model["samples_digest"], of_program["samples_digest"]);
    assert_eq!(
        of_model["optima"][0]["limits"],
        of_program["optima"][0]["limits"]
    );

    // One of two servers is away.
    drop(other);
    let of_one = run("one", &served(&both, ""));
    assert_eq!(of_one["samples_digest"], of_program["samples_digest"]);

    let refused = |text: &str| {
        std::fs::write(sandbox.path("wrong.toml"), text).expect("a file");
        let said = sandbox.coordinator(&["check", "wrong.toml"]);
        assert_ne!(said.status.code(), Some(0), "{}", printed(&said));
        errors(&said)
    };
    let here = [url(one.address)];
    let error = refused(&served(&here, "model = \"beam\"\n"));
    assert!(
        error.contains("has no model \"beam\"; it has: bracket"),
        "{error}"
    );
    let fewer = served(&here, "").replace(
        "\n[[responses]]\nname = \"stress_pull\"\nunit = \"MPa\"\n",
        "",
    );
    let fewer = fewer.replace(
        "{ greatest = [\"stress_pull\", \"stress_push\"] }",
        "\"stress_push\"",
    );
    let error = refused(&fewer);
    assert!(
        error.contains("has 3 numbers in lists of [1, 2], and the campaign 2 outputs"),
        "{error}"
    );
    drop(one);
    let error = refused(&served(&here, ""));
    assert!(error.contains("no UM-Bridge server answers at"), "{error}");
}
