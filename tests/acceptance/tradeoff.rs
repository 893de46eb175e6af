//! `tradeoff`: speed against accuracy.

use acceptance::{Sandbox, assert_code, errors, printed, small_campaign};
use serde_json::Value;

const STUDIES: [&str; 9] = [
    "simulator",
    "contact",
    "percentile",
    "estimators",
    "kriging",
    "optimisation",
    "runner",
    "cores",
    "growth",
];

#[test]
fn studies_are_measured_once_and_shown_on_one_page() {
    let sandbox = Sandbox::new();
    let file = sandbox.write("small.toml", &small_campaign(150, 10));
    let file = file.to_str().expect("a plain path");
    let arguments = ["tradeoff", file, "--designs", "8", "--out", "out"];
    let output = sandbox.coordinator(&arguments);
    assert_code(&output, 0);
    let lines = printed(&output);
    for study in STUDIES {
        let line = lines.lines().find(|line| line.starts_with(study));
        let line = line.unwrap_or_else(|| panic!("no line of {study} in\n{lines}"));
        // Nobody chooses the time of a sample or the size of a task.
        let says = match study {
            "runner" => "The least time",
            "cores" | "growth" => " as the power ",
            _ => "Recommended: ",
        };
        assert!(
            line.contains(": measured, ") && line.contains(says),
            "{line}"
        );
    }
    let page = std::fs::read_to_string(sandbox.path("out/tradeoff.html")).unwrap();
    for study in STUDIES {
        assert!(
            page.contains(&format!("<section id=\"{study}\">")),
            "{study}"
        );
    }
    assert!(page.contains("Pareto front"));
    assert!(
        !page.contains("src=") && !page.contains("<script"),
        "it loads nothing"
    );
    assert!(sandbox.path("out/charts/simulator-1.svg").exists());
    let grids = std::fs::read_to_string(sandbox.path("out/simulator.csv")).unwrap();
    let header = grids.lines().next().unwrap();
    assert!(
        header.contains("(µs)") && header.contains("(%)"),
        "{header}"
    );
    let own = |line: &&str| line.contains(",64 × 32,1,");
    assert_eq!(grids.lines().filter(own).count(), 1, "{grids}");
    let table =
        |study: &str| std::fs::read_to_string(sandbox.path(&format!("out/{study}.csv"))).unwrap();
    assert!(table("optimisation").contains("enriched"));
    let runner = table("runner");
    for (workers, setting) in [
        ("1 worker", "built-in simulator"),
        ("2 workers", "1 ms a sample"),
    ] {
        assert!(
            runner.contains(&format!("{workers},{setting},")),
            "{runner}"
        );
    }
    let left = std::fs::read_dir(sandbox.path("out"))
        .unwrap()
        .map(|entry| entry.unwrap().path());
    let left: Vec<_> = left
        .filter(|path| path.is_dir() && !path.ends_with("charts"))
        .collect();
    assert!(left.is_empty(), "stores of the studies are left: {left:?}");

    // Only the interrupted study is measured again: otherwise the times would differ.
    let read = |study: &str| std::fs::read(sandbox.path(&format!("out/{study}.csv"))).unwrap();
    let before = STUDIES.map(read);
    std::fs::remove_file(sandbox.path("out/kriging.csv")).unwrap();
    let output = sandbox.coordinator(&arguments);
    assert_code(&output, 0);
    let lines = printed(&output);
    assert_eq!(
        lines.matches(": measured before, ").count(),
        STUDIES.len() - 1,
        "{lines}"
    );
    assert!(lines.contains("kriging: measured, "), "{lines}");
    let after = STUDIES.map(read);
    assert!(
        [0, 1, 2, 3, 5, 6, 7, 8]
            .iter()
            .all(|&study| before[study] == after[study])
    );
    let page = std::fs::read(sandbox.path("out/tradeoff.html")).unwrap();

    // Errors are reproducible, times are not.
    let json = sandbox.coordinator(&[&arguments[..], &["--json"]].concat());
    assert_code(&json, 0);
    let found: Value = serde_json::from_str(&printed(&json)).expect("one JSON object");
    let names = found["studies"].as_array().expect("studies").iter();
    assert!(names.map(|study| &study["name"]).eq(STUDIES));
    assert!(found["studies"][0]["recommended"][0]["why"].is_string());
    assert_eq!(STUDIES.map(read), after);
    assert!(!page.is_empty());
}

#[test]
fn folders_and_campaigns_that_do_not_fit_are_refused() {
    let sandbox = Sandbox::new();
    let file = sandbox.write("small.toml", &small_campaign(150, 10));
    let file = file.to_str().expect("a plain path");
    std::fs::create_dir(sandbox.path("mine")).unwrap();
    sandbox.write("mine/simulator.csv", "mine");
    let output = sandbox.coordinator(&["tradeoff", file, "--designs", "1", "--out", "mine"]);
    assert_code(&output, 4);
    assert!(errors(&output).contains("not empty"), "{}", errors(&output));
    let kept = std::fs::read_to_string(sandbox.path("mine/simulator.csv")).unwrap();
    assert_eq!(kept, "mine");
    let external = acceptance::root().join("campaigns/ishigami/campaign.toml");
    let external = external.to_str().expect("a plain path");
    let output = sandbox.coordinator(&["tradeoff", external, "--out", "other"]);
    assert_code(&output, 2);
    assert!(errors(&output).contains("gears"), "{}", errors(&output));
    assert!(!sandbox.path("other").exists());
}
