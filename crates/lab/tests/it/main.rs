//! The entries of the stability atlas. `tests/acceptance/stability.rs` tests that they keep their promises.

use std::collections::BTreeSet;

use lab::stability::{Method, Outcome, entries};

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
