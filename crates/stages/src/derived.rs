//! Results that depend on the samples of the DoE, and are discarded when these change.

use campaign::Approach;
use ledger::{Kind, StreamId};

use crate::infill;

/// The approaches that use the samples of the DoE.
const APPROACHES: [Approach; 3] = [
    Approach::Kriging,
    Approach::BestOfDoe,
    Approach::EnrichedKriging,
];

/// The names of the approaches that use the samples of the DoE.
pub const DERIVED_APPROACHES: [&str; 3] = [
    APPROACHES[0].name(),
    APPROACHES[1].name(),
    APPROACHES[2].name(),
];

/// Whether a stream depends on the samples of the DoE: runs on the model, infill, and the
/// verification samples of their results.
#[must_use]
pub fn is_derived(stream: StreamId) -> bool {
    let learns = |number: u64| {
        APPROACHES
            .iter()
            .any(|approach| approach.number() == number)
    };
    match stream.kind {
        Kind::Run => learns(stream.run_parts().0.into()),
        Kind::Design => false,
        Kind::Point => learns(stream.index) || infill::is_infill(stream.index),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_computed_without_samples_of_the_doe_stays() {
        let run = |approach: Approach| StreamId::run(approach.number() as u32, 1);
        let point = |approach: Approach| StreamId::point(approach.number());
        for approach in Approach::ALL {
            let learns = APPROACHES.contains(&approach);
            assert_eq!(is_derived(run(approach)), learns, "{approach:?}");
            assert_eq!(is_derived(point(approach)), learns, "{approach:?}");
        }
        let infill = infill::point_number(0, &[0.5; 6], &[]);
        assert!(is_derived(StreamId::point(infill)));
        assert!(!is_derived(StreamId::design(3)));
    }
}
