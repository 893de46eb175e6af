//! Rounds of infill: from the store's rows to a decision, and back.
//!
//! The decision of a round follows from rows and seed alone, so a coordinator that was killed
//! before the decision was on disk makes the same one again.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::{AtomicU64, Ordering};

use anyhow::Context as _;
use enrich::{Decision, ExactCriteria, Infill, Note, Reason, RoundRecord, SampledDesign, State};
use problem::Criteria;
use problem::file::ControlVariate;
use problem::formulation::{Design, Problem};
use problem::simulator;
use rayon::prelude::*;
use stats::Samples;
use stats::streams::Purpose;
use store::{
    CriteriaRow, EvaluationRow, InfillRow, ModelRow, NewRound, ResponseRow, RoundRow, Store,
    UnsampledPoint,
};

use crate::constraints;
use crate::doe::Doe;
use crate::fitting::{self, Observation};
use crate::infill::{self, MORE, REACH, bits, options, point_name, point_number};
use crate::limits::{Caution, LimitedModels};
use crate::linear::LinearResponse;
use crate::plausibility::Plausibility;
use crate::responses;
use crate::snapshot::{design_samples, infill_samples, response_counts};

/// The rows of the store that a round is decided from.
#[derive(Debug, Default)]
pub struct Rows {
    doe: Doe,
    /// Number of samples behind each response.
    counts: BTreeMap<u64, u64>,
    rounds: Vec<RoundRow>,
    infill: Vec<InfillRow>,
    /// The samples of every infill point that has all of them, none of them absurd.
    samples: BTreeMap<u64, Samples>,
    /// The infill points that count as failed because of an absurd sample, with the reason.
    absurd: BTreeMap<u64, String>,
    /// The samples of the designs at which infill points lie.
    of_designs: BTreeMap<u64, Samples>,
    /// Evaluations of infill points by an external program.
    evaluations: BTreeMap<u64, EvaluationRow>,
}

impl Rows {
    pub async fn read(store: &Store, problem: &Problem) -> anyhow::Result<Self> {
        let mut rows = Self {
            doe: Doe::read(store).await?,
            counts: response_counts(store, problem).await?,
            rounds: store.rounds().await?,
            infill: store.infill().await?,
            ..Self::default()
        };
        let plausibility = Plausibility::read(store).await?;
        for row in &rows.infill {
            let (_, held) = infill_samples(store, problem, row).await?;
            if held.len() as u64 == row.samples {
                match plausibility.absurd(problem, &held) {
                    Some((sample, name, value)) => {
                        let why = format!("{name} of sample {sample} is {value:?}");
                        rows.absurd.insert(row.infill, why).map(drop)
                    }
                    None => rows.samples.insert(row.infill, held).map(drop),
                };
            }
            if let Some(evaluation) = constraints::evaluation(store, row).await? {
                rows.evaluations.insert(row.infill, evaluation);
            }
        }
        let sampled: BTreeSet<Vec<u64>> = rows.infill.iter().map(|row| bits(&row.x)).collect();
        for design in &rows.doe.designs {
            if sampled.contains(&bits(&design.x)) {
                let count = rows.counts.get(&design.design).copied().unwrap_or(0);
                let held = design_samples(store, problem, design.design).await?;
                rows.of_designs
                    .insert(design.design, held.first(count as usize));
            }
        }
        Ok(rows)
    }

    /// The infill points of the last round that count as failed because of an absurd sample: a sentence each.
    #[must_use]
    pub fn absurd(&self) -> Vec<String> {
        let is_new = |row: &&InfillRow| !row.failed;
        let sentence = |row: &InfillRow| {
            let why = self.absurd.get(&row.infill)?;
            Some(format!("infill point {} is left out: {why}", row.infill))
        };
        let new = self.infill.iter().filter(is_new);
        new.filter_map(sentence).collect()
    }

    /// The points that have no usable samples although their round is over.
    fn unsampled(&self, problem: &Problem) -> Vec<UnsampledPoint> {
        let unsampled = |row: &&InfillRow| !row.failed && !self.samples.contains_key(&row.infill);
        let points = self.infill.iter().filter(unsampled);
        let violation = |row: &InfillRow| {
            let evaluation = self.evaluations.get(&row.infill)?;
            constraints::violation_of(problem, evaluation)
        };
        points
            .map(|row| UnsampledPoint {
                infill: row.infill,
                violation: violation(row).unwrap_or(0.0),
            })
            .collect()
    }

