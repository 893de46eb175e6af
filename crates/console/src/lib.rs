//! What the coordinator and the worker share: log, progress bars, signals, help, and the messages to a service
//! manager.

#![expect(
    clippy::disallowed_methods,
    reason = "reads PITCHLINE_LOG and NO_COLOR for both programs, and feeds a watchdog"
)]

pub mod service;

use std::io::{IsTerminal as _, Write as _};
use std::sync::OnceLock;

use indicatif::MultiProgress;
use protocol::exit;
use tokio::signal::unix::{SignalKind, signal};
use tokio_util::sync::CancellationToken;
use tracing_subscriber::EnvFilter;
use tracing_subscriber::filter::LevelFilter;

/// The environment variable that says what to log.
pub const LOG_VARIABLE: &str = "PITCHLINE_LOG";

/// How the log is written.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum LogFormat {
    /// Lines for people.
    #[default]
    Text,
    /// One JSON object per line.
    Json,
}

/// The environment asks for a log that there is not.
#[derive(Debug, thiserror::Error)]
#[error(
    "{LOG_VARIABLE} is {found:?}, but must be off, error, warn, info, debug or trace, or such levels for \
     parts of the program, as in warn,coordinator=debug"
)]
pub struct BadLogLevel {
    found: String,
}

/// Starts logging to standard error, in colour only on a terminal that wants it.
///
/// # Errors
///
/// The environment variable [`LOG_VARIABLE`] names no level.
pub fn start_log(format: LogFormat) -> Result<(), BadLogLevel> {
    let filter = match std::env::var_os(LOG_VARIABLE) {
        None => EnvFilter::new("info"),
        Some(text) => filter(&text.to_string_lossy())?,
    };
    let subscriber = tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_target(false)
        .with_writer(|| BesideBars);
    match format {
        LogFormat::Text => {
            let stderr = std::io::stderr();
            let colour = stderr.is_terminal() && std::env::var_os("NO_COLOR").is_none();
            subscriber.with_ansi(colour).init();
        }
        LogFormat::Json => subscriber.json().flatten_event(true).init(),
    }
    Ok(())
}

/// The levels of the log, for the whole program and for parts of it. A bare word that is no level would be
/// taken as the name of a part, of which everything is logged.
fn filter(text: &str) -> Result<EnvFilter, BadLogLevel> {
    let bad = || BadLogLevel {
        found: text.to_owned(),
    };
    if text.trim().is_empty() {
        return Ok(EnvFilter::new("info"));
    }
    let is_bare_word = |part: &str| !part.contains('=') && part.parse::<LevelFilter>().is_err();
    if text.split(',').map(str::trim).any(is_bare_word) {
        return Err(bad());
    }
    EnvFilter::try_new(text).map_err(|_| bad())
}

/// The progress bars of this program, on standard error; none are drawn unless it is a terminal.
pub fn bars() -> &'static MultiProgress {
    static BARS: OnceLock<MultiProgress> = OnceLock::new();
    BARS.get_or_init(MultiProgress::new)
}

/// Standard error, from which the bars step aside while a line of the log is written.
struct BesideBars;

impl std::io::Write for BesideBars {
    fn write(&mut self, buffer: &[u8]) -> std::io::Result<usize> {
        bars().suspend(|| std::io::stderr().write(buffer))
    }

    fn flush(&mut self) -> std::io::Result<()> {
        std::io::stderr().flush()
    }
}

/// Says on standard error, whatever is logged, why a program ends.
pub fn complain(sentence: &str) {
    // If even standard error is gone, the exit code has to do.
    let _ = writeln!(std::io::stderr(), "error: {sentence}");
}

/// Says on standard error, whatever is logged, what somebody must know to use a program.
pub fn announce(sentence: &str) {
    let _ = writeln!(std::io::stderr(), "{sentence}");
}

/// The end of `--help`: environment and exit codes.
#[must_use]
pub fn help_footer() -> String {
    let codes = exit::TABLE
        .iter()
        .map(|(code, meaning)| format!("  {code:>2}  {meaning}\n"));
    format!(
        "Environment:\n  {LOG_VARIABLE}  what to log to standard error [default: info]\n\n\
         Exit codes:\n{}",
        codes.collect::<String>()
    )
}

/// Cancels `shutdown` at the first SIGTERM or SIGINT, after logging `notice`. A SIGINT after that, as when
/// somebody presses Ctrl-C again, ends the program at once; a SIGTERM changes nothing, since batch systems
/// send several.
pub async fn watch_signals(shutdown: CancellationToken, notice: &'static str) {
    let (Ok(mut terminate), Ok(mut interrupt)) = (
        signal(SignalKind::terminate()),
        signal(SignalKind::interrupt()),
    ) else {
        return;
    };
    loop {
        let is_interrupt = tokio::select! {
            _ = terminate.recv() => false,
            _ = interrupt.recv() => true,
        };
        if !shutdown.is_cancelled() {
            tracing::info!("{notice}");
            shutdown.cancel();
        } else if is_interrupt {
            std::process::exit(i32::from(exit::INTERRUPTED));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_level_is_refused_with_those_there_are() {
        for good in [
            "",
            "off",
            "WARN",
            "warn,coordinator=debug",
            "coordinator[run]=info",
        ] {
            assert!(filter(good).is_ok(), "{good}");
        }
        for bad in ["nonsense", "info,loud", "coordinator=loud", "="] {
            let text = filter(bad).unwrap_err().to_string();
            assert!(text.contains(bad) && text.contains("warn, info"), "{text}");
        }
    }
}
