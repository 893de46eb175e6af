//! The measures of the designs of the DoE, computed from their samples design by design.

use std::collections::{BTreeMap, BTreeSet};

use anyhow::Context as _;
use ledger::StreamId;
use problem::formulation::Problem;
use stats::Samples;
use stats::streams::Purpose;
use store::{ResponseRow, SampleBlock};

use crate::linear::LinearResponse;
use crate::plausibility::{Outlier, Plausibility, Summary};
use crate::responses::{self, Sufficiency};

/// The result of a [`Collector`].
#[derive(Debug, Clone, PartialEq)]
pub enum Outcome {
    /// The responses of all designs that have enough samples, and none that is absurd.
    Responses(Vec<ResponseRow>, Plausibility),
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
    samples: Samples,
    rows: Vec<ResponseRow>,
    wanting: BTreeMap<u64, u64>,
    /// The plausibility of the samples behind `rows`, for each response; empty for the built-in simulator.
    summaries: Vec<Vec<Summary>>,
    /// Stored samples that the campaign's limits refuse.
    refused: Vec<Outlier>,
}

impl<'a> Collector<'a> {
    /// A collector without samples.
    #[must_use]
    pub fn new(
        problem: &'a Problem,
        linear: &'a BTreeMap<u64, LinearResponse>,
        quarantined: &'a BTreeSet<StreamId>,
    ) -> Self {
        Self {
            problem,
            linear,
            quarantined,
            design: None,
            samples: Samples::none(problem.sampled().len()),
            rows: Vec::new(),
            wanting: BTreeMap::new(),
            summaries: vec![Vec::new(); problem.sampled().len()],
            refused: Vec::new(),
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
            self.samples.extend(&block.samples.first(wanted));
        }
        Ok(())
    }

    /// The responses from all samples, or the samples still needed.
    pub fn finish(mut self) -> anyhow::Result<Outcome> {
        self.close()?;
        let mut found = Plausibility::of(&self.summaries);
        found.outliers.append(&mut self.refused);
        found.outliers.sort_by_key(|one| one.design);
        self.rows.retain(|row| !found.excludes(row.design));
        self.wanting.retain(|design, _| !found.excludes(*design));
        Ok(if self.wanting.is_empty() {
            Outcome::Responses(self.rows, found)
        } else {
            Outcome::Wants(self.wanting)
        })
    }

    fn close(&mut self) -> anyhow::Result<()> {
        let none = Samples::none(self.samples.width());
        let samples = std::mem::replace(&mut self.samples, none);
        if let Some(design) = self.design {
            let computed = self.respond(design, &samples);
            computed.with_context(|| format!("the samples of design {design}"))?;
        }
        Ok(())
    }

    /// Computes the measures of a design if it has enough samples.
    fn respond(&mut self, design: u64, samples: &Samples) -> Result<(), stats::Error> {
        let objective = self.problem.objective();
        let settings = objective.sampling();
        let first = settings.samples_per_design as usize;
        if samples.len() < first {
            return Ok(());
        }
        // The campaign may have got limits since they were stored.
        let is_external = self.problem.campaign().is_external();
        let is_refused = |row: &[f64]| is_external && self.problem.check_sample(row).is_err();
        let refused = samples.rows().position(is_refused);
        let taken = samples.first(refused.unwrap_or(samples.len()));
        let sufficiency = (taken.len() >= first)
            .then(|| responses::sufficiency(&objective.values(&taken), settings))
            .transpose()?;
        let count = match (sufficiency, refused) {
            (Some(Sufficiency::Enough(count)), _) => count,
            (Some(Sufficiency::Wants { samples, at_least }), None) => {
                if !self.is_quarantined(design) {
                    self.wanting.insert(design, samples as u64);
                }
                at_least
            }
            (_, Some(sample)) => {
                self.refused.extend(self.refusal(design, sample, samples));
                return Ok(());
            }
            (None, None) => return Ok(()),
        };
        let control = self.linear.get(&design).map(|linear| {
            let stream = (Purpose::Wear, design);
            let values = responses::controls(self.problem, stream, linear, count);
            (values, linear.moments())
        });
        let taken = taken.first(count);
        let control = control
            .as_ref()
            .map(|(values, known)| (&values[..], *known));
        let rows = responses::measures(self.problem, design, &taken, control)?;
        self.rows.extend(rows);
        if is_external {
            for (response, summaries) in self.summaries.iter_mut().enumerate() {
                let values: Vec<f64> = taken.rows().map(|row| row[response]).collect();
                summaries.extend(Summary::of(design, &values, first));
            }
        }
        Ok(())
    }

