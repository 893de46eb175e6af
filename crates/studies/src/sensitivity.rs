//! `coordinator sensitivity`: how the recommended design's P90 depends on the scenario of wear, and
//! on tolerances.
//!
//! Two questions, two tables. The first varies one parameter of the wear field at a time by a factor
//! and samples again. The second lets small deviations of the six variables and of the wear's
//! parameters vary together and splits the variance that follows among them (Sobol' indices).
//!
//! A deviation of a variable is one of manufacture: tools keep their module, so the module stays as
//! designed, and the centre distance without backlash follows.

use std::ops::Range;
use std::path::Path;

use anyhow::{Context as _, anyhow};
use problem::formulation::Problem;
use problem::formulation::gears::{Gears, VARIABLE_NAMES};
use problem::optimise::COMMON;
use problem::task::VERIFICATION;
use problem::{Campaign, Design};
use rayon::prelude::*;
use results::number::fixed;
use results::report::{charts, symbol, write_file};
use results::row;
use results::table::{Column, Table};
use stats::streams::{Purpose, stream};
use stats::{IntervalEstimate, Sensitivity, SensitivityIndex, SensitivityPlan};

use crate::finished::FeasibleOptimum;
use crate::samples::in_pieces;
use crate::table::{Document, PageTable, percentile_cells, with_interval};

/// The stream of the wear profiles from which the field of a single sample is drawn.
const FIELDS: u64 = (1 << 40) + 1;

/// Number of bootstrap samples behind an interval.
const RESAMPLES: usize = 1000;

/// The parameters of the wear field, in the order of the inputs after the variables.
const SCENARIO: [&str; 3] = ["wear depth", "wear variance", "wear range"];

/// Text of the error for a campaign of another kind, which the commands refuse.
const NO_GEARS: &str = "a campaign of gears is needed";

/// Number of a pair's variables that deviate: the first ones, profile shifts and heights of the
/// tools.
const DEVIATING: usize = 6;

/// The tolerances of an analysis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tolerances {
    /// Largest deviation of each of the six variables, modules.
    pub modules: f64,
    /// Largest deviation of the wear's depth, variance and range, as a share of each.
    pub scenario: f64,
    /// Rows of the analysis; a power of two is best.
    pub rows: usize,
}

/// A changed parameter of the wear field, with the percentile that follows.
#[derive(Debug, Clone, PartialEq)]
pub struct Scenario {
    /// The parameter that is changed.
    pub parameter: &'static str,
    /// The factor by which it is changed.
    pub factor: f64,
    /// P90 from the campaign's number of verification samples.
    pub p90: IntervalEstimate,
}

/// The indices of one output.
#[derive(Debug, Clone, PartialEq)]
pub struct Indices {
    /// The output, in words.
    pub output: String,
    pub inputs: Vec<String>,
    /// The indices of all inputs.
    pub sensitivity: Sensitivity,
}

/// Factors on the parameters of a wear field.
#[derive(Debug, Clone, Copy)]
struct WearFactors {
    depth: f64,
    variance: f64,
    range: f64,
}

impl WearFactors {
    const NONE: Self = Self {
        depth: 1.0,
        variance: 1.0,
        range: 1.0,
    };

    fn apply(self, wear: &gear::Wear) -> gear::Wear {
        gear::Wear {
            law: wear.law.scaled(self.depth),
            variance: self.variance * wear.variance,
            range: self.range * wear.range,
            ..*wear
        }
    }
}

