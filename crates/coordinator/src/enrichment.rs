//! Rounds of infill: from the store's rows to a decision, and back.
//!
//! What a round decides follows from rows and seed alone, so a coordinator that was killed before
//! the decision was on disk makes the same one again.

use std::cell::Cell;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use anyhow::Context as _;
use campaign::enrichment::{self, Progress, REACH, options, point_name, point_number};
use campaign::file::{ControlVariate, Sampling};
use campaign::formulation::{Problem, ROBUST_VARIABLES};
use campaign::optimise::Found;
use campaign::plan::VerifyPoint;
use campaign::{Approach, Frozen, Variables};
use enrich::{Decision, Infill, Known, Reason, Recommendation, RoundRecord, Sampled, State, Stop};
use rayon::prelude::*;
use stats::streams::Purpose;
use store::{
    CriteriaRow, DesignRow, InfillRow, NewRound, OptimumRow, ResponseRow, RoundRow, Store,
};
use tracing::{info, warn};

use crate::engine::{Engine, blocking};
use crate::ingest;
use crate::sampling::{self, Sampled as Enough, Samples};
use crate::steps::{self, Cost};

type Point = [f64; ROBUST_VARIABLES];

/// How far the enrichment is, with the points of its last round.
///
/// # Errors
///
/// The store cannot be read.
pub async fn progress(store: &Store, frozen: &Frozen) -> Result<Progress, store::Error> {
    let rounds = store.rounds().await?;
    let Some(last) = rounds.last() else {
        return Ok(Progress::default());
    };
    let mut points = Vec::new();
    for row in store.infill().await? {
        if row.round == last.round {
            points.push(VerifyPoint {
                stored: samples(store, &row).await?.keys().copied().collect(),
                name: row.name,
                number: row.number,
                variables: Variables::robust(&row.x, frozen),
                wanted: u32::try_from(row.samples).unwrap_or(u32::MAX),
            });
        }
    }
    Ok(Progress {
        rounds: rounds.len() as u32,
        points,
        is_stopped: last.stop_json.is_some(),
    })
}

/// The samples of a point that were asked for, by index.
async fn samples(store: &Store, row: &InfillRow) -> Result<BTreeMap<u32, f64>, store::Error> {
    let held = store.verify_samples(&row.name).await?;
    Ok(held
        .iter()
        .filter(|sample| sample.sample < row.samples)
        .filter_map(|sample| Some((u32::try_from(sample.sample).ok()?, sample.delta_ste_um)))
        .collect())
}

/// What a round is decided from.
#[derive(Debug, Default)]
struct Rows {
    designs: Vec<DesignRow>,
    criteria: Vec<CriteriaRow>,
    responses: Vec<ResponseRow>,
    /// How many samples each response rests on.
    counts: BTreeMap<u64, u64>,
    rounds: Vec<RoundRow>,
    infill: Vec<InfillRow>,
    /// The samples of every infill point that has all of them.
    samples: BTreeMap<u64, Vec<f64>>,
    /// The samples of the designs at which infill points lie.
    of_designs: BTreeMap<u64, Vec<f64>>,
}

impl Rows {
    async fn read(store: &Store, sampling: &Sampling) -> anyhow::Result<Self> {
        let mut rows = Self {
            designs: store.designs().await?,
            criteria: store.criteria().await?,
            responses: store.responses().await?,
            counts: counts(store, sampling).await?,
            rounds: store.rounds().await?,
            infill: store.infill().await?,
            ..Self::default()
        };
        for row in &rows.infill {
            let held = samples(store, row).await?;
            if held.len() as u64 == row.samples {
                rows.samples
                    .insert(row.infill, held.into_values().collect());
            }
        }
        let sampled: BTreeSet<[u64; ROBUST_VARIABLES]> =
            rows.infill.iter().map(|row| bits(&row.x)).collect();
        for design in &rows.designs {
            if sampled.contains(&bits(&design.point())) {
                let count = rows.counts.get(&design.design).copied().unwrap_or(0);
                let held = store.samples_of(design.design).await?;
                let held = held
                    .into_iter()
                    .take(count as usize)
                    .map(|(_, value)| value);
                rows.of_designs.insert(design.design, held.collect());
            }
        }
        Ok(rows)
    }

