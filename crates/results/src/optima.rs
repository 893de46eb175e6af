//! The optima of a campaign with their verification, and which of them is recommended.

use problem::Approach;
use problem::formulation::{Bound, Constraint, Problem, ResponseMeasure};
use serde::{Deserialize, Serialize};
use stages::names;
use stages::optima::{self, Optimum};
use stages::verification::Verification;
use stats::{IntervalEstimate, Samples};
use store::Store;

use crate::estimate::Estimate;
use crate::number::percent;

/// An optimum with its verification.
#[derive(Debug, Clone, PartialEq)]
pub struct VerifiedOptimum {
    pub optimum: Optimum,
    /// The constraints on deterministic responses; empty without a design.
    pub constraints: Vec<Constraint>,
    /// The constraints on measures of samples; empty until all verification samples are there.
    pub limits: Vec<VerifiedLimit>,
    /// The verification samples in the store; `None` without a design.
    pub verification: Option<Verification>,
    /// The verified measure with its 95 % interval; `None` until all samples are there.
    pub measure: Option<IntervalEstimate>,
    /// The difference of the measure from that of the recommended optimum, positive if worse, from samples with
    /// the same random numbers. `None` for the recommended optimum, for one that is not ranked, and if the samples
    /// are too few for an interval.
    pub behind: Option<IntervalEstimate>,
}

/// A constraint on a measure of samples, judged by verification samples.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct VerifiedLimit {
    /// The constraint's name.
    pub constraint: String,
    /// The measure as a phrase, such as P(stress > 400 MPa).
    pub measure: String,
    /// Its unit; empty for a probability.
    pub unit: String,
    /// The verified value with its 95 % interval.
    #[serde(flatten)]
    pub value: Estimate,
    /// The relation that the value must have to the limit, ≤ or ≥.
    pub relation: Bound,
    /// The limit.
    pub limit: f64,
    /// Whether the value keeps the limit.
    pub holds: bool,
    /// The confidence with which the samples show that it does; absent if they are too few.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub confidence: Option<f64>,
}

impl VerifiedLimit {
    fn of(measure: &ResponseMeasure, samples: &Samples) -> Option<Self> {
        let limit = measure.limit()?;
        let value = measure.verified(samples).ok()?;
        Some(Self {
            constraint: measure.quantity.name.to_string(),
            measure: measure.title(),
            unit: measure.limit_unit().to_owned(),
            value: value.into(),
            relation: measure.relation(),
            limit,
            holds: measure.keeps_limit(value.value),
            confidence: measure.confidence(samples),
        })
    }

    /// Whether the samples show with a confidence of 95 % that the limit is kept.
    #[must_use]
    pub fn is_shown(&self) -> bool {
        self.confidence.is_some_and(|confidence| confidence >= 0.95)
    }

    /// The constraint, evaluated at the verified value.
    #[must_use]
    pub fn constraint(&self) -> Constraint {
        let (name, unit) = (self.measure.clone(), self.unit.clone());
        Constraint::new(name, unit, self.value.value, self.relation, self.limit)
    }

    /// The constraint as a phrase, such as P(stress > 400 MPa) ≤ 0.001.
    #[must_use]
    pub fn statement(&self) -> String {
        format!("{} {}", self.measure, self.relation_to_limit())
    }

    /// The relation and the limit as the file states it, such as ≤ 0.001.
    #[must_use]
    pub fn relation_to_limit(&self) -> String {
        let space = if self.unit.is_empty() { "" } else { " " };
        format!("{} {}{space}{}", self.relation, self.limit, self.unit)
    }

    /// The confidence in words.
    #[must_use]
    pub fn confidence_in_words(&self) -> String {
        match self.confidence {
            _ if !self.holds => "broken".to_owned(),
            None => "too few samples to tell".to_owned(),
            // `ResponseMeasure::confidence` returns 0.9999 at most.
            Some(confidence) if confidence > 0.9998 => "holds, confidence above 99.9 %".to_owned(),
            // And 0.5 at least.
            Some(confidence) if confidence <= 0.5 => "holds, confidence at most 50 %".to_owned(),
            // Rounded down: 94.99 % is not 95 %.
            Some(confidence) => {
                let confidence = (1e3 * confidence).floor() / 1e3;
                format!("holds, confidence {}", percent(confidence))
            }
        }
    }
}

impl VerifiedOptimum {
    /// The verification samples; `None` without a design.
    #[must_use]
    pub fn samples(&self) -> Option<&Samples> {
        self.verification.as_ref().map(|one| &one.samples)
    }

    /// The values of the verification samples from which the optimised measure is estimated; empty without a design.
    #[must_use]
    pub fn values(&self, problem: &Problem) -> Vec<f64> {
        let samples = self.samples();
        samples.map_or_else(Vec::new, |samples| problem.objective().values(samples))
    }

