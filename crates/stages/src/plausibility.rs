//! Samples of an external program that are absurd beside all others of the DoE.
//!
//! The scale is the median of the designs' medians, together with the usual scatter of samples and designs. A sample
//! says nothing about its design if it is so far from that median that, in double precision, adding it rounds the
//! others away. The design then gets no response. A sample that is far, but may come from a heavy tail or stand for a
//! failed run, is reported and counts.

use problem::formulation::{Problem, Quantity};
use serde::{Deserialize, Serialize};
use stats::Samples;
use store::{DerivedResult, Store};

/// Distance in scales from which a sample is reported.
const DOUBTFUL: f64 = 1e6;
/// Distance in scales from which a sample excludes its design: added to it, the others are rounded away.
const ABSURD: f64 = 1.0 / f64::EPSILON;

/// The scale of a campaign's samples.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Scale {
    /// The median of the designs' medians.
    centre: f64,
    /// Unit of the distance from it: the largest of its magnitude, the median distance of the designs' medians
    /// from it, and the median of the designs' interquartile ranges.
    unit: f64,
}

/// A sample that is far from all others.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Outlier {
    /// Index of the design.
    pub design: u64,
    /// Index of the sample.
    pub sample: u64,
    /// Index of the response.
    pub response: usize,
    /// Its value.
    pub value: f64,
    /// Whether the design has no response because of it.
    pub is_excluded: bool,
}

/// The plausibility of the samples of the DoE.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Plausibility {
    /// The scale of each response; `None` if it has no samples or most of them are 0. Empty if no response has a
    /// scale.
    pub scales: Vec<Option<Scale>>,
    /// The farthest sample of each response and design that has a doubtful one, in the order of the designs.
    pub outliers: Vec<Outlier>,
}

/// The statistics of a design's samples of one response from which plausibility is judged.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Summary {
    design: u64,
    median: f64,
    interquartile: f64,
    /// The smallest and the largest sample, with their indices.
    extremes: [(u64, f64); 2],
}

impl Summary {
    /// The summary of a design. Median and interquartile range are those of the `first` samples, the extremes those
    /// of all samples. `None` if the first samples have all failed.
    pub(crate) fn of(design: u64, samples: &[f64], first: usize) -> Option<Self> {
        let finite = |count: usize| {
            let samples = (0..).zip(samples.iter().copied()).take(count);
            samples.filter(|(_, value)| value.is_finite())
        };
        let mut sorted: Vec<f64> = finite(first).map(|(_, value)| value).collect();
        sorted.sort_by(f64::total_cmp);
        let last = sorted.len().checked_sub(1)?;
        let quarter = |quarters: usize| sorted[quarters * last / 4];
        let by_value = |a: &(u64, f64), b: &(u64, f64)| a.1.total_cmp(&b.1);
        Some(Self {
            design,
            median: quarter(2),
            interquartile: quarter(3) - quarter(1),
            extremes: [
                finite(samples.len()).min_by(by_value)?,
                finite(samples.len()).max_by(by_value)?,
            ],
        })
    }
}

impl Scale {
    fn of(designs: &[Summary]) -> Option<Self> {
        let median = |of: &dyn Fn(&Summary) -> f64| {
            let mut values: Vec<f64> = designs.iter().map(of).collect();
            values.sort_by(f64::total_cmp);
            values.get(values.len().checked_sub(1)? / 2).copied()
        };
        let centre = median(&|one| one.median)?;
        let within = median(&|one| one.interquartile)?;
        let between = median(&|one| (one.median - centre).abs())?;
        let unit = centre.abs().max(within).max(between);
        (unit > 0.0).then_some(Self { centre, unit })
    }

    /// Distance of a sample from the centre, in units.
    fn distance(self, value: f64) -> f64 {
        (value - self.centre).abs() / self.unit
    }

