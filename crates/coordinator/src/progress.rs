//! A campaign's progress as a bar on a terminal.

use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};
use results::live::Live;
use results::status::Status;

const TICK: Duration = Duration::from_millis(200);

/// What is shown while a campaign runs.
pub(crate) struct Progress {
    bar: ProgressBar,
}

impl Progress {
    /// An empty bar; it is not drawn unless standard error is a terminal.
    pub(crate) fn new() -> Self {
        let bar = console::bars().add(ProgressBar::new(0));
        let style = ProgressStyle::with_template("{prefix:>9} [{bar:30}] {pos}/{len} {msg}");
        if let Ok(style) = style {
            bar.set_style(style.progress_chars("=> "));
        }
        bar.enable_steady_tick(TICK);
        Self { bar }
    }

    /// Shows the stage that runs.
    pub(crate) fn show(&self, status: &Status) {
        let (position, length, message) = match status.stage.as_str() {
            "sample" => {
                let left = status.missing().0.round() as u64;
                let done = status.samples.done;
                (done, done + left, pace(status.live.as_ref()))
            }
            "verify" => {
                let verified = status.verified();
                let message = format!("verification samples{}", to_go(status.live.as_ref()));
                (verified.done, verified.wanted, message)
            }
            "enrich" => {
                let round = status.enrichment.map(|enrichment| enrichment.samples);
                let (done, wanted) = round.map_or((0, 0), |round| (round.done, round.wanted));
                (done, wanted, pace(status.live.as_ref()))
            }
            "doe" | "fit" | "done" => (0, 0, String::new()),
            _ => {
                let runs = status.optimiser_runs;
                let message = format!("runs{}", to_go(status.live.as_ref()));
                (runs.done, runs.wanted, message)
            }
        };
        self.bar.set_prefix(status.stage_name());
        self.bar.set_length(length);
        self.bar.set_position(position);
        self.bar.set_message(message);
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

fn pace(live: Option<&Live>) -> String {
    let rate = live.map_or_else(
        || "samples".to_owned(),
        |live| results::describing::rate(live.samples_per_second),
    );
    format!("{rate}{}", to_go(live))
}

fn to_go(live: Option<&Live>) -> String {
    let time = live.and_then(Live::time_to_go);
    time.map_or_else(String::new, |time| format!(", to go: {time}"))
}
