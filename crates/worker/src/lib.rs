//! Leases jobs from a coordinator, simulates, and reports the results.
