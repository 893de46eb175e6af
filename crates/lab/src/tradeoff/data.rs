//! A campaign's DoE, sampled in this thread with the samples that workers would draw.

use std::collections::BTreeMap;

use campaign::file::ControlVariate;
use campaign::formulation::{Design, Problem};
use campaign::simulator::State;
use campaign::task::{Output, Source, compute};
use ledger::{Generation, StreamId, Unit};
use stages::responses::{self, Samples};
use stats::streams::Purpose;
use store::{DesignRow, ResponseRow};

/// A sampled DoE.
pub(crate) struct Doe {
    /// All designs.
    pub(crate) designs: Vec<DesignRow>,
    /// The responses of the simulable designs.
    pub(crate) responses: Vec<ResponseRow>,
    /// The numbers of the feasible designs.
    pub(crate) feasible: Vec<u64>,
    /// Number of simulator calls.
    pub(crate) calls: u64,
}

/// Creates and samples the campaign's DoE; `base` has the values of the variables that the campaign
/// does not vary.
pub(crate) fn sampled(problem: &Problem, base: &Design) -> anyhow::Result<Doe> {
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
        let samples = Samples {
            values: &samples,
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
