//! The responses of the DoE, computed from its samples design by design.

use std::collections::{BTreeMap, BTreeSet};

use anyhow::Context as _;
use ledger::StreamId;
use problem::formulation::Problem;
use stats::streams::Purpose;
use store::{ResponseRow, SampleBlock};

use crate::linear::LinearResponse;
use crate::responses::{self, Samples, Sufficiency};

/// The result of a [`Collector`].
#[derive(Debug, Clone, PartialEq)]
pub enum Outcome {
    /// The responses of all designs that have enough samples.
    Responses(Vec<ResponseRow>),
    /// No responses yet: the number of samples that each of these designs needs for the precision.
    Wants(BTreeMap<u64, u64>),
}

/// Computes responses from samples in the order of design and sample.
#[derive(Debug)]
pub struct Collector<'a> {
    problem: &'a Problem,
    /// The control variates of designs.
    linear: &'a BTreeMap<u64, LinearResponse>,
    /// Streams that get no more samples.
    quarantined: &'a BTreeSet<StreamId>,
    design: Option<u64>,
    samples: Vec<f64>,
    rows: Vec<ResponseRow>,
    wanting: BTreeMap<u64, u64>,
}

impl<'a> Collector<'a> {
    /// A collector without samples.
    #[must_use]
    pub const fn new(
        problem: &'a Problem,
        linear: &'a BTreeMap<u64, LinearResponse>,
        quarantined: &'a BTreeSet<StreamId>,
    ) -> Self {
        Self {
            problem,
            linear,
            quarantined,
            design: None,
            samples: Vec::new(),
            rows: Vec::new(),
            wanting: BTreeMap::new(),
        }
    }

    /// Takes the next samples.
    pub fn push(&mut self, block: &SampleBlock) -> anyhow::Result<()> {
        let design = block.stream.index;
        if self.design != Some(design) {
            self.close()?;
            self.design = Some(design);
        }
        let most = self.problem.campaign().sampling.samples_max() as usize;
        // Samples beyond a hole wait until it is filled.
        if block.first_sample == self.samples.len() as u64 {
            let wanted = most.saturating_sub(self.samples.len());
            self.samples.extend(block.samples.iter().take(wanted));
        }
        Ok(())
    }

    /// The responses from all samples, or the samples still needed.
    pub fn finish(mut self) -> anyhow::Result<Outcome> {
        self.close()?;
        Ok(if self.wanting.is_empty() {
            Outcome::Responses(self.rows)
        } else {
            Outcome::Wants(self.wanting)
        })
    }

    fn close(&mut self) -> anyhow::Result<()> {
        let settings = &self.problem.campaign().sampling;
        if let Some(design) = self.design
            && self.samples.len() >= settings.samples_per_design as usize
        {
            let context = || format!("the samples of design {design}");
            let count =
                match responses::sufficiency(&self.samples, settings).with_context(context)? {
                    Sufficiency::Enough(count) => count,
                    Sufficiency::Wants { samples, at_least } => {
                        if !self.is_quarantined(design) {
                            self.wanting.insert(design, samples as u64);
                        }
                        at_least
                    }
                };
            let control = self.linear.get(&design).map(|linear| {
                let stream = (Purpose::Wear, design);
                let values = responses::controls(self.problem, stream, linear, count);
                (values, linear.moments())
            });
            let samples = Samples {
                values: &self.samples[..count],
                control: control
                    .as_ref()
                    .map(|(values, known)| (&values[..], *known)),
            };
            let row = responses::response_of(design, samples, settings).with_context(context)?;
            self.rows.push(row);
        }
        self.samples.clear();
        Ok(())
    }

    fn is_quarantined(&self, design: u64) -> bool {
        let stream = u32::try_from(design).map(StreamId::design);
        stream.is_ok_and(|stream| self.quarantined.contains(&stream))
    }
}

#[cfg(test)]
mod tests {
    use std::ops::Range;

    use problem::Campaign;

    use super::*;

    /// A campaign of ten samples a design, with this precision in µm.
    fn problem(precision: Option<f64>) -> Problem {
        let mut campaign = Campaign::parse("paper.toml", Campaign::PAPER).unwrap();
        campaign.sampling.samples_per_design = 10;
        campaign.sampling.precision = precision;
        campaign.sampling.samples_max = precision.map(|_| 60);
        Problem::new(campaign)
    }

    /// Samples of a design that scatter by `sd`.
    fn blocks(design: u32, samples: Range<u64>, sd: f64) -> Vec<SampleBlock> {
        let value = |sample: u64| {
            if sample.is_multiple_of(2) {
                1.0 - sd
            } else {
                1.0 + sd
            }
        };
        vec![SampleBlock {
            stream: StreamId::design(design),
            first_sample: samples.start,
            samples: samples.map(value).collect(),
        }]
    }

    fn computed(problem: &Problem, blocks: &[SampleBlock], quarantined: &[u32]) -> Outcome {
        let linear = BTreeMap::new();
        let quarantined = quarantined.iter().copied().map(StreamId::design).collect();
        let mut collector = Collector::new(problem, &linear, &quarantined);
        for block in blocks {
            collector.push(block).unwrap();
        }
        collector.finish().unwrap()
    }

    #[test]
    fn samples_beyond_a_hole_wait_until_it_is_filled() {
        let mut held = blocks(0, 0..12, 0.2);
        held.extend(blocks(3, 0..7, 0.2));
        held.extend(blocks(3, 8..12, 0.2));
        held.extend(blocks(4, 0..6, 0.2));
        held.extend(blocks(4, 6..10, 0.2));
        let Outcome::Responses(responses) = computed(&problem(None), &held, &[]) else {
            panic!("nothing more is wanted without a precision");
        };
        let designs: Vec<u64> = responses.iter().map(|row| row.design).collect();
        assert_eq!(designs, [0, 4]);
        let [of_twelve, of_ten] = &responses[..] else {
            panic!("two responses");
        };
        assert_eq!(
            of_twelve.percentile, of_ten.percentile,
            "the first ten count"
        );
    }

    #[test]
    fn designs_that_want_more_hold_up_the_others_until_they_are_quarantined() {
        let mut held = blocks(0, 0..10, 0.01);
        held.extend(blocks(1, 0..10, 0.35));
        let precise = problem(Some(0.1));
        let wants = computed(&precise, &held, &[]);
        assert_eq!(wants, Outcome::Wants(BTreeMap::from([(1, 20)])));
        let Outcome::Responses(responses) = computed(&precise, &held, &[1]) else {
            panic!("what is quarantined is not waited for");
        };
        assert_eq!(responses.len(), 2);
    }
}
