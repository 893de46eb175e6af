//! A short soak; `cargo run --release -p acceptance --bin chaos` runs a longer one.

use acceptance::Sandbox;
use acceptance::chaos::{Kind, Soak};

#[test]
fn random_faults_leave_no_trace_in_the_results() {
    let sandbox = Sandbox::new();
    let soak = Soak::new(&sandbox.path("."), &acceptance::programs(), 2009).unwrap();
    for (round, kind) in [(0, Kind::Plain), (1, Kind::Licence), (2, Kind::Sharded)] {
        let done = soak.round(round, Some(kind)).unwrap();
        assert!(done.looks > 0, "no look at the progress: {done:?}");
        // The processes of a campaign in shards may all end before they would be killed.
        if kind != Kind::Sharded {
            assert!(done.acts > 0, "undisturbed: {done:?}");
            assert!(done.visits > 0, "the live page never answered: {done:?}");
        }
    }
}
