//! The cost of a grid of the simulator, and its error.
//!
//! The errors of ΔSTE are relative to the converged value of the same design and, with random wear,
//! of the same random numbers. The plain sum ([`PlainSum`]) uses compliance and gap of the
//! converged pair, and its time does not include drawing the random field.

use std::hint::black_box;

use anyhow::{Context as _, bail};
use gear::{Discretisation, Pair, PairInput, PlainSum, Sampler, ToothModel, Wear};
use problem::formulation::Problem;
use rand::RngExt as _;
use stats::streams::{Purpose, stream};

use crate::summary::{median, quantile};
use crate::tradeoff::clock::micros;
use crate::tradeoff::front::Rule;
use crate::tradeoff::size::Size;
use crate::tradeoff::table::{Row, Table};
use crate::tradeoff::view::{self, Reading};

pub(crate) const LEAD: &str = "Error of ΔSTE against the converged value of the same design, at random designs of the campaign's box, and CPU time \
     of a worn sample and of a new design with its analyses without wear and with Archard's wear. Each tooth model has \
     its own converged values and its own chart. The plain sum is the textbook calculation, phase by phase and slice by \
     slice; its time does not include the random field.";

const COLUMNS: [&str; 8] = [
    "CPU time a sample (µs)",
    "CPU time a design (µs)",
    "error with random wear, median (%)",
    "error with random wear, 95th percentile (%)",
    "error without wear, median (%)",
    "error without wear, 95th percentile (%)",
    "error with Archard’s wear, median (%)",
    "error with Archard’s wear, 95th percentile (%)",
];

/// Half a percent of ΔSTE is below the uncertainty of random wear and 500 verification samples.
const TOLERANCE: Rule = Rule::Within(0.5);

pub(crate) const PAIRS: &[view::Pair] = &[
    view::Pair {
        cost: 0,
        error: 3,
        reading: Reading::Choice(TOLERANCE),
    },
    view::Pair {
        cost: 1,
        error: 7,
        reading: Reading::Choice(TOLERANCE),
    },
];

/// Numbers of cells and phases.
const GRIDS: [[usize; 2]; 10] = [
    [12, 8],
    [16, 12],
    [24, 12],
    [32, 16],
    [48, 24],
    [64, 32],
    [96, 48],
    [128, 64],
    [192, 96],
    [256, 128],
];
/// Numbers of cells and phases for coupled cells, whose finest grid has 96 phases.
const COUPLED_GRIDS: [[usize; 2]; 5] = [[64, 12], [64, 16], [64, 24], [64, 32], [64, 48]];
/// Numbers of samples per design: for the error and for the time.
const COMPARED: u64 = 4;
const TIMED: u64 = 20;
/// Number of designs refused in a row after which the campaign's box counts as empty.
const REFUSED: usize = 10_000;
/// Relative change at which a value counts as converged.
const CONVERGED: f64 = 1e-6;

/// A design with its converged values of ΔSTE, in µm.
struct Reference {
    input: PairInput,
    unworn: f64,
    archard: f64,
    random: Vec<f64>,
    /// The positions and gaps of the samples, for the plain sum.
    nodes: Vec<f64>,
    gaps: Vec<Vec<f64>>,
    pair: Pair,
}

/// The times and errors of one method, for all designs.
#[derive(Default)]
struct Measurements {
    design_micros: Vec<f64>,
    sample_micros: Vec<f64>,
    unworn: Vec<f64>,
    archard: Vec<f64>,
    random: Vec<f64>,
}

pub(crate) fn run(
    problem: &Problem,
    size: Size,
    progress: &mut dyn FnMut(&str),
) -> anyhow::Result<Table> {
    let gears = problem.gears().context("the campaign designs no gears")?;
    let own = gears.pair_input(problem.base()).tooth_model;
    let mut models = vec![own];
    let others = ToothModel::ALL.iter().filter(|model| **model != own);
    models.extend(others.filter(|model| match size {
        Size::Full => true,
        _ => **model == ToothModel::WeberBanaschek,
    }));
    let (wear, own_grid) = (gears.wear(), gears.discretisation());
    let own_grid = [own_grid.cells, own_grid.phases];
    let mut table = Table::new(&COLUMNS);
    for model in models {
        let is_coupled = model == ToothModel::Coupled;
        let mut grids = match is_coupled {
            true => COUPLED_GRIDS.to_vec(),
            false => GRIDS.to_vec(),
        };
        if model == own && !grids.contains(&own_grid) {
            grids.push(own_grid);
            grids.sort_unstable();
        }
        let references = references(problem, model, size.designs(200, 40))?;
        let mut of_grids: Vec<Measurements> =
            grids.iter().map(|_| Measurements::default()).collect();
        let mut of_plain = Measurements::default();
        let method = match is_coupled {
            true => "coupled cells",
            false => "prefix sums",
        };
        // Design by design, so that a temporary slowdown of the machine affects all grids alike.
        for (number, reference) in references.iter().enumerate() {
            for (&[cells, phases], measured) in grids.iter().zip(&mut of_grids) {
                measured.ours(reference, number, wear, &Discretisation { cells, phases })?;
            }
            if !is_coupled {
                of_plain.plain(reference, wear);
            }
        }
        for (&grid, measured) in grids.iter().zip(&of_grids) {
            let is_campaign = model == own && grid == own_grid;
            let row = measured.row(model, method, grid, is_campaign);
            table.rows.push(row);
        }
        if !is_coupled {
            let row = of_plain.row(model, "plain sum", PlainSum::TEXTBOOK, false);
            table.rows.push(row);
        }
        progress(&format!("simulator: {model}, {} designs", references.len()));
    }
    Ok(table)
}

