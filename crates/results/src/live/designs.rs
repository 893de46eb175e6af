//! The designs of the DoE with their measures, including those still being sampled.
//!
//! The campaign computes its responses when all samples are stored. Until then, this module
//! estimates a measure for each design that has its first samples, by the campaign's own rule
//! but without a control variate. Each measure is computed once, and only a few at a time, so
//! that viewing a large campaign costs little.

use std::collections::BTreeMap;

use problem::formulation::Problem;
use stages::cost::Cost;
use stages::doe::Doe;
use stages::responses::measures;
use stages::{choosing, names, optima};
use stats::IntervalEstimate;
use store::{Progress, ResponseRow, Store};

use crate::live::views::{BestOfDoe, Point};
use crate::optima::Optima;
use crate::running::Z95;

/// Maximum number of preliminary measures computed at a time.
const DESIGNS_AT_ONCE: usize = 500;
/// Approximate maximum number of samples that are read for preliminary measures at a time.
const SAMPLES_AT_ONCE: usize = 100_000;

/// The designs with their measures.
#[derive(Debug, Default)]
pub(crate) struct Designs {
    /// The store's progress at the last reading.
    seen: Option<Progress>,
    /// The DoE, whose responses are empty until they are computed.
    doe: Doe,
    /// Measures of the first samples, of the objective first; empty if too many samples failed.
    preliminary: BTreeMap<u64, Vec<ResponseRow>>,
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
            self.doe = Doe::read(store).await?;
            self.seen = Some(now);
        }
        if !self.doe.responses.is_empty() {
            self.preliminary.clear();
            self.is_behind = false;
        } else if is_new || self.is_behind {
            self.estimate(store, problem).await?;
        }
        Ok(())
    }

    async fn estimate(&mut self, store: &Store, problem: &Problem) -> Result<(), store::Error> {
        let wanted = problem.campaign().sampling.samples_per_design as usize;
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
            let held = store.first_samples_of(names::design(design), problem.sampled().len());
            let first = held.await?.first(wanted);
            let rows =
                (first.len() == wanted).then(|| measures(problem, design, &first, None).ok());
            self.preliminary
                .insert(design, rows.flatten().unwrap_or_default());
        }
        self.is_behind = waiting.len() > 0;
        Ok(())
    }

    /// Whether the measures are preliminary, computed from the first samples only.
    pub(crate) fn is_preliminary(&self) -> bool {
        self.doe.responses.is_empty()
    }

    /// The measures that are optimised, ordered by design.
    pub(crate) fn responses(&self) -> Vec<ResponseRow> {
        if self.is_preliminary() {
            self.preliminary_rows()
                .filter(|row| row.number == 0)
                .collect()
        } else {
            self.doe.responses.clone()
        }
    }

    fn preliminary_rows(&self) -> impl Iterator<Item = ResponseRow> {
        self.preliminary.values().flatten().copied()
    }

    /// The designs that have a measure.
    pub(crate) fn points(&self) -> Vec<Point> {
        let rows = self.responses();
        let point = |row: &ResponseRow| {
            let design = self.doe.designs.get(row.design as usize)?;
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
        let doe = match self.is_preliminary() {
            false => self.doe.clone(),
            true => {
                let mut limited: Vec<ResponseRow> = self
                    .preliminary_rows()
                    .filter(|row| row.number > 0)
                    .collect();
                limited.sort_by_key(|row| row.number);
                Doe {
                    responses: responses.clone(),
                    limited,
                    ..self.doe.clone()
                }
            }
        };
        let optimum = choosing::choose_of_doe(problem, &base, &doe, Cost::default());
        let found = optimum.found.ok()?;
        let response = responses
            .iter()
            .find(|response| response.measure.total_cmp(&found.criterion).is_eq())?;
        let half = Z95 * response.measure_variance.sqrt();
        Some(BestOfDoe {
            number: response.design,
            measure: IntervalEstimate {
                n: problem.campaign().sampling.samples_per_design as usize,
                value: response.measure,
                interval: Some((response.measure - half, response.measure + half)),
            },
            found,
        })
    }
}