    /// The points that are not sampled although their round is over: they were given up.
    fn lost(&self) -> Vec<u64> {
        let lost = |row: &&InfillRow| !row.failed && !self.samples.contains_key(&row.infill);
        self.infill
            .iter()
            .filter(lost)
            .map(|row| row.infill)
            .collect()
    }

    fn has_failed(&self, row: &InfillRow) -> bool {
        row.failed || !self.samples.contains_key(&row.infill)
    }

    /// How many samples were asked for so far.
    fn asked(&self) -> u64 {
        let of_doe = self
            .responses
            .iter()
            .filter_map(|r| self.counts.get(&r.design));
        let of_infill = self.infill.iter().map(|row| row.samples);
        of_doe.copied().chain(of_infill).sum()
    }

    /// All that is known of responses: one entry per place, the designs of the DoE first.
    fn state(&self, problem: &Problem, frozen: &Frozen) -> State {
        let criteria: BTreeMap<u64, &CriteriaRow> =
            self.criteria.iter().map(|row| (row.design, row)).collect();
        let mut sampled: Vec<Sampled> = Vec::new();
        // The samples of places that rest on more than a design's response, with the names of their
        // random streams.
        let mut pooled: BTreeMap<usize, Vec<Stream<'_>>> = BTreeMap::new();
        let mut places: BTreeMap<[u64; ROBUST_VARIABLES], usize> = BTreeMap::new();
        for response in &self.responses {
            let Some(design) = self.designs.get(response.design as usize) else {
                continue;
            };
            let x = design.point();
            let Some(row) = criteria.get(&response.design) else {
                continue;
            };
            let worn = steps::worn_criteria(problem, &Variables::robust(&x, frozen), row);
            let violation = worn.map(|worn| enrichment::violation(problem, &worn));
            let (Some(violation), Some(baseline_um)) = (violation, row.delta_ste_archard_um) else {
                continue;
            };
            if violation > REACH {
                continue;
            }
            if let Some(held) = self.of_designs.get(&response.design) {
                let stream = (Purpose::Wear, response.design, held.as_slice());
                pooled.insert(sampled.len(), vec![stream]);
            }
            places.insert(bits(&x), sampled.len());
            let samples = self.counts.get(&response.design).copied().unwrap_or(0);
            sampled.push(Sampled {
                x: x.to_vec(),
                samples: u32::try_from(samples).unwrap_or(u32::MAX),
                response_um: response.p90_um,
                variance_um2: response.p90_variance_um2,
                violation,
                baseline_um,
            });
        }
        for row in self.infill.iter().filter(|row| !self.has_failed(row)) {
            let place = *places.entry(bits(&row.x)).or_insert_with(|| {
                sampled.push(Sampled {
                    x: row.x.to_vec(),
                    samples: 0,
                    response_um: f64::NAN,
                    variance_um2: 0.0,
                    violation: row.violation,
                    baseline_um: f64::NAN,
                });
                sampled.len() - 1
            });
            if let Some(drawn) = self.samples.get(&row.infill) {
                let stream = (Purpose::Verify, row.number, drawn.as_slice());
                pooled.entry(place).or_default().push(stream);
            }
        }
        let responses: Vec<(usize, usize, Option<ResponseRow>, Option<f64>)> = pooled
            .par_iter()
            .map(|(&place, streams)| {
                let x = &sampled[place].x;
                let (count, row) = pool(problem, frozen, x, streams);
                (place, count, row, baseline(problem, frozen, x))
            })
            .collect();
        for (place, count, row, baseline) in responses {
            let entry = &mut sampled[place];
            if let Some(baseline) = baseline {
                entry.baseline_um = baseline;
            }
            entry.samples = u32::try_from(count).unwrap_or(u32::MAX);
            if let Some(row) = row {
                entry.response_um = row.p90_um;
                entry.variance_um2 = row.p90_variance_um2;
            }
        }
        let failed = self.infill.iter().filter(|row| self.has_failed(row));
        State {
            sampled,
            failed: failed
                .filter(|row| !places.contains_key(&bits(&row.x)))
                .map(|row| row.x.to_vec())
                .collect(),
            rounds: self.rounds.iter().map(|round| self.record(round)).collect(),
        }
    }