    /// Marks these points as failed, with their constraint violations.
    fn settle(&mut self, unsampled: &[UnsampledPoint]) {
        for one in unsampled {
            let row = &mut self.infill[one.infill as usize];
            (row.failed, row.violation) = (true, one.violation);
        }
    }

    /// The designs whose criteria are known, with their criteria.
    fn evaluated(&self, problem: &Problem, base: &Design) -> Vec<(Vec<f64>, Criteria)> {
        let of_doe = self.doe.evaluated(problem, base).into_iter();
        let of_doe = of_doe.filter_map(|(number, criteria)| {
            let design = self.doe.designs.get(number as usize)?;
            Some((design.x.clone(), criteria))
        });
        let of_infill = self.infill.iter().filter_map(|row| {
            let criteria = self.evaluations.get(&row.infill)?.criteria.clone()?;
            Some((row.x.clone(), Criteria::new(criteria)))
        });
        of_doe.chain(of_infill).collect()
    }

    /// Number of samples asked for so far.
    fn asked(&self) -> u64 {
        let of_doe = self
            .doe
            .responses
            .iter()
            .filter_map(|r| self.counts.get(&r.design));
        let asked = self.infill.iter().filter(|row| !row.is_ruled_out());
        let of_infill = asked.map(|row| row.samples);
        of_doe.copied().chain(of_infill).sum()
    }

    /// All known responses as an enrichment's state: one entry per place, the designs of the DoE
    /// first. The measures that constraints limit enter its violations.
    fn state(&self, problem: &Problem, base: &Design) -> KnownResponses {
        let criteria: BTreeMap<u64, &CriteriaRow> = self
            .doe
            .criteria
            .iter()
            .map(|row| (row.design, row))
            .collect();
        let of_doe = self.doe.estimates(problem);
        let mut estimates: Vec<Vec<(f64, f64)>> = Vec::new();
        let mut sampled: Vec<SampledDesign> = Vec::new();
        // The samples of places with more than the samples of one design's response, with the names
        // of their random streams.
        let mut pooled: BTreeMap<usize, Vec<Stream<'_>>> = BTreeMap::new();
        let mut places: BTreeMap<Vec<u64>, usize> = BTreeMap::new();
        for response in &self.doe.responses {
            let Some(design) = self.doe.designs.get(response.design as usize) else {
                continue;
            };
            let x = &design.x;
            let Some(row) = criteria.get(&response.design) else {
                continue;
            };
            let worn = row.responses.as_ref().and_then(|responses| {
                let design = problem.design(x, base);
                problem.analysis(&design, responses, simulator::State::Baseline)
            });
            let Some(worn) = worn else {
                continue;
            };
            let violation = infill::violation(problem, &worn.criteria);
            if violation > REACH {
                continue;
            }
            if let Some(held) = self.of_designs.get(&response.design) {
                let stream = (Purpose::Wear, response.design, held);
                pooled.insert(sampled.len(), vec![stream]);
            }
            places.insert(bits(x), sampled.len());
            let samples = self.counts.get(&response.design).copied().unwrap_or(0);
            estimates.push(of_doe.get(&response.design).cloned().unwrap_or_default());
            sampled.push(SampledDesign {
                x: x.clone(),
                samples: u32::try_from(samples).unwrap_or(u32::MAX),
                response: problem.cost(response.measure),
                variance: response.measure_variance,
                violation,
                baseline: infill::baseline(problem, &worn),
            });
        }
        for row in self.infill.iter().filter(|row| !row.failed) {
            let place = *places.entry(bits(&row.x)).or_insert_with(|| {
                estimates.push(Vec::new());
                sampled.push(SampledDesign {
                    x: row.x.to_vec(),
                    samples: 0,
                    response: f64::NAN,
                    variance: 0.0,
                    violation: row.violation,
                    baseline: f64::NAN,
                });
                sampled.len() - 1
            });
            if let Some(drawn) = self.samples.get(&row.infill) {
                let stream = (Purpose::Verify, row.number, drawn);
                pooled.entry(place).or_default().push(stream);
            }
        }
        let responses: Vec<(usize, usize, Vec<ResponseRow>, Option<f64>)> = pooled
            .par_iter()
            .map(|(&place, streams)| {
                let x = &sampled[place].x;
                let (count, rows) = pool(problem, base, x, streams);
                let baseline = infill::baseline_at_um(problem, &problem.design(x, base));
                (place, count, rows, baseline)
            })
            .collect();
        for (place, count, rows, baseline) in responses {
            let entry = &mut sampled[place];
            if let Some(baseline) = baseline {
                entry.baseline = baseline;
            }
            entry.samples = u32::try_from(count).unwrap_or(u32::MAX);
            if let Some((row, limited)) = rows.split_first() {
                entry.response = problem.cost(row.measure);
                entry.variance = row.measure_variance;
                let limited = limited
                    .iter()
                    .map(|row| (row.measure, row.measure_variance));
                estimates[place] = limited.collect();
            }
        }
        let estimated = sampled.iter().zip(estimates.iter().map(Vec::as_slice));
        let limited = LimitedModels::fit(problem, estimated);
        let mut bounds = BTreeMap::new();
        for (entry, own) in sampled.iter_mut().zip(&estimates) {
            let of_entry = limited.bounds(problem, &entry.x, own);
            entry.violation += problem.limited_violation(&of_entry);
            if of_entry.len() < problem.limited().len() {
                // Without estimates, nothing shows that the limits are kept, so the design counts as infeasible.
                entry.violation += 1.0;
            }
            bounds.insert(bits(&entry.x), of_entry);
        }
        let failed = self.infill.iter().filter(|row| row.has_failed());
        let failed = failed.map(|row| &row.x);
        // The coordinator can compute which gear pairs are simulable; only an external program's refusals have to be
        // learned.
        let is_told = constraints::are_asked(problem);
        let refused = self
            .doe
            .criteria
            .iter()
            .filter(|row| is_told && !row.simulable);
        let refused = refused.filter_map(|row| Some(&self.doe.designs.get(row.design as usize)?.x));
        let state = State {
            failed: refused
                .chain(failed)
                .filter(|x| !places.contains_key(&bits(x)))
                .cloned()
                .collect(),
            sampled,
            rounds: self.rounds.iter().map(|round| self.record(round)).collect(),
        };
        KnownResponses {
            state,
            limited,
            bounds,
        }
    }

