//! A campaign's progress: on a terminal one line for each stage, elsewhere a line of the log from time to time.

use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{HumanDuration, ProgressBar, ProgressStyle};
use results::running::CoordinatorStatus;
use results::status::Status;
use stages::stage::Stage;
use tracing::info;

const TICK: Duration = Duration::from_millis(200);
/// Interval of lines in the log, without a terminal.
const LOGGED_EVERY: Duration = Duration::from_secs(15);

/// The progress of a campaign.
pub(crate) struct Progress(Mutex<Output>);

/// The line on the terminal, or the time of the last line in the log.
struct Output {
    /// On a terminal, a line for each finished stage and one for the running stage.
    line: Option<Line>,
    /// The time of the last line in the log.
    logged: Instant,
}

/// The line of the running stage.
struct Line {
    stage: Stage,
    bar: ProgressBar,
}

/// The progress of a stage.
struct Step {
    done: u64,
    /// Number of items in the stage; zero if they are not counted.
    wanted: u64,
    message: String,
}

impl Progress {
    /// Creates the display without lines. It draws only if standard error is a terminal, and writes to the log
    /// otherwise.
    pub(crate) fn new() -> Self {
        Self(Mutex::new(Output {
            line: None,
            logged: Instant::now(),
        }))
    }

    /// Shows the running stage. The line of the previous one stays, with its duration.
    pub(crate) fn show(&self, status: &Status) {
        let mut output = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if runner::console::bars().is_hidden() {
            if status.stage != Stage::Done && output.logged.elapsed() >= LOGGED_EVERY {
                output.logged = Instant::now();
                let step = step(status);
                info!(stage = %status.stage, done = step.done, of = step.wanted, "{}", step.message);
            }
            return;
        }
        let line = &mut output.line;
        if line.as_ref().is_none_or(|line| line.stage != status.stage) {
            if let Some(line) = line.take() {
                line.end();
            }
            if status.stage == Stage::Done {
                return;
            }
            *line = Some(Line::new(status));
        }
        if let Some(line) = line.as_ref() {
            line.bar.set_prefix(status.stage_name());
            line.show(step(status));
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        let output = self.0.get_mut().unwrap_or_else(PoisonError::into_inner);
        if let Some(line) = output.line.take() {
            line.bar.finish_and_clear();
        }
    }
}

impl Line {
    fn new(status: &Status) -> Self {
        let bar = runner::console::bars().add(ProgressBar::new(0));
        bar.enable_steady_tick(TICK);
        Self {
            stage: status.stage,
            bar,
        }
    }

    fn show(&self, step: Step) {
        let style = match step.wanted {
            0 => "{prefix:>9} {spinner} {wide_msg}",
            _ => "{prefix:>9} [{bar:30}] {pos}/{len} {wide_msg}",
        };
        if let Ok(style) = ProgressStyle::with_template(style) {
            self.bar.set_style(style.progress_chars("=> "));
        }
        self.bar.set_length(step.wanted);
        self.bar.set_position(step.done);
        self.bar.set_message(step.message);
    }

    /// Marks the stage as done, with its duration.
    fn end(self) {
        let took = HumanDuration(self.bar.elapsed());
        let line = format!("{:>9} done in {took}", self.bar.prefix());
        self.bar.finish_and_clear();
        // Above the next line, and nowhere unless standard error is a terminal.
        let _ = runner::console::bars().println(line);
    }
}

fn step(status: &Status) -> Step {
    let live = status.live.as_ref();
    let (done, wanted, message) = match status.stage {
        Stage::Sample => {
            let left = status.missing().0.round() as u64;
            let done = status.samples.done;
            (done, done + left, pace(live))
        }
        Stage::Verify => {
            let verified = status.verified();
            let message = format!("verification samples{}", to_go(live));
            (verified.done, verified.wanted, message)
        }
        Stage::Enrich => {
            let round = status.enrichment.map(|enrichment| enrichment.samples);
            let (done, wanted) = round.map_or((0, 0), |round| (round.done, round.wanted));
            (done, wanted, pace(live))
        }
        Stage::Doe | Stage::Fit | Stage::Done => (0, 0, String::new()),
        Stage::Optimise => {
            let runs = status.optimiser_runs;
            let message = format!("runs{}", to_go(live));
            (runs.done, runs.wanted, message)
        }
    };
    Step {
        done,
        wanted,
        message,
    }
}

fn pace(live: Option<&CoordinatorStatus>) -> String {
    let rate = live.map_or_else(
        || "samples".to_owned(),
        |live| results::number::rate(live.samples_per_second),
    );
    format!("{rate}{}", to_go(live))
}

fn to_go(live: Option<&CoordinatorStatus>) -> String {
    let time = live.and_then(CoordinatorStatus::time_to_go);
    time.map_or_else(String::new, |time| format!(", to go: {time}"))
}
