//! What the coordinator and the worker do alike on a terminal: log, progress bars, signals, help.

use std::io::{IsTerminal as _, Write as _};
use std::sync::OnceLock;

use indicatif::MultiProgress;
use protocol::exit;
use tokio::signal::unix::{SignalKind, signal};
use tokio_util::sync::CancellationToken;
use tracing_subscriber::EnvFilter;

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

/// Starts logging to standard error, in colour only on a terminal that wants it.
pub fn start_log(format: LogFormat) {
    let filter = EnvFilter::try_from_env(LOG_VARIABLE).unwrap_or_else(|_| EnvFilter::new("info"));
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
