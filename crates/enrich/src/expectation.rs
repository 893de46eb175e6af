//! The gain that a round expects.

/// The highest value of an observation in a round, and the regions that were consulted.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Expectation {
    /// The highest value of any observation in the consulted regions.
    pub(crate) expected_um: f64,
    consulted: Vec<bool>,
}

impl Expectation {
    /// The expectation before any of `regions` regions is consulted.
    pub(crate) fn new(regions: usize) -> Self {
        Self {
            expected_um: 0.0,
            consulted: vec![false; regions],
        }
    }

    /// Records the highest value in a region.
    pub(crate) fn record(&mut self, region: usize, value: f64) {
        self.expected_um = self.expected_um.max(value);
        self.consulted[region] = true;
    }

    /// Whether a value of this region was recorded.
    pub(crate) fn was_consulted(&self, region: usize) -> bool {
        self.consulted[region]
    }

    /// Whether less than δ is expected in every basin and in the whole box.
    pub(crate) fn is_below(&self, delta_um: f64) -> bool {
        self.expected_um < delta_um && self.consulted.iter().all(|consulted| *consulted)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_expectation_is_below_delta_only_if_every_region_was_consulted() {
        let mut expectation = Expectation::new(2);
        expectation.record(0, 0.01);
        assert!(!expectation.is_below(0.02));
        expectation.record(1, 0.005);
        assert!(expectation.is_below(0.02));
        assert!(!expectation.is_below(0.01));
        expectation.record(0, 0.03);
        assert!(!expectation.is_below(0.02));
    }
}
