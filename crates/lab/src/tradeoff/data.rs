//! Designs to measure at: a campaign's DoE with its samples, and random designs.

use std::collections::BTreeMap;

use anyhow::Context as _;
use ledger::{Generation, StreamId, Unit};
use problem::file::ControlVariate;
use problem::formulation::{Design, Problem};
use problem::simulator::State;
use problem::task::{Output, Source, compute};
use rand::{Rng, RngExt as _};
use stages::responses::{self, ControlledSamples};
use stats::streams::Purpose;
use store::{DesignRow, ResponseRow};

/// Constraint violation up to which a design is nearly feasible.
const NEARLY: f64 = 0.5;
/// Maximum number of random designs tried.
pub(crate) const TRIES: usize = 100_000;

/// A sampled DoE.
pub(crate) struct Doe {
    pub(crate) designs: Vec<DesignRow>,
    /// The responses of the simulable designs.
    pub(crate) responses: Vec<ResponseRow>,
    /// The numbers of the feasible designs.
    pub(crate) feasible: Vec<u64>,
    pub(crate) calls: u64,
}

/// Creates the campaign's DoE and draws in this thread the samples that workers would draw. `base` has the values of
/// the variables that the campaign does not vary.
pub(crate) fn sample_doe(problem: &Problem, base: &Design) -> anyhow::Result<Doe> {
    let settings = &problem.campaign().sampling;
    let designs = stages::designs::make(problem, &[])?;
    let linear = match settings.control {
        ControlVariate::None => BTreeMap::new(),
        ControlVariate::Linearised => responses::linearise(problem, base, &designs),
    };
    let mut doe = Doe {
        responses: Vec::new(),
        feasible: Vec::new(),
        // Counted as in the campaign: one call without wear, and for simulable designs one with
        // Archard's wear.
        calls: designs.len() as u64,
        designs,
    };
    for row in &doe.designs {
        let design = problem.design(&row.x, base);
        let unit = Unit {
            stream: StreamId::design(row.design as u32),
            generation: Generation(0),
            samples: 0..settings.samples_per_design,
        };
        let output = compute(problem, &unit, &Source::Design(design.clone()));
        let Output::Design {
            responses: values,
            samples,
            ..
        } = output.map_err(anyhow::Error::msg)?
        else {
            continue;
        };
        doe.calls += 1 + samples.len() as u64;
        if samples.is_empty() {
            continue;
        }
        let control = linear.get(&row.design).map(|linear| {
            doe.calls += linear.analyses();
            let stream = (Purpose::Wear, row.design);
            let controls = responses::controls(problem, stream, linear, samples.len());
            (controls, linear.moments())
        });
        let drawn = problem.objective().values(&samples);
        let samples = ControlledSamples {
            values: &drawn,
            control: control
                .as_ref()
                .map(|(values, known)| (&values[..], *known)),
        };
        let response = responses::response_of(row.design, samples, settings)?;
        doe.responses.push(response);
        let worn = problem.analysis(&design, &values, State::Baseline);
        if worn.is_some_and(|worn| problem.is_feasible(&worn.criteria)) {
            doe.feasible.push(row.design);
        }
    }
    Ok(doe)
}

/// Draws [`TRIES`] random designs from the campaign's box. Returns the gear pairs that keep the constraints or nearly
/// do.
pub(crate) fn nearly_feasible<'a>(
    problem: &'a Problem,
    rng: &'a mut impl Rng,
) -> anyhow::Result<impl Iterator<Item = gear::Pair> + 'a> {
    let gears = problem.gears().context("the campaign designs no gears")?;
    Ok((0..TRIES).filter_map(move |_| {
        let unit: Vec<f64> = (0..problem.dimension()).map(|_| rng.random()).collect();
        let design = problem.design(&problem.free_point(&unit), problem.base());
        let pair = gears.pair(&design).ok()?;
        let criteria = gears.pair_criteria(&pair, 0.0).into();
        (problem.violation(&criteria) <= NEARLY).then_some(pair)
    }))
}