    /// Whether the design keeps every limit, those on measures by the verification samples that are there.
    #[must_use]
    pub fn keeps_limits(&self) -> bool {
        self.optimum.feasible().is_some() && self.limits.iter().all(|limit| limit.holds)
    }

    /// The verified measure as a cost, which is minimised; `None` for a design that cannot be recommended, because it
    /// breaks a limit or has no measure.
    #[must_use]
    pub fn cost(&self, problem: &Problem) -> Option<f64> {
        let cost = problem.cost(self.measure?.value);
        let is_judged = self.limits.len() == problem.limited().len();
        (is_judged && self.keeps_limits() && cost.is_finite()).then_some(cost)
    }
}

/// The optima of a campaign, in the order of the paper's Table 5.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Optima {
    all: Vec<VerifiedOptimum>,
    /// The indices of the ranked optima, the best first.
    ranking: Vec<usize>,
}

impl Optima {
    /// Reads the optima of the campaign in `store`, which is that of `problem`.
    ///
    /// # Errors
    ///
    /// The store cannot be read, or its optima are not of this problem.
    pub async fn read(store: &Store, problem: &Problem) -> anyhow::Result<Self> {
        let mut verified = Vec::new();
        for optimum in optima::stored(store, problem).await? {
            let verification = match optimum.found {
                Ok(_) => {
                    let point = names::verification(optimum.approach);
                    Some(Verification::read(store, problem, point).await?)
                }
                Err(_) => None,
            };
            verified.push((optimum, verification));
        }
        Ok(Self::new(problem, verified))
    }

    /// Ranks optima, which are in the order of Table 5.
    #[must_use]
    pub fn new(problem: &Problem, optima: Vec<(Optimum, Option<Verification>)>) -> Self {
        let verified = |(optimum, verification): (Optimum, Option<Verification>)| {
            let samples = verification
                .as_ref()
                .filter(|verification| verification.is_complete())
                .map(|verification| &verification.samples);
            let limits = samples.map_or_else(Vec::new, |samples| {
                let limited = problem.limited().iter();
                limited
                    .filter_map(|measure| VerifiedLimit::of(measure, samples))
                    .collect()
            });
            VerifiedOptimum {
                constraints: match &optimum.found {
                    Ok(found) => {
                        let criteria = problem.with_limited(&found.criteria, &[]);
                        problem.constraints(&criteria)
                    }
                    Err(_) => Vec::new(),
                },
                limits,
                measure: samples.and_then(|samples| problem.objective().verified(samples).ok()),
                behind: None,
                optimum,
                verification,
            }
        };
        let mut all: Vec<VerifiedOptimum> = optima.into_iter().map(verified).collect();
        let ranked = all.iter().zip(0..).filter_map(|(optimum, place)| {
            let cost = optimum.cost(problem)?;
            is_ranked(problem, optimum.optimum.approach).then_some((cost, place))
        });
        let mut ranked: Vec<(f64, usize)> = ranked.collect();
        ranked.sort_by(|(a, _), (b, _)| a.total_cmp(b));
        let ranking: Vec<usize> = ranked.into_iter().map(|(_, place)| place).collect();
        if let Some((&best, others)) = ranking.split_first() {
            for &other in others {
                all[other].behind = behind(problem, &all[other], &all[best]);
            }
        }
        Self { all, ranking }
    }

    /// The optimum of an approach.
    #[must_use]
    pub fn of(&self, approach: Approach) -> Option<&VerifiedOptimum> {
        self.iter()
            .find(|optimum| optimum.optimum.approach == approach)
    }

    /// All optima, in the order of Table 5.
    pub fn iter(&self) -> impl Iterator<Item = &VerifiedOptimum> {
        self.all.iter()
    }

    /// The ranked optima, the best first: feasible, with all verification samples, whose measures keep their limits,
    /// and of an approach that moves the variables of the DoE.
    pub fn ranked(&self) -> impl Iterator<Item = &VerifiedOptimum> {
        self.ranking.iter().map(|&place| &self.all[place])
    }

    /// The recommended optimum: the one with the best verified measure.
    #[must_use]
    pub fn recommended(&self) -> Option<&VerifiedOptimum> {
        self.ranked().next()
    }

