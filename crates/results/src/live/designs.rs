//! The designs of the DoE with their measures, including those still being sampled.
//!
//! The campaign computes its responses when all samples are stored. Until then, this module
//! estimates a measure for each design that has its first samples, by the campaign's own rule
//! but without a control variate. Each measure is computed once, and only a few at a time, so
//! that viewing a large campaign costs little.

use std::collections::BTreeMap;

use problem::formulation::Problem;
use stages::cost::Cost;
use stages::responses::{Samples, response_of};
use stages::{choosing, names, optima};
use stats::Verified;
use store::{CriteriaRow, DesignRow, Progress, ResponseRow, Store};

use crate::live::views::{BestOfDoe, Point};
use crate::optima::Optima;

/// The normal deviate of a two-sided 95 % interval.
const Z95: f64 = 1.959_963_984_540_054;
/// Maximum number of preliminary measures computed at a time.
const DESIGNS_AT_ONCE: usize = 500;
/// Approximate maximum number of samples that they are computed from.
const SAMPLES_AT_ONCE: usize = 100_000;

/// The designs with their measures.
#[derive(Debug, Default)]
pub(crate) struct Designs {
    /// The store's progress at the last reading.
    seen: Option<Progress>,
    designs: Vec<DesignRow>,
    criteria: Vec<CriteriaRow>,
    /// The campaign's responses; empty until they are computed.
    responses: Vec<ResponseRow>,
    /// Percentiles of the first samples; `None` if too many samples failed.
    preliminary: BTreeMap<u64, Option<ResponseRow>>,
    /// Whether more designs have their first samples than are in `preliminary`.
    is_behind: bool,
}

impl Designs {
    /// Reads the changes in the store.
    ///
    /// # Errors
    ///
    /// The store cannot be read.
    pub(crate) async fn refresh(
        &mut self,
        store: &Store,
        problem: &Problem,
    ) -> Result<(), store::Error> {
        let now = store.progress().await?;
        let is_new = self.seen.as_ref() != Some(&now);
        if is_new {
            if self.designs.len() as u64 != now.designs {
                self.designs = store.designs().await?;
            }
            self.criteria = store.criteria().await?;
            self.responses = store.responses().await?;
            self.seen = Some(now);
        }
        if !self.responses.is_empty() {
            self.preliminary.clear();
            self.is_behind = false;
        } else if is_new || self.is_behind {
            self.estimate(store, problem).await?;
        }
        Ok(())
    }

    async fn estimate(&mut self, store: &Store, problem: &Problem) -> Result<(), store::Error> {
        let sampling = &problem.campaign().sampling;
        let wanted = sampling.samples_per_design as usize;
        let counts = store.sampled_counts().await?;
        let mut waiting = counts
            .into_iter()
            .filter(|(_, held)| *held >= wanted as u64)
            .map(|(design, _)| design)
            .filter(|design| !self.preliminary.contains_key(design))
            .collect::<Vec<u64>>()
            .into_iter();
        let at_once = (SAMPLES_AT_ONCE / wanted.max(1)).clamp(1, DESIGNS_AT_ONCE);
        for design in waiting.by_ref().take(at_once) {
            let held = store.samples_of(names::design(design)).await?;
            let first = held.iter().zip(0..wanted as u64);
            let first = first.take_while(|((sample, _), place)| sample == place);
            let values: Vec<f64> = first.map(|((_, value), _)| *value).collect();
            let row = response_of(design, Samples::plain(&values), sampling).ok();
            self.preliminary
                .insert(design, row.filter(|_| values.len() == wanted));
        }
        self.is_behind = waiting.len() > 0;
        Ok(())
    }

    /// Whether the measures are preliminary, computed from the first samples only.
    pub(crate) fn is_preliminary(&self) -> bool {
        self.responses.is_empty()
    }

    /// The measures, ordered by design.
    pub(crate) fn responses(&self) -> Vec<ResponseRow> {
        if self.responses.is_empty() {
            self.preliminary.values().flatten().copied().collect()
        } else {
            self.responses.clone()
        }
    }

    /// The designs that have a measure.
    pub(crate) fn points(&self) -> Vec<Point> {
        let rows = self.responses();
        let point = |row: &ResponseRow| {
            let design = self.designs.get(row.design as usize)?;
            // A design without a measure: too many of its samples failed.
            if !row.measure.is_finite() {
                return None;
            }
            Some(Point {
                design: row.design,
                x: design.x.clone(),
                value: row.measure,
            })
        };
        rows.iter().filter_map(point).collect()
    }

    /// The feasible design with the best measure, chosen as the campaign chooses it.
    pub(crate) fn best(&self, problem: &Problem, optima: &Optima) -> Option<BestOfDoe> {
        let chosen = optima.iter().map(|verified| &verified.optimum);
        // Before the first samples, no base is known.
        let base = optima::base(problem, chosen).unwrap_or_else(|| problem.base().clone());
        let responses = self.responses();
        let optimum = choosing::choose_of_doe(
            problem,
            &base,
            &self.designs,
            &self.criteria,
            &responses,
            Cost::default(),
        );
        let found = optimum.found.ok()?;
        let response = responses
            .iter()
            .find(|response| response.measure.total_cmp(&found.criterion).is_eq())?;
        let half = Z95 * response.measure_variance.sqrt();
        Some(BestOfDoe {
            number: response.design,
            measure: Verified {
                n: problem.campaign().sampling.samples_per_design as usize,
                value: response.measure,
                interval: Some((response.measure - half, response.measure + half)),
            },
            found,
        })
    }
}
