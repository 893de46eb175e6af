//! Scatter of manufacture: the profile slope deviation of each gear.
//!
//! A profile slope deviation f_Hα turns all flanks of one gear by the same small angle, as a wrong
//! pressure angle of the tool does. It is measured in the transverse plane along the line of
//! action, and is positive where the profile rises towards the tip (ISO 1328-1:2013). With x from
//! −1/2 at the start of the path of contact to 1/2 at its end, where the pinion's tip touches,
//! deviations f1 and f2 change the gap along the normal by
//!
//! g(s) += (f2 − f1) x cos β_b.
//!
//! Two gears that deviate alike fit each other. The gap is zero in the middle of the path; a constant
//! would move the transmission error and leave ΔSTE alone.
//!
//! # Assumptions
//! - Each gear's deviation is normal with mean 0, and the tolerance ±f_HαT is ±3 standard deviations
//!   ([`TOLERANCE_IN_SD`]). The standard limits the deviation and says nothing of its distribution.
//! - The active flank is the evaluated length: f_Hα is the deviation from one end of the path of
//!   contact to the other. A flank that is usable beyond its active part deviates less on that part.
//! - Tolerances are not rounded as the standard's printed values are.
//!
//! Left out: pitch deviations, profile and helix form, helix slope, and differences between the teeth of
//! a gear.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::geometry::Geometry;
use crate::input::InputError;

/// The tolerance of a deviation, in standard deviations of it.
pub const TOLERANCE_IN_SD: f64 = 3.0;

/// A flank tolerance class of ISO 1328-1:2013, from 1, the finest, to 11.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "u32", into = "u32")]
#[schemars(extend("minimum" = 1, "maximum" = 11))]
pub struct FlankClass(u32);

impl TryFrom<u32> for FlankClass {
    type Error = InputError;

    fn try_from(number: u32) -> Result<Self, InputError> {
        Self::new(number).ok_or(InputError {
            field: "flank_class",
            value: f64::from(number),
            expected: "a whole number from 1 to 11",
        })
    }
}

impl From<FlankClass> for u32 {
    fn from(class: FlankClass) -> Self {
        class.0
    }
}

impl FlankClass {
    /// The finest class.
    pub const FINEST: u32 = 1;
    /// The coarsest class.
    pub const COARSEST: u32 = 11;

    /// The class with this number; `None` outside 1 to 11.
    #[must_use]
    pub fn new(number: u32) -> Option<Self> {
        (Self::FINEST..=Self::COARSEST)
            .contains(&number)
            .then_some(Self(number))
    }

    /// The class's number.
    #[must_use]
    pub const fn number(self) -> u32 {
        self.0
    }

    /// Profile slope tolerance f_HαT, mm, of a gear with this normal module m_n and reference diameter
    /// d, mm: (0.4 m_n + 0.001 d + 4) √2^(A − 5) µm with A the class (ISO 1328-1:2013, formula (7)),
    /// not rounded. The standard is for m_n from 0.5 to 70 mm and d from 5 to 15 000 mm; beyond, the
    /// formula is extrapolated.
    #[must_use]
    pub fn slope_tolerance(self, normal_module: f64, reference_diameter: f64) -> f64 {
        let class_5_um = 0.4 * normal_module + 0.001 * reference_diameter + 4.0;
        1e-3 * class_5_um * 2_f64.powf(0.5 * (f64::from(self.0) - 5.0))
    }

    /// The tolerances of both gears of a pair, mm.
    #[must_use]
    pub fn slope_tolerances(self, geometry: &Geometry) -> [f64; 2] {
        geometry
            .r
            .map(|r| self.slope_tolerance(geometry.normal_module, 2.0 * r))
    }
}

/// The random slope deviations of a pair, one standard normal coefficient for each gear.
#[derive(Debug, Clone)]
pub(crate) struct SlopeDeviations {
    /// Standard deviations of f1 and f2, mm.
    sd: [f64; 2],
    /// x cos β_b at the nodes of the path.
    shape: Vec<f64>,
}

impl SlopeDeviations {
    /// Number of coefficients of a draw.
    pub(crate) const MODES: usize = 2;

    /// The deviations of a pair of this class at the places `s`.
    pub(crate) fn new(class: FlankClass, geometry: &Geometry, s: &[f64]) -> Self {
        let (middle, length) = (
            0.5 * (geometry.s_in + geometry.s_out),
            geometry.s_out - geometry.s_in,
        );
        let normal = geometry.beta_b.cos();
        Self {
            sd: class
                .slope_tolerances(geometry)
                .map(|tolerance| tolerance / TOLERANCE_IN_SD),
            shape: s.iter().map(|s| normal * (s - middle) / length).collect(),
        }
    }

    /// The deviations f1 and f2 of these coefficients, mm; those that are missing count as zero.
    pub(crate) fn of(&self, coefficients: &[f64]) -> [f64; 2] {
        [0, 1].map(|gear| self.sd[gear] * coefficients.get(gear).copied().unwrap_or_default())
    }

    /// Adds the deviations `f` to the gap at the nodes.
    pub(crate) fn add_to(&self, gap: &mut [f64], f: [f64; 2]) {
        let difference = f[1] - f[0];
        for (gap, shape) in gap.iter_mut().zip(&self.shape) {
            *gap += difference * shape;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Formula (7) by hand.
    #[test]
    fn slope_tolerances_are_those_of_the_standard() {
        for (class, module, diameter, um) in [
            // 1.2 + 0.1 + 4
            (5, 3.0, 100.0, 5.3),
            // 4 + 0.4 + 4
            (5, 10.0, 400.0, 8.4),
            // 0.2 + 0.005 + 4, a quarter of it
            (1, 0.5, 5.0, 4.205 / 4.0),
            // 1.2 + 0.1 + 4, eight times
            (11, 3.0, 100.0, 42.4),
        ] {
            let tolerance = FlankClass::new(class)
                .unwrap()
                .slope_tolerance(module, diameter);
            assert!((1e3 * tolerance - um).abs() < 1e-12 * um, "class {class}");
        }
        for number in 1..11 {
            let of = |number| FlankClass::new(number).unwrap().slope_tolerance(4.0, 50.0);
            assert!((of(number + 1) / of(number) - std::f64::consts::SQRT_2).abs() < 1e-12);
        }
        assert_eq!([0, 12].map(FlankClass::new), [None, None]);
    }
}
