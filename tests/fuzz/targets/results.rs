//! What a worker hands in becomes rows that cover what they say, or is refused.

#![no_main]

use coordinator::ingest;
use libfuzzer_sys::fuzz_target;
use prost::Message as _;
use protocol::v2::UnitResult;

fuzz_target!(|bytes: &[u8]| {
    let Ok(result) = UnitResult::decode(bytes) else {
        return;
    };
    let Ok(read) = ingest::read(&result, |_| Some("archard".to_owned())) else {
        return;
    };
    let Ok(batch) = read.rows else {
        return;
    };
    assert!(batch.times.iter().all(|time| time.cpu_seconds >= 0.0));
    let range = u64::from(read.unit.samples.start)..u64::from(read.unit.samples.end);
    let is_right = |row: &store::SampleRow| {
        row.design == read.unit.stream.index
            && range.contains(&row.sample)
            && (0.0..=1e6).contains(&row.delta_ste_um)
    };
    assert!(batch.samples.iter().all(is_right));
});