/// P90 of the design as verified, and with the wear field's variance, range and depth halved and
/// doubled. The random numbers are those of the verification.
///
/// # Errors
///
/// The design cannot be simulated, which is not expected for one from the campaign's store.
pub fn scenarios(problem: &Problem, optimum: &FeasibleOptimum) -> anyhow::Result<Vec<Scenario>> {
    let gears = problem.gears().context(NO_GEARS)?;
    let pair = gears.pair(&optimum.design.clone())?;
    let none = WearFactors::NONE;
    const FACTORS: [f64; 2] = [0.5, 2.0];
    let of_variance = FACTORS.map(|variance| {
        let factors = WearFactors { variance, ..none };
        ("wear variance", variance, factors)
    });
    let of_range = FACTORS.map(|range| ("wear range", range, WearFactors { range, ..none }));
    let of_depth = FACTORS.map(|depth| ("wear depth", depth, WearFactors { depth, ..none }));
    let as_designed = [("as designed", 1.0, none)];
    let scenarios = [&as_designed[..], &of_variance, &of_range, &of_depth].concat();
    scenarios
        .into_par_iter()
        .map(|(parameter, factor, factors)| {
            let wear = factors.apply(gears.wear());
            let samples = in_pieces(optimum.verified.len() as u32, |samples| {
                draw(problem, &pair, &wear, VERIFICATION, samples)
            })?;
            Ok(Scenario {
                parameter,
                factor,
                p90: problem.campaign().sampling.verified(&samples)?,
            })
        })
        .collect()
}

/// Samples of the ΔSTE of a pair with this wear, µm, that counts of those in all cases. Sample i uses the stream
/// (campaign's seed, purpose, number, i).
fn draw(
    problem: &Problem,
    pair: &gear::Pair,
    wear: &gear::Wear,
    (purpose, number): (Purpose, u64),
    samples: Range<u32>,
) -> anyhow::Result<Vec<f64>> {
    let gears = problem.gears().context(NO_GEARS)?;
    let mut sampler = gears.cases_of(pair.clone(), wear)?.sampler();
    let seed = problem.campaign().seed;
    let mut all = stats::Samples::none(problem.sampled().len());
    for index in samples {
        let sample = sampler.draw(&mut stream(seed, purpose, number, index.into()));
        let checked = problem.check_sample(&sample);
        checked.map_err(|(name, why)| anyhow!("{name} of sample {index} {why}"))?;
        all.push(&sample);
    }
    Ok(problem.objective().values(&all))
}

/// First-order and total indices of P90 (from the common samples of a direct search), and of the
/// ΔSTE of one worn pair, whose wear field is one input more, together with the slope deviations of
/// a campaign with a flank class.
///
/// # Errors
///
/// The design has no module, tolerances leave no design that can be simulated, nothing varies, or
/// the simulator fails.
pub fn indices(
    problem: &Problem,
    optimum: &FeasibleOptimum,
    tolerances: &Tolerances,
) -> anyhow::Result<Vec<Indices>> {
    let names = &VARIABLE_NAMES[..DEVIATING];
    let inputs: Vec<String> = names
        .iter()
        .chain(&SCENARIO)
        .map(ToString::to_string)
        .collect();
    let gears = problem.gears().context(NO_GEARS)?;
    let sampling = &problem.campaign().sampling;
    let nominal = NominalDesign::new(gears, optimum.design.clone())?;
    let of_percentile = |point: &[f64]| -> anyhow::Result<f64> {
        let Some((pair, wear)) = nominal.deviated(tolerances, point) else {
            return Ok(f64::NAN);
        };
        let samples = draw(
            problem,
            &pair,
            &wear,
            COMMON,
            0..sampling.samples_per_design,
        )?;
        Ok(sampling
            .verified(&samples)
            .map_or(f64::NAN, |p90| p90.value))
    };
    let of_sample = |point: &[f64]| -> anyhow::Result<f64> {
        let Some((pair, wear)) = nominal.deviated(tolerances, point) else {
            return Ok(f64::NAN);
        };
        // The field is drawn from 2³² numbered ones, so that its number is a uniform input.
        let number = (point[inputs.len()] * f64::from(u32::MAX)) as u32;
        let number = number.min(u32::MAX - 1);
        let fields = (Purpose::Wear, FIELDS);
        let samples = draw(problem, &pair, &wear, fields, number..number + 1)?;
        Ok(samples[0])
    };
    // One stream per sample draws the wear and the deviations of manufacture.
    let field = match gears.scatter() == gear::Scatter::default() {
        true => "wear field",
        false => "wear field and manufacture",
    };
    let with_field = [&inputs[..], &[field.to_owned()]].concat();
    let seed = problem.campaign().seed;
    Ok(vec![
        analyse(
            seed,
            tolerances.rows,
            0,
            &problem.campaign().measure_name(),
            inputs.clone(),
            of_percentile,
        )?,
        analyse(
            seed,
            tolerances.rows,
            1,
            "ΔSTE of one worn pair",
            with_field,
            of_sample,
        )?,
    ])
}