    /// Whether a sample is so far away that its design gets no response. A failed sample is not.
    fn is_absurd(self, value: f64) -> bool {
        value.is_finite() && self.distance(value) >= ABSURD
    }
}

impl Plausibility {
    /// The plausibility of samples: for each response the designs, which are in order.
    pub(crate) fn of(responses: &[Vec<Summary>]) -> Self {
        let mut this = Self::default();
        for (response, designs) in responses.iter().enumerate() {
            let scale = Scale::of(designs);
            let farthest = |one: &Summary| {
                let scale = scale?;
                let [low, high] = one.extremes.map(|(_, value)| scale.distance(value));
                let (sample, value) = one.extremes[usize::from(high > low)];
                (low.max(high) >= DOUBTFUL).then(|| Outlier {
                    design: one.design,
                    sample,
                    response,
                    value,
                    is_excluded: scale.is_absurd(value),
                })
            };
            this.outliers.extend(designs.iter().filter_map(farthest));
            this.scales.push(scale);
        }
        if this.scales.iter().all(Option::is_none) {
            this.scales.clear();
        }
        this.outliers.sort_by_key(|one| one.design);
        this
    }

    /// Reads the plausibility that was found when the stored responses were computed.
    ///
    /// # Errors
    ///
    /// The store cannot be read.
    pub async fn read(store: &Store) -> Result<Self, store::Error> {
        let mut derivations = store.derivations().await?;
        let found = derivations.remove(&DerivedResult::Responses.name());
        let found = found.and_then(|found| serde_json::from_str(&found.failure?).ok());
        Ok(found.unwrap_or_default())
    }

    /// Whether a design has no response because of one of its samples.
    #[must_use]
    pub fn excludes(&self, design: u64) -> bool {
        let mut outliers = self.outliers.iter();
        outliers.any(|one| one.design == design && one.is_excluded)
    }

    /// The first of these samples that says nothing about its design: its index, the name of the response and the
    /// value.
    #[must_use]
    pub fn absurd<'p>(
        &self,
        problem: &'p Problem,
        samples: &Samples,
    ) -> Option<(usize, &'p str, f64)> {
        let is_far = |response: usize, value: f64| {
            let scale = self.scales.get(response).copied().flatten();
            scale.is_some_and(|scale| scale.is_absurd(value))
        };
        let mut rows = samples.rows().enumerate();
        rows.find_map(|(sample, row)| {
            let refused = problem.check_sample(row).err().map(|(name, _)| name);
            let mut named = problem.sampled().iter().zip(row).enumerate();
            let found = named.find(|(response, (quantity, value))| {
                refused == Some(&*quantity.name) || is_far(*response, **value)
            });
            found.map(|(_, (quantity, value))| (sample, &*quantity.name, *value))
        })
    }

    /// A sentence on the designs without a response, and one on the others with a doubtful sample.
    #[must_use]
    pub fn sentences(&self, problem: &Problem) -> Vec<String> {
        let named = |are_excluded: bool| {
            let outliers = self.outliers.iter();
            let found: Vec<&Outlier> = outliers
                .filter(|one| one.is_excluded == are_excluded)
                .collect();
            (!found.is_empty()).then(|| listed(problem, &found))
        };
        let excluded = named(true).map(|designs| {
            format!(
                "Designs that the model and the optima leave out because of an absurd sample: {designs}. Mend the \
                 program or limit the response (min and max of [[responses]]), remove the samples of each with \
                 `coordinator discard --db FILE --design N --yes`, and give the same command again."
            )
        });
        let doubtful = named(false).map(|designs| {
            format!(
                "These designs count although a sample of each lies farther from the median than a million times the usual \
                 scatter: {designs}. If they are faults of the program, min and max of [[responses]] make them failures."
            )
        });
        excluded.into_iter().chain(doubtful).collect()
    }
}

/// Number of designs that a sentence names.
const NAMED: usize = 5;

