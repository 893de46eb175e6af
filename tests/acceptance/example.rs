//! The example of an external simulator in a sandbox, with changes, and its processes.

use acceptance::{Sandbox, changed, python, root};

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