    /// Constraints on samples that the recommended design is not shown to keep, and optima that break one, in
    /// sentences.
    #[must_use]
    pub fn doubts(&self, problem: &Problem) -> Vec<String> {
        let mut doubts = Vec::new();
        let open = self.recommended().map_or(&[][..], |best| &best.limits);
        for limit in open.iter().filter(|limit| !limit.is_shown()) {
            doubts.push(format!(
                "The verification samples of the recommended design do not show with a confidence of 95 % that \
                 {} ({}): more of them (verify.samples) show whether it does.",
                limit.statement(),
                limit.confidence_in_words()
            ));
        }
        for verified in self.iter().filter(|one| one.optimum.feasible().is_some()) {
            let broken = verified.limits.iter().filter(|limit| !limit.holds);
            let broken: Vec<&str> = broken.map(|limit| &*limit.constraint).collect();
            if !broken.is_empty() {
                doubts.push(format!(
                    "The optimum of “{}” is not ranked: its verification samples break {}.",
                    problem.approach_name(verified.optimum.approach),
                    broken.join(", ")
                ));
            }
        }
        doubts
    }
}

/// Whether an approach moves the variables that the DoE moves, so that its design is comparable with the others'.
#[must_use]
pub fn is_ranked(problem: &Problem, approach: Approach) -> bool {
    problem.dimension_of(approach) == problem.dimension()
}

/// The difference between the measures of two optima, positive if `best` is better.
fn behind(
    problem: &Problem,
    other: &VerifiedOptimum,
    best: &VerifiedOptimum,
) -> Option<IntervalEstimate> {
    let (other, best) = (other.samples()?, best.samples()?);
    let difference = problem.objective().difference(other, best)?;
    let as_cost = |(low, high)| {
        let (a, b) = (problem.cost(low), problem.cost(high));
        (a.min(b), a.max(b))
    };
    Some(IntervalEstimate {
        value: problem.cost(difference.value),
        interval: difference.interval.map(as_cost),
        ..difference
    })
}

#[cfg(test)]
mod tests {
    use problem::file::Aim;
    use problem::optimise::Solution;
    use problem::{Campaign, Criteria, Design};
    use stages::cost::Cost;
    use stats::reference::Reference;
    use stats::streams::{Purpose, stream};

    use super::*;

    fn problem(aim: &str) -> Problem {
        let text = include_str!("../../../campaigns/ishigami/campaign.toml");
        let text = text.replace("aim = \"minimise\"", &format!("aim = \"{aim}\""));
        Problem::new(Campaign::parse("campaign.toml", &text).unwrap())
    }

    fn samples(shift: f64) -> Vec<f64> {
        let draw = |sample| Reference::Normal.draw(&mut stream(1, Purpose::Test, 0, sample));
        (0..500).map(|sample| draw(sample) + shift).collect()
    }

    fn optima(problem: &Problem, samples: [Vec<f64>; 2]) -> Optima {
        let found = Solution {
            design: Design::new(vec![0.0; problem.dimension()]),
            criterion: 0.0,
            criteria: Criteria::new(Vec::new()),
            feasible: true,
        };
        let approaches = [Approach::Kriging, Approach::BestOfDoe];
        let all = approaches
            .into_iter()
            .zip(samples)
            .map(|(approach, samples)| {
                let optimum = Optimum {
                    approach,
                    found: Ok(found.clone()),
                    cost: Cost::default(),
                    note: String::new(),
                };
                let samples = Samples::from(samples);
                let wanted = samples.len();
                (optimum, Some(Verification { samples, wanted }))
            });
        Optima::new(problem, all.collect())
    }

    fn low_end(optima: &Optima) -> Option<f64> {
        let (low, _) = optima.ranked().nth(1)?.behind?.interval?;
        Some(low)
    }

    #[test]
    fn optima_are_ranked_by_the_aim_and_compared_by_shared_random_numbers() {
        for (aim, sign) in [("minimise", 1.0), ("maximise", -1.0)] {
            let problem = problem(aim);
            assert_eq!(problem.aim() == Aim::Maximise, sign < 0.0);
            let optima = optima(&problem, [samples(sign * 0.1), samples(0.0)]);
            let best = optima.recommended().unwrap();
            assert_eq!(best.optimum.approach, Approach::BestOfDoe);
            assert_eq!(best.behind, None);
            // Independent samples with standard errors of 0.1 would not tell 0.1 from 0.
            assert!(low_end(&optima).unwrap() > 0.0);
            let behind = optima.of(Approach::Kriging).unwrap().behind.unwrap();
            assert!((behind.value - 0.1).abs() < 1e-9);
        }
    }

    #[test]
    fn optima_that_samples_do_not_tell_apart_are_not_called_different() {
        let mut other = samples(0.0);
        other.rotate_left(1);
        let alike = optima(&problem("minimise"), [samples(0.0), other]);
        assert!(low_end(&alike).unwrap() <= 0.0);
        let few = optima(&problem("minimise"), [vec![1.0; 4], vec![2.0; 4]]);
        assert_eq!(few.ranked().count(), 2);
        assert_eq!(low_end(&few), None);
    }
}
