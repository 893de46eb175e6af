//! `stability`: the page of the inputs on which methods fail.

use acceptance::{Sandbox, assert_code, errors};
use serde_json::Value;

#[test]
fn the_atlas_keeps_its_promises_and_its_page_says_what_was_run() {
    let sandbox = Sandbox::new();
    let arguments = ["stability", "--out", "atlas", "--json"];
    let output = sandbox.coordinator(&arguments);
    let atlas: Value = serde_json::from_slice(&output.stdout)
        .unwrap_or_else(|error| panic!("{error}: {}", errors(&output)));
    let entries = atlas["entries"].as_array().expect("a list");
    let broken: Vec<&Value> = entries
        .iter()
        .filter(|entry| entry["kept"] != true)
        .collect();
    assert!(broken.is_empty(), "{broken:#?}");
    assert_eq!(atlas["kept"], true);
    assert_code(&output, 0);
    assert!(entries.len() >= 40, "{}", entries.len());

    let read = |name: &str| std::fs::read_to_string(sandbox.path(name)).expect("it was written");
    let page = read("atlas/index.html");
    assert!(!page.contains("<script") && !page.contains("http-equiv"));
    let headline = format!("All {} entries keep what they promise.", entries.len());
    assert!(page.contains(&headline));
    let promises = read("atlas/promises.csv");
    for entry in entries {
        let id = entry["id"].as_str().expect("a name");
        assert!(
            page.contains(&format!("id=\"{id}\"")),
            "{id} is not on the page"
        );
        for detected in entry["detected"].as_array().expect("a list") {
            let name = detected["name"].as_str().expect("a name");
            assert!(
                page.contains(&format!("<code>{name}</code>")),
                "{id}: {name}"
            );
        }
        let of_entry = promises
            .lines()
            .filter(|line| line.starts_with(&format!("{id},")));
        let listed = entry["promises"].as_array().expect("a list");
        assert!(!listed.is_empty());
        assert_eq!(of_entry.count(), listed.len(), "{id}");
    }
    // Every chart has an accessible description and a table of its points.
    let charts = page.matches("<svg").count();
    assert_eq!(page.matches("role=\"img\" aria-label=\"").count(), charts);
    let files = std::fs::read_dir(sandbox.path("atlas")).expect("a folder");
    assert_eq!(
        files.count(),
        charts + 3,
        "the page, two tables, one for each chart"
    );

    let again = sandbox.coordinator(&arguments);
    assert_code(&again, 4);
    assert!(errors(&again).contains("--out"), "{}", errors(&again));
    assert_eq!(read("atlas/index.html"), page, "nothing is overwritten");
}