    /// The values by which the constraints on samples are judged at a sampled design.
    pub fn limited_at(&self, problem: &Problem, base: &Design, x: &[f64]) -> Vec<f64> {
        if problem.limited().is_empty() {
            return Vec::new();
        }
        let mut known = self.state(problem, base);
        known.bounds.remove(&bits(x)).unwrap_or_default()
    }

    fn record(&self, round: &RoundRow) -> RoundRecord {
        let of_round = self.infill.iter().filter(|row| row.round == round.round);
        RoundRecord {
            expected_improvement: round.expected_improvement,
            asked: of_round.clone().count() as u32,
            failed: of_round.filter(|row| row.has_failed()).count() as u32,
        }
    }

    /// The model of the DoE and all infill points, as the campaign's `[kriging]` says.
    fn fit(&self, problem: &Problem, base: &Design, state: &State) -> anyhow::Result<ModelRow> {
        let mut all = fitting::of_doe(problem, base, &self.doe, 0);
        let mut places: BTreeMap<Vec<u64>, usize> = (0..)
            .zip(&all)
            .map(|(place, observed)| (bits(&observed.x), place))
            .collect();
        for row in &self.infill {
            places.entry(bits(&row.x)).or_insert_with(|| {
                all.push(Observation {
                    number: self.doe.designs.len() as u64 + row.infill,
                    x: row.x.clone(),
                    value: f64::NAN,
                    variance: 0.0,
                    samples: 0,
                    is_feasible: row.violation <= 0.0,
                });
                all.len() - 1
            });
        }
        for sampled in &state.sampled {
            if let Some(place) = places.get(&bits(&sampled.x)) {
                let observed = &mut all[*place];
                observed.value = problem.cost(sampled.response);
                observed.variance = sampled.variance;
                observed.samples = sampled.samples.into();
            }
        }
        let (model, summary) = fitting::fit(problem, &all)?;
        fitting::model_row(ModelRow::ENRICHED, 0, &model, &summary)
    }

