//! Leases, retries and quarantine: a state machine without sockets or clocks.
