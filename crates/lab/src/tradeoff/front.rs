//! The Pareto front of cost and error, and the choice of a setting.

use std::cmp::Ordering;

/// The rule that chooses the recommended setting.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Rule {
    /// The cheapest setting whose error is at most this; the most accurate one if there is none.
    Within(f64),
    /// The cheapest setting whose error exceeds the least error by at most this share of it.
    NearBest(f64),
}

/// The reason for a recommendation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Reason {
    /// No cheaper setting has an error of at most this.
    CheapestWithin(f64),
    /// No error is within the rule's limit; the setting has the least error.
    MostAccurate,
}

/// Returns the indices of the Pareto front of points (cost, error), by rising cost. A point is on
/// the front if no other point is at most as large in both and smaller in one. Points that are not
/// finite are left out; of equal points the first is taken.
#[must_use]
pub fn front(points: &[[f64; 2]]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..points.len())
        .filter(|&i| points[i].iter().all(|value| value.is_finite()))
        .collect();
    order.sort_by(|&a, &b| compare(points[a], points[b]));
    let mut least = f64::INFINITY;
    order.retain(|&i| {
        let is_better = points[i][1] < least;
        least = least.min(points[i][1]);
        is_better
    });
    order
}

/// Returns the index of the recommended point (cost, error) with the reason; none without a finite
/// point.
#[must_use]
pub fn recommend(points: &[[f64; 2]], rule: Rule) -> Option<(usize, Reason)> {
    let front = front(points);
    let best = *front.last()?;
    let limit = match rule {
        Rule::Within(limit) => limit,
        // The share applies to the absolute error: an error that is a response may be negative.
        Rule::NearBest(share) => points[best][1] + share * points[best][1].abs(),
    };
    let cheapest = front.iter().find(|&&i| points[i][1] <= limit);
    Some(match cheapest {
        Some(&cheapest) => (cheapest, Reason::CheapestWithin(limit)),
        None => (best, Reason::MostAccurate),
    })
}

/// A power law y = c xᵏ.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PowerLaw {
    pub(crate) exponent: f64,
    /// ln c.
    intercept: f64,
}

impl PowerLaw {
    /// The power law of least squared differences of logarithms; `None` with fewer than two different sizes.
    pub(crate) fn fit(points: &[[f64; 2]]) -> Option<Self> {
        let positive = points
            .iter()
            .filter(|p| p.iter().all(|v| *v > 0.0 && v.is_finite()));
        let logarithms: Vec<[f64; 2]> = positive.map(|p| p.map(f64::ln)).collect();
        let count = logarithms.len() as f64;
        let mean = |k: usize| logarithms.iter().map(|p| p[k]).sum::<f64>() / count;
        let centre = [mean(0), mean(1)];
        let moment = |k: usize| -> f64 {
            let products = logarithms
                .iter()
                .map(|p| (p[0] - centre[0]) * (p[k] - centre[k]));
            products.sum()
        };
        let exponent = moment(1) / moment(0);
        exponent.is_finite().then(|| Self {
            exponent,
            intercept: centre[1] - exponent * centre[0],
        })
    }

    pub(crate) fn at(&self, x: f64) -> f64 {
        (self.intercept + self.exponent * x.ln()).exp()
    }
}

/// Orders points by cost, then by error.
fn compare(a: [f64; 2], b: [f64; 2]) -> Ordering {
    a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1]))
}

#[cfg(test)]
mod tests {
    use super::*;

    const POINTS: [[f64; 2]; 7] = [
        [4.0, 1.0],
        [1.0, 9.0],
        [2.0, 9.0],
        [2.0, 3.0],
        [f64::NAN, 0.0],
        [3.0, 4.0],
        [8.0, 0.9],
    ];

    #[test]
    fn no_point_dominates_the_front() {
        assert_eq!(front(&POINTS), [1, 3, 0, 6]);
        assert_eq!(front(&[[1.0, 1.0], [1.0, 1.0], [1.0, 2.0]]), [0]);
        assert_eq!(front(&[]), [0; 0]);
        // By definition, a point is on the front unless another one dominates it.
        let dominates = |a: [f64; 2], b: [f64; 2]| a[0] <= b[0] && a[1] <= b[1] && a != b;
        let found = front(&POINTS);
        for (i, point) in POINTS.iter().enumerate().filter(|(i, _)| *i != 4) {
            let is_dominated = POINTS.iter().any(|other| dominates(*other, *point));
            assert_eq!(found.contains(&i), !is_dominated, "{i}");
        }
    }

    #[test]
    fn the_cheapest_accurate_setting_is_recommended() {
        let within = Reason::CheapestWithin;
        assert_eq!(
            recommend(&POINTS, Rule::Within(5.0)),
            Some((3, within(5.0)))
        );
        assert_eq!(
            recommend(&POINTS, Rule::Within(1.0)),
            Some((0, within(1.0)))
        );
        assert_eq!(
            recommend(&POINTS, Rule::Within(0.5)),
            Some((6, Reason::MostAccurate))
        );
        let near = recommend(&POINTS, Rule::NearBest(0.2));
        assert_eq!(near.map(|(place, _)| place), Some(0));
        let near = recommend(&POINTS, Rule::NearBest(0.0));
        assert_eq!(near, Some((6, within(0.9))));
        assert_eq!(recommend(&POINTS[4..5], Rule::Within(1.0)), None);
    }

    #[test]
    fn a_power_law_is_found_again() {
        let law = |x: f64| [x, 3.0 * x.powf(2.5)];
        let found = PowerLaw::fit(&[law(2.0), law(5.0), law(40.0), [0.0, 1.0]]).unwrap();
        assert!((found.exponent - 2.5).abs() < 1e-12);
        assert!((found.at(7.0) / law(7.0)[1] - 1.0).abs() < 1e-12);
        assert_eq!(PowerLaw::fit(&[law(2.0), law(2.0)]), None);
        assert_eq!(PowerLaw::fit(&[]), None);
    }
}
