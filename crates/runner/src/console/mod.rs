//! Console facilities shared by the coordinator and the worker: their start, log, progress bars, signals,
//! help, and messages to a service manager.

#![expect(
    clippy::disallowed_methods,
    reason = "reads PITCHLINE_LOG and NO_COLOR for both programs, and feeds a watchdog"
)]

pub mod service;
mod signals;

use std::io::{IsTerminal as _, Write as _};
use std::process::ExitCode;
use std::sync::OnceLock;

use crate::exit::{self, ProgramError};
use crate::gateway::port;
use indicatif::MultiProgress;
use rustix::process::{DumpableBehavior, set_dumpable_behavior};
use tracing_subscriber::filter::{LevelFilter, Targets};
use tracing_subscriber::layer::SubscriberExt as _;
use tracing_subscriber::util::SubscriberInitExt as _;

pub use signals::{watch_input, watch_signals};

/// The environment variable that sets the log levels.
pub const LOG_VARIABLE: &str = "PITCHLINE_LOG";

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum LogFormat {
    /// Lines for people.
    #[default]
    Text,
    /// One JSON object per line.
    Json,
}

/// The environment variable for the log levels is invalid.
#[derive(Debug, thiserror::Error)]
#[error(
    "{LOG_VARIABLE} is {found:?}, but must be off, error, warn, info, debug or trace, or such levels for \
     parts of the program, as in warn,runner=debug"
)]
struct BadLogLevel {
    found: String,
}

/// Starts logging to standard error. Colour is used only on a terminal and without `NO_COLOR`.
fn start_log(format: LogFormat) -> Result<(), BadLogLevel> {
    let levels = match std::env::var_os(LOG_VARIABLE) {
        None => Targets::new().with_default(LevelFilter::INFO),
        Some(text) => levels(&text.to_string_lossy())?,
    };
    let lines = tracing_subscriber::fmt::layer()
        .with_target(false)
        .with_writer(|| BesideBars);
    let log = tracing_subscriber::registry().with(levels);
    match format {
        LogFormat::Text => {
            let stderr = std::io::stderr();
            let colour = stderr.is_terminal() && std::env::var_os("NO_COLOR").is_none();
            log.with(lines.with_ansi(colour)).init();
        }
        LogFormat::Json => log.with(lines.json().flatten_event(true)).init(),
    }
    Ok(())
}

/// Parses the log levels for the whole program and for parts of it. A bare word that is not a level
/// is refused: it would be taken as the name of a part, with everything logged.
fn levels(text: &str) -> Result<Targets, BadLogLevel> {
    let bad = || BadLogLevel {
        found: text.to_owned(),
    };
    if text.trim().is_empty() {
        return Ok(Targets::new().with_default(LevelFilter::INFO));
    }
    let is_bad = |part: &str| match part.split_once('=') {
        Some((name, level)) => name.is_empty() || level.is_empty(),
        None => part.parse::<LevelFilter>().is_err(),
    };
    if text.split(',').map(str::trim).any(is_bad) {
        return Err(bad());
    }
    text.parse().map_err(|_| bad())
}

/// Keeps the memory of this process, which holds tokens and a key, from core dumps and debuggers. A limit on the size
/// of core dumps would not suffice: the system ignores it if dumps go to a program, and simulators would inherit it.
fn protect_memory() {
    // An error is ignored: every Linux has this setting.
    let _ = set_dumpable_behavior(DumpableBehavior::NotDumpable);
}

/// Runs a program with a log and an async runtime. An error is printed and becomes the exit code.
pub fn run(
    format: LogFormat,
    threads: usize,
    program: impl Future<Output = Result<u8, ProgramError>>,
) -> ExitCode {
    protect_memory();
    port::allow_many_files();
    if let Err(error) = start_log(format) {
        complain(&error.to_string());
        return ExitCode::from(exit::USAGE);
    }
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(threads)
        .enable_all()
        .build();
    let runtime = match runtime {
        Ok(runtime) => runtime,
        Err(error) => {
            complain(&format!("cannot start: {error}"));
            return ExitCode::from(exit::FAILURE);
        }
    };
    let ended = runtime.block_on(async {
        signals::survive_size_limit();
        program.await
    });
    // Threads that still compute must not delay the exit.
    runtime.shutdown_background();
    ExitCode::from(ended.unwrap_or_else(|error| {
        complain(&format!("{error:#}"));
        error.code()
    }))
}

/// The progress bars of this program, on standard error. They are drawn only on a terminal.
pub fn bars() -> &'static MultiProgress {
    static BARS: OnceLock<MultiProgress> = OnceLock::new();
    BARS.get_or_init(MultiProgress::new)
}

/// Standard error, with the bars hidden while a line of the log is written.
struct BesideBars;

impl std::io::Write for BesideBars {
    fn write(&mut self, buffer: &[u8]) -> std::io::Result<usize> {
        bars().suspend(|| std::io::stderr().write(buffer))
    }

    fn flush(&mut self) -> std::io::Result<()> {
        std::io::stderr().flush()
    }
}

/// Prints the reason why a program ends to standard error, whatever the log levels.
pub fn complain(sentence: &str) {
    // If standard error is closed, the exit code remains.
    let _ = writeln!(std::io::stderr(), "error: {sentence}");
}

/// Prints a sentence that the user needs to standard error, whatever the log levels.
pub fn announce(sentence: &str) {
    let _ = writeln!(std::io::stderr(), "{sentence}");
}

/// The end of `--help`: environment variables and exit codes.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_programs_memory_is_protected() {
        protect_memory();
        let behaviour = rustix::process::dumpable_behavior().unwrap();
        assert_eq!(behaviour, DumpableBehavior::NotDumpable);
    }

    #[test]
    fn what_is_no_level_is_refused_with_those_there_are() {
        for good in ["", "off", "WARN", "warn,runner=debug"] {
            assert!(levels(good).is_ok(), "{good}");
        }
        for bad in ["nonsense", "info,loud", "runner=loud", "runner=", "="] {
            let text = levels(bad).unwrap_err().to_string();
            assert!(text.contains(bad) && text.contains("warn, info"), "{text}");
        }
    }
}
