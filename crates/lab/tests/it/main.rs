//! Every entry of the stability atlas keeps its promises.

use std::collections::BTreeSet;

use lab::stability::{Method, Outcome, entries};

/// Runs the entries of one method and fails with the broken promises.
fn check(method: Method) {
    let mut broken = Vec::new();
    for entry in entries().into_iter().filter(|entry| entry.method == method) {
        let outcome = entry.run();
        for promise in outcome.promises().iter().filter(|p| !p.is_kept) {
            let figures = outcome.figures();
            broken.push(format!("{}: {}\n{figures:#?}", entry.id, promise.sentence));
        }
    }
    assert!(broken.is_empty(), "{}", broken.join("\n"));
}

#[test]
fn kriging_keeps_its_promises() {
    check(Method::Kriging);
}

#[test]
fn percentiles_keep_their_promises() {
    check(Method::Statistics);
}

#[test]
fn designs_keep_their_promises() {
    check(Method::Designs);
}

#[test]
fn searches_keep_their_promises() {
    check(Method::Search);
}

#[test]
fn enrichment_keeps_its_promises() {
    check(Method::Enrichment);
}

#[test]
fn gears_keep_their_promises() {
    check(Method::Gears);
}

#[test]
fn leases_keep_their_promises() {
    check(Method::Leases);
}

#[test]
fn every_entry_has_a_name_and_texts() {
    let all = entries();
    assert!(all.len() >= 40, "{}", all.len());
    let ids: BTreeSet<&str> = all.iter().map(|entry| entry.id).collect();
    assert_eq!(ids.len(), all.len(), "two entries share a name");
    for entry in &all {
        let plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
        assert!(entry.id.chars().all(plain), "{}", entry.id);
        for text in [entry.title, entry.input, entry.instead] {
            assert!(!text.is_empty(), "{}", entry.id);
        }
    }
    for method in Method::ALL {
        assert!(all.iter().any(|entry| entry.method == method), "{method:?}");
    }
}

#[test]
fn an_entry_gives_the_same_figures_every_time() {
    for id in ["kriging-outlier", "lease-pauses", "search-corner"] {
        let entries = entries();
        let entry = entries.iter().find(|entry| entry.id == id).expect(id);
        let [first, second] = [entry.run(), entry.run()];
        // Compared as text, in which a NaN equals itself.
        let text = |outcome: &Outcome| format!("{:?}", outcome.figures());
        assert_eq!(text(&first), text(&second), "{id}");
    }
}
