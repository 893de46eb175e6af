//! The table, one file for each method.

mod designs;
mod enrichment;
mod gear_edges;
mod gear_refusals;
mod kriging_covariance;
mod kriging_data;
mod leases;
mod search;
mod statistics;

use crate::Entry;

/// All entries, in the order of the page.
#[must_use]
pub fn entries() -> Vec<Entry> {
    let groups: [&[Entry]; 9] = [
        &kriging_covariance::ENTRIES,
        &kriging_data::ENTRIES,
        &statistics::ENTRIES,
        &designs::ENTRIES,
        &search::ENTRIES,
        &enrichment::ENTRIES,
        &gear_edges::ENTRIES,
        &gear_refusals::ENTRIES,
        &leases::ENTRIES,
    ];
    groups.concat()
}
