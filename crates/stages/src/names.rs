//! Streams by what they are of, and their names in messages.

use std::ops::Range;

use campaign::Approach;
use ledger::{Kind, StreamId, Unit};
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

/// The stream of a run.
#[must_use]
pub const fn run(approach: Approach, start: u32) -> StreamId {
    StreamId::run(approach.number() as u32, start)
}

/// The approach and the start of a run; `None` if the stream is none.
#[must_use]
pub fn run_of(stream: StreamId) -> Option<(Approach, u32)> {
    let (number, start) = stream.run_parts();
    let approach = Approach::numbered(number.into())?;
    (stream.kind == Kind::Run).then_some((approach, start))
}

/// The name of a stream in messages.
#[must_use]
pub fn stream_name(stream: StreamId) -> String {
    match stream.kind {
        Kind::Run => {
            let (number, start) = stream.run_parts();
            let name = Approach::numbered(number.into()).map_or("unknown", Approach::name);
            format!("run-{name}-{start}")
        }
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

/// A job as the log names it: `design 59, samples 130–154`. Without samples the whole stream is meant.
#[must_use]
pub fn job_name(stream: StreamId, samples: &Range<u32>) -> String {
    let of = match stream.kind {
        Kind::Run => {
            let (number, start) = stream.run_parts();
            let name = Approach::numbered(number.into()).map_or("unknown", Approach::name);
            return format!("search {name}, start {}", start + 1);
        }
        Kind::Design => format!("design {}", stream.index),
        Kind::Point if infill::is_infill(stream.index) => {
            format!("infill point {}", infill::mark(stream.index))
        }
        Kind::Point => {
            let name = Approach::numbered(stream.index).map_or("a reference", Approach::name);
            format!("verification of {name}")
        }
    };
    match samples.len() {
        0 => of,
        1 => format!("{of}, sample {}", samples.start),
        _ => format!("{of}, samples {}–{}", samples.start, samples.end - 1),
    }
}

/// The key of a unit's time in the store. It holds the kind in 8 bits; then, for samples, 4 zero
/// bits, the stream's index in 28 and the first sample in 24; for a run, the approach in 8, the
/// start in 16, and 32 bits that distinguish its units.
#[must_use]
pub fn time_key(unit: &Unit) -> u64 {
    let (stream, first) = (unit.stream, u64::from(unit.samples.start));
    match stream.kind {
        Kind::Run => {
            let (approach, start) = stream.run_parts();
            let stamp = unit.generation.0.wrapping_add(first) & 0xffff_ffff;
            1 << 56 | u64::from(approach) << 48 | u64::from(start) << 32 | stamp
        }
        Kind::Design => 2 << 56 | stream.index << 24 | first,
        Kind::Point => 3 << 56 | stream.index << 24 | first,
    }
}

/// Whether a time in the store is that of a unit of this run.
#[must_use]
pub const fn is_time_of_run(job: u64, approach: Approach, start: u32) -> bool {
    job >> 32 == 1 << 24 | approach.number() << 16 | start as u64
}

/// The kind of the unit whose time is in the store, and for samples the stream's index.
#[must_use]
pub const fn timed(job: u64) -> Option<(Kind, u64)> {
    let index = (job >> 24) & 0x0fff_ffff;
    match job >> 56 {
        1 => Some((Kind::Run, 0)),
        2 => Some((Kind::Design, index)),
        3 => Some((Kind::Point, index)),
        _ => None,
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
            "design 59, samples 130–154"
        );
        assert_eq!(
            job_name(StreamId::design(59), &(0..1)),
            "design 59, sample 0"
        );
        assert_eq!(job_name(run, &(0..40)), "search kriging, start 3");
        assert_eq!(
            job_name(StreamId::point(2), &(0..0)),
            "verification of archard"
        );
    }

    #[test]
    fn the_key_of_a_time_tells_of_what_it_was_taken() {
        let of = |stream| {
            let unit = Unit {
                stream,
                generation: ledger::Generation(0xabcd_0000_1234),
                samples: 5..7,
            };
            timed(time_key(&unit))
        };
        assert_eq!(of(StreamId::run(3, 2)), Some((Kind::Run, 0)));
        let unit = Unit {
            stream: StreamId::run(3, 2),
            generation: ledger::Generation(u64::MAX),
            samples: 40..50,
        };
        let of_run = |start| is_time_of_run(time_key(&unit), Approach::Kriging, start);
        assert!(of_run(2) && !of_run(1));
        assert_eq!(of(StreamId::design(7)), Some((Kind::Design, 7)));
        assert_eq!(of(StreamId::point(3)), Some((Kind::Point, 3)));
    }
}