    fn record(&self, round: &RoundRow) -> RoundRecord {
        let of_round = self.infill.iter().filter(|row| row.round == round.round);
        RoundRecord {
            expected_improvement_um: round.expected_improvement_um,
            asked: of_round.clone().count() as u32,
            failed: of_round.filter(|row| self.has_failed(row)).count() as u32,
        }
    }

    /// Decides the next round; its CPU time is left zero.
    fn decide(&self, problem: &Problem, frozen: &Frozen) -> anyhow::Result<(NewRound, Decision)> {
        let section = problem.campaign().enrichment.as_ref();
        let section = section.context("the campaign has no enrichment")?;
        let left = u64::from(section.samples).saturating_sub(self.asked());
        // At most what the budget says, which has 32 bits.
        let options = options(problem, section, left as u32)?;
        let state = self.state(problem, frozen);
        let calls = Cell::new(0);
        let exact = |x: &[f64]| -> Option<Known> {
            let x: Point = x.try_into().ok()?;
            let (known, took) = enrichment::known(problem, &Variables::robust(&x, frozen))?;
            calls.set(calls.get() + took);
            Some(known)
        };
        let decision = enrich::decide(&state, &options, &exact)?;
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
                    (&entry.x, Some(entry.violation), *samples, "more")
                }
            };
            let x = x.as_slice().try_into();
            let x: Point = x.context("an infill point of another problem")?;
            let number = point_number(index, &x, &taken);
            taken.push(number);
            infill.push(InfillRow {
                infill: index,
                round,
                name: point_name(index, number),
                number,
                reason: reason.to_owned(),
                x,
                violation: violation.context("an infill point that cannot be simulated")?,
                samples: u64::from(samples),
                failed: false,
            });
        }
        let row = RoundRow {
            round,
            expected_improvement_um: decision.expected_improvement_um,
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
            simulator_calls: calls.get(),
            cpu_seconds: 0.0,
        };
        let failed = self.lost();
        Ok((
            NewRound {
                row,
                infill,
                failed,
            },
            decision,
        ))
    }
}

/// Samples and the name of their random streams.
type Stream<'a> = (Purpose, u64, &'a [f64]);

/// ΔSTE with Archard's wear at a place that can be simulated.
fn baseline(problem: &Problem, frozen: &Frozen, x: &[f64]) -> Option<f64> {
    let x: Point = x.try_into().ok()?;
    let pair = problem.pair(&Variables::robust(&x, frozen)).ok()?;
    Some(pair.archard(problem.wear()).analysis.delta_ste_um)
}

/// How many samples there are at a place, and the response that they make together.
fn pool(
    problem: &Problem,
    frozen: &Frozen,
    x: &[f64],
    streams: &[Stream<'_>],
) -> (usize, Option<ResponseRow>) {
    let sampling = problem.campaign().sampling;
    let values: Vec<f64> = streams
        .iter()
        .flat_map(|(_, _, held)| *held)
        .copied()
        .collect();
    let linear = (sampling.control == ControlVariate::Linearised)
        .then(|| {
            let x: Point = x.try_into().ok()?;
            problem.linearise(&Variables::robust(&x, frozen)).ok()
        })
        .flatten();
    let control = linear.map(|linear| {
        let of_stream = |(purpose, number, held): &Stream<'_>| {
            sampling::controls(problem, (*purpose, *number), &linear, held.len())
        };
        let controls: Vec<f64> = streams.iter().flat_map(of_stream).collect();
        (controls, linear.moments())
    });
    let samples = Samples {
        values: &values,
        control: control
            .as_ref()
            .map(|(controls, known)| (&controls[..], *known)),
    };
    let row = sampling::response(0, samples, sampling.percentile);
    (values.len(), row.ok())
}

