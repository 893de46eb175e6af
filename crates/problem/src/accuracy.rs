//! Settings for an accuracy: `[accuracy] tolerance_um` chooses the simulator's grid, the number of samples
//! and the estimator of the percentile.
//!
//! The choice rests on two tables that `coordinator tradeoff campaigns/paper.toml` measured: the error of each grid
//! relative to ΔSTE, and the error of each estimator in standard deviations of ΔSTE. Both are converted to micrometres
//! by the medians of ΔSTE and of its standard deviation over twenty random designs of the campaign's own box. The
//! errors are independent, so their squares add up. Among the settings whose error is within the tolerance, the one
//! with the least time for a design is taken, by the times of the tables: the choice depends on the file alone, not on
//! the machine.

use std::fmt;

use rand::RngExt as _;
use stats::streams::{Purpose, stream};

use crate::file::{
    Campaign, ControlVariate, EstimatorRule, FileError, Form, Sampling, Source, WearCoefficients,
};
use crate::formulation::Problem;
use crate::own_designs;

/// The simulator's table of `tradeoff`, measured in full with the paper's campaign. Coupled cells were measured with
/// the gears of `campaigns/pair.toml`, against 96 phases.
pub const SIMULATOR_TABLE: &str = include_str!("../data/simulator.csv");
/// The percentile's table of `tradeoff`, measured in full with the paper's campaign.
pub const PERCENTILE_TABLE: &str = include_str!("../data/percentile.csv");

/// The estimators that a campaign can ask for, by the names of their keys.
pub const ESTIMATORS: [Estimator; 6] = {
    use ControlVariate::{Linearised, None};
    use EstimatorRule::{Chosen, Normal, Paper};
    use WearCoefficients::{Antithetic, Independent, QuasiRandom};
    [
        Estimator::new("paper", Paper, None, Independent),
        Estimator::new("normal", Normal, None, Independent),
        Estimator::new("chosen", Chosen, None, Independent),
        Estimator::new("linearised", Normal, Linearised, Independent),
        Estimator::new("antithetic", Normal, None, Antithetic),
        Estimator::new("quasi-random", Normal, None, QuasiRandom),
    ]
};

/// How a percentile is estimated: three keys of `[sampling]`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Estimator {
    /// The name in the tables.
    pub name: &'static str,
    /// `estimator`
    pub rule: EstimatorRule,
    /// `control`
    pub control: ControlVariate,
    /// `coefficients`
    pub coefficients: WearCoefficients,
}

impl Estimator {
    const fn new(
        name: &'static str,
        rule: EstimatorRule,
        control: ControlVariate,
        coefficients: WearCoefficients,
    ) -> Self {
        Self {
            name,
            rule,
            control,
            coefficients,
        }
    }

    /// Whether the campaign may use this estimator.
    fn suits(&self, campaign: &Campaign) -> bool {
        let is_independent = self.coefficients == WearCoefficients::Independent;
        let has_long_tail = campaign
            .gears()
            .is_some_and(|sections| sections.manufacture.is_some());
        (campaign.enrichment.is_none() || is_independent)
            && (!has_long_tail || self.rule == EstimatorRule::Chosen)
    }
}

/// The settings that a tolerance chooses, with the figures that decided.
#[derive(Debug, Clone, PartialEq)]
pub struct Choice {
    /// The tolerance, µm.
    pub tolerance_um: f64,
    /// Cells along the path of contact, and phases.
    pub grid: [u32; 2],
    /// The estimator.
    pub estimator: Estimator,
    /// Samples per design.
    pub samples: u32,
    /// 95th percentile of the grid's error, µm.
    pub grid_error_um: f64,
    /// Root mean square error of the percentile from `samples` samples, µm.
    pub percentile_error_um: f64,
    /// CPU time of a design with its samples on the machine of the tables, µs.
    pub design_micros: f64,
    /// Median ΔSTE and median standard deviation over the pilot designs, µm.
    pub pilot_um: [f64; 2],
}

impl Choice {
    /// Root mean square of both errors, µm.
    #[must_use]
    pub fn error_um(&self) -> f64 {
        self.grid_error_um.hypot(self.percentile_error_um)
    }
}

impl fmt::Display for Choice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [cells, phases] = self.grid;
        let [mean, sd] = self.pilot_um;
        write!(
            f,
            "accuracy.tolerance_um = {} chooses {cells} cells and {phases} phases and {} samples a design with the \
             estimator \"{}\": an expected error of {:.3} µm, of which {:.3} µm are the grid's and {:.3} µm the \
             samples', where ΔSTE is {mean:.2} µm with a standard deviation of {sd:.2} µm (medians of {PILOTS} random \
             designs). A design takes {:.0} µs on the machine that measured the tables",
            self.tolerance_um,
            self.samples,
            self.estimator.name,
            self.error_um(),
            self.grid_error_um,
            self.percentile_error_um,
            self.design_micros,
        )
    }
}

