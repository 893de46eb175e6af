//! The tooth models against finite elements, with their cost.

use std::hint::black_box;

use gear::{Discretisation, Kernel, ToothModel, Wear, WearLaw};
use stats::streams::{Purpose, stream};

use crate::contact::{CLASSES, Case, Difference, cases};
use crate::summary::{median, quantile};
use crate::tradeoff::clock::micros;
use crate::tradeoff::front::Rule;
use crate::tradeoff::size::Size;
use crate::tradeoff::table::{Row, Table};
use crate::tradeoff::view::{self, Reading};

pub(crate) const LEAD: &str = "Tooth models against finite elements: 288 load cases of 24 spur and helical pairs, bare, relieved, worn, \
     misaligned and crowned, and as “unseen pairs” 264 cases of 22 pairs that influenced no choice. An error of \
     0.05 µm in ΔSTE counts as 5 %. CPU times are of a sample with random wear and of a new design. The tooth model \
     whole-face-beam refuses crowning and helix slopes, so those cases do not count for it.";

const COLUMNS: [&str; 8] = [
    "CPU time a sample, median (µs)",
    "CPU time a sample, 95th percentile (µs)",
    "CPU time a design, median (µs)",
    "error of ΔSTE, median (%)",
    "error of ΔSTE, 95th percentile (%)",
    "bias of ΔSTE, median (%)",
    "error of the mean STE, 95th percentile (%)",
    "error of the greatest pressure, 95th percentile (%)",
];

pub(crate) const PAIRS: &[view::Pair] = &[view::Pair {
    cost: 0,
    error: 4,
    reading: Reading::Choice(Rule::Within(15.0)),
}];

/// Phases of the coupled model.
const PHASES: [usize; 5] = [12, 16, 24, 32, 48];
/// Number of samples that are timed together.
const TIMED: u64 = 20;

/// The wear of the timed samples.
const WEAR: Wear = Wear {
    law: WearLaw::Archard { max_depth_um: 3.0 },
    kernel: Kernel::SquaredExponential,
    range: 0.2,
    variance: 0.01,
    life: None,
};

/// The measurements of one case with one model and grid.
struct Measurement<'a> {
    case: &'a Case,
    sample_micros: f64,
    design_micros: f64,
    difference: Difference,
}

pub(crate) fn run(size: Size, progress: &mut dyn FnMut(&str)) -> anyhow::Result<Table> {
    let cases = cases();
    // A quick measurement takes every third case and a test fewer, of all pairs.
    let step = cases.len()
        / size
            .designs(cases.len(), cases.len() / 3)
            .clamp(1, cases.len());
    let cases: Vec<&Case> = cases.iter().step_by(step).collect();
    let mut table = Table::new(&COLUMNS);
    let mut rows: Vec<Vec<Row>> = CLASSES.iter().map(|_| Vec::new()).collect();
    for &model in ToothModel::ALL {
        let own = Discretisation::of(model);
        let mut phases = vec![own.phases];
        if model == ToothModel::Coupled {
            phases = size.pick(PHASES.to_vec(), vec![16, 24, 32], vec![24]);
        }
        for phases in phases {
            let grid = Discretisation { phases, ..own };
            let measured = cases
                .iter()
                .filter_map(|case| measure(case, model, &grid).transpose())
                .collect::<Result<Vec<_>, _>>()?;
            for (class, rows) in CLASSES.iter().zip(&mut rows) {
                let of_class: Vec<&Measurement<'_>> =
                    measured.iter().filter(|one| one.case.is(class)).collect();
                if !of_class.is_empty() {
                    rows.push(row(class, model, &grid, grid == own, &of_class));
                }
            }
            progress(&format!(
                "contact: {model}, {phases} phases, {} cases",
                measured.len()
            ));
        }
    }
    table.rows = rows.into_iter().flatten().collect();
    Ok(table)
}

/// `None` for a case that the model refuses.
fn measure<'a>(
    case: &'a Case,
    model: ToothModel,
    grid: &Discretisation,
) -> Result<Option<Measurement<'a>>, gear::Error> {
    let pair = match case.pair(model, grid) {
        Err(gear::Error::Input(_)) => return Ok(None),
        pair => pair?,
    };
    let mut sampler = pair.sampler(&WEAR);
    let all = micros(|| {
        for sample in 0..TIMED {
            black_box(sampler.draw(&mut stream(1, Purpose::Test, 0, sample)));
        }
    });
    Ok(Some(Measurement {
        case,
        sample_micros: all / TIMED as f64,
        design_micros: micros(|| case.pair(model, grid).map(|pair| pair.unworn())),
        difference: case.difference(&pair),
    }))
}

fn row(
    class: &str,
    model: ToothModel,
    grid: &Discretisation,
    is_default: bool,
    measured: &[&Measurement<'_>],
) -> Row {
    let of = |value: &dyn Fn(&Measurement<'_>) -> f64| -> Vec<f64> {
        measured.iter().map(|one| value(one)).collect()
    };
    let samples = of(&|one| one.sample_micros);
    let errors = of(&|one| one.difference.delta_ste);
    let size = |k: usize| quantile(&of(&|one| one.difference.relative[k].abs()), 0.95);
    Row {
        panel: class.to_owned(),
        method: model.to_string(),
        setting: format!("{} × {}", grid.cells, grid.phases),
        is_campaign: is_default && model == ToothModel::default(),
        values: vec![
            median(&samples),
            quantile(&samples, 0.95),
            median(&of(&|one| one.design_micros)),
            median(&errors),
            quantile(&errors, 0.95),
            median(&of(&|one| one.difference.relative[0])),
            size(1),
            size(2),
        ],
    }
}