/// How many samples each response rests on, by design. Samples may be there that came before they
/// were wanted: those count for nothing.
pub(crate) async fn counts(
    store: &Store,
    settings: &Sampling,
) -> anyhow::Result<BTreeMap<u64, u64>> {
    let mut counts = BTreeMap::new();
    for row in store.responses().await? {
        let count = if settings.rule().is_none() {
            settings.samples_per_design as usize
        } else {
            let held = store.samples_of(row.design).await?;
            let held: Vec<f64> = held.into_iter().map(|(_, value)| value).collect();
            match sampling::sampled(&held, settings)? {
                Enough::Enough(count) => count,
                Enough::Wants { at_least, .. } => at_least,
            }
        };
        counts.insert(row.design, count as u64);
    }
    Ok(counts)
}

/// A design's variables as a key; zeros have lost their sign in the store.
fn bits(x: &Point) -> [u64; ROBUST_VARIABLES] {
    x.map(f64::to_bits)
}

const fn reason_name(reason: Reason) -> &'static str {
    match reason {
        Reason::Local => "local",
        Reason::Global => "global",
        Reason::SpaceFilling => "space-filling",
    }
}

/// A round as the store keeps it, read.
#[derive(Debug, Clone, PartialEq)]
pub struct Round {
    /// Its row.
    pub row: RoundRow,
    /// The best design when it was decided.
    pub recommendation: Option<Recommendation>,
    /// Why the enrichment ends, if this round says so.
    pub stop: Option<Stop>,
}

impl Round {
    /// Reads the JSON of a row.
    ///
    /// # Errors
    ///
    /// It is not what this version writes.
    pub fn read(row: RoundRow) -> serde_json::Result<Self> {
        let recommendation = row.recommendation_json.as_deref();
        let stop = row.stop_json.as_deref();
        Ok(Self {
            recommendation: recommendation.map(serde_json::from_str).transpose()?,
            stop: stop.map(serde_json::from_str).transpose()?,
            row,
        })
    }
}

/// A stop in a sentence.
#[must_use]
pub fn sentence(stop: &Stop) -> String {
    match stop {
        Stop::Converged {
            expected_improvement_um,
            half_width_um,
        } => format!(
            "The enrichment has converged: in two rounds at most {expected_improvement_um:.4} µm were \
             to be gained, and the prediction is known to ±{half_width_um:.4} µm."
        ),
        Stop::Budget { samples } => {
            format!("The enrichment ended with its samples: {samples} are left.")
        }
        Stop::Rounds { rounds } => {
            format!("The enrichment ended after {rounds} rounds, which is all that it may have.")
        }
        Stop::OnlyFailures => {
            "The enrichment ended because every infill point of two rounds failed.".to_owned()
        }
        Stop::NothingFeasible => {
            "The enrichment ended because it found no design that satisfies every constraint."
                .to_owned()
        }
    }
}

impl Engine {
    /// Decides the next round and stores it; its points are posted after that.
    pub(crate) async fn enrich(&self, frozen: Frozen) -> anyhow::Result<()> {
        let sampling = self.problem.campaign().sampling;
        let rows = Rows::read(&self.store, &sampling).await?;
        let problem = Arc::clone(&self.problem);
        let decide = move || rows.decide(&problem, &frozen);
        let (decided, cpu_seconds) = blocking(decide).await?;
        let (mut new, decision) = decided?;
        new.row.cpu_seconds = cpu_seconds;
        for note in &decision.notes {
            tracing::debug!(round = new.row.round, ?note, "infill");
        }
        if !new.failed.is_empty() {
            warn!(
                points = new.failed.len(),
                "infill points of the last round have failed"
            );
        }
        let best = decision.recommendation.as_ref();
        info!(
            round = new.row.round + 1,
            points = new.infill.len(),
            expected_improvement_um = decision.expected_improvement_um,
            predicted_um = best.map(|best| best.predicted_um),
            half_width_um = best.map(Recommendation::half_width_um),
            cpu_seconds,
            "infill decided"
        );
        if let Some(stop) = &decision.stop {
            info!("{}", sentence(stop));
        }
        self.store.put_round(&new).await?;
        Ok(())
    }