/// Number of random designs on which ΔSTE and its standard deviation are measured.
const PILOTS: usize = 20;
/// Samples of each pilot design.
const PILOT_SAMPLES: u64 = 30;
/// Maximum number of random designs tried to find simulable pilot designs.
const TRIED: u64 = 2000;

/// A campaign file. Its tolerance, if it has one, is replaced by the chosen settings.
#[derive(Debug, Clone, PartialEq)]
pub struct CampaignFile {
    /// The campaign, with the grid, samples and estimator that a tolerance chooses.
    pub campaign: Campaign,
    /// The text that [`Campaign::parse`] reads as this campaign: the user's, unless it has a tolerance or a table of
    /// designs.
    pub text: String,
    /// The settings that the tolerance chooses.
    pub choice: Option<Choice>,
}

impl CampaignFile {
    /// Parses and validates `text`; `file` names it in errors. A tolerance requires simulations of random designs.
    ///
    /// # Errors
    ///
    /// The error names the line, the fault and the valid values.
    ///
    /// # Panics
    ///
    /// Never: a campaign is plain numbers and names, which TOML can hold.
    pub fn parse(file: &str, text: &str) -> Result<Self, FileError> {
        let source = Source { file, text };
        let form = Form::parse(source)?;
        let Some(tolerance_um) = form.tolerance_um() else {
            let campaign = Campaign::parse(file, text)?;
            own_designs::check(&campaign, source)?;
            return Ok(Self {
                campaign,
                text: text.to_owned(),
                choice: None,
            });
        };
        let key = "accuracy.tolerance_um";
        source.leaves_to("accuracy", &["cells", "phases"], key)?;
        source.leaves_to(
            "sampling",
            &[
                "samples_per_design",
                "precision",
                "samples_max",
                "estimator",
                "control",
                "coefficients",
                "group",
            ],
            key,
        )?;
        source.leaves_to(
            "objective",
            &["measure", "level", "k", "limit"],
            "accuracy.tolerance_um, which chooses the estimator of the 90th percentile",
        )?;
        source.positive(key, tolerance_um)?;
        let mut campaign = Campaign::from(form);
        // Valid values until the choice is made.
        campaign.sampling.samples_per_design = 30;
        campaign.validate(source)?;
        let choice = choice(&campaign, tolerance_um)
            .map_err(|expected| source.refuse(key, tolerance_um, expected))?;
        let Estimator {
            rule,
            control,
            coefficients,
            ..
        } = choice.estimator;
        campaign.sampling = Sampling {
            samples_per_design: choice.samples,
            estimator: Some(rule),
            control,
            coefficients,
            ..campaign.sampling
        };
        if let Some(gears) = campaign.gears_mut() {
            let [cells, phases] = choice.grid.map(|count| count as usize);
            gears.grid = gear::Discretisation { cells, phases };
        }
        campaign.validate(source)?;
        own_designs::check(&campaign, source)?;
        let written = toml::to_string(&campaign).expect("plain numbers and names serialise");
        Ok(Self {
            campaign,
            text: format!("# {choice}\n\n{written}"),
            choice: Some(choice),
        })
    }

    /// The campaign with the designs of its table, whose text is `table`; `file` names the table in errors.
    ///
    /// # Errors
    ///
    /// The error names the line, the fault and the valid values.
    ///
    /// # Panics
    ///
    /// Never: a campaign is plain numbers and names, which TOML can hold.
    pub fn with_designs(self, file: &str, table: &str) -> Result<Self, FileError> {
        let doe = own_designs::of_table(&Problem::new(self.campaign.clone()), file, table)?;
        let campaign = Campaign {
            doe,
            ..self.campaign
        };
        Ok(Self {
            text: toml::to_string(&campaign).expect("plain numbers and names serialise"),
            campaign,
            ..self
        })
    }
}

