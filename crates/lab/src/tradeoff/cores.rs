//! The time of whole campaigns on more and more processors.

use problem::Campaign;
use problem::formulation::Problem;

use crate::summary::median;
use crate::tradeoff::optimisation::scaled;
use crate::tradeoff::runner::{CampaignTimes, Runner};
use crate::tradeoff::size::Size;
use crate::tradeoff::table::{Row, Table};
use crate::tradeoff::view::{self, Reading};

pub(crate) const LEAD: &str = "Time of the campaign, as `coordinator run` computes it, on one processor and on twice as many each time, the median \
     of three runs; with --quick of one with a tenth of the designs and evaluations and no enrichment. The time of a stage is \
     that in which the campaign waited for it: the first optimisers run while the designs are made. Efficiency is the \
     time on one processor over n times that on n. CPU times are those of workers, fits and decisions; that of making \
     the designs is not recorded. Results are the same on any number of processors.";

const COLUMNS: [&str; 4] = ["processors", "time (s)", "efficiency (%)", "CPU time (s)"];

/// The first panel; the others are the stages.
const WHOLE: &str = "whole campaign";

pub(crate) const PAIRS: &[view::Pair] = &[view::Pair {
    cost: 0,
    error: 1,
    reading: Reading::Growth,
}];

pub(crate) fn run(
    problem: &Problem,
    size: Size,
    runner: &mut dyn Runner,
    progress: &mut dyn FnMut(&str),
) -> anyhow::Result<Table> {
    let campaign = match size {
        Size::Full => problem.campaign().clone(),
        Size::Quick => scaled(problem.campaign(), 0.1),
        Size::Designs(_) => scaled(problem.campaign(), 0.02),
    };
    let available = std::thread::available_parallelism().map_or(1, usize::from);
    let counts = counts(available.min(size.pick(usize::MAX, usize::MAX, 2)));
    let mut measured: Vec<(usize, Vec<CampaignTimes>)> = Vec::new();
    for &processors in &counts {
        let runs = (0..size.pick(3, 1, 1)).map(|_| runner.timed(&campaign, processors));
        measured.push((processors, runs.collect::<anyhow::Result<_>>()?));
        progress(&format!("cores: {processors} of {available} processors"));
    }
    Ok(table(&campaign, &measured))
}

/// One processor, twice as many each time, and all `available` ones.
fn counts(available: usize) -> Vec<usize> {
    let powers = std::iter::successors(Some(1), |count| Some(2 * count));
    let mut counts: Vec<usize> = powers.take_while(|count| *count < available).collect();
    counts.push(available);
    counts
}

/// The table of the median times. `measured` has the runs for each number of processors, beginning with one.
fn table(campaign: &Campaign, measured: &[(usize, Vec<CampaignTimes>)]) -> Table {
    let mut table = Table::new(&COLUMNS);
    let of = |runs: &[CampaignTimes], value: &dyn Fn(&CampaignTimes) -> Option<[f64; 2]>| {
        let values: Vec<[f64; 2]> = runs.iter().filter_map(value).collect();
        let each = |k: usize| values.iter().map(|value| value[k]).collect::<Vec<f64>>();
        [0, 1].map(|k| median(&each(k)))
    };
    let mut add = |panel: &str, value: &dyn Fn(&CampaignTimes) -> Option<[f64; 2]>| {
        let mut alone = f64::NAN;
        for (processors, runs) in measured {
            let [seconds, cpu_seconds] = of(runs, value);
            if *processors == 1 {
                alone = seconds;
            }
            let count = *processors as f64;
            table.rows.push(Row {
                panel: panel.to_owned(),
                method: campaign.name.clone(),
                setting: match processors {
                    1 => "1 processor".to_owned(),
                    count => format!("{count} processors"),
                },
                is_campaign: false,
                values: vec![
                    count,
                    seconds,
                    100.0 * alone / (count * seconds),
                    cpu_seconds,
                ],
            });
        }
    };
    add(WHOLE, &|run| {
        let of_stages = run.stages.iter().map(|stage| stage.cpu_seconds);
        let known = of_stages.filter(|seconds| seconds.is_finite());
        Some([run.seconds, known.sum()])
    });
    let stages = measured.first().and_then(|(_, runs)| runs.first());
    for (place, stage) in stages.iter().flat_map(|run| &run.stages).enumerate() {
        let panel = format!("stage {}", stage.stage);
        add(&panel, &|run| {
            let stage = run.stages.get(place)?;
            Some([stage.wall_seconds, stage.cpu_seconds])
        });
    }
    table
}

#[cfg(test)]
mod tests {
    use results::costs::StageCost;
    use stages::stage::Stage;

    use super::*;

    #[test]
    fn counts_double_and_end_with_all() {
        assert_eq!(counts(1), [1]);
        assert_eq!(counts(2), [1, 2]);
        assert_eq!(counts(6), [1, 2, 4, 6]);
        assert_eq!(counts(16), [1, 2, 4, 8, 16]);
    }

    #[test]
    fn efficiency_compares_medians_with_one_processor() {
        let campaign = Campaign::parse("paper.toml", Campaign::PAPER).unwrap();
        let run = |seconds: f64| CampaignTimes {
            seconds,
            stages: [(Stage::Doe, f64::NAN), (Stage::Fit, 8.0)]
                .map(|(stage, cpu_seconds)| StageCost {
                    stage,
                    wall_seconds: 0.5 * seconds,
                    cpu_seconds,
                })
                .to_vec(),
        };
        let measured = [
            (1, vec![run(8.0), run(7.0), run(20.0)]),
            (4, vec![run(4.0), run(2.5), run(1.0)]),
        ];
        let table = table(&campaign, &measured);
        assert_eq!(table.panels(), [WHOLE, "stage doe", "stage fit"]);
        assert_eq!(table.rows[1].values, [4.0, 2.5, 80.0, 8.0]);
        assert_eq!(table.rows[3].values[..3], [4.0, 1.25, 80.0]);
        assert!(table.rows[3].values[3].is_nan());
    }
}
