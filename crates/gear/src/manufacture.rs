//! Scatter of manufacture and assembly: slopes of profiles and helices, misaligned shafts, and amounts of
//! tip relief.
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
//! A helix slope deviation f_Hβ is the same along the face: positive where the helix angle is too
//! large. With z from 0 at the leading end of the face, where a contact line is ahead, to 1 at the trailing
//! one, deviations f1 and f2 and a misalignment m of the shafts in the plane of action change the gap by
//!
//! g(z) += (f1 − f2 + m) z cos β_b.
//!
//! # Assumptions
//! - Each deviation is normal with mean 0, and its tolerance ± is ±3 standard deviations
//!   ([`TOLERANCE_IN_SD`]). The standard limits deviations and says nothing of their distribution.
//! - The active flank is the evaluated length: f_Hα is the deviation from one end of the path of
//!   contact to the other, f_Hβ from one end of the face to the other. A flank that is usable beyond its
//!   active part deviates less on that part.
//! - Tolerances are not rounded as the standard's printed values are.
//! - Samples of whole teeth have neither helix slopes nor misalignment: they have one gap for the whole face.
//!
//! Left out: pitch deviations, profile and helix form, and differences between the teeth of a gear.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::geometry::Geometry;
use crate::input::{InputError, Member};
use crate::pair::Pair;

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
        1e-3 * class_5_um * self.step()
    }

    /// Helix slope tolerance f_HβT, mm, of a gear with this reference diameter d and face width b, mm:
    /// (0.05 √d + 0.35 √b + 4) √2^(A − 5) µm with A the class (ISO 1328-1:2013), not rounded. The
    /// standard is for d from 5 to 15 000 mm and b from 4 to 1200 mm.
    #[must_use]
    pub fn helix_slope_tolerance(self, reference_diameter: f64, face_width: f64) -> f64 {
        let class_5_um = 0.05 * reference_diameter.sqrt() + 0.35 * face_width.sqrt() + 4.0;
        1e-3 * class_5_um * self.step()
    }

    /// The helix slope tolerances of both gears of a pair with these face widths, mm.
    #[must_use]
    pub fn helix_slope_tolerances(self, geometry: &Geometry, face_width: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|i| self.helix_slope_tolerance(2.0 * geometry.r[i], face_width[i]))
    }

    /// The class's tolerance as a multiple of that of class 5.
    fn step(self) -> f64 {
        2_f64.powf(0.5 * (f64::from(self.0) - 5.0))
    }

    /// The profile slope tolerances of both gears of a pair, mm.
    #[must_use]
    pub fn slope_tolerances(self, geometry: &Geometry) -> [f64; 2] {
        geometry
            .r
            .map(|r| self.slope_tolerance(geometry.normal_module, 2.0 * r))
    }
}

/// The scatter of manufacture and assembly. The default is none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scatter {
    /// Class of both gears' flanks: profile slopes and helix slopes deviate within its tolerances.
    pub flank_class: Option<FlankClass>,
    /// Factors on the class's tolerances of profile slopes and of helix slopes.
    pub class_factors: [f64; 2],
    /// Tolerance ± of the misalignment of the shafts in the plane of action over the face, mm.
    pub misalignment: f64,
    /// Tolerance ± of the amount of each tip relief, mm. The amount is never negative.
    pub tip_relief: f64,
}

impl Default for Scatter {
    fn default() -> Self {
        Self {
            flank_class: None,
            class_factors: [1.0; 2],
            misalignment: 0.0,
            tip_relief: 0.0,
        }
    }
}

impl Scatter {
    /// The scatter of flanks of this class on shafts that are parallel.
    #[must_use]
    pub const fn of_class(class: FlankClass) -> Self {
        Self {
            flank_class: Some(class),
            class_factors: [1.0; 2],
            misalignment: 0.0,
            tip_relief: 0.0,
        }
    }
}

/// The random deviations of a pair, one standard normal coefficient each: profile slopes of pinion and
/// gear, their helix slopes, the misalignment, and the amounts of tip relief; those that do not scatter are left out.
#[derive(Debug, Clone)]
pub(crate) struct Deviations {
    /// Standard deviations of f_Hα of both gears, mm.
    profile: Option<[f64; 2]>,
    /// Growth of the gap along the face for one standard deviation of each deviation, mm.
    tilts: Vec<f64>,
    /// x cos β_b at the nodes of the path.
    shape: Vec<f64>,
    /// The gears' tip reliefs, if their amounts scatter.
    reliefs: Vec<Relief>,
    /// Standard deviation of the amount of a relief, mm.
    relief_sd: f64,
}

/// A tip relief whose amount scatters.
#[derive(Debug, Clone)]
struct Relief {
    /// Amount as designed, mm.
    amount: f64,
    /// Depth at the nodes of the path for one mm of amount.
    shape: Vec<f64>,
}