/// The design without deviations of manufacture.
struct NominalDesign<'a> {
    gears: &'a Gears,
    design: Design,
    /// The module of the tools, mm.
    module: f64,
}

impl<'a> NominalDesign<'a> {
    fn new(gears: &'a Gears, design: Design) -> anyhow::Result<Self> {
        Ok(Self {
            module: gears.normal_module(&design)?,
            gears,
            design,
        })
    }

    /// The pair and the wear at a point of the unit cube; `None` if the pair is not simulable.
    fn deviated(&self, tolerances: &Tolerances, point: &[f64]) -> Option<(gear::Pair, gear::Wear)> {
        let deviation = |input: usize, size: f64| size * (2.0 * point[input] - 1.0);
        let mut values = self.design.values().to_vec();
        for (input, value) in values[..DEVIATING].iter_mut().enumerate() {
            *value += deviation(input, tolerances.modules);
        }
        let factor = |number: usize| 1.0 + deviation(DEVIATING + number, tolerances.scenario);
        let factors = WearFactors {
            depth: factor(0),
            variance: factor(1),
            range: factor(2),
        };
        let input = gear::PairInput {
            size: gear::Size::NormalModule(self.module),
            ..self.gears.pair_input(&Design::new(values))
        };
        let corrections = self.gears.corrections(&self.design);
        let grid = self.gears.discretisation();
        let pair = gear::Pair::with_corrections(&input, &corrections, grid).ok()?;
        Some((pair, factors.apply(self.gears.wear())))
    }
}

/// The indices of the output `value` of a point. `number` distinguishes the analyses of a campaign.
fn analyse(
    seed: u64,
    rows: usize,
    number: u32,
    output: &str,
    inputs: Vec<String>,
    value: impl Fn(&[f64]) -> anyhow::Result<f64> + Sync,
) -> anyhow::Result<Indices> {
    let plan = SensitivityPlan::new(inputs.len(), rows, number)?;
    let outputs: anyhow::Result<Vec<f64>> = (0..plan.len())
        .into_par_iter()
        .map(|index| value(&plan.point(index)))
        .collect();
    let mut rng = stream(seed, Purpose::Wear, FIELDS + 1, u64::from(number));
    let sensitivity = plan
        .analyse(&outputs?, RESAMPLES, &mut rng)
        .with_context(|| format!("the indices of {output}"))?;
    Ok(Indices {
        output: output.to_owned(),
        inputs,
        sensitivity,
    })
}

