//! The name of a stream in messages and tables.

use ledger::{Kind, StreamId};

use super::FIRST_INFILL;
use crate::approach::Approach;

/// The name of a stream in messages; starts count from 0.
#[must_use]
pub fn stream_name(stream: StreamId) -> String {
    let name = match (stream.kind, stream.index) {
        (Kind::Design, _) => None,
        (Kind::Run, _) => {
            let (number, start) = stream.run_parts();
            let approach = Approach::numbered(number.into());
            approach.map(|approach| format!("run-{}-{start}", approach.name()))
        }
        (Kind::Point, infill @ FIRST_INFILL..) => Some(format!("infill-{}", infill_mark(infill))),
        (Kind::Point, number) => {
            let approach = Approach::numbered(number);
            approach.map(|approach| format!("verify-{}", approach.name()))
        }
    };
    name.unwrap_or_else(|| stream.to_string())
}

/// The hashed part of an infill point's number, which ends its name.
#[must_use]
pub fn infill_mark(number: u64) -> String {
    format!("{:07x}", number % FIRST_INFILL)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn streams_have_names_for_people() {
        let infill = StreamId::point(FIRST_INFILL + 0xab);
        assert_eq!(stream_name(StreamId::run(3, 2)), "run-kriging-2");
        assert_eq!(stream_name(StreamId::run(9, 2)), "run-9-2");
        assert_eq!(stream_name(StreamId::point(2)), "verify-archard");
        assert_eq!(stream_name(infill), "infill-00000ab");
        assert_eq!(stream_name(StreamId::design(7)), "design-7");
    }
}