    /// A stored sample that the campaign's limits refuse, with the response and the value at fault.
    fn refusal(&self, design: u64, sample: usize, samples: &Samples) -> Option<Outlier> {
        let row = samples.get(sample)?;
        let (name, _) = self.problem.check_sample(row).err()?;
        let mut sampled = self.problem.sampled().iter();
        let response = sampled.position(|one| one.name == name)?;
        Some(Outlier {
            design,
            sample: sample as u64,
            response,
            value: *row.get(response)?,
            is_excluded: true,
        })
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
            samples: samples.map(value).collect::<Vec<f64>>().into(),
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
        let Outcome::Responses(responses, _) = computed(&problem(None), &held, &[]) else {
            panic!("nothing more is wanted without a precision");
        };
        let designs: Vec<u64> = responses.iter().map(|row| row.design).collect();
        assert_eq!(designs, [0, 4]);
        let [of_twelve, of_ten] = &responses[..] else {
            panic!("two responses");
        };
        assert_eq!(of_twelve.measure, of_ten.measure, "the first ten count");
    }

    #[test]
    fn designs_that_want_more_hold_up_the_others_until_they_are_quarantined() {
        let mut held = blocks(0, 0..10, 0.01);
        held.extend(blocks(1, 0..10, 0.35));
        let precise = problem(Some(0.1));
        let wants = computed(&precise, &held, &[]);
        assert_eq!(wants, Outcome::Wants(BTreeMap::from([(1, 20)])));
        let Outcome::Responses(responses, _) = computed(&precise, &held, &[1]) else {
            panic!("what is quarantined is not waited for");
        };
        assert_eq!(responses.len(), 2);
    }

    /// An external campaign with these keys of `[[responses]]` and of `[sampling]`.
    fn external(response: &str, sampling: &str) -> Problem {
        let text = include_str!("../../../campaigns/ishigami/campaign.toml");
        let text = text.replace("[[responses]]\n", &format!("[[responses]]\n{response}\n"));
        let mut campaign = Campaign::parse("c.toml", &text).unwrap();
        campaign.sampling = problem(None).campaign().sampling.clone();
        campaign.sampling.precision = (!sampling.is_empty()).then_some(0.1);
        campaign.sampling.samples_max = (!sampling.is_empty()).then_some(60);
        Problem::new(campaign)
    }

    /// The squares of 1e160 overflow; a fit through 1e50 predicts as much below zero elsewhere.
    #[test]
    fn an_absurd_sample_costs_its_design_alone() {
        for (value, limit, precision) in [
            (1e160, "", ""),
            (1e50, "", ""),
            (1e50, "", "precise"),
            (1e160, "", "precise"),
            (7.0, "max = 5.0", "precise"),
            (7.0, "max = 5.0", ""),
        ] {
            let problem = external(limit, precision);
            let mut held: Vec<SampleBlock> = (0..5).flat_map(|d| blocks(d, 0..10, 0.01)).collect();
            let undisturbed = computed(&problem, &held, &[]);
            let mut values = held[2].samples.values().to_vec();
            values[4] = value;
            held[2].samples = values.into();
            let Outcome::Responses(responses, found) = computed(&problem, &held, &[]) else {
                panic!("{value:?}: the absurd sample asks for more")
            };
            let outlier = Outlier {
                design: 2,
                sample: 4,
                response: 0,
                value,
                is_excluded: true,
            };
            assert_eq!(found.outliers, [outlier]);
            let Outcome::Responses(mut all, none) = undisturbed else {
                panic!("ten samples are enough")
            };
            assert_eq!(none.outliers, []);
            all.remove(2);
            assert_eq!(responses, all, "{value:?}");
            let [sentence] = &found.sentences(&problem)[..] else {
                panic!("one sentence")
            };
            assert!(
                sentence.contains("design 2 (y of sample 4 is "),
                "{sentence}"
            );
        }
    }
}
