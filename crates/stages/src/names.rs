//! The streams of designs, points and runs, and their names in messages.

use std::ops::Range;

use ledger::{Kind, StreamId, Unit};
use problem::Approach;
use store::FailureRow;

use crate::infill;

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

/// The name of a stream in messages; starts count from 0.
#[must_use]
pub fn stream_name(stream: StreamId) -> String {
    match stream.kind {
        Kind::Run => match approach_and_start(stream) {
            Some((approach, start)) => format!("run-{}-{start}", approach.name()),
            None => stream.to_string(),
        },
        Kind::Design => stream.to_string(),
        Kind::Point if infill::is_infill(stream.index) => {
            format!("infill-{}", infill::mark(stream.index))
        }
        Kind::Point => match Approach::numbered(stream.index) {
            Some(approach) => format!("verify-{}", approach.name()),
            None => stream.to_string(),
        },
    }
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
    fn streams_have_names_for_people() {
        let run = StreamId::run(Approach::Kriging.number() as u32, 2);
        let infill = StreamId::point(infill::point_number(3, &[0.5; 6], &[]));
        assert_eq!(stream_name(run), "run-kriging-2");
        assert_eq!(stream_name(StreamId::point(2)), "verify-archard");
        assert!(stream_name(infill).starts_with("infill-"));
        assert_eq!(stream_name(StreamId::design(7)), "design-7");
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
