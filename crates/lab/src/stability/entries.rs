//! The entries by method. A module `…_scene` has the helpers that the entries of a method share.

mod designs;
mod enrichment;
mod gear_coupled;
mod gear_edges;
mod gear_loads;
mod gear_refusals;
mod gear_scene;
mod kriging_covariance;
mod kriging_data;
mod kriging_response;
mod kriging_scene;
mod lease_failures;
mod lease_scene;
mod leases;
mod search;
mod search_feasibility;
mod search_scene;
mod statistics;
mod verification;

use crate::stability::Entry;

/// Returns all entries in the order of the page.
#[must_use]
pub fn entries() -> Vec<Entry> {
    let groups: [&[Entry]; 15] = [
        &kriging_covariance::ENTRIES,
        &kriging_response::ENTRIES,
        &kriging_data::ENTRIES,
        &statistics::ENTRIES,
        &verification::ENTRIES,
        &designs::ENTRIES,
        &search::ENTRIES,
        &search_feasibility::ENTRIES,
        &enrichment::ENTRIES,
        &gear_edges::ENTRIES,
        &gear_loads::ENTRIES,
        &gear_coupled::ENTRIES,
        &gear_refusals::ENTRIES,
        &leases::ENTRIES,
        &lease_failures::ENTRIES,
    ];
    groups.concat()
}
