//! The signals that end a program.

use tokio::signal::unix::{Signal, SignalKind, signal};
use tokio_util::sync::CancellationToken;

use crate::exit;

/// Cancels `shutdown` at the first SIGTERM, SIGINT or SIGHUP, after logging `notice`. A later SIGINT, such
/// as a second Ctrl-C, ends the program at once. Other later signals have no effect: batch systems send
/// several, and a terminal that closes sends SIGHUP. Under `nohup` SIGHUP stays ignored.
///
/// Signals are taken from the call on, before the future is polled. Must be called within a Tokio runtime.
pub fn watch_signals(
    shutdown: CancellationToken,
    notice: &'static str,
) -> impl Future<Output = ()> + Send {
    let terminate = signal(SignalKind::terminate());
    let interrupt = signal(SignalKind::interrupt());
    let hang_up = hang_up();
    async move {
        if let (Ok(terminate), Ok(interrupt)) = (terminate, interrupt) {
            watch(terminate, interrupt, hang_up, &shutdown, notice).await;
        }
    }
}

async fn watch(
    mut terminate: Signal,
    mut interrupt: Signal,
    mut hang_up: Option<Signal>,
    shutdown: &CancellationToken,
    notice: &str,
) {
    loop {
        let is_interrupt = tokio::select! {
            _ = terminate.recv() => false,
            _ = interrupt.recv() => true,
            () = received(hang_up.as_mut()) => false,
        };
        if !shutdown.is_cancelled() {
            tracing::info!("{notice}");
            shutdown.cancel();
        } else if is_interrupt {
            std::process::exit(i32::from(exit::INTERRUPTED));
        }
    }
}

/// Makes a write beyond the size limit of files (`ulimit -f`) an error, as on a full disk. Otherwise a signal would end the
/// process without a word. Must be called within a Tokio runtime.
pub(super) fn survive_size_limit() {
    // If that fails, the system's default stays.
    let _ = signal(SignalKind::from_raw(rustix::process::Signal::XFSZ.as_raw()));
}

/// Cancels `shutdown` at the end of standard input, after logging `notice`. The program at the other end has then
/// ended, even if it was killed.
pub fn watch_input(shutdown: CancellationToken, notice: &'static str) {
    // On a thread of its own, so that the program can end without waiting for it.
    std::thread::spawn(move || {
        let _ = std::io::copy(&mut std::io::stdin(), &mut std::io::sink());
        if !shutdown.is_cancelled() {
            tracing::info!("{notice}");
            shutdown.cancel();
        }
    });
}

/// The receiver of SIGHUP; `None` if the program was started to ignore it.
fn hang_up() -> Option<Signal> {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let kind = SignalKind::hangup();
    if is_ignored(&status, kind) {
        return None;
    }
    signal(kind).ok()
}

/// Waits for the next signal; forever without a receiver.
async fn received(signal: Option<&mut Signal>) {
    match signal {
        Some(signal) => {
            let _ = signal.recv().await;
        }
        None => std::future::pending().await,
    }
}

/// Whether a process ignores a signal, by its `/proc/PID/status` (proc_pid_status(5)).
fn is_ignored(status: &str, kind: SignalKind) -> bool {
    let mut masks = status
        .lines()
        .filter_map(|line| line.strip_prefix("SigIgn:"));
    let mask = masks.next().map(str::trim);
    let mask = mask.and_then(|mask| u64::from_str_radix(mask, 16).ok());
    mask.is_some_and(|mask| (mask >> (kind.as_raw_value() - 1)) & 1 == 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_ignored_signal_is_seen() {
        let hangup = SignalKind::hangup();
        let status = "Name:\tworker\nSigBlk:\t0000000000000001\nSigIgn:\t0000000000001001\n";
        assert!(is_ignored(status, hangup));
        let status = "SigIgn:\t0000000000001000\nSigCgt:\t0000000000000001\n";
        assert!(!is_ignored(status, hangup));
        assert!(is_ignored(status, SignalKind::pipe()));
        assert!(!is_ignored("", hangup));
    }
}
