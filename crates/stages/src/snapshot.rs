//! The state of a campaign, read from its store for decisions.

use std::collections::{BTreeMap, BTreeSet};

use ledger::StreamId;
use problem::formulation::{Approach, Design, Problem};
use problem::task::{Inputs, Source};
use stats::Samples;
use store::{InfillRow, MissingWork, ModelRow, SampleTally, Store};

use crate::constraints;
use crate::fitting::ModelSummary;
use crate::responses::{self, Sufficiency};
use crate::state::{OpenDesign, Progress, State, VerifyPoint};
use crate::verification::Sizes;
use crate::{names, optima};

/// Reads the state of the campaign, without the quarantined streams. `more` has the designs that need more
/// samples than others, `sizes` the known numbers of verification samples.
///
/// Everything is read as of one moment: results that come meanwhile are never seen without what they were
/// derived from. Only the missing part of the DoE is read, so that a restart is quick however much is done.
pub async fn load(
    store: &Store,
    problem: &Problem,
    inputs: &Inputs,
    references: &[VerifyPoint],
    more: &BTreeMap<u64, u64>,
    sizes: &mut Sizes,
) -> anyhow::Result<State> {
    let store = &store.snapshot().await?;
    let campaign = problem.campaign();
    let wanted = u64::from(campaign.sampling.samples_per_design);
    let missing = store.missing_work(wanted, more).await?;
    // The built-in simulator analyses a design faster than its responses are read.
    let is_known = |work: &MissingWork| !work.criteria && campaign.is_external();
    let mut known: BTreeMap<u64, Vec<f64>> = BTreeMap::new();
    if missing.iter().any(is_known) {
        let rows = store.criteria().await?.into_iter();
        known.extend(rows.filter_map(|row| Some((row.design, row.responses?))));
    }
    let open = missing.iter().map(|work| OpenDesign {
        // A DoE has at most 100 000 designs, and the samples of each are counted in 32 bits.
        design: work.design.design as u32,
        x: work.design.x.clone(),
        samples: more
            .get(&work.design.design)
            .map_or(wanted, |more| wanted.max(*more)) as u32,
        missing: work
            .samples
            .iter()
            .map(|range| range.start as u32..range.end as u32)
            .collect(),
        responses: known.remove(&work.design.design),
    });
    let models = store.models_named(ModelRow::DOE).await?;
    // A summary that cannot be read has no such design, and the search begins at random.
    let summary = models
        .first()
        .map(|row| serde_json::from_str::<ModelSummary>(&row.summary_json));
    let mut state = State {
        designs: store.progress().await?.designs as usize,
        open: open.collect(),
        samples: store.samples_digest().await?,
        criteria: store.criteria_digest().await?,
        derivations: store.derivations().await?,
        best_of_doe: summary.and_then(|read| read.ok()?.best_of_doe),
        models: models.into_iter().map(|row| row.json.into()).collect(),
        ..State::default()
    };
    for run in store.optimiser_runs().await? {
        state.runs.extend(names::approach_and_start(run.stream));
    }
    let tallies = store.sample_tallies().await?;
    let count = |point: StreamId| tallies.get(&point).map_or(0, |tally| tally.samples);
    let generations = store.generations().await?;
    for optimum in optima::stored(store, problem).await? {
        let approach = optimum.approach;
        let design = optimum.found.ok().map(|found| found.design);
        let point = names::verification(approach);
        let count = count(point);
        let generation = generations.get(&point);
        if count > 0 && !is_of(inputs, approach, design.as_ref(), generation) {
            state.stale.insert(approach);
        } else if let Some(design) = &design {
            let sizes = sizes.of(store, problem, (point, design), count).await?;
            state.verified.insert(approach, sizes);
        }
        state.optima.insert(approach, design);
    }
    for point in references {
        let stream = StreamId::point(point.number);
        let of = (stream, &point.design);
        let (wanted, stored) = sizes.of(store, problem, of, count(stream)).await?;
        state.reference_points.push(VerifyPoint {
            wanted,
            stored,
            ..point.clone()
        });
    }
    if let (Some(base), Some(_)) = (state.base(problem), &campaign.enrichment) {
        state.enrichment = enrichment(store, problem, &base, &tallies).await?;
    }
    Ok(state)
}

/// Whether the stored verification samples of an approach, which have this generation, are those of `design`.
fn is_of(
    inputs: &Inputs,
    approach: Approach,
    design: Option<&Design>,
    generation: Option<&u64>,
) -> bool {
    let stream = names::verification(approach);
    let wanted = design.map(|design| inputs.generation(stream, &Source::Point(design.clone())));
    wanted.is_some_and(|wanted| generation == Some(&wanted.0))
}

