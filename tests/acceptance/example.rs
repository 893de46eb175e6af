//! The example of an external simulator in a sandbox, with changes, and its processes.

use acceptance::{Sandbox, changed, python, root};
use serde_json::Value;

fn example(name: &str) -> String {
    let path = root().join("campaigns/external").join(name);
    std::fs::read_to_string(path).expect("the example is shipped")
}

/// Writes the example's campaign with `changes` to the sandbox.
pub(crate) fn campaign(sandbox: &Sandbox, changes: &[(&str, &str)]) -> String {
    path(&sandbox.write(
        "campaign.toml",
        &changed(&example("campaign.toml"), changes),
    ))
}

/// The command that runs the example's program with `changes` from the sandbox.
pub(crate) fn program(sandbox: &Sandbox, name: &str, changes: &[(&str, &str)]) -> String {
    python(&sandbox.write(name, &changed(&example("simulator.py"), changes)))
}

pub(crate) fn path(path: &std::path::Path) -> String {
    path.to_str().expect("a path in UTF-8").to_owned()
}

/// The ids of the Python processes whose command line contains `mark`.
pub(crate) fn processes(mark: &str) -> Vec<String> {
    let all = std::fs::read_dir("/proc").expect("processes can be listed");
    all.filter_map(Result::ok)
        .filter(|entry| {
            let line = std::fs::read(entry.path().join("cmdline")).unwrap_or_default();
            let line = String::from_utf8_lossy(&line);
            let name = line.split('\0').next().unwrap_or("");
            name.contains("python3") && line.contains(mark)
        })
        .map(|entry| entry.file_name().to_string_lossy().into_owned())
        .collect()
}

/// The example with 20 designs and no probe simulations.
pub(crate) fn twenty_designs(sandbox: &Sandbox) -> String {
    campaign(
        sandbox,
        &[
            ("designs = 60", "method = \"random\"\ndesigns = 20"),
            ("probe_designs = 3", "probe_designs = 0\nretry_s = 5.0"),
            (
                "[sampling]\n",
                "[sampling]\nfailed = \"quarantines-design\"\n",
            ),
        ],
    )
}

/// The example with 20 designs and no probe simulations. Its only job at first is one run of an
/// optimiser, whose optimum has the values of the frozen variables.
pub(crate) fn run_before_designs(sandbox: &Sandbox) -> String {
    campaign(
        sandbox,
        &[
            ("probe_designs = 3", "probe_designs = 0"),
            ("from = \"printed\"", "from = \"deterministic\""),
            ("designs = 60", "designs = 20"),
            ("starts = 2", "starts = 1"),
        ],
    )
}

/// Changes to the example's program: `action` runs before each sample of designs that satisfy
/// `condition`. The modules `sys` and `os` are imported.
pub(crate) fn before_samples(condition: &str, action: &str) -> [(String, String); 3] {
    [
        (
            "import random\n".to_owned(),
            "import os\nimport random\n".to_owned(),
        ),
        (
            "        shift = [design".to_owned(),
            format!("        self.marked = {condition}\n        shift = [design"),
        ),
        (
            "        generator = random".to_owned(),
            format!("        if self.marked:\n            {action}\n        generator = random"),
        ),
    ]
}

pub(crate) fn changed_program(
    sandbox: &Sandbox,
    name: &str,
    changes: &[(String, String)],
) -> String {
    let changes: Vec<(&str, &str)> = changes
        .iter()
        .map(|(from, to)| (from.as_str(), to.as_str()))
        .collect();
    program(sandbox, name, &changes)
}

/// The status of a finished campaign.
pub(crate) fn finished(sandbox: &Sandbox, db: &str) -> Value {
    let status = sandbox.status(db).expect("the store is there");
    assert_eq!(status["finished"], true, "{status}");
    status
}
