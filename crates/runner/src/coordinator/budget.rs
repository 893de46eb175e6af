//! The end of a campaign's budget.

use std::sync::Arc;
use std::time::{Duration, Instant};

use problem::formulation::Problem;
use stages::calls;
use store::Store;

use crate::coordinator::board::Board;
use crate::exit::{self, HasExitCode};

/// The budget of a campaign is used up, and work is left.
#[derive(Debug, thiserror::Error)]
#[error(
    "{0}: no more jobs are leased; all results are kept. Raise the budget and run the same command to continue"
)]
pub(crate) struct ExceededBudget(pub(crate) String);

impl HasExitCode for ExceededBudget {
    fn exit_code(&self) -> u8 {
        exit::OVER_BUDGET
    }
}

/// Interval at which the cost is compared with the budget.
const PERIOD: Duration = Duration::from_millis(200);

/// Waits until the budget is used up and there is work left, and returns a sentence that says so. Never returns for a
/// campaign without a budget.
///
/// # Errors
///
/// The store cannot be read.
pub(crate) async fn used_up(
    problem: &Problem,
    store: &Store,
    board: &Arc<Board>,
) -> Result<String, store::Error> {
    let budget = problem.campaign().budget;
    let before: f64 = store
        .stage_times()
        .await?
        .iter()
        .map(|row| row.wall_seconds)
        .sum();
    let since = Instant::now();
    let mut period = tokio::time::interval(PERIOD);
    loop {
        period.tick().await;
        let counts = board.live().counts;
        if counts.free + counts.waiting + counts.leased == 0 {
            continue;
        }
        let hours = (before + since.elapsed().as_secs_f64()) / 3600.0;
        if let Some(most) = budget.hours.filter(|most| hours >= *most) {
            return Ok(format!(
                "budget.hours is {most}, and coordinators have worked on the campaign for {hours:.2} h"
            ));
        }
        let progress = store.progress().await?;
        let known = match problem.campaign().doe.samples.is_empty() {
            true => 0,
            false => calls::known(problem, store.sampled_counts().await?),
        };
        let samples = calls::samples(problem, &progress).saturating_sub(known);
        if let Some(most) = budget.samples.filter(|most| samples >= *most) {
            return Ok(format!(
                "budget.samples is {most}, and there are {samples} samples"
            ));
        }
        // The calls that the store records.
        let calls = samples + progress.criteria_done + progress.evaluations + progress.failures;
        if let Some(most) = budget.calls.filter(|most| calls >= *most) {
            return Ok(format!(
                "budget.calls is {most}, and the program was called {calls} times"
            ));
        }
    }
}
