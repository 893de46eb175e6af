//! Loops that use the vector instructions of the machine.

/// Runs loops with the widest vectors that the machine has. The width does not change a bit of the results. `work` and
/// all functions that it calls in its loops must be marked `#[inline(always)]`; otherwise they are compiled without
/// wide vectors.
#[inline(always)]
pub(crate) fn with_vectors<R>(work: impl FnOnce() -> R) -> R {
    pulp::Arch::new().dispatch(work)
}
