//! The verification samples of an optimum or a printed design: how many it gets, and those in the store.

use std::collections::{BTreeMap, BTreeSet};

use ledger::StreamId;
use problem::formulation::{Design, Problem};
use stats::Samples;
use store::Store;

/// Number of samples that a point with these samples gets. It depends on the campaign and on the first
/// samples alone, so samples that came early change nothing.
#[must_use]
pub fn wanted(problem: &Problem, samples: &Samples) -> u32 {
    let verify = &problem.campaign().verify;
    let first = verify.first();
    if samples.len() < first as usize {
        return first;
    }
    let pilot = problem.objective().verified(&samples.first(first as usize));
    pilot.map_or(first, |pilot| verify.wanted(&pilot))
}

/// The verification of a point, as far as the store holds it.
#[derive(Debug, Clone, PartialEq)]
pub struct Verification {
    /// The samples, those from the first on.
    pub samples: Samples,
    /// Number of samples that the point gets, as far as is known.
    pub wanted: usize,
}

impl Verification {
    /// Reads the verification of a point.
    pub async fn read(
        store: &Store,
        problem: &Problem,
        point: StreamId,
    ) -> Result<Self, store::Error> {
        let samples = store.first_samples_of(point, problem.sampled().len());
        let samples = samples.await?;
        Ok(Self {
            wanted: wanted(problem, &samples) as usize,
            samples,
        })
    }

    /// Whether all samples are there.
    #[must_use]
    pub fn is_complete(&self) -> bool {
        self.samples.len() >= self.wanted
    }
}

/// The number of verification samples of each point and design, once stored samples have determined it.
#[derive(Debug, Default)]
pub struct Sizes(BTreeMap<(StreamId, Vec<u64>), u32>);

impl Sizes {
    /// Number of samples that the point at `design` gets, and the indices of those in the store,
    /// of which there are `count`.
    pub(crate) async fn of(
        &mut self,
        store: &Store,
        problem: &Problem,
        (point, design): (StreamId, &Design),
        count: u64,
    ) -> Result<(u32, BTreeSet<u32>), store::Error> {
        let bits = design.values().iter().map(|value| value.to_bits());
        let key = (point, bits.collect());
        let known = self.0.get(&key).copied();
        if let Some(wanted) = known
            && count >= wanted.into()
        {
            return Ok((wanted, (0..wanted).collect()));
        }
        let held = store.blocks_of(point).await?;
        let indices = held
            .iter()
            .flat_map(|block| block.first_sample..block.end());
        let stored: BTreeSet<u32> = indices
            .filter_map(|sample| u32::try_from(sample).ok())
            .collect();
        let first = problem.campaign().verify.first();
        if known.is_none() && !(0..first).all(|sample| stored.contains(&sample)) {
            return Ok((first, stored));
        }
        let wanted = known.unwrap_or_else(|| {
            let mut samples = Samples::none(problem.sampled().len());
            for block in &held {
                samples.extend(&block.samples);
            }
            wanted(problem, &samples)
        });
        self.0.insert(key, wanted);
        Ok((wanted, stored))
    }
}
