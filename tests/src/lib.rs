//! Helpers of the acceptance tests: the programs' binaries, processes that end with the test, and
//! campaign files derived from the shipped ones.

#![expect(
    clippy::disallowed_methods,
    reason = "tests wait with time limits and read the environment"
)]

pub mod browser;
pub mod chaos;
pub mod http;
pub mod isolated;
mod sandbox;

use std::net::{Ipv4Addr, SocketAddr, TcpListener};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

pub use sandbox::{RunningProgram, Sandbox};

/// Longer than any step takes on a slow, busy machine.
const PATIENCE: Duration = Duration::from_secs(240);

/// The path of a program under test, see [`programs`].
///
/// # Panics
///
/// The program cannot be built.
#[must_use]
pub fn binary(name: &str) -> PathBuf {
    programs().join(name)
}

/// The folder of the programs under test, built with the profile of the running program.
///
/// # Panics
///
/// The programs cannot be built.
#[must_use]
pub fn programs() -> PathBuf {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    let folder = FOLDER.get_or_init(|| {
        let exe = std::env::current_exe().expect("the program's own path");
        // TARGET/PROFILE/deps/acceptance-HASH, or TARGET/PROFILE/chaos
        let is_test = exe.parent().is_some_and(|folder| folder.ends_with("deps"));
        let profile = exe.ancestors().nth(if is_test { 2 } else { 1 });
        let profile = profile.expect("programs live in target/PROFILE");
        let target = profile.parent().expect("programs live in target/PROFILE");
        let mut cargo = Command::new(env!("CARGO"));
        if is_test {
            // The command that runs the suite itself, so that nothing is left to build and nothing
            // is built again with other features.
            cargo.args(["test", "--workspace", "--no-run", "--quiet"]);
        } else {
            cargo.args(["build", "-p", "coordinator", "-p", "worker", "--quiet"]);
        }
        cargo.arg("--target-dir").arg(target).current_dir(root());
        // Cargo describes this package to its tests. Build scripts that read such a variable, as that
        // of ring, would run again, and all that depends on them would be built again.
        for (name, _) in std::env::vars_os() {
            let text = name.to_string_lossy();
            if text.starts_with("CARGO_PKG_") || text.starts_with("CARGO_MANIFEST_") {
                cargo.env_remove(&name);
            }
        }
        if profile.file_name().is_some_and(|name| name == "release") {
            cargo.arg("--release");
        }
        let status = cargo.status().expect("cargo runs");
        assert!(status.success(), "the programs under test do not build");
        profile.to_owned()
    });
    folder.clone()
}

/// The root of the workspace.
#[must_use]
pub fn root() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/.."))
}

/// The quick campaign's file after `changes` (the text to replace, and its replacement).
///
/// # Panics
///
/// The text to replace is missing.
#[must_use]
pub fn quick_campaign(changes: &[(&str, &str)]) -> String {
    let shipped = root().join("campaigns/quick.toml");
    let text = std::fs::read_to_string(shipped).expect("the quick campaign is shipped");
    changed(&text, changes)
}

/// A text after `changes` (the text to replace, and its replacement).
///
/// # Panics
///
/// The text to replace is missing.
#[must_use]
pub fn changed(text: &str, changes: &[(&str, &str)]) -> String {
    changes.iter().fold(text.to_owned(), |text, (from, to)| {
        assert!(text.contains(from), "{from:?} is not there to be replaced");
        text.replacen(from, to, 1)
    })
}

/// The quick campaign with this number of designs and samples, which does little besides sampling:
/// its designs are random, since the search for a maximin design would take longer than the rest.
///
/// # Panics
///
/// The quick campaign has changed in these places.
#[must_use]
pub fn small_campaign(designs: u32, samples: u32) -> String {
    quick_campaign(&[
        (
            "designs = 150 ",
            &format!("method = \"random\"\ndesigns = {designs} "),
        ),
        (
            "samples_per_design = 10 ",
            &format!("samples_per_design = {samples} "),
        ),
        ("evaluations = 1200 ", "evaluations = 100 "),
        ("restart_at = 600 ", "restart_at = 50 "),
        ("starts = 3", "starts = 1"),
        ("compare_with_paper = true", "compare_with_paper = false"),
    ])
}