/// The settings that a tolerance chooses for a campaign.
///
/// # Errors
///
/// The tolerances that would be valid, in words.
fn choice(campaign: &Campaign, tolerance_um: f64) -> Result<Choice, String> {
    let Some(sections) = campaign.gears() else {
        return Err("absent: only gear pairs have the tables of errors".to_owned());
    };
    let pilot_um = pilot(campaign).ok_or(
        "left out: no design of [bounds] could be simulated, so the size of ΔSTE is unknown",
    )?;
    let [mean, sd] = pilot_um;
    let mut best: Option<Choice> = None;
    let mut least = f64::INFINITY;
    for grid in grids(sections.pair.tooth_model) {
        for Estimate {
            estimator,
            samples,
            calls,
            error,
        } in estimates()
            .into_iter()
            .filter(|one| one.estimator.suits(campaign))
        {
            let choice = Choice {
                tolerance_um,
                grid: grid.size,
                estimator,
                samples,
                grid_error_um: 0.01 * grid.error_percent * mean,
                percentile_error_um: error * sd,
                design_micros: grid.design_micros + calls * grid.sample_micros,
                pilot_um,
            };
            least = least.min(choice.error_um());
            let is_better = best
                .as_ref()
                .is_none_or(|best| choice.design_micros < best.design_micros);
            if choice.error_um() <= tolerance_um && is_better {
                best = Some(choice);
            }
        }
    }
    best.ok_or_else(|| {
        format!(
            "at least {:.3}, the error of the most accurate settings measured",
            least + 0.0005
        )
    })
}

/// Medians over random designs of ΔSTE and of its standard deviation under the random wear, µm.
fn pilot(campaign: &Campaign) -> Option<[f64; 2]> {
    let problem = Problem::new(campaign.clone());
    let gears = problem.gears()?;
    let (mut means, mut sds) = (Vec::new(), Vec::new());
    for number in 0..TRIED {
        if means.len() == PILOTS {
            break;
        }
        let mut rng = stream(campaign.seed, Purpose::Test, number, 2);
        let unit: Vec<f64> = (0..problem.dimension()).map(|_| rng.random()).collect();
        let design = problem.design(&problem.free_point(&unit), problem.base());
        let Ok(pair) = gears.pair(&design) else {
            continue;
        };
        let mut sampler = gears.sampler(&pair);
        let samples: Vec<f64> = (0..PILOT_SAMPLES).map(|_| sampler.draw(&mut rng)).collect();
        let (mean, sd) = stats::mean_sd(&samples).ok()?;
        means.push(mean);
        sds.push(sd);
    }
    let median = |values: &mut Vec<f64>| {
        values.sort_by(f64::total_cmp);
        values.get(values.len() / 2).copied()
    };
    Some([median(&mut means)?, median(&mut sds)?])
}

/// A grid of the simulator's table.
struct Grid {
    size: [u32; 2],
    sample_micros: f64,
    design_micros: f64,
    error_percent: f64,
}

/// The grids that were measured for a tooth model.
fn grids(tooth_model: gear::ToothModel) -> Vec<Grid> {
    let columns = [
        "CPU time a sample (µs)",
        "CPU time a design (µs)",
        "error with random wear, 95th percentile (%)",
    ];
    let rows = rows(SIMULATOR_TABLE, columns).into_iter();
    let panel = tooth_model.to_string();
    let measured = rows.filter(|row| row.panel == panel && row.method != "plain sum");
    let grid = |row: Row<3>| {
        let (cells, phases) = row.setting.split_once(" × ")?;
        let [sample_micros, design_micros, error_percent] = row.values;
        Some(Grid {
            size: [cells.parse().ok()?, phases.parse().ok()?],
            sample_micros,
            design_micros,
            error_percent,
        })
    };
    measured.filter_map(grid).collect()
}

/// An estimator with a number of samples, as it was measured.
struct Estimate {
    estimator: Estimator,
    samples: u32,
    calls: f64,
    /// Root mean square error in standard deviations of ΔSTE: the larger one of normal and of other designs.
    error: f64,
}

fn estimates() -> Vec<Estimate> {
    let columns = ["simulator calls", "RMSE (standard deviations)"];
    let mut found: Vec<Estimate> = Vec::new();
    for row in rows(PERCENTILE_TABLE, columns) {
        let estimator = ESTIMATORS.into_iter().find(|one| one.name == row.method);
        let samples = row.setting.split(' ').next().map(str::parse);
        let (Some(estimator), Some(Ok(samples)), [calls, error]) = (estimator, samples, row.values)
        else {
            continue;
        };
        let same = |one: &&mut Estimate| (one.estimator, one.samples) == (estimator, samples);
        match found.iter_mut().find(same) {
            Some(one) => {
                one.error = one.error.max(error);
                one.calls = one.calls.max(calls);
            }
            None => found.push(Estimate {
                estimator,
                samples,
                calls,
                error,
            }),
        }
    }
    found
}

/// A row of a table of `tradeoff`.
struct Row<const N: usize> {
    panel: String,
    method: String,
    setting: String,
    values: [f64; N],
}

