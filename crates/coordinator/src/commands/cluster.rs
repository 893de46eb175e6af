//! `simulate-cluster`: how many workers one coordinator can serve.

use lab::rehearsal::{Rehearsal, Scenario, Wave, rehearse};
use results::report::charts::{self, TradeoffChart, TradeoffSeries};
use results::report::write_file;
use results::table::VersionedObject;
use runner::exit::{self, ProgramError};
use serde::Serialize;
use tracing::info;

use super::output::print_either;
use crate::arguments;

/// Maximum number of samples in a scenario, to bound the time of the simulation.
const MOST_SAMPLES: f64 = 3e8;

#[derive(Serialize)]
struct ScenarioResult {
    #[serde(flatten)]
    scenario: Scenario,
    #[serde(flatten)]
    outcome: Rehearsal,
    coordinator_cores: f64,
}

/// Simulates a cluster for every pair of a number of workers and a time of a sample.
pub(super) fn simulate_cluster(arguments: &arguments::SimulateCluster) -> Result<u8, ProgramError> {
    let mut simulated = Vec::new();
    for &sample_seconds in &arguments.sample_seconds {
        for &workers in &arguments.workers {
            let scenario = Scenario {
                slots: arguments.slots,
                failure_seconds: arguments.failure_hours.map(|hours| 3600.0 * hours),
                wave: arguments.wave_share.map(|share| Wave {
                    every_seconds: arguments.wave_every,
                    share,
                    away_seconds: arguments.wave_away,
                }),
                seed: arguments.seed,
                ..Scenario::new(workers, sample_seconds)
            };
            let scenario = Scenario {
                seconds: arguments.seconds.unwrap_or(scenario.seconds),
                ..scenario
            };
            let slots = f64::from(workers) * f64::from(scenario.slots);
            if slots * scenario.seconds / sample_seconds > MOST_SAMPLES {
                info!(
                    workers,
                    sample_seconds, "too many samples to simulate: left out"
                );
                continue;
            }
            let outcome = rehearse(&scenario);
            simulated.push(ScenarioResult {
                scenario,
                coordinator_cores: outcome.coordinator_cores(),
                outcome,
            });
        }
    }
    if let Some(out) = &arguments.out {
        std::fs::create_dir_all(out)?;
        write_file(out, "cluster.csv", csv(&simulated)?)?;
        let chart = charts::tradeoff(&chart(&simulated))?.standalone();
        write_file(out, "cluster.svg", chart)?;
    }
    let object = VersionedObject::new(serde_json::json!({ "scenarios": simulated }));
    print_either(arguments.json, &object, || describe(&simulated))?;
    Ok(exit::OK)
}

const COLUMNS: [&str; 9] = [
    "workers",
    "slots",
    "sample_seconds",
    "samples_per_second",
    "busy_percent",
    "calls_per_second",
    "kilobytes_per_second",
    "lost_samples",
    "coordinator_cores",
];

fn values(one: &ScenarioResult) -> [f64; 9] {
    let seconds = one.outcome.seconds;
    [
        f64::from(one.scenario.workers),
        f64::from(one.scenario.slots),
        one.scenario.sample_seconds,
        one.outcome.samples as f64 / seconds,
        100.0 * one.outcome.busy,
        one.outcome.calls.all() as f64 / seconds,
        1e-3 * one.outcome.message_bytes as f64 / seconds,
        one.outcome.lost_samples as f64,
        one.coordinator_cores,
    ]
}

fn csv(simulated: &[ScenarioResult]) -> anyhow::Result<Vec<u8>> {
    let mut out = csv::Writer::from_writer(Vec::new());
    out.write_record(COLUMNS)?;
    for one in simulated {
        out.write_record(values(one).map(|value| value.to_string()))?;
    }
    Ok(out.into_inner()?)
}

fn describe(simulated: &[ScenarioResult]) -> String {
    let mut text = format!(
        "{:>8}{:>7}{:>11}{:>13}{:>8}{:>10}{:>10}{:>9}{:>8}\n",
        "workers", "slots", "s/sample", "samples/s", "busy", "calls/s", "kB/s", "lost", "cores"
    );
    for one in simulated {
        let [
            workers,
            slots,
            sample,
            rate,
            busy,
            calls,
            bytes,
            lost,
            cores,
        ] = values(one);
        text += &format!(
            "{workers:>8}{slots:>7}{sample:>11}{rate:>13.1}{busy:>7.1}%{calls:>10.1}{bytes:>10.1}{lost:>9}{cores:>8.3}\n"
        );
    }
    text + "\ncores: processors that the coordinator keeps busy; busy: share of the slots' time spent on samples that count\n"
}

fn chart(simulated: &[ScenarioResult]) -> TradeoffChart {
    let mut series: Vec<TradeoffSeries> = Vec::new();
    for one in simulated {
        let name = format!("{} s a sample", one.scenario.sample_seconds);
        let point = [f64::from(one.scenario.workers), one.coordinator_cores];
        match series.iter_mut().find(|series| series.name == name) {
            Some(series) => series.points.push(point),
            None => series.push(TradeoffSeries {
                name,
                points: vec![point],
            }),
        }
    }
    TradeoffChart {
        file: "cluster".to_owned(),
        title: "Processors that the coordinator keeps busy".to_owned(),
        cost: "workers".to_owned(),
        error: "processors".to_owned(),
        series,
        line: TradeoffSeries {
            name: String::new(),
            points: Vec::new(),
        },
        campaign: Vec::new(),
        recommended: None,
        recommendation: String::new(),
    }
}
