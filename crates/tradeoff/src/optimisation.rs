//! What each approach to the optimum costs and how good the design is that it ends on.
//!
//! The approaches run in this process, as the workers run them. Effort is the share of the campaign's designs
//! of the DoE and of its optimiser's evaluations.

use anyhow::Context as _;
use campaign::formulation::{Approach, Design, Problem};
use campaign::optimise;
use campaign::task::Run;
use stages::fitting;
use stats::streams::{Purpose, stream};
use studies::finished;
use studies::simulations::InProcess;

use crate::clock::process_seconds;
use crate::data::{self, Doe};
use crate::front::Rule;
use crate::study::Size;
use crate::summary::{median, quantile};
use crate::table::{Row, Table};
use crate::view;

pub(crate) const LEAD: &str = "The percentile of the best feasible design that an approach ends on, from fresh verification samples, against calls of \
     the simulator, CPU time with this simulator, and time with one that takes 2 s a call, as the paper's did. Medians \
     and quartiles over seeds; a run without a feasible design counts as an infinite percentile. Effort is the share \
     of the campaign's designs and of its optimisers' evaluations. The approaches of the campaign are marked at the \
     largest effort.";

const COLUMNS: [&str; 7] = [
    "simulator calls",
    "CPU time (s)",
    "time at 2 s a call (s)",
    "verified percentile, median (µm)",
    "verified percentile, lower quartile (µm)",
    "verified percentile, upper quartile (µm)",
    "runs that end on a feasible design (%)",
];

/// Seconds of a call of the paper's simulator.
const PAPER_SECONDS: f64 = 2.0;

/// Percentiles closer than this to each other are no reason to compute longer.
const NEAR: Rule = Rule::NearBest(0.02);

pub(crate) const PAIRS: &[view::Pair] = &[
    view::Pair {
        cost: 0,
        error: 3,
        rule: NEAR,
    },
    view::Pair {
        cost: 1,
        error: 3,
        rule: NEAR,
    },
    view::Pair {
        cost: 2,
        error: 3,
        rule: NEAR,
    },
];

/// The approaches that are measured, in the order of the paper's Table 5.
const APPROACHES: [Approach; 5] = [
    Approach::Nominal,
    Approach::Baseline,
    Approach::Kriging,
    Approach::BestOfDoe,
    Approach::Direct,
];

/// The fewest designs and evaluations, whatever the effort.
const FEWEST: u32 = 60;

/// What one approach came to for one seed.
struct Ended {
    calls: f64,
    seconds: f64,
    /// Infinite without a feasible design.
    percentile_um: f64,
}

pub(crate) fn run(
    problem: &Problem,
    size: Size,
    progress: &mut dyn FnMut(&str),
) -> anyhow::Result<Table> {
    let seeds = size.pick(6, 3, 1);
    let efforts: &[f64] = match size {
        Size::Full => &[0.03, 0.1, 0.3, 1.0],
        Size::Quick => &[0.03, 0.1, 0.3],
        Size::Designs(_) => &[0.02],
    };
    let mut table = Table::new(&COLUMNS);
    let campaign = problem.campaign();
    let panel = format!(
        "{} of the best feasible design, {seeds} seeds",
        campaign.sampling.percentile_name()
    );
    for (place, &effort) in (1..).zip(efforts) {
        let mut ended: [Vec<Ended>; APPROACHES.len()] = Default::default();
        for seed in 0..seeds {
            let mut campaign = campaign.clone();
            campaign.seed += seed;
            let scaled =
                |count: u32| ((f64::from(count) * effort).round() as u32).max(FEWEST.min(count));
            campaign.doe.designs = scaled(campaign.doe.designs);
            campaign.optimise.evaluations = scaled(campaign.optimise.evaluations);
            let half = campaign.optimise.evaluations / 2;
            campaign.optimise.restart_at =
                campaign.optimise.restart_at.map(|at| scaled(at).min(half));
            campaign
                .kriging
                .leave_out
                .retain(|number| *number < campaign.doe.designs);
            let found = of_seed(&Problem::new(campaign))?;
            for (ended, found) in ended.iter_mut().zip(found) {
                ended.push(found);
            }
        }
        for (approach, ended) in APPROACHES.into_iter().zip(&ended) {
            let is_own = problem.approaches().any(|own| own == approach);
            table.rows.push(Row {
                panel: panel.clone(),
                method: problem.approach_name(approach).to_owned(),
                setting: format!("effort {} %", 100.0 * effort),
                is_campaign: is_own && place == efforts.len(),
                values: values(ended),
            });
        }
        progress(&format!(
            "optimisation: effort {} %, {seeds} seeds",
            100.0 * effort
        ));
    }
    Ok(table)
}