/// The rows with a number in each of these columns.
///
/// # Panics
///
/// The shipped table lacks one of the columns. A test reads all of them.
fn rows<const N: usize>(table: &str, columns: [&str; N]) -> Vec<Row<N>> {
    let mut reader = csv::Reader::from_reader(table.as_bytes());
    let header = reader.headers().expect("the table has headings").clone();
    let places = columns.map(|name| {
        let place = header.iter().position(|column| column == name);
        place.unwrap_or_else(|| panic!("the table has no column {name:?}"))
    });
    let row = |record: csv::StringRecord| {
        let values = places.map(|place| record[place].parse().unwrap_or(f64::NAN));
        let [panel, method, setting] = [0, 1, 2].map(|label| record[label].to_owned());
        Row {
            panel,
            method,
            setting,
            values,
        }
    };
    let records = reader.records().filter_map(Result::ok);
    records
        .map(row)
        .filter(|row| row.values.iter().all(|value| value.is_finite()))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The paper's file with a tolerance in the place of the samples.
    fn text(tolerance_um: f64) -> String {
        Campaign::PAPER
            .replacen("samples_per_design = 30", "", 1)
            .replacen("estimator = \"paper\"", "", 1)
            + &format!("\n[accuracy]\ntolerance_um = {tolerance_um}\n")
    }

    fn parse(text: &str) -> CampaignFile {
        CampaignFile::parse("my.toml", text).unwrap()
    }

    #[test]
    fn a_smaller_tolerance_costs_more_and_is_kept() {
        let mut last = 0.0;
        for tolerance_um in [0.4, 0.1, 0.05] {
            let CampaignFile {
                campaign, choice, ..
            } = parse(&text(tolerance_um));
            let choice = choice.unwrap();
            assert!(choice.error_um() <= tolerance_um, "{choice}");
            assert!(choice.design_micros >= last, "{choice}");
            last = choice.design_micros;
            assert_eq!(campaign.sampling.samples_per_design, choice.samples);
            let grid = campaign.gears().unwrap().grid;
            assert_eq!([grid.cells as u32, grid.phases as u32], choice.grid);
        }
    }

    #[test]
    fn a_tolerance_is_the_campaign_of_the_settings_that_it_chooses() {
        let CampaignFile {
            campaign: chosen,
            text: written,
            ..
        } = parse(&text(0.1));
        // A store keeps the text, and reads it without a simulation.
        let parse = |text: &str| Campaign::parse("my.toml", text).unwrap();
        assert_eq!(parse(&written), chosen);
        let refused = Campaign::parse("my.toml", &text(0.1))
            .unwrap_err()
            .to_string();
        assert!(
            refused.contains("accuracy.tolerance_um is 0.1"),
            "{refused}"
        );
        assert_eq!(
            Campaign::from_json(&chosen.to_json()).unwrap().digest(),
            chosen.digest()
        );
        assert!(parse(&written).extends(&chosen) && chosen.extends(&parse(&written)));
        assert_ne!(parse(Campaign::PAPER).digest(), chosen.digest());
    }

    #[test]
    fn what_a_tolerance_chooses_is_left_out_and_what_cannot_be_reached_is_refused() {
        let refusal = |text: &str| {
            CampaignFile::parse("my.toml", text)
                .unwrap_err()
                .to_string()
        };
        let both = format!("{}\n[accuracy]\ntolerance_um = 0.1\n", Campaign::WEAR);
        let message = refusal(&both);
        assert!(
            message.contains("sampling.samples_per_design is 30") && message.contains("left out"),
            "{message}"
        );
        let message = refusal(&(text(0.1) + "cells = 48\n"));
        assert!(message.contains("accuracy.cells"), "{message}");
        let message = refusal(&text(1e-6));
        assert!(
            message.contains("accuracy.tolerance_um") && message.contains("at least"),
            "{message}"
        );
        let message = refusal(&text(-1.0));
        assert!(message.contains("accuracy.tolerance_um is -1"), "{message}");
        let neither = Campaign::PAPER.replacen("samples_per_design = 30", "", 1);
        assert!(refusal(&neither).contains("sampling.samples_per_design"));
    }

    #[test]
    fn an_enrichment_and_manufacture_limit_the_estimators() {
        let with = |section: &str| parse(&(text(0.2) + section)).choice.unwrap();
        let enriched = with(
            "[enrichment]\ncriterion = \"knowledge-gradient\"\nsamples = 1000\nrounds = 5\npoints_per_round = 5\n\
             samples_per_point = 30\ntolerance = 0.01\n",
        );
        assert_eq!(
            enriched.estimator.coefficients,
            WearCoefficients::Independent
        );
        let made = with("[manufacture]\nflank_class = 5\n");
        assert_eq!(made.estimator.rule, EstimatorRule::Chosen);
    }

    #[test]
    fn every_grid_and_estimator_is_in_the_tables() {
        for model in gear::ToothModel::ALL {
            assert!(grids(*model).len() >= 5, "{model}");
        }
        for estimator in ESTIMATORS {
            assert!(
                estimates().iter().any(|one| one.estimator == estimator),
                "{}",
                estimator.name
            );
        }
    }
}