/// Writes `scenarios.csv`, `indices.csv`, `sensitivity.md` and a chart for each output into `out`; returns what it wrote.
///
/// # Errors
///
/// A file cannot be written.
pub fn write_tables(
    out: &Path,
    campaign: &Campaign,
    optimum: &FeasibleOptimum,
    tolerances: &Tolerances,
    scenarios: &[Scenario],
    indices: &[Indices],
) -> anyhow::Result<Document> {
    let name = &campaign.name;
    let [value, low, high] = campaign.sampling.measure_columns();
    let mut columns = vec![Column::text("parameter"), Column::number("factor")];
    columns.extend([value, low, high].map(Column::number));
    let mut table = Table::new(columns);
    let measure = campaign.measure_name();
    let mut shown = PageTable::new(["scenario", &format!("{measure}, µm")]);
    for row in scenarios {
        let p90 = &row.p90;
        let mut line = row![row.parameter, row.factor].to_vec();
        line.extend(percentile_cells(Some(*p90)));
        table.rows.push(line);
        let label = if row.factor == 1.0 {
            row.parameter.to_owned()
        } else {
            format!("{} × {}", row.parameter, row.factor)
        };
        shown.rows.push(vec![label, with_interval(p90)]);
    }
    write_file(out, "scenarios.csv", table.csv()?)?;
    let figures = index_figures(indices);
    write_file(out, "indices.csv", figures.csv()?)?;
    let mut page = format!(
        "# {name}: sensitivity of the design of approach {}\n\n{}",
        optimum.approach.name(),
        shown.markdown()
    );
    page += &format!(
        "\nShares of the variance when the six variables deviate by up to {} modules and the \
         wear's depth, variance and range by up to {} %, all evenly and independently, with 95 % \
         bootstrap intervals. The first-order index is what an input does alone, the total one what \
         it does with the others, too.\n",
        tolerances.modules,
        100.0 * tolerances.scenario
    );
    for (one, chart) in indices.iter().zip(["sensitivity", "sensitivity-of-a-pair"]) {
        let found = &one.sensitivity;
        let mut shown = PageTable::new(["input", "first-order index", "total index"]);
        let index = |i: &SensitivityIndex| {
            let [value, low, high] = [i.value, i.low, i.high].map(|share| fixed(share, 3));
            format!("{value} [{low}; {high}]")
        };
        for ((input, first), total) in one.inputs.iter().zip(&found.first).zip(&found.total) {
            shown
                .rows
                .push(vec![(*input).to_owned(), index(first), index(total)]);
        }
        page += &format!(
            "\n{}: mean {} µm, standard deviation {} µm",
            one.output,
            fixed(found.mean, 3),
            fixed(found.variance.sqrt(), 3)
        );
        if found.left_out > 0 {
            page += &format!(
                "; {} of {} rows left out, because a deviated pair cannot be simulated",
                found.left_out, tolerances.rows
            );
        }
        page += &format!(".\n\n{}", shown.markdown());
        let inputs: Vec<String> = one.inputs.iter().map(|input| symbol(input)).collect();
        let drawn = charts::indices(&one.output, &inputs, &found.first, &found.total)?;
        write_file(out, &format!("{chart}.svg"), drawn.standalone())?;
        page += &format!("\n![Indices of {}]({chart}.svg)\n", one.output);
    }
    write_file(out, "sensitivity.md", &page)?;
    Ok(Document {
        page,
        tables: vec![("scenarios", table), ("indices", figures)],
    })
}

fn index_figures(indices: &[Indices]) -> Table {
    let mut columns = ["output", "input"].map(Column::text).to_vec();
    let figures = [
        "first",
        "first_low",
        "first_high",
        "total",
        "total_low",
        "total_high",
    ];
    columns.extend(figures.map(Column::number));
    let mut table = Table::new(columns);
    for one in indices {
        let found = &one.sensitivity;
        for ((input, first), total) in one.inputs.iter().zip(&found.first).zip(&found.total) {
            let mut line = row![one.output.as_str(), input.as_str()].to_vec();
            for index in [first, total] {
                line.extend(row![index.value, index.low, index.high]);
            }
            table.rows.push(line);
        }
    }
    table
}

#[cfg(test)]
mod tests {
    use problem::Approach;

    use super::*;
    use crate::samples;

    /// The optimum of Figure 9 with the campaign's own random numbers.
    fn figure_9() -> (Problem, FeasibleOptimum) {
        let mut campaign = Campaign::parse("paper.toml", Campaign::PAPER).unwrap();
        campaign.sampling.samples_per_design = 10;
        campaign.verify.samples = Some(200);
        let problem = Problem::new(campaign);
        let design = stages::references::design(gear::paper::printed::Place::Figure(9));
        let optimum = FeasibleOptimum {
            approach: Approach::Baseline,
            design: design.clone(),
            verified: samples::verification(&problem, &design).unwrap(),
        };
        (problem, optimum)
    }

