//! The verified designs of a campaign, the best first, with what the others differ by.

use campaign::Approach;
use campaign::formulation::Problem;
use stats::OrderStatistic;

/// A verified design among the others.
#[derive(Debug, Clone, PartialEq)]
pub struct Ranked<T> {
    /// The design.
    pub design: T,
    /// Its verified percentile.
    pub verified: OrderStatistic,
    /// How far its percentile is worse than the best one's, in the unit of the response and not negative
    /// but for the interval, from samples with the same random numbers; `None` for the best design, and where
    /// the samples are too few for an interval.
    pub behind: Option<OrderStatistic>,
}

impl<T> Ranked<T> {
    /// Whether the samples tell the design from the best one: the interval of their difference does not
    /// contain zero. `None` where there is no interval.
    #[must_use]
    pub fn is_told_apart(&self) -> Option<bool> {
        let (low, _) = self.behind?.interval?;
        Some(low > 0.0)
    }
}

/// Whether an approach moves the variables that the DoE moves, so that its design can be compared with those
/// of the others.
#[must_use]
pub fn is_ranked(problem: &Problem, approach: Approach) -> bool {
    problem.dimension_of(approach) == problem.dimension()
}

/// Ranks designs by their verification samples. A design whose samples have no percentile is left out.
#[must_use]
pub fn rank<T>(
    problem: &Problem,
    designs: impl IntoIterator<Item = (T, Vec<f64>)>,
) -> Vec<Ranked<T>> {
    let sampling = &problem.campaign().sampling;
    let mut ranked: Vec<(Ranked<T>, Vec<f64>)> = designs
        .into_iter()
        .filter_map(|(design, samples)| {
            let verified = sampling.verified(&samples).ok()?;
            let behind = None;
            Some((
                Ranked {
                    design,
                    verified,
                    behind,
                },
                samples,
            ))
        })
        .filter(|(ranked, _)| ranked.verified.value.is_finite())
        .collect();
    let cost = |ranked: &Ranked<T>| problem.cost(ranked.verified.value);
    ranked.sort_by(|(a, _), (b, _)| cost(a).total_cmp(&cost(b)));
    if let Some(((_, best), others)) = ranked.split_first_mut() {
        for (other, samples) in others {
            other.behind = sampling.difference(samples, best).map(|difference| {
                let as_cost = |(low, high)| {
                    let (a, b) = (problem.cost(low), problem.cost(high));
                    (a.min(b), a.max(b))
                };
                OrderStatistic {
                    value: problem.cost(difference.value),
                    interval: difference.interval.map(as_cost),
                    ..difference
                }
            });
        }
    }
    ranked.into_iter().map(|(ranked, _)| ranked).collect()
}

#[cfg(test)]
mod tests {
    use campaign::Campaign;
    use campaign::file::Aim;
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

    #[test]
    fn designs_are_ranked_by_the_aim_and_compared_by_shared_random_numbers() {
        for (aim, sign) in [("minimise", 1.0), ("maximise", -1.0)] {
            let problem = problem(aim);
            assert_eq!(problem.aim() == Aim::Maximise, sign < 0.0);
            let designs = [("far", sign * 0.1), ("best", 0.0)];
            let designs = designs.map(|(name, shift)| (name, samples(shift)));
            let ranked = rank(&problem, designs);
            assert_eq!([ranked[0].design, ranked[1].design], ["best", "far"]);
            assert_eq!(ranked[0].is_told_apart(), None);
            // Independent samples would not tell 0.1 from 0 with a standard error of 0.1 each.
            assert_eq!(ranked[1].is_told_apart(), Some(true), "{:?}", ranked[1]);
            assert!((ranked[1].behind.unwrap().value - 0.1).abs() < 1e-9);
        }
    }

    #[test]
    fn designs_that_samples_do_not_tell_apart_are_not_called_different() {
        let mut other = samples(0.0);
        other.rotate_left(1);
        let ranked = rank(&problem("minimise"), [("a", samples(0.0)), ("b", other)]);
        assert_eq!(ranked[1].is_told_apart(), Some(false));
        let few = rank(
            &problem("minimise"),
            [("a", vec![1.0; 4]), ("b", vec![2.0; 4])],
        );
        assert_eq!(few[1].is_told_apart(), None);
    }
}