/// The progress of the enrichment.
async fn enrichment(
    store: &Store,
    problem: &Problem,
    base: &Design,
    tallies: &BTreeMap<StreamId, SampleTally>,
) -> Result<Progress, store::Error> {
    let rounds = store.rounds().await?;
    let evaluated = store.evaluated().await?;
    let mut progress = Progress {
        rounds: vec![String::new(); rounds.len()],
        is_stopped: rounds.last().is_some_and(|last| last.stop_json.is_some()),
        ..Progress::default()
    };
    for row in store.infill().await? {
        progress.numbers.insert(row.number);
        let stream = StreamId::point(row.number);
        let tally = tallies.get(&stream);
        let complete = tally.filter(|tally| tally.samples == row.samples);
        if let Some(results) = progress.rounds.get_mut(row.round as usize) {
            // A round takes all samples of a point, or none.
            let samples = complete.map_or_else(|| "-".to_owned(), SampleTally::digest);
            let evaluation = evaluated.get(&stream).map_or("-", |(_, digest)| digest);
            *results += &format!("{} {samples} {evaluation};", row.name);
        }
        if complete.is_some() {
            continue;
        }
        let asks_criteria = constraints::is_asked(problem, &row);
        let evaluation = match asks_criteria {
            true => constraints::evaluation(store, &row).await?,
            false => None,
        };
        if let Some(evaluation) = &evaluation
            && constraints::violation_of(problem, evaluation) != Some(0.0)
        {
            // The point cannot be simulated or breaks a constraint, so it gets no samples.
            continue;
        }
        progress.points.push(VerifyPoint {
            asks_criteria: asks_criteria && evaluation.is_none(),
            stored: infill_samples(store, problem, &row).await?.0,
            number: row.number,
            design: problem.design(&row.x, base),
            wanted: u32::try_from(row.samples).unwrap_or(u32::MAX),
        });
    }
    Ok(progress)
}

/// The samples of a point that were asked for: their indices, and the samples in the same order.
pub(crate) async fn infill_samples(
    store: &Store,
    problem: &Problem,
    row: &InfillRow,
) -> Result<(BTreeSet<u32>, Samples), store::Error> {
    let mut samples = Samples::none(problem.sampled().len());
    let mut indices = BTreeSet::new();
    for block in store.blocks_of(StreamId::point(row.number)).await? {
        for (sample, values) in block.indexed() {
            if sample < row.samples
                && let Ok(index) = u32::try_from(sample)
            {
                indices.insert(index);
                samples.push(values);
            }
        }
    }
    Ok((indices, samples))
}

/// The samples of a design from the first on, without a hole.
pub(crate) async fn design_samples(
    store: &Store,
    problem: &Problem,
    design: u64,
) -> Result<Samples, store::Error> {
    let responses = problem.sampled().len();
    store
        .first_samples_of(names::design(design), responses)
        .await
}

/// Number of samples behind each response, by design. Samples that came before they were needed do
/// not count.
pub async fn response_counts(
    store: &Store,
    problem: &Problem,
) -> anyhow::Result<BTreeMap<u64, u64>> {
    let settings = problem.objective().sampling();
    let mut counts = BTreeMap::new();
    for row in store.responses().await? {
        let count = if settings.rule().is_none() {
            settings.samples_per_design as usize
        } else {
            let held = design_samples(store, problem, row.design).await?;
            let held = problem.objective().values(&held);
            match responses::sufficiency(&held, settings)? {
                Sufficiency::Enough(count) => count,
                Sufficiency::Wants { at_least, .. } => at_least,
            }
        };
        counts.insert(row.design, count as u64);
    }
    Ok(counts)
}

/// The designs with a response that need more samples than others, and how many they need. There are such designs
/// after a restart, too, for example quarantined ones that a campaign went on without.
pub async fn wants_more(store: &Store, problem: &Problem) -> anyhow::Result<BTreeMap<u64, u64>> {
    let settings = problem.objective().sampling();
    let mut more = BTreeMap::new();
    if settings.rule().is_none() {
        return Ok(more);
    }
    for row in store.responses().await? {
        let held = design_samples(store, problem, row.design).await?;
        let held = problem.objective().values(&held);
        if let Sufficiency::Wants { samples, .. } = responses::sufficiency(&held, settings)? {
            more.insert(row.design, samples as u64);
        }
    }
    Ok(more)
}
