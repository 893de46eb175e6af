//! The limit on open files. Each connection takes one file descriptor, and anybody may connect. Some descriptors are
//! therefore reserved for the store, the report and the simulators.

use std::os::fd::{AsFd, AsRawFd as _};

use rustix::process::{Resource, getrlimit, setrlimit};

/// Number of descriptors that connections leave free.
pub const RESERVE: u64 = 64;

/// Raises the limit on open files to `wanted`, or as far as the system permits: the usual 1024 are too few for a
/// thousand workers.
pub fn allow(wanted: u64) {
    let mut limit = getrlimit(Resource::Nofile);
    let possible = limit.maximum.map_or(wanted, |maximum| maximum.min(wanted));
    if limit.current.is_some_and(|current| current < possible) {
        limit.current = Some(possible);
        // If the limit cannot be raised, a port serves fewer connections.
        let _ = setrlimit(Resource::Nofile, limit);
    }
}

/// Whether a descriptor that was just opened is one of the last `reserve` ones. The system gives out the lowest free
/// number, so all below it are in use.
pub fn is_of_reserve(opened: &impl AsFd, reserve: u64) -> bool {
    let number = u64::try_from(opened.as_fd().as_raw_fd()).unwrap_or_default();
    let limit = getrlimit(Resource::Nofile).current;
    limit.is_some_and(|limit| is_of_last(number, limit, reserve))
}

/// Whether a descriptor is one of the last `reserve` below the limit, or of the upper half if the limit is very low.
fn is_of_last(number: u64, limit: u64, reserve: u64) -> bool {
    number >= limit - reserve.min(limit / 2)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_descriptors_are_left_to_files() {
        assert!(!is_of_last(959, 1024, 64) && is_of_last(960, 1024, 64));
        assert!(!is_of_last(19, 40, 64) && is_of_last(20, 40, 64));
    }

    #[test]
    fn a_limit_is_never_lowered() {
        let before = getrlimit(Resource::Nofile);
        allow(1);
        assert_eq!(getrlimit(Resource::Nofile), before);
        let file = tempfile::tempfile().unwrap();
        assert!(!is_of_reserve(&file, 1));
    }
}
