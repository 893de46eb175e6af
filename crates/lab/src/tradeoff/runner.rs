//! The time that leases, messages, processes and the store add to that of the simulator.

use problem::{Approach, Campaign};
use results::costs::StageCost;

use crate::tradeoff::front::Rule;
use crate::tradeoff::size::Size;
use crate::tradeoff::table::{Row, Table};
use crate::tradeoff::view::{self, Reading};

pub(crate) const LEAD: &str = "Time lost to leases, messages and the store, with workers of one slot in the coordinator's process, against the time \
     of a sample. Beside the built-in simulator there is an external program that sleeps, so that many workers fit on \
     few processors. Time lost is the share of the workers' time, or of the processors' with the built-in simulator, in \
     which no sample ran. The overhead is the CPU time in excess of that of the same samples in one thread. When samples \
     take longer than the time that a chart states, the cost of the runner does not matter.";

const COLUMNS: [&str; 5] = [
    "time a sample (s)",
    "workers",
    "samples a second",
    "time lost (%)",
    "CPU overhead a sample (µs)",
];

const LEAST_LOST: Rule = Rule::Within(10.0);

pub(crate) const PAIRS: &[view::Pair] = &[
    view::Pair {
        cost: 0,
        error: 3,
        reading: Reading::Given(LEAST_LOST),
    },
    view::Pair {
        cost: 0,
        error: 4,
        reading: Reading::Given(Rule::NearBest(0.5)),
    },
];

/// Samples to run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Load {
    /// Time that a program sleeps for each sample, in seconds; none for the built-in simulator.
    pub sleep: Option<f64>,
    /// Number of workers, of one slot each.
    pub workers: usize,
    pub samples: u32,
}

/// The time of a run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RunnerTimes {
    /// Time from the first sample until the last one is stored, in seconds.
    pub seconds: f64,
    /// CPU time of this process meanwhile, in seconds.
    pub cpu_seconds: f64,
    /// CPU time of a sample in one thread, in seconds; zero for a program's sample.
    pub alone_seconds: f64,
}

/// The result of one approach for one seed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ApproachResult {
    pub approach: Approach,
    /// Simulator calls, including those of the DoE if the approach uses it.
    pub calls: f64,
    /// CPU time in seconds, including that of the DoE if the approach uses it.
    pub seconds: f64,
    /// The percentile of verification samples, in µm; infinite without a feasible design.
    pub percentile: f64,
}

/// The times of a whole campaign.
#[derive(Debug, Clone, PartialEq)]
pub struct CampaignTimes {
    /// From the start of the program to its end, in seconds.
    pub seconds: f64,
    /// The stages in their order.
    pub stages: Vec<StageCost>,
}

/// A runner of samples and campaigns.
pub trait Runner {
    /// Runs samples with workers.
    ///
    /// # Errors
    ///
    /// A worker or the store failed.
    fn samples(&mut self, load: &Load) -> anyhow::Result<RunnerTimes>;

    /// Runs a whole campaign and returns the result of each approach.
    ///
    /// # Errors
    ///
    /// The campaign failed.
    fn campaign(&mut self, campaign: &Campaign) -> anyhow::Result<Vec<ApproachResult>>;

    /// Runs a whole campaign on this number of processors.
    ///
    /// # Errors
    ///
    /// The campaign failed.
    fn timed(&mut self, campaign: &Campaign, processors: usize) -> anyhow::Result<CampaignTimes>;
}

/// Number of samples of the built-in simulator: fewer where one takes long, as with coupled cells.
fn of_built_in(size: Size, runner: &mut dyn Runner) -> anyhow::Result<u32> {
    let (most, seconds) = size.pick((1_000_000, 10.0), (300_000, 3.0), (2_000, 1.0));
    let trial = Load {
        sleep: None,
        workers: 1,
        samples: 1000,
    };
    let alone = runner.samples(&trial)?.alone_seconds;
    Ok(most.min((seconds / alone) as u32).max(trial.samples))
}

pub(crate) fn run(
    size: Size,
    runner: &mut dyn Runner,
    progress: &mut dyn FnMut(&str),
) -> anyhow::Result<Table> {
    let sleeps: &[f64] = size.pick(
        &[1e-3, 1e-2, 0.1, 1.0, 10.0],
        &[1e-3, 1e-2, 0.1],
        &[1e-3][..],
    );
    let counts: &[usize] = size.pick(&[1, 2, 4, 8, 16], &[1, 2, 8], &[1, 2]);
    let most_seconds = size.pick(3.0, 1.0, 0.1);
    let built_in = of_built_in(size, runner)?;
    let mut table = Table::new(&COLUMNS);
    for sleep in std::iter::once(None).chain(sleeps.iter().copied().map(Some)) {
        for &workers in counts {
            let samples = match sleep {
                None => built_in,
                Some(sleep) => {
                    // At least two samples for each worker.
                    let each = (most_seconds / sleep).max(2.0);
                    (each * workers as f64) as u32
                }
            };
            let load = Load {
                sleep,
                workers,
                samples,
            };
            table.rows.push(row(&load, &runner.samples(&load)?));
        }
        progress(&format!("runner: {}", name(sleep)));
    }
    Ok(table)
}

