//! The box of admissible designs, and its scaling to the unit box.

use crate::Error;

/// One closed interval per variable, in the caller's units.
#[derive(Debug, Clone, PartialEq)]
pub struct Bounds {
    intervals: Vec<(f64, f64)>,
}

impl Bounds {
    /// Bounds from one (lower, upper) pair per variable.
    ///
    /// # Errors
    ///
    /// [`Error::NoVariables`] without any pair, [`Error::Bounds`] where a pair (or its width) is
    /// not finite or lower ≥ upper.
    pub fn new(intervals: impl Into<Vec<(f64, f64)>>) -> Result<Self, Error> {
        let intervals = intervals.into();
        if intervals.is_empty() {
            return Err(Error::NoVariables);
        }
        for (index, &(lower, upper)) in intervals.iter().enumerate() {
            let finite = lower.is_finite() && upper.is_finite() && (upper - lower).is_finite();
            if !finite || lower >= upper {
                return Err(Error::Bounds {
                    index,
                    lower,
                    upper,
                });
            }
        }
        Ok(Self { intervals })
    }

    /// The unit box [0, 1]ᵈ.
    ///
    /// # Errors
    ///
    /// [`Error::NoVariables`] when `dimension` is 0.
    pub fn unit(dimension: usize) -> Result<Self, Error> {
        Self::new(vec![(0.0, 1.0); dimension])
    }

    /// The number of variables.
    #[must_use]
    pub fn dimension(&self) -> usize {
        self.intervals.len()
    }

    /// The (lower, upper) pairs.
    #[must_use]
    pub fn intervals(&self) -> &[(f64, f64)] {
        &self.intervals
    }

    /// Whether `x` has the right number of coordinates and each is within its interval.
    #[must_use]
    pub fn contains(&self, x: &[f64]) -> bool {
        x.len() == self.dimension()
            && self
                .intervals
                .iter()
                .zip(x)
                .all(|(&(lower, upper), v)| (lower..=upper).contains(v))
    }

    /// Scales a design to the unit box.
    pub(crate) fn scale(&self, x: &[f64]) -> Result<Vec<f64>, Error> {
        if x.len() != self.dimension() {
            return Err(Error::Dimension {
                expected: self.dimension(),
                got: x.len(),
            });
        }
        let scale = |(index, (&(lower, upper), &value)): (usize, (&(f64, f64), &f64))| {
            if (lower..=upper).contains(&value) {
                Ok(((value - lower) / (upper - lower)).clamp(0.0, 1.0))
            } else {
                Err(Error::StartOutside {
                    index,
                    value,
                    lower,
                    upper,
                })
            }
        };
        self.intervals
            .iter()
            .zip(x)
            .enumerate()
            .map(scale)
            .collect()
    }

    /// The design at a point of the unit box. 0 and 1 give the bounds themselves, to the bit.
    pub(crate) fn unscale<'a>(&self, unit: impl IntoIterator<Item = &'a f64>) -> Vec<f64> {
        let unscale = |(&(lower, upper), &u): (&(f64, f64), &f64)| {
            // The first product can round past the upper bound.
            if u >= 1.0 {
                upper
            } else {
                (lower + u * (upper - lower)).clamp(lower, upper)
            }
        };
        self.intervals.iter().zip(unit).map(unscale).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_corners_are_hit_to_the_bit() {
        let bounds = Bounds::new([(0.8, 1.7), (-1.0, 2.0)]).unwrap();
        assert_eq!(bounds.unscale(&[0.0, 1.0]), [0.8, 2.0]);
        assert_eq!(bounds.unscale(&[1.0, 0.0]), [1.7, -1.0]);
    }

    #[test]
    fn bad_pairs_are_named() {
        assert_eq!(Bounds::new([]), Err(Error::NoVariables));
        assert_eq!(Bounds::unit(0), Err(Error::NoVariables));
        for (lower, upper) in [
            (1.0, 1.0),
            (2.0, 1.0),
            (0.0, f64::INFINITY),
            (-1e308, 1e308),
        ] {
            let error = Bounds::new([(0.0, 1.0), (lower, upper)]).unwrap_err();
            assert_eq!(
                error,
                Error::Bounds {
                    index: 1,
                    lower,
                    upper
                }
            );
        }
        assert!(matches!(
            Bounds::new([(f64::NAN, 1.0)]),
            Err(Error::Bounds { index: 0, .. })
        ));
    }

    #[test]
    fn points_outside_are_refused() {
        let bounds = Bounds::new([(0.8, 1.7), (-1.0, 2.0)]).unwrap();
        assert!(bounds.contains(&[0.8, 2.0]));
        assert!(!bounds.contains(&[0.8, 2.1]));
        assert!(!bounds.contains(&[f64::NAN, 0.0]));
        assert!(!bounds.contains(&[1.0]));
        assert_eq!(
            bounds.scale(&[1.0]),
            Err(Error::Dimension {
                expected: 2,
                got: 1
            })
        );
        assert!(matches!(
            bounds.scale(&[1.0, -2.0]),
            Err(Error::StartOutside { index: 1, .. })
        ));
    }
}
