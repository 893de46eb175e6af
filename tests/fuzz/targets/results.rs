//! A worker's report becomes rows that cover its unit, or is refused.

#![no_main]

use std::sync::LazyLock;

use problem::Campaign;
use problem::formulation::Problem;
use runner::coordinator::ingest;
use libfuzzer_sys::fuzz_target;
use prost::Message as _;
use runner::protocol::v1::UnitResult;

/// The problem of the workers' reports.
fn problem() -> &'static Problem {
    static PROBLEM: LazyLock<Problem> = LazyLock::new(|| {
        let campaign = Campaign::parse("paper.toml", Campaign::PAPER);
        Problem::new(campaign.expect("it is shipped"))
    });
    &PROBLEM
}

fuzz_target!(|bytes: &[u8]| {
    let Ok(result) = UnitResult::decode(bytes) else {
        return;
    };
    let Ok(read) = ingest::read(problem(), &result, |_| Some("archard".to_owned())) else {
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
