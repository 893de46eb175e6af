//! Results that contradict stored ones, as the table of failures records them.

use ledger::{Kind, StreamId};

/// The beginning of a recorded contradiction.
const MARK: &str = "contradiction: ";

/// Whether a recorded error is a contradiction.
#[must_use]
pub fn is_recorded(error: &str) -> bool {
    error.starts_with(MARK)
}

/// The record of a contradiction between `worker` and the earlier one whose result is stored; `difference` has
/// both results.
#[must_use]
pub fn record(stream: StreamId, worker: &str, earlier: &str, difference: &str) -> String {
    let remedy = match stream.kind {
        Kind::Design => format!(
            "; to have the design computed by a third, give `coordinator discard --db FILE --design {} --yes` and the \
             same command again",
            stream.index
        ),
        Kind::Point | Kind::Run => String::new(),
    };
    format!(
        "{MARK}{worker} and {earlier} computed different results ({difference}). Either may be wrong, so it counts \
         against neither, and the stored result stays{remedy}"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_record_names_both_workers_and_the_remedy_and_is_known_by_its_cause() {
        let text = record(
            StreamId::design(7),
            "b",
            "an earlier worker",
            "1.5, not 1.2",
        );
        for part in [
            "b and an earlier worker",
            "1.5, not 1.2",
            "--design 7 --yes",
        ] {
            assert!(text.contains(part), "{part}: {text}");
        }
        assert!(is_recorded(&text) && !is_recorded("design-7: no licence"));
        let run = record(StreamId::run(2, 1), "b", "a", "…");
        assert!(!run.contains("discard"), "{run}");
    }
}