/// The command that runs a Python program with the standard library alone.
///
/// The interpreter itself is started: a version manager's wrapper and the search for packages take
/// five times as long.
///
/// # Panics
///
/// There is no Python 3.
#[must_use]
pub fn python(program: &Path) -> String {
    static INTERPRETER: OnceLock<String> = OnceLock::new();
    let interpreter = INTERPRETER.get_or_init(|| {
        let path = Command::new("python3")
            .args(["-c", "import sys; print(sys.executable, end='')"])
            .output();
        printed(&path.expect("Python 3 runs"))
    });
    format!("exec {interpreter} -S -B {}", program.display())
}

/// The signal of a process that aborts, for example at a fail point.
pub const SIGABRT: i32 = 6;

/// The pair file of the paper's Figure 7.
pub const FIGURE_7: &str = r#"[pair]
teeth = [20, 22]
centre_distance_mm = 110.0
pressure_angle_deg = 18.0
helix_angle_deg = 30.0
face_width_mm = 10.0
profile_shift = [0.49, 0.49]
tool_addendum = [1.20, 1.11]
tool_dedendum = [1.00, 1.09]
tip_radius_mm = [0.0003, 0.19]
root_radius_mm = [0.64, 0.23]
tooth_model = "hertz-beam"
[load]
pinion_torque_nm = 200.0
[material]
youngs_modulus_gpa = 200.0
poisson_ratio = 0.29
contact_limit_mpa = 1550.0
bending_limit_mpa = 860.0
"#;

/// Reports that a test could not be run here, and why.
///
/// # Panics
///
/// The environment variable `PITCHLINE_SKIP_NO_TEST` is set, as it is where a change is accepted.
#[expect(clippy::print_stderr, reason = "for readers of the tests' output")]
pub fn skipped(why: &str) {
    assert!(
        std::env::var_os("PITCHLINE_SKIP_NO_TEST").is_none(),
        "this test cannot be skipped: {why}"
    );
    eprintln!("skipped: {why}");
}

/// A free loopback address. The system assigns the ports of clients from 32768 on, so no other
/// program gets this one by chance, and each call returns another port.
///
/// # Panics
///
/// There is no free port.
#[must_use]
pub fn free_address() -> SocketAddr {
    const FIRST: u32 = 20_000;
    const COUNT: u32 = 12_000;
    static CALLS: AtomicU32 = AtomicU32::new(0);
    // Processes that start together have adjacent ids.
    let start = std::process::id().wrapping_mul(97);
    let is_free = |address: &SocketAddr| TcpListener::bind(address).is_ok();
    (0..COUNT)
        .map(|_| start.wrapping_add(CALLS.fetch_add(1, Ordering::Relaxed)) % COUNT)
        .map(|port| SocketAddr::from((Ipv4Addr::LOCALHOST, (FIRST + port) as u16)))
        .find(is_free)
        .expect("a free port")
}

/// The standard error of a program.
#[must_use]
pub fn errors(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// The standard output of a program.
#[must_use]
pub fn printed(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// Asserts that a program ended with `code`, and shows its standard error otherwise.
///
/// # Panics
///
/// The program ended with another code.
pub fn assert_code(output: &Output, code: i32) {
    assert_eq!(output.status.code(), Some(code), "{}", errors(output));
}

/// Waits for the end of these programs, which have names, and asserts that each one succeeded.
///
/// # Panics
///
/// A program does not end in time, or it fails.
pub fn assert_all_succeed<const N: usize>(programs: [(&str, RunningProgram); N]) {
    for (name, program) in programs {
        let (status, log) = program.finish();
        assert_eq!(status.code(), Some(0), "{name}: {log}");
    }
}
