//! The cost of each approach to the optimum, and the quality of its design.
//!
//! Whole campaigns run, as with `coordinator run`. The effort is the share of the campaign's DoE
//! designs, optimiser evaluations and enrichment samples.

use problem::Campaign;
use problem::file::{Enrichment, EstimatorRule};
use problem::formulation::{Approach, Problem};

use crate::summary::{median, quantile};
use crate::tradeoff::front::Rule;
use crate::tradeoff::runner::{ApproachResult, Runner};
use crate::tradeoff::size::Size;
use crate::tradeoff::table::{Row, Table};
use crate::tradeoff::view::{self, Reading};

pub(crate) const LEAD: &str = "Percentile of the best feasible design of an approach, from verification samples, against calls of the simulator, \
     CPU time with this simulator, and time with one that takes 2 s a call, as the paper's did. Medians and quartiles \
     over seeds; the percentile of a run without a feasible design is infinite. Effort is the share of the campaign's \
     designs and of its optimisers' evaluations. The approaches of the campaign are marked at the largest effort.";

const COLUMNS: [&str; 7] = [
    "simulator calls",
    "CPU time (s)",
    "time at 2 s a call (s)",
    "verified percentile, median (µm)",
    "verified percentile, lower quartile (µm)",
    "verified percentile, upper quartile (µm)",
    "runs with a feasible design (%)",
];

/// Time of a call of the paper's simulator, in seconds.
const PAPER_SECONDS: f64 = 2.0;

/// Percentiles closer than this count as equally good.
const NEAR: Rule = Rule::NearBest(0.02);

pub(crate) const PAIRS: &[view::Pair] = &[
    view::Pair {
        cost: 0,
        error: 3,
        reading: Reading::Choice(NEAR),
    },
    view::Pair {
        cost: 1,
        error: 3,
        reading: Reading::Choice(NEAR),
    },
    view::Pair {
        cost: 2,
        error: 3,
        reading: Reading::Choice(NEAR),
    },
];

/// The measured approaches, in the order of the paper's Table 5.
const APPROACHES: [Approach; 6] = [
    Approach::Nominal,
    Approach::Baseline,
    Approach::Kriging,
    Approach::BestOfDoe,
    Approach::Direct,
    Approach::EnrichedKriging,
];

/// Minimum number of designs and of evaluations.
const FEWEST: u32 = 60;

pub(crate) fn run(
    problem: &Problem,
    size: Size,
    runner: &mut dyn Runner,
    progress: &mut dyn FnMut(&str),
) -> anyhow::Result<Table> {
    let seeds = size.pick(6, 3, 1);
    let efforts: &[f64] = match size {
        Size::Full => &[0.03, 0.1, 0.3, 1.0],
        Size::Quick => &[0.03, 0.1],
        Size::Designs(_) => &[0.02],
    };
    let mut table = Table::new(&COLUMNS);
    let campaign = problem.campaign();
    let panel = format!(
        "{} of the best feasible design, {seeds} seeds",
        campaign.measure_name()
    );
    for (place, &effort) in (1..).zip(efforts) {
        let mut results = Vec::new();
        for seed in 0..seeds {
            let mut plain = scaled(campaign, effort);
            plain.seed += seed;
            plain.optimise.direct = true;
            results.extend(runner.campaign(&plain)?);
            let enriched = enriched(&plain, effort);
            let of_enrichment = runner.campaign(&enriched)?.into_iter();
            results.extend(of_enrichment.filter(|one| one.approach == Approach::EnrichedKriging));
        }
        for approach in APPROACHES {
            let is_own = problem.approaches().any(|own| own == approach);
            let own: Vec<ApproachResult> = results
                .iter()
                .copied()
                .filter(|one| one.approach == approach)
                .collect();
            table.rows.push(Row {
                panel: panel.clone(),
                method: problem.approach_name(approach).to_owned(),
                setting: format!("effort {} %", 100.0 * effort),
                is_campaign: is_own && place == efforts.len(),
                values: values(&own, seeds),
            });
        }
        progress(&format!(
            "optimisation: effort {} %, {seeds} seeds",
            100.0 * effort
        ));
    }
    Ok(table)
}

/// Returns the campaign at this effort, without enrichment.
pub(crate) fn scaled(campaign: &Campaign, effort: f64) -> Campaign {
    let mut campaign = campaign.clone();
    let scaled = |count: u32| ((f64::from(count) * effort).round() as u32).max(FEWEST.min(count));
    campaign.doe.designs = scaled(campaign.doe.designs);
    campaign.optimise.evaluations = scaled(campaign.optimise.evaluations);
    let half = campaign.optimise.evaluations / 2;
    campaign.optimise.restart_at = campaign.optimise.restart_at.map(|at| scaled(at).min(half));
    campaign
        .kriging
        .leave_out
        .retain(|number| *number < campaign.doe.designs);
    campaign.enrichment = None;
    if let Some(sections) = campaign.gears_mut() {
        sections.report.compare_with_paper = false;
    }
    campaign
}

/// Returns a campaign with a small DoE and enrichment, with the settings of `campaigns/enriched.toml`. The searches of
/// its other approaches are cut to the minimum.
fn enriched(campaign: &Campaign, effort: f64) -> Campaign {
    let mut campaign = campaign.clone();
    campaign.doe.designs = campaign.doe.designs.min(120);
    let sampling = &mut campaign.sampling;
    sampling.samples_per_design = 36;
    sampling.estimator = Some(EstimatorRule::Normal);
    sampling.control = Default::default();
    sampling.coefficients = Default::default();
    sampling.group = None;
    sampling.skip_violation = Some(1.0);
    campaign.optimise.direct = false;
    campaign.optimise.starts = 1;
    campaign.optimise.evaluations = campaign.optimise.evaluations.min(FEWEST);
    let restart_at = campaign.optimise.restart_at;
    campaign.optimise.restart_at = restart_at.map(|at| at.min(FEWEST / 2));
    campaign.enrichment = Some(Enrichment {
        criterion: enrich::Criterion::ExpectedQuantileImprovement,
        samples: (18_000.0 * effort).round() as u32,
        rounds: 100,
        points_per_round: 24,
        samples_per_point: 36,
        tolerance: 0.003,
    });
    campaign
}

/// Computes the values of [`COLUMNS`]. The percentile of a seed without a design is infinite.
fn values(results: &[ApproachResult], seeds: u64) -> Vec<f64> {
    let each =
        |value: fn(&ApproachResult) -> f64| -> Vec<f64> { results.iter().map(value).collect() };
    let mut percentiles = each(|one| one.percentile);
    percentiles.resize(seeds as usize, f64::INFINITY);
    let feasible = percentiles.iter().filter(|value| value.is_finite()).count();
    vec![
        median(&each(|one| one.calls)),
        median(&each(|one| one.seconds)),
        median(&each(|one| one.seconds + PAPER_SECONDS * one.calls)),
        median(&percentiles),
        quantile(&percentiles, 0.25),
        quantile(&percentiles, 0.75),
        100.0 * feasible as f64 / percentiles.len() as f64,
    ]
}
