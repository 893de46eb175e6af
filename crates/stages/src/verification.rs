//! The verification samples of an optimum or a printed design: how many it gets, and those in the store.

use std::collections::{BTreeMap, BTreeSet};

use ledger::StreamId;
use problem::Campaign;
use problem::formulation::Design;
use store::Store;

/// Number of samples that a point with these samples gets. It depends on the campaign and on the first
/// samples alone, so samples that came early change nothing.
#[must_use]
pub fn wanted(campaign: &Campaign, samples: &[f64]) -> u32 {
    let verify = &campaign.verify;
    let first = verify.first();
    let Some(pilot) = samples.get(..first as usize) else {
        return first;
    };
    let pilot = campaign.sampling.verified(pilot);
    pilot.map_or(first, |pilot| verify.wanted(&pilot))
}

/// The verification of a point, as far as the store holds it.
#[derive(Debug, Clone, PartialEq)]
pub struct Verification {
    /// The samples, those from the first on.
    pub samples: Vec<f64>,
    /// Number of samples that the point gets, as far as is known.
    pub wanted: usize,
}

impl Verification {
    /// Reads the verification of a point.
    pub async fn read(
        store: &Store,
        campaign: &Campaign,
        point: StreamId,
    ) -> Result<Self, store::Error> {
        let held = store.samples_of(point).await?;
        let samples: Vec<f64> = (0..)
            .zip(held)
            .take_while(|(index, (sample, _))| index == sample)
            .map(|(_, (_, value))| value)
            .collect();
        Ok(Self {
            wanted: wanted(campaign, &samples) as usize,
            samples,
        })
    }

    /// Whether all samples are there.
    #[must_use]
    pub fn is_complete(&self) -> bool {
        self.samples.len() >= self.wanted
    }
}

/// The numbers of samples that follow from samples read before.
#[derive(Debug, Default)]
pub struct Sizes(BTreeMap<(StreamId, Vec<u64>), u32>);

impl Sizes {
    /// Number of samples that the point at `design` gets, and the indices of those in the store,
    /// of which there are `count`.
    pub(crate) async fn of(
        &mut self,
        store: &Store,
        campaign: &Campaign,
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
        let held = store.samples_of(point).await?;
        let stored: BTreeSet<u32> = held
            .iter()
            .filter_map(|(sample, _)| u32::try_from(*sample).ok())
            .collect();
        let first = campaign.verify.first();
        if known.is_none() && !(0..first).all(|sample| stored.contains(&sample)) {
            return Ok((first, stored));
        }
        let wanted = known.unwrap_or_else(|| {
            let values: Vec<f64> = held.iter().map(|(_, value)| *value).collect();
            wanted(campaign, &values)
        });
        self.0.insert(key, wanted);
        Ok((wanted, stored))
    }
}
