//! `coordinator sensitivity`: how the recommended design's P90 depends on the scenario of wear, and
//! on tolerances.
//!
//! Two questions, two tables. The first varies one parameter of the wear field at a time by a factor
//! and samples again. The second lets small deviations of the six variables and of the wear's
//! parameters vary together and splits the variance that follows among them (Sobol' indices).
//!
//! A deviation of a variable is one of manufacture: tools keep their module, so the module stays as
//! designed, and the centre distance at which the pair meshes without backlash follows.

use std::path::Path;

use anyhow::Context as _;
use campaign::Campaign;
use campaign::file::Sampling;
use campaign::formulation::Problem;
use campaign::formulation::gears::VARIABLE_NAMES;
use campaign::optimise::COMMON;
use campaign::task::VERIFICATION;
use campaign::{Design, Variant, WearFactors};
use report::Percentile;
use results::percentile::percentile;
use stats::streams::{Purpose, stream};
use stats::{Index, Sensitivity, SensitivityPlan};

use crate::finished::Optimum;
use crate::simulations::{Answer, Request, Simulations};
use crate::table::{Table, Written, exact, with_interval, write};

/// Names the wear profiles among which the field of a single sample is drawn.
const FIELDS: u64 = (1 << 40) + 1;

/// Number of bootstrap samples behind an interval.
const RESAMPLES: usize = 1000;

/// The parameters of the wear field, in the order of the inputs after the variables.
const SCENARIO: [&str; 3] = ["wear depth", "wear variance", "wear range"];

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

/// One line of the scenario table.
#[derive(Debug, Clone, PartialEq)]
pub struct Scenario {
    /// The parameter that is changed.
    pub parameter: &'static str,
    /// The factor by which it is changed.
    pub factor: f64,
    /// P90 from as many verification samples as the campaign verifies with.
    pub p90: Percentile,
}

/// The indices of one output.
#[derive(Debug, Clone, PartialEq)]
pub struct Indices {
    /// The output, in words.
    pub output: String,
    /// The inputs.
    pub inputs: Vec<String>,
    /// The indices of all inputs.
    pub sensitivity: Sensitivity,
}

/// The optimum of least verified P90, or that of the approach of that name.
///
/// # Errors
///
/// There is no such feasible optimum.
pub fn choose<'a>(
    sampling: &Sampling,
    optima: &'a [Optimum],
    approach: Option<&str>,
) -> anyhow::Result<&'a Optimum> {
    let p90 = |optimum: &Optimum| percentile(sampling, &optimum.verified).value;
    match approach {
        Some(name) => optima
            .iter()
            .find(|optimum| optimum.approach.name() == name)
            .with_context(|| format!("approach {name} found no feasible design")),
        None => optima
            .iter()
            .filter(|optimum| p90(optimum).is_finite())
            .min_by(|a, b| p90(a).total_cmp(&p90(b)))
            .context("no approach found a feasible design"),
    }
}