/// One draw of the deviations.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Deviation {
    /// f_Hα of both gears, mm.
    pub(crate) profile: [f64; 2],
    /// Growth of the gap along the face, mm.
    pub(crate) tilt: f64,
    /// Deviations of the amounts of the tip reliefs, mm.
    relief: Vec<f64>,
}

impl Deviations {
    /// The deviations of a pair; with `may_tilt` those along the face, too.
    pub(crate) fn new(scatter: Scatter, pair: &Pair, may_tilt: bool) -> Self {
        let (geometry, s) = (pair.geometry(), pair.path());
        let (middle, length) = (
            0.5 * (geometry.s_in + geometry.s_out),
            geometry.s_out - geometry.s_in,
        );
        let normal = geometry.beta_b.cos();
        let of = |factor: f64, tolerances: [f64; 2]| {
            tolerances.map(|tolerance| factor * tolerance / TOLERANCE_IN_SD)
        };
        let [profile, helix] = scatter.class_factors;
        let class = scatter.flank_class;
        let mut tilts = Vec::new();
        if may_tilt {
            if let Some(class) = class {
                let tolerances = class.helix_slope_tolerances(geometry, pair.input().face_width);
                let [pinion, gear] = of(helix, tolerances);
                // A helix angle that is too large opens the trailing end of a pinion's flank and closes
                // that of its mate's.
                tilts.extend([normal * pinion, -normal * gear]);
            }
            if scatter.misalignment > 0.0 {
                tilts.push(normal * scatter.misalignment / TOLERANCE_IN_SD);
            }
        }
        Self {
            profile: class.map(|class| of(profile, class.slope_tolerances(geometry))),
            tilts,
            shape: s.iter().map(|s| normal * (s - middle) / length).collect(),
            reliefs: if scatter.tip_relief > 0.0 {
                reliefs(pair)
            } else {
                Vec::new()
            },
            relief_sd: scatter.tip_relief / TOLERANCE_IN_SD,
        }
    }

    /// Number of coefficients of a draw.
    pub(crate) fn modes(&self) -> usize {
        self.profile.map_or(0, |profile| profile.len()) + self.tilts.len() + self.reliefs.len()
    }

    /// Whether the gap along the face scatters.
    pub(crate) fn tilts(&self) -> bool {
        !self.tilts.is_empty()
    }

    /// The deviations of these coefficients; those that are missing count as zero.
    pub(crate) fn of(&self, coefficients: &[f64]) -> Deviation {
        let mut rest = coefficients.iter().copied().chain(std::iter::repeat(0.0));
        let mut next = move || rest.next().unwrap_or_default();
        Deviation {
            profile: self.profile.map_or([0.0; 2], |sd| sd.map(|sd| sd * next())),
            tilt: self.tilts.iter().map(|tilt| tilt * next()).sum(),
            relief: self
                .reliefs
                .iter()
                .map(|relief| (self.relief_sd * next()).max(-relief.amount))
                .collect(),
        }
    }

    /// Adds the deviations along the profile to the gap at the nodes.
    pub(crate) fn add_to(&self, gap: &mut [f64], deviation: &Deviation) {
        let difference = deviation.profile[1] - deviation.profile[0];
        for (gap, shape) in gap.iter_mut().zip(&self.shape) {
            *gap += difference * shape;
        }
        for (relief, more) in self.reliefs.iter().zip(&deviation.relief) {
            for (gap, shape) in gap.iter_mut().zip(&relief.shape) {
                *gap += more * shape;
            }
        }
    }
}

/// The tip reliefs of a pair.
fn reliefs(pair: &Pair) -> Vec<Relief> {
    let (geometry, all) = (pair.geometry(), pair.corrections().tip_relief);
    let of = |member: Member| {
        let relief = all[member.index()].filter(|relief| relief.amount > 0.0)?;
        let of_one = crate::TipRelief {
            amount: 1.0,
            ..relief
        };
        let alone = crate::Corrections::default().with_tip_relief(member, of_one);
        let places = pair.path().iter();
        Some(Relief {
            amount: relief.amount,
            shape: places.map(|&s| alone.relief_at(geometry, s)).collect(),
        })
    };
    Member::BOTH.into_iter().filter_map(of).collect()
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

    /// By hand: class 5 at d = 100 mm and b = 25 mm is 0.5 + 1.75 + 4 µm, class 7 twice that.
    #[test]
    fn helix_slope_tolerances_are_those_of_the_standard() {
        for (class, um) in [(5, 6.25), (7, 12.5)] {
            let class = FlankClass::new(class).unwrap();
            let tolerance = class.helix_slope_tolerance(100.0, 25.0);
            assert!((1e3 * tolerance - um).abs() < 1e-12 * um);
        }
    }
}
