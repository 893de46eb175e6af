//! The streams of designs, points and runs, and their names in messages.

use std::ops::Range;

use ledger::{Kind, StreamId, Unit};
use problem::Approach;
pub use problem::task::stream_name;
use store::FailureRow;

/// The stream of a design in the store.
#[must_use]
pub const fn design(index: u64) -> StreamId {
    // A DoE has at most 100 000 designs.
    StreamId::design(index as u32)
}

/// The stream of an optimum's verification samples.
#[must_use]
pub const fn verification(approach: Approach) -> StreamId {
    StreamId::point(approach.number())
}

#[must_use]
pub const fn run(approach: Approach, start: u32) -> StreamId {
    StreamId::run(approach.number() as u32, start)
}

/// The approach and the start of a run; `None` for another stream.
#[must_use]
pub fn approach_and_start(stream: StreamId) -> Option<(Approach, u32)> {
    let (number, start) = stream.run_parts();
    let approach = Approach::numbered(number.into())?;
    (stream.kind == Kind::Run).then_some((approach, start))
}

/// The job of a failure in messages.
#[must_use]
pub fn failed_job(row: &FailureRow) -> String {
    let name = stream_name(row.stream);
    if row.shared {
        name + " and others"
    } else {
        name
    }
}

/// A job in messages: `design-59, samples 130–154`. Without samples the whole stream is meant.
#[must_use]
pub fn job_name(stream: StreamId, samples: &Range<u32>) -> String {
    let of = stream_name(stream);
    match samples.len() {
        0 => of,
        1 => format!("{of}, sample {}", samples.start),
        _ => format!("{of}, samples {}–{}", samples.start, samples.end - 1),
    }
}

/// The key of a unit's time among the times of its stream: the first sample and, for a run, the generation,
/// because a restarted run costs time again.
#[must_use]
pub fn time_part(unit: &Unit) -> u64 {
    let first = u64::from(unit.samples.start);
    match unit.stream.kind {
        Kind::Run => unit.generation.0.wrapping_add(first) & 0xffff_ffff,
        Kind::Design | Kind::Point => first,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn jobs_have_names_for_people() {
        let run = StreamId::run(Approach::Kriging.number() as u32, 2);
        assert_eq!(
            job_name(StreamId::design(59), &(130..155)),
            "design-59, samples 130–154"
        );
        assert_eq!(
            job_name(StreamId::design(59), &(0..1)),
            "design-59, sample 0"
        );
        assert_eq!(job_name(run, &(0..40)), "run-kriging-2, samples 0–39");
        assert_eq!(job_name(StreamId::point(2), &(0..0)), "verify-archard");
    }
}