/// Returns `count` simulable random designs of the campaign's box.
fn references(
    problem: &Problem,
    tooth_model: ToothModel,
    count: usize,
) -> anyhow::Result<Vec<Reference>> {
    let gears = problem.gears().context("the campaign designs no gears")?;
    let mut rng = stream(problem.campaign().seed, Purpose::Test, 0, 0);
    let mut references = Vec::new();
    let mut refused = 0;
    while references.len() < count {
        let unit: Vec<f64> = (0..problem.dimension()).map(|_| rng.random()).collect();
        let design = problem.design(&problem.free_point(&unit), problem.base());
        let input = PairInput {
            tooth_model,
            ..gears.pair_input(&design)
        };
        match reference(input, gears.wear(), references.len()) {
            Ok(reference) => {
                references.push(reference);
                refused = 0;
            }
            Err(gear::Error::Infeasible(_)) if refused < REFUSED => refused += 1,
            Err(gear::Error::Infeasible(why)) => {
                bail!("none of {REFUSED} random designs can be simulated, the last because {why}")
            }
            Err(error) => return Err(error.into()),
        }
    }
    Ok(references)
}

fn reference(input: PairInput, wear: &Wear, design: usize) -> Result<Reference, gear::Error> {
    let pair = Pair::converged(&input, wear, CONVERGED)?.pair;
    let mut sampler = pair.sampler(wear);
    let (mut random, mut gaps) = (Vec::new(), Vec::new());
    for sample in 0..COMPARED {
        let mut rng = stream(2009, Purpose::Test, design as u64, sample);
        let profile = sampler.draw_profile(&mut rng);
        random.push(profile.delta_ste_um);
        let [pinion, mate] = &profile.depth;
        gaps.push(pinion.iter().zip(mate).map(|(a, b)| a + b).collect());
    }
    let worn = pair.archard(wear);
    Ok(Reference {
        input,
        unworn: pair.unworn().delta_ste_um,
        archard: worn.analysis.delta_ste_um,
        random,
        nodes: worn.s,
        gaps,
        pair,
    })
}

fn draw(sampler: &mut Sampler, design: usize, sample: u64) -> f64 {
    sampler.draw(&mut stream(2009, Purpose::Test, design as u64, sample))
}

fn percent(ours: f64, exact: f64) -> f64 {
    100.0 * (ours / exact - 1.0).abs()
}

impl Measurements {
    fn ours(
        &mut self,
        reference: &Reference,
        number: usize,
        wear: &Wear,
        grid: &Discretisation,
    ) -> Result<(), gear::Error> {
        let pair = Pair::new(&reference.input, grid)?;
        self.design_micros.push(micros(|| {
            let pair = Pair::new(&reference.input, grid);
            pair.map(|pair| {
                black_box((pair.sliding(), pair.interference(), pair.root_stress()));
                (pair.unworn(), pair.archard(wear))
            })
        }));
        self.note_unworn(pair.unworn().delta_ste_um, reference);
        self.note_archard(pair.archard(wear).analysis.delta_ste_um, reference);
        let mut sampler = pair.sampler(wear);
        for (sample, &exact) in (0..).zip(&reference.random) {
            let found = draw(&mut sampler, number, sample);
            self.random.push(percent(found, exact));
        }
        let all = micros(|| {
            for sample in 0..TIMED {
                black_box(draw(&mut sampler, number, sample));
            }
        });
        self.sample_micros.push(all / TIMED as f64);
        Ok(())
    }

    fn plain(&mut self, reference: &Reference, wear: &Wear) {
        let sum = || PlainSum::new(&reference.pair, &reference.nodes, PlainSum::TEXTBOOK);
        let zero = vec![0.0; reference.nodes.len()];
        self.design_micros
            .push(micros(|| sum().delta_ste_um(&zero)));
        let mut sum = sum();
        self.note_unworn(sum.delta_ste_um(&zero), reference);
        let [pinion, mate] = reference.pair.archard(wear).depth;
        let gap: Vec<f64> = pinion.iter().zip(&mate).map(|(a, b)| a + b).collect();
        self.note_archard(sum.delta_ste_um(&gap), reference);
        for (gap, &exact) in reference.gaps.iter().zip(&reference.random) {
            self.random.push(percent(sum.delta_ste_um(gap), exact));
        }
        let all = micros(|| {
            for gap in &reference.gaps {
                black_box(sum.delta_ste_um(gap));
            }
        });
        self.sample_micros.push(all / COMPARED as f64);
    }

    fn note_unworn(&mut self, delta_ste_um: f64, reference: &Reference) {
        self.unworn.push(percent(delta_ste_um, reference.unworn));
    }

    fn note_archard(&mut self, delta_ste_um: f64, reference: &Reference) {
        self.archard.push(percent(delta_ste_um, reference.archard));
    }

    fn row(&self, model: ToothModel, method: &str, grid: [usize; 2], is_campaign: bool) -> Row {
        let mut values = vec![median(&self.sample_micros), median(&self.design_micros)];
        for errors in [&self.random, &self.unworn, &self.archard] {
            values.extend([median(errors), quantile(errors, 0.95)]);
        }
        Row {
            panel: model.to_string(),
            method: method.to_owned(),
            setting: format!("{} × {}", grid[0], grid[1]),
            is_campaign,
            values,
        }
    }
}