    #[test]
    fn the_scenario_as_designed_is_the_verification_and_more_wear_is_worse() {
        let (problem, optimum) = figure_9();
        let rows = scenarios(&problem, &optimum).unwrap();
        assert_eq!(rows.len(), 7);
        assert_eq!(
            rows[0].p90,
            problem
                .campaign()
                .sampling
                .verified(&optimum.verified)
                .unwrap()
        );
        let of = |parameter: &str, factor: f64| {
            let row = rows
                .iter()
                .find(|row| row.parameter == parameter && row.factor == factor);
            row.unwrap().p90.value
        };
        let nominal = rows[0].p90.value;
        // Half the depth may be worse, too, for a design that was optimised for the whole.
        assert!(nominal < of("wear depth", 2.0));
        // A wider scatter of the same mean moves the percentile up.
        assert!(of("wear variance", 0.5) < nominal && nominal < of("wear variance", 2.0));
    }

    #[test]
    fn indices_are_reproducible_and_shares_of_one() {
        let (problem, optimum) = figure_9();
        let tolerances = Tolerances {
            modules: 0.01,
            scenario: 0.2,
            rows: 128,
        };
        let indices = |tolerances| indices(&problem, &optimum, tolerances);
        let found = indices(&tolerances).unwrap();
        // The number of threads does not matter.
        let one = rayon::ThreadPoolBuilder::new().num_threads(1).build();
        assert_eq!(
            found,
            one.unwrap().install(|| indices(&tolerances)).unwrap()
        );
        assert_eq!(
            found.iter().map(|one| one.inputs.len()).collect::<Vec<_>>(),
            [9, 10]
        );
        for one in &found {
            let sum: f64 = one.sensitivity.first.iter().map(|index| index.value).sum();
            // Estimates from 128 rows: a deviation beyond these limits is an error, not chance.
            assert!((0.6..1.3).contains(&sum), "{}: {sum}", one.output);
            assert_eq!(one.sensitivity.left_out, 0);
        }
        // The percentile is nearly proportional to the depth, which varies by 20 %.
        let of_p90 = &found[0];
        let depth = of_p90
            .inputs
            .iter()
            .position(|i| *i == "wear depth")
            .unwrap();
        assert!(of_p90.sensitivity.total[depth].value > 0.3);
        let none = Tolerances {
            modules: 0.0,
            scenario: 0.0,
            rows: 64,
        };
        let error = indices(&none).unwrap_err();
        assert!(
            format!("{error:#}").contains("does not depend"),
            "{error:#}"
        );
    }

    /// Slope deviations move what is sampled, and are named with the field that they are drawn with.
    #[test]
    fn slope_deviations_are_part_of_the_random_input() {
        let (perfect, optimum) = figure_9();
        let mut campaign = perfect.campaign().clone();
        let flank_class = gear::FlankClass::new(9).unwrap();
        let manufacture = problem::file::Manufacture {
            flank_class: Some(flank_class),
            ..Default::default()
        };
        campaign.gears_mut().unwrap().manufacture = Some(manufacture);
        let problem = Problem::new(campaign);
        let rows = scenarios(&problem, &optimum).unwrap();
        let sampling = &problem.campaign().sampling;
        let as_designed = sampling.verified(&optimum.verified).unwrap();
        assert!(rows[0].p90.value > as_designed.value);
        let tolerances = Tolerances {
            modules: 0.01,
            scenario: 0.2,
            rows: 64,
        };
        let total = |problem: &Problem, name: &str| {
            let found = indices(problem, &optimum, &tolerances).unwrap();
            let of_one = &found[1];
            assert_eq!(of_one.inputs[9], name);
            of_one.sensitivity.total[9].value * of_one.sensitivity.variance
        };
        let with = total(&problem, "wear field and manufacture");
        assert!(with > 1.2 * total(&perfect, "wear field"), "{with}");
    }
}