    /// Decides the next round; its CPU time is left zero.
    pub fn decide(
        mut self,
        problem: &Problem,
        base: &Design,
    ) -> anyhow::Result<(NewRound, Decision)> {
        let section = problem.campaign().enrichment.as_ref();
        let section = section.context("the campaign has no enrichment")?;
        let unsampled = self.unsampled(problem);
        self.settle(&unsampled);
        let left = u64::from(section.samples).saturating_sub(self.asked());
        // At most the budget, which has 32 bits.
        let options = options(problem, section, left as u32)?;
        let KnownResponses { state, limited, .. } = self.state(problem, base);
        let is_feasible = |one: &SampledDesign| one.violation <= 0.0;
        let caution = match state.sampled.iter().any(is_feasible) {
            true => Caution::of_round(self.rounds.len()),
            // No region is safe yet.
            false => Caution::Probable,
        };
        let calls = AtomicU64::new(0);
        let models = constraints::are_asked(problem)
            .then(|| constraints::Models::fit(problem, &self.evaluated(problem, base)));
        let exact = |x: &[f64]| -> Option<ExactCriteria> {
            if let Some(models) = &models {
                let known = models.known(problem, x, caution);
                return Some(ExactCriteria {
                    holds: known.holds * limited.factor(problem, x, caution),
                    ..known
                });
            }
            let (known, took) = infill::known(problem, &problem.design(x, base))?;
            calls.fetch_add(took, Ordering::Relaxed);
            Some(known)
        };
        let mut decision = enrich::decide(&state, &options, &exact)?;
        if let Some(best) = &mut decision.recommendation {
            best.predicted = problem.cost(best.predicted);
            let [a, b] = <[f64; 2]>::from(best.interval).map(|end| problem.cost(end));
            best.interval = (a.min(b), a.max(b));
        }
        let round = self.rounds.len() as u64;
        let mut taken: Vec<u64> = self.infill.iter().map(|row| row.number).collect();
        let mut infill = Vec::new();
        for entry in &decision.infill {
            let index = (self.infill.len() + infill.len()) as u64;
            let (x, violation, samples, reason) = match entry {
                Infill::New {
                    x, samples, reason, ..
                } => {
                    let violation = exact(x).map(|known| known.violation);
                    (x, violation, *samples, reason_name(*reason))
                }
                Infill::More {
                    design, samples, ..
                } => {
                    let entry = &state.sampled[*design];
                    (&entry.x, Some(entry.violation), *samples, MORE)
                }
            };
            let number = point_number(index, x, &taken);
            taken.push(number);
            infill.push(InfillRow {
                infill: index,
                round,
                name: point_name(index, number),
                number,
                reason: reason.to_owned(),
                x: x.clone(),
                violation: violation.context("an infill point that cannot be simulated")?,
                samples: u64::from(samples),
                failed: false,
            });
        }
        let model = decision
            .stop
            .is_some()
            .then(|| self.fit(problem, base, &state));
        let model = model.transpose().unwrap_or_else(|error| {
            let reason = format!("{error:#}");
            decision.notes.push(Note::NoModel { reason });
            None
        });
        let row = RoundRow {
            round,
            expected_improvement: decision.expected_improvement,
            recommendation_json: decision
                .recommendation
                .as_ref()
                .map(serde_json::to_string)
                .transpose()?,
            stop_json: decision
                .stop
                .as_ref()
                .map(serde_json::to_string)
                .transpose()?,
            notes_json: serde_json::to_string(&decision.notes)?,
            simulator_calls: calls.into_inner(),
            cpu_seconds: 0.0,
        };
        Ok((
            NewRound {
                row,
                infill,
                failed: unsampled,
                model,
            },
            decision,
        ))
    }
}

/// All known responses of an enrichment.
struct KnownResponses {
    state: State,
    limited: LimitedModels,
    /// The values by which constraints on samples are judged at each place.
    bounds: BTreeMap<Vec<u64>, Vec<f64>>,
}

/// Samples and the name of their random streams.
type Stream<'a> = (Purpose, u64, &'a Samples);

/// The number of samples at a place, and all measures of them; none if one of them has no estimate.
fn pool(
    problem: &Problem,
    base: &Design,
    x: &[f64],
    streams: &[Stream<'_>],
) -> (usize, Vec<ResponseRow>) {
    let mut samples = Samples::none(problem.sampled().len());
    for (_, _, held) in streams {
        samples.extend(held);
    }
    let is_controlled = problem.campaign().sampling.control == ControlVariate::Linearised;
    let linear = is_controlled
        .then(|| LinearResponse::of(problem.gears()?, &problem.design(x, base)).ok())
        .flatten();
    let control = linear.map(|linear| {
        let of_stream = |(purpose, number, held): &Stream<'_>| {
            responses::controls(problem, (*purpose, *number), &linear, held.len())
        };
        let controls: Vec<f64> = streams.iter().flat_map(of_stream).collect();
        (controls, linear.moments())
    });
    let control = control
        .as_ref()
        .map(|(controls, known)| (&controls[..], *known));
    let rows = responses::measures(problem, 0, &samples, control);
    (samples.len(), rows.unwrap_or_default())
}

const fn reason_name(reason: Reason) -> &'static str {
    match reason {
        Reason::Local => "local",
        Reason::Global => "global",
        Reason::SpaceFilling => "space-filling",
    }
}