/// The values of [`COLUMNS`].
fn values(ended: &[Ended]) -> Vec<f64> {
    let each = |value: fn(&Ended) -> f64| -> Vec<f64> { ended.iter().map(value).collect() };
    let percentiles = each(|one| one.percentile_um);
    let feasible = percentiles.iter().filter(|value| value.is_finite()).count();
    vec![
        median(&each(|one| one.calls)),
        median(&each(|one| one.seconds)),
        median(&each(|one| one.seconds + PAPER_SECONDS * one.calls)),
        median(&percentiles),
        quantile(&percentiles, 0.25),
        quantile(&percentiles, 0.75),
        100.0 * feasible as f64 / ended.len() as f64,
    ]
}

/// What the approaches come to, in their order.
fn of_seed(problem: &Problem) -> anyhow::Result<Vec<Ended>> {
    let base = finished::base_anew(&InProcess(problem), problem)?;
    let start = process_seconds();
    let doe = data::sampled(problem, &base)?;
    let doe_seconds = process_seconds() - start;
    let mut ended = Vec::new();
    for approach in APPROACHES {
        let start = process_seconds();
        let of_doe = |calls: u64| (calls + doe.calls) as f64;
        let (best, calls) = match approach {
            Approach::BestOfDoe => (best_of(problem, &base, &doe), of_doe(0)),
            Approach::Kriging => match fitting::fit(problem, &doe.designs, &doe.responses) {
                Ok((model, _)) => {
                    let model = Some(model.to_json()?.into());
                    let (best, calls) = searched(problem, &base, approach, model)?;
                    (best, of_doe(calls))
                }
                // A DoE that no model fits gives no design.
                Err(_) => (None, of_doe(0)),
            },
            _ => {
                let (best, calls) = searched(problem, &base, approach, None)?;
                (best, calls as f64)
            }
        };
        let seconds = process_seconds() - start;
        let takes_doe = matches!(approach, Approach::BestOfDoe | Approach::Kriging);
        let percentile_um = match best {
            Some(design) => verified(problem, &design, approach)?,
            None => f64::INFINITY,
        };
        ended.push(Ended {
            calls,
            seconds: seconds + if takes_doe { doe_seconds } else { 0.0 },
            percentile_um,
        });
    }
    Ok(ended)
}

fn best_of(problem: &Problem, base: &Design, doe: &Doe) -> Option<Design> {
    let feasible = doe
        .responses
        .iter()
        .filter(|row| doe.feasible.contains(&row.design));
    let best = feasible.min_by(|a, b| a.p90_um.total_cmp(&b.p90_um))?;
    Some(problem.design(&doe.designs.get(best.design as usize)?.x, base))
}

/// The best feasible design of all starts, and the simulator calls of all.
fn searched(
    problem: &Problem,
    base: &Design,
    approach: Approach,
    model: Option<std::sync::Arc<str>>,
) -> anyhow::Result<(Option<Design>, u64)> {
    let mut best: Option<(f64, Design)> = None;
    let mut calls = 0;
    for start in 0..problem.campaign().optimise.starts {
        let run = Run {
            approach,
            start,
            base: base.clone(),
            model: model.clone(),
        };
        let run = optimise::run(problem, &run).map_err(anyhow::Error::msg)?;
        calls += run.simulator_calls;
        let Some(found) = run.best else { continue };
        if best
            .as_ref()
            .is_none_or(|(value, _)| found.criterion_um < *value)
        {
            best = Some((found.criterion_um, found.design));
        }
    }
    Ok((best.map(|(_, design)| design), calls))
}

/// The percentile of fresh samples, µm.
fn verified(problem: &Problem, design: &Design, approach: Approach) -> anyhow::Result<f64> {
    let gears = problem.gears().context("the campaign designs no gears")?;
    let campaign = problem.campaign();
    let pair = gears.pair(design)?;
    let mut sampler = gears.sampler(&pair);
    let draw = |sample| {
        let number = approach.number();
        sampler.draw(&mut stream(campaign.seed, Purpose::Verify, number, sample))
    };
    let samples: Vec<f64> = (0..u64::from(campaign.verify.samples)).map(draw).collect();
    Ok(campaign.sampling.verified(&samples)?.p90)
}
