//! Plans a campaign, leases its jobs to workers, and writes the report.