fn listed(problem: &Problem, outliers: &[&Outlier]) -> String {
    let named = outliers.iter().take(NAMED).map(|one| {
        let Outlier {
            design,
            sample,
            response,
            value,
            ..
        } = one;
        let Quantity { name, unit } = &problem.sampled()[*response];
        let unit = match &**unit {
            "" => String::new(),
            unit => format!(" {unit}"),
        };
        format!("design {design} ({name} of sample {sample} is {value:?}{unit})")
    });
    let more = outliers.len().saturating_sub(NAMED);
    let more = (more > 0).then(|| format!("{more} more"));
    named.chain(more).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Twelve designs of thirty samples that lie around `offset`, with a standard deviation of about 1.
    fn designs(offset: f64) -> Vec<Vec<f64>> {
        let normal = |i: u32| stats::normal_quantile((f64::from(i) + 0.5) / 30.0);
        let design = |number: u32| {
            let samples = (0..30).map(|i| normal((7 * i + number) % 30));
            samples
                .map(|sample| offset + 0.1 * f64::from(number) + sample)
                .collect()
        };
        (0..12).map(design).collect()
    }

    fn found(designs: &[Vec<f64>]) -> Plausibility {
        let summaries = (0..).zip(designs);
        let summaries = summaries.filter_map(|(design, of)| Summary::of(design, of, 30));
        Plausibility::of(&[summaries.collect()])
    }

    #[test]
    fn an_absurd_sample_excludes_its_design_and_a_far_one_is_reported() {
        for offset in [0.0, 1.0, -300.0] {
            let mut all = designs(offset);
            assert_eq!(found(&all).outliers, []);
            for (design, sample, value) in [(3, 7, 1e50), (5, 29, -1e30), (8, 0, 1e9)] {
                all[design][sample] = value;
            }
            let outliers = found(&all).outliers;
            let seen: Vec<_> = outliers
                .iter()
                .map(|one| (one.design, one.sample, one.value, one.is_excluded))
                .collect();
            let expected = [(3, 7, 1e50, true), (5, 29, -1e30, true), (8, 0, 1e9, false)];
            assert_eq!(seen, expected);
        }
    }

    /// The scale stays as long as most designs, and most samples of a design, are plausible.
    #[test]
    fn the_scale_does_not_follow_the_absurd_samples() {
        let mut all = designs(1.0);
        for design in &mut all[..5] {
            design.fill(1e40);
        }
        for design in &mut all[5..] {
            design[..6].fill(1e40);
        }
        let found = found(&all);
        assert_eq!(found.outliers.len(), 12);
        assert!((0..12).all(|design| found.excludes(design)));
    }

    #[test]
    fn heavy_tails_and_penalties_exclude_nothing() {
        let quantile = |i: u32| (f64::from(i) + 0.5) / 360.0;
        let cauchy = |p: f64| (std::f64::consts::PI * (p - 0.5)).tan();
        let log_normal = |p: f64| (3.0 * stats::normal_quantile(p)).exp();
        let penalty = |p: f64| if p > 0.95 { 1e9 } else { p };
        for sample in [&cauchy as &dyn Fn(f64) -> f64, &log_normal, &penalty] {
            let design = |number: u32| {
                let samples = (0..30).map(|i| sample(quantile(12 * i + number)));
                samples.collect::<Vec<f64>>()
            };
            let all: Vec<_> = (0..12).map(design).collect();
            let outliers = found(&all).outliers;
            assert!(outliers.iter().all(|one| !one.is_excluded), "{outliers:?}");
        }
    }

    #[test]
    fn without_a_scale_nothing_is_judged() {
        let mut all = vec![vec![0.0; 30]; 12];
        all[2][3] = 1e90;
        assert_eq!(found(&all), Plausibility::default());
        assert_eq!(found(&[]), Plausibility::default());
        assert_eq!(found(&[vec![f64::INFINITY; 30]]), Plausibility::default());
    }
}
