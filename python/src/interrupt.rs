//! Work without the interpreter's lock, which Ctrl-C ends if it is long.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::thread;
use std::time::Duration;

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

/// Interval at which signals are checked during long work.
const LOOK: Duration = Duration::from_millis(50);

/// A flag that asks work to end early.
#[derive(Debug, Clone, Default)]
pub(crate) struct Stopping(Arc<AtomicBool>);

impl Stopping {
    /// Whether the user has asked for the end.
    pub(crate) fn is_asked(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

/// The process that has started the threads of this library; 0 before that.
static STARTED: AtomicU32 = AtomicU32::new(0);

/// Refuses a process that was forked from one with threads: the fork has none of them, and would wait for ever.
fn refuse_forked() -> PyResult<()> {
    let own = std::process::id();
    match STARTED.compare_exchange(0, own, Ordering::Relaxed, Ordering::Relaxed) {
        Err(other) if other != own => Err(PyRuntimeError::new_err(
            "this process was forked from one that had used pitchline, whose threads it lacks: start processes with \
             multiprocessing.get_context(\"spawn\") or \"forkserver\"",
        )),
        _ => Ok(()),
    }
}

/// The result of short `work`, without the interpreter's lock.
pub(crate) fn detached<T: Send>(py: Python<'_>, work: impl FnOnce() -> T + Send) -> PyResult<T> {
    refuse_forked()?;
    Ok(py.detach(work))
}

/// The result of `work`, which another thread computes while this one looks for signals without the interpreter's lock.
/// A signal raises the exception of its handler at once, and asks the work to end. Work that does not look at
/// [`Stopping`] runs to its end, and its result is discarded.
pub(crate) fn interruptible<T: Send + 'static>(
    py: Python<'_>,
    work: impl FnOnce(&Stopping) -> T + Send + 'static,
) -> PyResult<T> {
    refuse_forked()?;
    let stopping = Stopping::default();
    let (sender, mut receiver) = mpsc::channel();
    let of_thread = stopping.clone();
    thread::spawn(move || {
        // Without a receiver the result is no longer wanted.
        let _ = sender.send(work(&of_thread));
    });
    loop {
        // Moved in and out, because two threads cannot share a receiver.
        let received;
        (received, receiver) = py.detach(move || (receiver.recv_timeout(LOOK), receiver));
        match received {
            Ok(result) => return Ok(result),
            Err(RecvTimeoutError::Timeout) => {
                if let Err(interrupted) = py.check_signals() {
                    stopping.0.store(true, Ordering::Relaxed);
                    return Err(interrupted);
                }
            }
            Err(RecvTimeoutError::Disconnected) => {
                return Err(PyRuntimeError::new_err(
                    "the computation ended without a result: this is a bug, please report it with \
                     the call that shows it",
                ));
            }
        }
    }
}