    /// The row of the design that the last round recommends.
    pub(crate) async fn choose_enriched(&self, frozen: &Frozen) -> anyhow::Result<OptimumRow> {
        let rounds = self.store.rounds().await?;
        let infill = self.store.infill().await?;
        let cost = self.enrichment_cost(frozen, &rounds, &infill).await?;
        let last = rounds.into_iter().last().context("there is no round")?;
        let last = Round::read(last)?;
        let Some(best) = last.recommendation else {
            let note = last.stop.as_ref().map_or_else(String::new, sentence);
            return steps::optimum(Approach::EnrichedKriging, None, cost, note);
        };
        let x = best.x.as_slice().try_into();
        let x: Point = x.context("a recommendation of another problem")?;
        let variables = Variables::robust(&x, frozen);
        let pair = self.problem.pair(&variables)?;
        let worn = pair.archard(self.problem.wear()).analysis;
        let criteria = self.problem.criteria(&pair, worn.hertz_pressure_mpa);
        let found = Found {
            variables,
            criterion_um: best.predicted_um,
            criteria,
            feasible: self.problem.is_feasible(&criteria),
        };
        steps::optimum(Approach::EnrichedKriging, Some(&found), cost, String::new())
    }

    /// What the DoE, the infill samples and the rounds' decisions cost.
    async fn enrichment_cost(
        &self,
        frozen: &Frozen,
        rounds: &[RoundRow],
        infill: &[InfillRow],
    ) -> anyhow::Result<Cost> {
        let sampling = self.sampling_cost(Some(*frozen)).await?;
        let numbers: BTreeSet<u64> = infill.iter().map(|row| row.number).collect();
        let searching: u64 = rounds.iter().map(|round| round.simulator_calls).sum();
        let sampled = infill
            .iter()
            .filter(|row| !row.failed)
            .map(|row| row.samples);
        let control = self.control_analyses(frozen, infill).await?;
        Ok(Cost {
            simulator_calls: sampling.simulator_calls + searching + sampled.sum::<u64>() + control,
            cpu_seconds: sampling.cpu_seconds
                + rounds.iter().map(|round| round.cpu_seconds).sum::<f64>()
                + infill_seconds(&self.store.job_times().await?, &numbers),
        })
    }
}

impl Engine {
    /// The analyses that the control variates of infill points took.
    async fn control_analyses(&self, frozen: &Frozen, infill: &[InfillRow]) -> anyhow::Result<u64> {
        if self.problem.campaign().sampling.control == ControlVariate::None {
            return Ok(0);
        }
        let places: BTreeMap<[u64; ROBUST_VARIABLES], Point> =
            infill.iter().map(|row| (bits(&row.x), row.x)).collect();
        let (problem, frozen) = (Arc::clone(&self.problem), *frozen);
        let count = move || -> u64 {
            let linear = |x: &Point| problem.linearise(&Variables::robust(x, &frozen)).ok();
            let linear = places.par_iter().filter_map(|(_, x)| linear(x));
            linear.map(|linear| linear.analyses()).sum()
        };
        Ok(blocking(count).await?.0)
    }
}

/// The CPU time of the samples of these infill points, seconds.
pub(crate) fn infill_seconds(times: &[store::JobTimeRow], numbers: &BTreeSet<u64>) -> f64 {
    let is_infill = |row: &&store::JobTimeRow| {
        matches!(ingest::timed(row.job),
            Some((ledger::Kind::Point, number)) if numbers.contains(&number))
    };
    times
        .iter()
        .filter(is_infill)
        .map(|row| row.cpu_seconds)
        .sum()
}
