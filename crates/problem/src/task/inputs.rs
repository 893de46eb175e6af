//! The inputs on which the values of a stream depend.

use std::sync::Arc;

use ledger::{Generation, History, StreamDemand, StreamId};
use sha2::{Digest as _, Sha256};

use super::Source;
use crate::Campaign;

/// The digest of the inputs common to all values of a campaign, independent of the campaign's size.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Inputs {
    digest: [u8; 32],
    /// Whether failures of designs and points are results.
    tolerates_failures: bool,
}

impl Inputs {
    /// The inputs of a campaign whose simulator has this model digest. The digest is absent before
    /// an external program has answered; a store then accepts the samples of only one simulator.
    #[must_use]
    pub fn new(campaign: &Campaign, model_digest: Option<&str>) -> Self {
        let mut hash = Sha256::new();
        hash.update(campaign.values_digest());
        hash.update(model_digest.unwrap_or_default());
        Self {
            digest: hash.finalize().into(),
            tolerates_failures: campaign.is_external() && campaign.sampling.tolerates_failures(),
        }
    }

    /// The generation of a stream: the digest of everything that its values depend on.
    #[must_use]
    pub fn generation(&self, stream: StreamId, source: &Source) -> Generation {
        let mut hash = Sha256::new();
        hash.update(self.digest);
        hash.update(stream.to_string());
        let mut number = |number: f64| hash.update(number.to_bits().to_le_bytes());
        match source {
            // The responses follow from the design.
            Source::Design(design) | Source::Analysed { design, .. } | Source::Point(design) => {
                design.values().iter().copied().for_each(number);
            }
            Source::Run(run) => {
                run.base.values().iter().copied().for_each(&mut number);
                if let Some(from) = &run.from {
                    from.values().iter().copied().for_each(&mut number);
                }
                run.models.iter().for_each(|model| hash.update(&**model));
            }
            Source::Candidates(candidates) => {
                for candidate in candidates {
                    number(f64::from(candidate.evaluation));
                    number(f64::from(u8::from(candidate.may_improve)));
                    candidate
                        .design
                        .values()
                        .iter()
                        .copied()
                        .for_each(&mut number);
                }
            }
        }
        let digest = hash.finalize();
        let first = digest.first_chunk().expect("SHA-256 has 32 bytes");
        Generation(u64::from_le_bytes(*first))
    }

    /// A stream that needs this many samples and has none yet, as an input of the ledger.
    #[must_use]
    pub fn wanted(
        &self,
        stream: StreamId,
        source: Source,
        samples: u32,
    ) -> StreamDemand<Arc<Source>> {
        let is_tolerant = match source {
            Source::Candidates(_) => true,
            Source::Design(_) | Source::Analysed { .. } | Source::Point(_) => {
                self.tolerates_failures
            }
            Source::Run(_) => false,
        };
        let is_analysed = !matches!(source, Source::Design(_));
        StreamDemand {
            stream,
            generation: self.generation(stream, &source),
            source: Arc::new(source),
            samples,
            missing: std::iter::once(0..samples).collect(),
            history: History::default(),
            is_tolerant,
            is_analysed,
        }
    }
}
