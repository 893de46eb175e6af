//! The linear part of ΔSTE as a control variate of its samples. ΔSTE is all but linear in the wear
//! of most designs, though not in large slope deviations, and the distribution of a sum of normal
//! coefficients is known.

use problem::formulation::Design;
use problem::formulation::gears::Gears;
use stats::streams::StreamRng;

/// The linear part of a design's ΔSTE, sample by sample: a control variate.
#[derive(Debug, Clone, PartialEq)]
pub struct LinearResponse {
    slopes: Vec<f64>,
}

impl LinearResponse {
    /// The linear response of a design: the slopes of ΔSTE, µm, in the coefficients of its wear and
    /// its slope deviations.
    pub fn of(gears: &Gears, design: &Design) -> Result<Self, gear::Error> {
        let pair = gears.pair(design)?;
        let slopes = gears.sampler(&pair).slopes();
        Ok(Self { slopes })
    }

    /// Number of analyses it took.
    #[must_use]
    pub fn analyses(&self) -> u64 {
        2 * self.slopes.len() as u64
    }

    /// Mean and standard deviation of the linear response, µm.
    #[must_use]
    pub fn moments(&self) -> stats::Control {
        stats::Control {
            mean: 0.0,
            sd: self
                .slopes
                .iter()
                .map(|slope| slope * slope)
                .sum::<f64>()
                .sqrt(),
        }
    }

    /// Value of the linear response for the sample that is drawn from `rng`, µm.
    pub fn of_sample(&self, rng: &mut StreamRng) -> f64 {
        let coefficients = gear::draw_coefficients(rng, self.slopes.len());
        self.slopes
            .iter()
            .zip(coefficients)
            .map(|(a, b)| a * b)
            .sum()
    }
}