/// P90 of the design as verified, and with the wear field's variance, range and depth halved and
/// doubled. The random numbers are those of the verification.
///
/// # Errors
///
/// The errors of the simulations, or the design cannot be simulated; none of the latter for one
/// from the campaign's store.
pub fn scenarios(
    simulations: &dyn Simulations,
    problem: &Problem,
    optimum: &Optimum,
) -> anyhow::Result<Vec<Scenario>> {
    let one = ["as designed"].map(|parameter| (parameter, 1.0));
    let varied = ["wear variance", "wear range", "wear depth"]
        .into_iter()
        .flat_map(|parameter| [0.5, 2.0].map(|factor| (parameter, factor)));
    let scenarios: Vec<_> = one.into_iter().chain(varied).collect();
    let request = |(parameter, factor): &(&str, f64)| {
        let mut variant = Variant::new(optimum.variables.into(), VERIFICATION);
        match *parameter {
            "wear variance" => variant.wear.variance = *factor,
            "wear range" => variant.wear.range = *factor,
            "wear depth" => variant.wear.depth = *factor,
            _ => {}
        }
        Request {
            variant,
            samples: 0..optimum.verified.len() as u32,
        }
    };
    let requests: Vec<Request> = scenarios.iter().map(request).collect();
    let answers = simulations.simulate(&requests)?;
    let scenario = |((parameter, factor), answer): ((&'static str, f64), Answer)| {
        let samples = answer.samples_of("the optimum")?;
        Ok(Scenario {
            parameter,
            factor,
            p90: percentile(&problem.campaign().sampling, &samples),
        })
    };
    scenarios.into_iter().zip(answers).map(scenario).collect()
}

/// First-order and total indices of P90 (from the common samples of the campaign's number), and of
/// the ΔSTE of one worn pair, whose wear field is one input more, together with the slope deviations
/// of a campaign with a flank class.
///
/// # Errors
///
/// The errors of the simulations; or the design has no module, tolerances leave no design that can
/// be simulated, or nothing varies.
pub fn indices(
    simulations: &dyn Simulations,
    problem: &Problem,
    optimum: &Optimum,
    tolerances: &Tolerances,
) -> anyhow::Result<Vec<Indices>> {
    let names = &VARIABLE_NAMES[..DEVIATING];
    let inputs: Vec<String> = names
        .iter()
        .chain(&SCENARIO)
        .map(ToString::to_string)
        .collect();
    let nominal = Design::from(optimum.variables);
    let gears = problem.gears().context("manufacture is varied of gears")?;
    let module = gears.normal_module(&nominal)?;
    let at = |point: &[f64], stream| Variant {
        normal_module_mm: Some(module),
        ..deviated(&nominal, tolerances, point, stream)
    };
    let samples_per_design = problem.campaign().sampling.samples_per_design;
    let of_p90 = |point: &[f64]| Request {
        variant: at(point, COMMON),
        samples: 0..samples_per_design,
    };
    let of_sample = |point: &[f64]| {
        // The field is drawn from 2³² numbered ones, so that its number is a uniform input.
        let number = (point[inputs.len()] * f64::from(u32::MAX)) as u32;
        let number = number.min(u32::MAX - 1);
        Request {
            variant: at(point, (Purpose::Wear, FIELDS)),
            samples: number..number + 1,
        }
    };
    // The sample's one stream gives both.
    let field = match gears.flank_class() {
        Some(_) => "wear field and profile slopes",
        None => "wear field",
    };
    let with_field = [&inputs[..], &[field.to_owned()]].concat();
    let analyse = |output: &str, inputs, number, request: &dyn Fn(&[f64]) -> Request| {
        analyse(
            simulations,
            problem,
            output,
            inputs,
            tolerances,
            number,
            request,
        )
    };
    Ok(vec![
        analyse(
            &problem.campaign().sampling.percentile_name(),
            inputs.clone(),
            0,
            &of_p90,
        )?,
        analyse("ΔSTE of one worn pair", with_field, 1, &of_sample)?,
    ])
}

/// The design and the wear at a point of the unit cube.
fn deviated(
    nominal: &Design,
    tolerances: &Tolerances,
    point: &[f64],
    stream: (Purpose, u64),
) -> Variant {
    let deviation = |input: usize, size: f64| size * (2.0 * point[input] - 1.0);
    let mut values = nominal.values().to_vec();
    for (input, value) in values[..DEVIATING].iter_mut().enumerate() {
        *value += deviation(input, tolerances.modules);
    }
    let factor = |number: usize| 1.0 + deviation(DEVIATING + number, tolerances.scenario);
    Variant {
        wear: WearFactors {
            depth: factor(0),
            variance: factor(1),
            range: factor(2),
        },
        ..Variant::new(Design::new(values), stream)
    }
}

fn analyse(
    simulations: &dyn Simulations,
    problem: &Problem,
    output: &str,
    inputs: Vec<String>,
    tolerances: &Tolerances,
    number: u32,
    request: &dyn Fn(&[f64]) -> Request,
) -> anyhow::Result<Indices> {
    let plan = SensitivityPlan::new(inputs.len(), tolerances.rows, number)?;
    let requests: Vec<Request> = (0..plan.len())
        .map(|index| request(&plan.point(index)))
        .collect();
    // The percentile of a single sample is that sample.
    let value = |answer| match answer {
        Answer::Refused(_) => f64::NAN,
        Answer::Simulated { samples, .. } => match samples[..] {
            [sample] => sample,
            _ => percentile(&problem.campaign().sampling, &samples).value,
        },
    };
    let answers = simulations.simulate(&requests)?;
    let outputs: Vec<f64> = answers.into_iter().map(value).collect();
    let seed = problem.campaign().seed;
    let mut rng = stream(seed, Purpose::Wear, FIELDS + 1, u64::from(number));
    let sensitivity = plan
        .analyse(&outputs, RESAMPLES, &mut rng)
        .with_context(|| format!("the indices of {output}"))?;
    Ok(Indices {
        output: output.to_owned(),
        inputs,
        sensitivity,
    })
}

/// Writes `scenarios.csv`, `indices.csv` and `sensitivity.md` into `out`; returns what it wrote.
///
/// # Errors
///
/// A file cannot be written.
pub fn write_tables(
    out: &Path,
    campaign: &Campaign,
    optimum: &Optimum,
    tolerances: &Tolerances,
    scenarios: &[Scenario],
    indices: &[Indices],
) -> anyhow::Result<Written> {
    let name = &campaign.name;
    let [value, low, high] = campaign.sampling.percentile_columns();
    let mut table = Table::new(["parameter", "factor", &value, &low, &high]);
    let percentile = campaign.sampling.percentile_name();
    let mut shown = Table::new(["scenario", &format!("{percentile}, µm")]);
    for row in scenarios {
        let p90 = &row.p90;
        let figures = [row.factor, p90.value, p90.low, p90.high].map(exact);
        table
            .rows
            .push([vec![row.parameter.to_owned()], figures.to_vec()].concat());
        let label = if row.factor == 1.0 {
            row.parameter.to_owned()
        } else {
            format!("{} × {}", row.parameter, row.factor)
        };
        shown.rows.push(vec![label, with_interval(p90)]);
    }
    write(out, "scenarios.csv", table.csv()?)?;
    let figures = index_figures(indices);
    write(out, "indices.csv", figures.csv()?)?;
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
    for one in indices {
        let found = &one.sensitivity;
        let mut shown = Table::new(["input", "first-order index", "total index"]);
        let index = |i: &Index| format!("{:.3} [{:.3}; {:.3}]", i.value, i.low, i.high);
        for ((input, first), total) in one.inputs.iter().zip(&found.first).zip(&found.total) {
            shown
                .rows
                .push(vec![(*input).to_owned(), index(first), index(total)]);
        }
        page += &format!(
            "\n{}: mean {:.3} µm, standard deviation {:.3} µm",
            one.output,
            found.mean,
            found.variance.sqrt()
        );
        if found.left_out > 0 {
            page += &format!(
                "; {} of {} rows left out, because a deviated pair cannot be simulated",
                found.left_out, tolerances.rows
            );
        }
        page += &format!(".\n\n{}", shown.markdown());
    }
    write(out, "sensitivity.md", &page)?;
    Ok(Written {
        page,
        tables: vec![("scenarios", table), ("indices", figures)],
    })
}

fn index_figures(indices: &[Indices]) -> Table {
    let mut table = Table::new([
        "output",
        "input",
        "first",
        "first_low",
        "first_high",
        "total",
        "total_low",
        "total_high",
    ]);
    for one in indices {
        let found = &one.sensitivity;
        for ((input, first), total) in one.inputs.iter().zip(&found.first).zip(&found.total) {
            let figures = [first, total].map(|i| [i.value, i.low, i.high].map(exact));
            let mut line = vec![one.output.clone(), (*input).to_owned()];
            line.extend(figures.concat());
            table.rows.push(line);
        }
    }
    table
}

#[cfg(test)]
mod tests {
    use campaign::{Approach, Campaign};

    use super::*;
    use crate::simulations::InProcess;

    /// The optimum of Figure 9 with the campaign's own random numbers.
    fn figure_9() -> (Problem, Optimum) {
        let mut campaign = Campaign::parse("paper.toml", Campaign::PAPER).unwrap();
        campaign.sampling.samples_per_design = 10;
        campaign.verify.samples = Some(200);
        let problem = Problem::new(campaign);
        let design = stages::references::design(gear::paper::printed::Place::Figure(9));
        let gears = problem.gears().unwrap();
        let pair = gears.pair(&design).unwrap();
        let variant = Variant::new(design.clone(), VERIFICATION);
        let request = Request {
            variant,
            samples: 0..200,
        };
        let answer = InProcess(&problem).simulate(&[request]).unwrap().remove(0);
        let optimum = Optimum {
            approach: Approach::Baseline,
            variables: design.gears(),
            criteria: gears.pair_criteria(&pair, 1000.0),
            verified: answer.samples_of("Figure 9").unwrap(),
        };
        (problem, optimum)
    }

    #[test]
    fn the_scenario_as_designed_is_the_verification_and_more_wear_is_worse() {
        let (problem, optimum) = figure_9();
        let rows = scenarios(&InProcess(&problem), &problem, &optimum).unwrap();
        assert_eq!(rows.len(), 7);
        assert_eq!(
            rows[0].p90,
            percentile(&problem.campaign().sampling, &optimum.verified)
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
        let here = &InProcess(&problem);
        let indices = |tolerances| indices(here, &problem, &optimum, tolerances);
        let found = indices(&tolerances).unwrap();
        assert_eq!(found, indices(&tolerances).unwrap());
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
        let manufacture = campaign::file::Manufacture { flank_class: 9 };
        campaign.gears_mut().unwrap().manufacture = Some(manufacture);
        let problem = Problem::new(campaign);
        let rows = scenarios(&InProcess(&problem), &problem, &optimum).unwrap();
        let as_designed = percentile(&problem.campaign().sampling, &optimum.verified);
        assert!(rows[0].p90.value > as_designed.value);
        let tolerances = Tolerances {
            modules: 0.01,
            scenario: 0.2,
            rows: 64,
        };
        let total = |problem: &Problem, name: &str| {
            let found = indices(&InProcess(problem), problem, &optimum, &tolerances).unwrap();
            let of_one = &found[1];
            assert_eq!(of_one.inputs[9], name);
            of_one.sensitivity.total[9].value * of_one.sensitivity.variance
        };
        let with = total(&problem, "wear field and profile slopes");
        assert!(with > 1.2 * total(&perfect, "wear field"), "{with}");
    }

    #[test]
    fn the_design_of_least_percentile_is_recommended_unless_another_is_asked_for() {
        let (problem, first) = figure_9();
        let sampling = &problem.campaign().sampling;
        let second = Optimum {
            approach: Approach::Kriging,
            verified: first.verified.iter().map(|sample| 0.5 * sample).collect(),
            ..first.clone()
        };
        let optima = [first, second];
        assert_eq!(
            choose(sampling, &optima, None).unwrap().approach,
            Approach::Kriging
        );
        let asked = choose(sampling, &optima, Some("archard")).unwrap();
        assert_eq!(asked.approach, Approach::Baseline);
        assert!(choose(sampling, &optima, Some("no-wear")).is_err());
        assert!(choose(sampling, &[], None).is_err());
    }
}
