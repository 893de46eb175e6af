//! The paper's campaign at full size, against the documented comparison.

use acceptance::{Sandbox, assert_code, printed, root};

/// Whether a row of the comparison is independent of the last bit of an optimiser's path, which may
/// differ between processors.
fn is_reproducible(line: &str) -> bool {
    line.starts_with("| ") && !line.starts_with("| Table 5")
}

#[test]
fn the_full_campaign_gives_the_documented_figures() {
    let sandbox = Sandbox::new();
    // Neither file nor store is given: the built-in campaign, and the defaults in the working
    // directory.
    assert_code(&sandbox.coordinator(&["run"]), 0);
    let status = sandbox.status("paper.db").expect("the default store");
    assert_eq!(status["finished"], true, "{status}");
    assert_eq!(status["designs"]["done"], 3000);
    let simulable = status["designs"]["simulable"].as_u64().unwrap();
    assert_eq!(status["samples"]["done"], 30 * simulable);
    assert!(sandbox.path("paper-report/report.html").exists());

    let output = sandbox.coordinator(&["compare", "--db", "paper.db"]);
    assert_code(&output, 0);
    let fresh = printed(&output);
    let documented = std::fs::read_to_string(root().join("docs/paper.md")).unwrap();
    let rows = |page: &str| -> Vec<String> {
        page.lines()
            .filter(|line| is_reproducible(line))
            .map(str::to_owned)
            .collect()
    };
    assert!(
        rows(&documented).len() > 60,
        "docs/paper.md has lost its table"
    );
    assert_eq!(
        rows(&fresh),
        rows(&documented),
        "docs/paper.md is out of date: coordinator run, then coordinator compare --db paper.db"
    );
}
