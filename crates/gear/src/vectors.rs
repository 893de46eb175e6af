//! Loops that use the vector instructions of the machine.

/// Runs loops with the widest vectors that the machine has. None of them changes a bit. `work` and all that it calls in
/// its loops must be marked `#[inline(always)]`; otherwise they are compiled without wide vectors.
#[inline(always)]
pub(crate) fn with_vectors<R>(work: impl FnOnce() -> R) -> R {
    pulp::Arch::new().dispatch(work)
}
