//! `coordinator compare`: the paper's printed figures beside a campaign's, as a Markdown page or as JSON.

mod page;
mod remarks;

use anyhow::Context as _;
use gear::paper::printed::{ACCURATE_SAMPLES, Place};
use gear::paper::readings::{Reading, Score, readings};
use problem::formulation::Problem;
use rayon::prelude::*;
use serde::Serialize;
use stages::references::design;
use store::{DesignRow, Store};

use crate::optima::VerifiedOptimum;
use crate::report::{PaperFigures, Report, approach_name, paper, statistics};
use crate::snapshot;

/// A campaign beside the paper.
pub struct PaperComparison {
    report: Report,
    /// The fitted readings of the paper.
    scores: Vec<Score>,
    /// The reading of the campaign.
    own: Score,
}

/// The comparison for programs.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ComparisonSummary {
    pub campaign: String,
    /// Digest of all samples.
    pub samples_digest: String,
    /// The campaign's reading of the paper.
    pub reading: ReadingSummary,
    /// The other readings, fitted to the paper.
    pub readings: Vec<ReadingSummary>,
    /// Every printed figure that the campaign has an answer to.
    pub rows: Vec<ComparedFigure>,
}

/// The fit of a reading to the paper.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ReadingSummary {
    /// The reading, in words.
    pub reading: String,
    /// Root mean square of ln(ours/paper) over all printed values.
    pub score: f64,
    /// Spearman's rank correlation of the printed designs' percentiles; `None` if it is not finite.
    pub rank_correlation: Option<f64>,
    /// Share of the design of experiments that cannot be simulated.
    pub refused: f64,
}

/// One printed figure beside ours.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ComparedFigure {
    /// The table or figure, as in `Table 4 #3`.
    pub place: String,
    /// The quantity, with its unit.
    pub quantity: String,
    pub paper: f64,
    pub ours: Option<f64>,
    /// Ours over the paper's, minus one.
    pub gap: Option<f64>,
    /// The explanation of a large gap.
    pub remark: Option<String>,
}

impl ComparedFigure {
    fn new(place: &str, quantity: &str, paper: f64, ours: f64) -> Self {
        Self {
            place: place.to_owned(),
            quantity: quantity.to_owned(),
            paper,
            ours: known(ours),
            gap: known(paper::gap(ours, paper)),
            remark: remarks::remark(place, quantity).map(str::to_owned),
        }
    }
}

fn known(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}

impl PaperComparison {
    /// The comparison as a Markdown page.
    #[must_use]
    pub fn page(&self) -> String {
        page::markdown(&self.report, &self.scores, &self.own)
    }

    /// The comparison for programs.
    #[must_use]
    pub fn summary(&self) -> ComparisonSummary {
        let reading = |score: &Score| ReadingSummary {
            reading: score.reading.to_string(),
            score: score.rms(),
            rank_correlation: known(score.rank_correlation()),
            refused: score.refused,
        };
        let snapshot = &self.report.snapshot;
        ComparisonSummary {
            campaign: snapshot.campaign.name.clone(),
            samples_digest: snapshot.samples_digest.clone(),
            reading: reading(&self.own),
            readings: self.scores.iter().map(reading).collect(),
            rows: figures(&self.report),
        }
    }
}

/// Compares the campaign in `store` with the paper.
///
/// # Errors
///
/// The store cannot be read, or its campaign does not compare itself with the paper.
pub async fn compare(store: &Store) -> anyhow::Result<PaperComparison> {
    let problem = snapshot::problem(store).await?;
    let campaign = problem.campaign();
    anyhow::ensure!(
        campaign.compares_with_paper(),
        "campaign {} does not compare itself with the paper: set report.compare_with_paper",
        campaign.name
    );
    let report = Report::read(store, &[]).await?;
    let designs = report.snapshot.designs.iter();
    let six = |row: &DesignRow| <[f64; 6]>::try_from(row.x.as_slice());
    let doe: Result<Vec<[f64; 6]>, _> = designs.map(six).collect();
    let doe = doe.context("the paper's problem moves six variables")?;
    let seed = campaign.seed;
    let scores: Vec<Score> = readings()
        .collect::<Vec<_>>()
        .into_par_iter()
        .map(|reading| reading.fitted(seed).score(&doe, seed))
        .collect();
    let gears = problem.gears().context("the paper designs gears")?;
    let input = gears.pair_input(&design(Place::Figure(7)));
    let own = Reading {
        law: gears.wear().law,
        tooth_model: input.tooth_model,
        tip_rule: input.tip_rule,
    };
    let own = own.score(&doe, seed);
    Ok(PaperComparison {
        report,
        scores,
        own,
    })
}

