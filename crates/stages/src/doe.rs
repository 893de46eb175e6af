//! The DoE as the store holds it: its designs, with their criteria and the measures of their samples.

use std::collections::BTreeMap;

use problem::formulation::{Criteria, Design, Problem};
use problem::simulator::State;
use store::{CriteriaRow, DesignRow, ResponseRow, Store};

/// The tables of a DoE.
#[derive(Debug, Clone, Default)]
pub struct Doe {
    /// The designs, in the order of their numbers.
    pub designs: Vec<DesignRow>,
    /// The deterministic responses.
    pub criteria: Vec<CriteriaRow>,
    /// The measure that is optimised.
    pub responses: Vec<ResponseRow>,
    /// The measures that constraints limit.
    pub limited: Vec<ResponseRow>,
}

impl Doe {
    /// Reads the tables.
    pub async fn read(store: &Store) -> Result<Self, store::Error> {
        Ok(Self {
            designs: store.designs().await?,
            criteria: store.criteria().await?,
            responses: store.responses().await?,
            limited: store.limited_responses().await?,
        })
    }

    /// The estimates of the measures that constraints limit, with their variances, for the designs that have all of
    /// them.
    #[must_use]
    pub fn estimates(&self, problem: &Problem) -> BTreeMap<u64, Vec<(f64, f64)>> {
        let count = problem.limited().len();
        let mut estimates: BTreeMap<u64, Vec<(f64, f64)>> = BTreeMap::new();
        // The rows are sorted by number.
        for row in &self.limited {
            let of_design = estimates.entry(row.design).or_default();
            of_design.push((row.measure, row.measure_variance));
        }
        estimates.retain(|_, all| all.len() == count);
        estimates
    }

    /// The deterministic criteria of the simulable designs, in the baseline state, by their numbers.
    #[must_use]
    pub fn evaluated(&self, problem: &Problem, base: &Design) -> BTreeMap<u64, Criteria> {
        let evaluated = self.criteria.iter().filter_map(|row| {
            let design = self.designs.get(row.design as usize)?;
            Some((row.design, criteria_of(problem, base, design, row)?))
        });
        evaluated.collect()
    }

    /// The simulable designs by their numbers, with their criteria: those of the baseline state, and the bounds of the
    /// measures that constraints limit. A design that lacks one of these measures is left out.
    #[must_use]
    pub fn judged(&self, problem: &Problem, base: &Design) -> BTreeMap<u64, (Design, Criteria)> {
        let estimates = self.estimates(problem);
        let none = Vec::new();
        let evaluated = self.evaluated(problem, base).into_iter();
        let judged = evaluated.filter_map(|(number, criteria)| {
            let design = problem.design(&self.designs.get(number as usize)?.x, base);
            let estimates = match problem.limited() {
                [] => &none,
                _ => estimates.get(&number)?,
            };
            let criteria = problem.with_limited(&criteria, &bounds(problem, estimates));
            Some((number, (design, criteria)))
        });
        judged.collect()
    }

    /// Those of the [judged](Self::judged) designs that satisfy every constraint.
    #[must_use]
    pub fn feasible(&self, problem: &Problem, base: &Design) -> BTreeMap<u64, (Design, Criteria)> {
        let mut designs = self.judged(problem, base);
        designs.retain(|_, (_, criteria)| problem.is_feasible(criteria));
        designs
    }
}

/// The deterministic criteria of a design in the baseline state, if it could be simulated.
pub(crate) fn criteria_of(
    problem: &Problem,
    base: &Design,
    design: &DesignRow,
    row: &CriteriaRow,
) -> Option<Criteria> {
    let responses = row.responses.as_ref()?;
    let design = problem.design(&design.x, base);
    let analysis = problem.analysis(&design, responses, State::Baseline)?;
    Some(analysis.criteria)
}

/// The values by which constraints on these estimates are judged.
pub(crate) fn bounds(problem: &Problem, estimates: &[(f64, f64)]) -> Vec<f64> {
    let limited = problem.limited().iter().zip(estimates);
    limited
        .map(|(measured, (value, variance))| measured.bound(*value, *variance))
        .collect()
}