fn name(sleep: Option<f64>) -> String {
    match sleep {
        None => "built-in simulator".to_owned(),
        Some(seconds) if seconds < 1.0 => format!("{} ms a sample", (1e3 * seconds).round()),
        Some(seconds) => format!("{seconds} s a sample"),
    }
}

fn row(load: &Load, ran: &RunnerTimes) -> Row {
    let samples = f64::from(load.samples);
    let each = load.sleep.unwrap_or(ran.alone_seconds);
    let processors = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let at_once = match load.sleep {
        Some(_) => load.workers,
        None => load.workers.min(processors),
    };
    let busy = samples * each / at_once as f64;
    Row {
        panel: "samples through the runner".to_owned(),
        method: match load.workers {
            1 => "1 worker".to_owned(),
            count => format!("{count} workers"),
        },
        setting: name(load.sleep),
        is_campaign: load.sleep.is_none() && load.workers == processors,
        values: vec![
            each,
            load.workers as f64,
            samples / ran.seconds,
            100.0 * (1.0 - busy / ran.seconds).max(0.0),
            1e6 * (ran.cpu_seconds / samples - ran.alone_seconds).max(0.0),
        ],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lost_time_and_overhead_are_those_in_excess_of_the_simulator() {
        let load = Load {
            sleep: Some(0.1),
            workers: 4,
            samples: 80,
        };
        let ran = RunnerTimes {
            seconds: 2.5,
            cpu_seconds: 0.004,
            alone_seconds: 0.0,
        };
        let row = row(&load, &ran);
        let expected = [0.1, 4.0, 32.0, 20.0, 50.0];
        for (found, expected) in row.values.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-9, "{:?}", row.values);
        }
        assert_eq!(
            (&*row.method, &*row.setting),
            ("4 workers", "100 ms a sample")
        );
    }

    /// A runner that records its calls.
    struct Fake {
        loads: Vec<Load>,
        alone_seconds: f64,
    }

    /// The loads of a study whose built-in samples take so long.
    fn loads(size: Size, alone_seconds: f64) -> Vec<Load> {
        let mut fake = Fake {
            loads: Vec::new(),
            alone_seconds,
        };
        let table = run(size, &mut fake, &mut |_| {}).unwrap();
        // The first one tells how long a sample takes.
        assert_eq!(table.rows.len() + 1, fake.loads.len());
        fake.loads.split_off(1)
    }

    impl Runner for Fake {
        fn samples(&mut self, load: &Load) -> anyhow::Result<RunnerTimes> {
            self.loads.push(*load);
            Ok(RunnerTimes {
                seconds: 1.0,
                cpu_seconds: 1.0,
                alone_seconds: self.alone_seconds,
            })
        }

        fn campaign(&mut self, _: &Campaign) -> anyhow::Result<Vec<ApproachResult>> {
            anyhow::bail!("no campaign is asked for")
        }

        fn timed(&mut self, _: &Campaign, _: usize) -> anyhow::Result<CampaignTimes> {
            anyhow::bail!("no campaign is asked for")
        }
    }

    #[test]
    fn every_worker_has_two_samples_of_a_slow_program() {
        let loads = loads(Size::Full, 1e-6);
        let slow = loads.iter().filter(|load| load.sleep == Some(10.0));
        assert!(
            slow.clone().count() == 5
                && slow
                    .clone()
                    .all(|load| load.samples as usize == 2 * load.workers)
        );
        let seconds: f64 = loads
            .iter()
            .filter_map(|load| Some(load.sleep? * f64::from(load.samples) / load.workers as f64))
            .sum();
        assert!(seconds < 200.0, "{seconds} s of sleep");
    }

    #[test]
    fn fewer_samples_are_run_of_a_built_in_simulator_that_takes_long() {
        for (alone_seconds, expected) in [(1e-6, 300_000), (1e-3, 3000), (10.0, 1000)] {
            let loads = loads(Size::Quick, alone_seconds);
            let mut built_in = loads.iter().filter(|load| load.sleep.is_none());
            assert!(built_in.all(|load| load.samples == expected));
        }
    }
}
