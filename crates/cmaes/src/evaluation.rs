//! The evaluation of a candidate, and which of two is better.

use std::cmp::Ordering;

/// The result of evaluating one candidate. A plain `f64` converts, with no violation.
///
/// The order is feasibility first: a feasible candidate is better than any infeasible one; feasible
/// candidates are compared by value, infeasible ones by violation. An evaluation with NaN or +∞ in
/// either field has failed: it is worse than all others, and equal to every other failed one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Evaluation {
    /// The objective, to be minimised.
    pub value: f64,
    /// Constraint violation, summed as the caller sees fit; 0 or less is feasible.
    pub violation: f64,
}

impl From<f64> for Evaluation {
    fn from(value: f64) -> Self {
        Self {
            value,
            violation: 0.0,
        }
    }
}

impl Evaluation {
    /// Whether the evaluation can be ranked at all: neither field is NaN or +∞.
    #[must_use]
    pub fn is_usable(&self) -> bool {
        self.value < f64::INFINITY && self.violation < f64::INFINITY
    }

    /// Whether the evaluation is usable and meets the constraints.
    #[must_use]
    pub fn is_feasible(&self) -> bool {
        self.is_usable() && self.violation <= 0.0
    }

    /// Compares in the order described for the type, which is a total preorder; `Less` is better.
    #[must_use]
    pub fn rank(&self, other: &Self) -> Ordering {
        let (class, merit) = self.key();
        let (other_class, other_merit) = other.key();
        // A merit is never NaN, so partial_cmp always has an answer.
        let by_merit = merit.partial_cmp(&other_merit).unwrap_or(Ordering::Equal);
        class.cmp(&other_class).then(by_merit)
    }

    /// Whether `self` ranks strictly before `other`.
    #[must_use]
    pub fn is_better_than(&self, other: &Self) -> bool {
        self.rank(other) == Ordering::Less
    }

    /// How much worse `other` is than `self` in the quantity both are ranked by; infinite when they
    /// are ranked by different quantities, 0 when both have failed.
    pub(crate) fn gap(&self, other: &Self) -> f64 {
        let (class, merit) = self.key();
        let (other_class, other_merit) = other.key();
        if class != other_class {
            f64::INFINITY
        } else if merit == other_merit {
            0.0 // Also for two values of -∞, whose difference is NaN.
        } else {
            (other_merit - merit).abs()
        }
    }

    /// Magnitude of the quantity that ranks the evaluation; 0 if the evaluation has failed.
    pub(crate) fn magnitude(&self) -> f64 {
        self.key().1.abs()
    }

    /// The class (feasible, infeasible, failed) and the number that ranks within it.
    fn key(&self) -> (u8, f64) {
        if !self.is_usable() {
            (2, 0.0)
        } else if self.violation <= 0.0 {
            (0, self.value)
        } else {
            (1, self.violation)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn evaluation(value: f64, violation: f64) -> Evaluation {
        Evaluation { value, violation }
    }

    #[test]
    fn candidates_are_sorted_feasibility_first() {
        let sorted = [
            evaluation(f64::NEG_INFINITY, 0.0),
            evaluation(-1.0, 0.0),
            evaluation(5.0, -3.0),
            evaluation(9.0, 1e-300),
            evaluation(-7.0, 2.0),
            evaluation(f64::NAN, 0.0),
        ];
        for (i, a) in sorted.iter().enumerate() {
            for (j, b) in sorted.iter().enumerate() {
                assert_eq!(a.rank(b), i.cmp(&j), "{a:?} against {b:?}");
            }
        }
    }

    #[test]
    fn all_failures_are_equal() {
        let failed = [
            evaluation(f64::NAN, 0.0),
            evaluation(f64::INFINITY, 0.0),
            evaluation(0.0, f64::NAN),
            evaluation(0.0, f64::INFINITY),
            evaluation(f64::NAN, 1.0),
        ];
        for a in &failed {
            assert!(!a.is_usable() && !a.is_feasible());
            assert!(
                failed
                    .iter()
                    .all(|b| a.rank(b) == Ordering::Equal && a.gap(b) == 0.0)
            );
        }
    }

    #[test]
    fn zeros_of_both_signs_are_equal() {
        assert_eq!(
            evaluation(0.0, 0.0).rank(&evaluation(-0.0, -0.0)),
            Ordering::Equal
        );
    }
}