/// Every printed figure of the paper that the campaign has an answer to.
fn figures(report: &Report) -> Vec<ComparedFigure> {
    let mut figures = Vec::new();
    let mut add = |place: &str, quantity: &str, paper: f64, ours: f64| {
        figures.push(ComparedFigure::new(place, quantity, paper, ours));
    };
    let none = PaperFigures::default();
    let gears = report.gears.as_ref();
    let designs = gears.and_then(|gears| gears.paper.as_ref());
    let PaperFigures {
        preliminary,
        similar,
        designs,
    } = designs.unwrap_or(&none);
    for design in designs {
        let place = format!("Figure {}", design.printed.figure);
        for figure in design.figures.iter().flatten() {
            let quantity = match figure.unit {
                "" => figure.symbol.to_owned(),
                unit => format!("{}, {unit}", figure.symbol),
            };
            add(&place, &quantity, figure.printed, figure.ours);
        }
    }
    for ours in preliminary {
        let (place, row) = (format!("Table 1 #{}", ours.number), ours.printed);
        add(&place, "mean of ΔSTE, µm", row.mean_um, ours.mean_um);
        add(&place, "SD of ΔSTE, µm", row.sd_um, ours.sd_um);
        add(&place, "P90, µm", row.p90_um, ours.p90_um);
    }
    let responses = gears.map_or_else(Vec::new, |gears| statistics(&gears.doe));
    let names = [
        "ΔSTE without wear, µm",
        "ΔSTE with Archard’s wear, µm",
        "P90, µm",
    ];
    for (ours, name) in responses.iter().zip(names) {
        if ours.designs == 0 {
            continue;
        }
        let row = ours.printed;
        let place = "Table 3";
        add(place, &format!("mean {name}"), row.mean_um, ours.mean);
        add(place, &format!("least {name}"), row.min_um, ours.least);
        add(
            place,
            &format!("greatest {name}"),
            row.max_um,
            ours.greatest,
        );
    }
    for ours in similar {
        let (place, row) = (format!("Table 4 #{}", ours.number), ours.printed);
        add(
            &place,
            "ΔSTE with Archard’s wear, µm",
            row.delta_ste_archard_um,
            ours.delta_ste_archard_um,
        );
        let p90 = ours.p90.map_or(f64::NAN, |p90| p90.value);
        add(&place, "P90, µm", row.p90_um, p90);
    }
    for row in &paper::APPROACHES {
        let Some(verified) = report.snapshot.optima.of(row.approach) else {
            continue;
        };
        let Ok(found) = &verified.optimum.found else {
            continue;
        };
        let problem = &report.snapshot.problem;
        let name = approach_name(problem, row.approach);
        let place = format!("Table 5, {}", name.to_lowercase());
        add(
            &place,
            "criterion at its own optimum, µm",
            row.criterion,
            found.criterion,
        );
        add(
            &place,
            "P90 at its own optimum, µm",
            row.p90_um,
            p90_by_paper_um(problem, verified),
        );
    }
    figures
}

/// P90 for the paper's Table 5, µm, verified as the paper does: by Equation (8), from the same number of samples.
fn p90_by_paper_um(problem: &Problem, verified: &VerifiedOptimum) -> f64 {
    let samples = verified.values(problem);
    let samples = &samples[..samples.len().min(ACCURATE_SAMPLES)];
    let estimate = problem.campaign().sampling.papers_estimate(samples);
    estimate.map_or(f64::NAN, |estimate| estimate.p90)
}
