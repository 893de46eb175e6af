//! The description of a gear pair, of its wear (`wear`), and of the fineness of the calculation.

mod wear;

use std::f64::consts::PI;
use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use wear::{Kernel, LocalAmount, Wear, WearLaw};

/// A number outside the domain of the model.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{field} is {value}, but must be {expected}")]
pub struct InputError {
    /// Field of [`PairInput`], [`Wear`], [`Discretisation`] or [`Corrections`](crate::Corrections), with
    /// its index where there is one.
    pub field: &'static str,
    /// Value of the field.
    pub value: f64,
    /// The domain, in words.
    pub expected: &'static str,
}

/// One of the two gears of a pair.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Member {
    /// Gear 1, the one the torque is given for.
    Pinion,
    /// Gear 2, its mate.
    Gear,
}

impl Member {
    /// Both members, in the order of every two-element array of this crate.
    pub const BOTH: [Self; 2] = [Self::Pinion, Self::Gear];

    /// Position in a two-element array: 0 for the pinion, 1 for the gear.
    #[must_use]
    pub const fn index(self) -> usize {
        match self {
            Self::Pinion => 0,
            Self::Gear => 1,
        }
    }
}

impl fmt::Display for Member {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Pinion => "pinion",
            Self::Gear => "gear",
        })
    }
}

/// Implements `Display` by the name in files, which serde knows, and lists the choices.
macro_rules! named {
    ($type:ident: $($variant:ident),+) => {
        impl $type {
            /// All choices, in the order of declaration.
            pub const ALL: &'static [Self] = &[$(Self::$variant),+];
        }

        impl std::fmt::Display for $type {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                serde::Serialize::serialize(self, f)
            }
        }
    };
}

/// The dimensions that fix the scale of the pair. If one is given, the other one follows from the zero-backlash
/// mesh; if both are, the backlash follows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Size {
    /// The distance between the axes, mm.
    CentreDistance(f64),
    /// The normal module m, mm.
    NormalModule(f64),
    /// Both, mm.
    Both {
        /// The normal module m.
        normal_module: f64,
        /// The distance between the axes.
        centre_distance: f64,
    },
}

/// The parts of a tooth's elasticity that are counted, and the distribution of the load on the
/// face.
///
/// With all but `"coupled"` and `"whole-face-beam"` teeth are thin slices across the face that do not feel
/// each other.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum ToothModel {
    /// Cells of the contact lines that feel each other along the face and from tooth to tooth, on a body
    /// with a hub, with contact beyond the ends of the path. The model to design with: it agrees with
    /// finite elements.
    #[default]
    Coupled,
    /// Beam bending and a constant Hertz compliance. Several times stiffer than real teeth.
    HertzBeam,
    /// Bending, shear, compression, elastic foundation and Weber's load-dependent approach, slice by slice, with
    /// contact beyond the ends of the path.
    WeberBanaschek,
    /// The beams and the contact of `"hertz-beam"`, but each tooth is one beam over
    /// the whole face: a line of contact that covers the share f of the face b has the compliance
    /// Q_B/b + Q_H/(b f), taken at its middle, and pressure and wear follow from F/b.
    ///
    /// Fast, and the nearest to what the 2009 paper printed. It does not know where on the face the
    /// load lies: the pressure of a line that is just coming into contact is too small, a corner
    /// load bends the tooth too little, and crowning is refused.
    WholeFaceBeam,
    /// The slices of `"hertz-beam"` with prismatic beams as thick as the tooth at the
    /// reference circle, s_n = m (π/2 + 2 x tan α_n), clamped where the fillet meets the root circle:
    /// q = 4 (1 − ν²) cos² α_F/E · ((y_L − y_0)/s_n)³ for each tooth.
    ///
    /// The taper, the fillet, an undercut and a pointed tip change nothing but the arm.
    PrismaticBeam,
}

pub(crate) use named;

impl ToothModel {
    /// Whether the model knows where on the face teeth touch, so that gaps may vary along it.
    #[must_use]
    pub const fn knows_the_face(self) -> bool {
        !matches!(self, Self::WholeFaceBeam)
    }
}

named!(ToothModel: Coupled, HertzBeam, WeberBanaschek, WholeFaceBeam, PrismaticBeam);

/// The treatment of a tip that would press into the mate's root.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum TipRule {
    /// The tip stays as its rack leaves it, even with a negative clearance.
    #[default]
    AsCut,
    /// The tip is first turned down to zero clearance.
    ClearRoot,
}

named!(TipRule: AsCut, ClearRoot);

/// The standard basic rack tooth profiles of ISO 53:1998, table 2: what a common hob cuts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum Rack {
    /// High loads: clearance 0.25 m and the largest fillet.
    #[serde(rename = "iso-53-a")]
    A,
    /// Common use, hobs with a smaller fillet.
    #[serde(rename = "iso-53-b")]
    B,
    /// Common use, hobs for racks with little fillet.
    #[serde(rename = "iso-53-c")]
    C,
    /// Precision gears with ground or shaved flanks: clearance 0.4 m.
    #[serde(rename = "iso-53-d")]
    D,
}

named!(Rack: A, B, C, D);

impl Rack {
    /// The tool's addendum, the dedendum h_fP of the gear's profile, in modules.
    #[must_use]
    pub const fn addendum(&self) -> f64 {
        match self {
            Self::A | Self::B | Self::C => 1.25,
            Self::D => 1.4,
        }
    }

    /// The tool's dedendum, the addendum h_aP of the gear's profile, in modules.
    #[must_use]
    pub const fn dedendum(&self) -> f64 {
        1.0
    }

    /// The radius of the tool's tip, the fillet radius ρ_fP of the gear's profile, in modules.
    #[must_use]
    pub const fn root_radius(&self) -> f64 {
        match self {
            Self::A => 0.38,
            Self::B => 0.3,
            Self::C => 0.25,
            Self::D => 0.39,
        }
    }
}

/// The elasticity of a gear's material.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Material {
    /// E, MPa.
    pub youngs_modulus_mpa: f64,
    /// ν.
    pub poisson_ratio: f64,
}

/// One gear pair under load. Arrays are [pinion, gear].
#[derive(Debug, Clone, PartialEq)]
pub struct PairInput {
    /// Numbers of teeth Z1, Z2.
    pub teeth: [u32; 2],
    /// Centre distance or module.
    pub size: Size,
    /// Rack pressure angle α_n in the normal section, rad.
    pub pressure_angle: f64,
    /// Helix angle β at the reference cylinder, rad. Its sign changes nothing.
    pub helix_angle: f64,
    /// Face widths b, mm. Teeth touch over the smaller one. The surplus of a wider gear counts only in the rating of
    /// its root and in its helix tolerance.
    pub face_width: [f64; 2],
    /// Profile shift (addendum modification) coefficients x, in normal modules.
    pub profile_shift: [f64; 2],
    /// Addendum of the rack tool haP₀, in normal modules. It cuts the gear's root.
    pub tool_addendum: [f64; 2],
    /// Dedendum of the rack tool hfP₀, in normal modules. It forms the gear's tip.
    pub tool_dedendum: [f64; 2],
    /// Tip rounding radius ρa, mm, in the transverse section.
    pub tip_radius: [f64; 2],
    /// Corner radius of the rack tool ρf, mm, in the normal section. It forms the root fillet.
    pub root_radius: [f64; 2],
    /// Tip diameter, mm, where the blank was turned to one instead of being cut by the tool.
    pub tip_diameter: [Option<f64>; 2],
    /// Radius at which the body of the gear is clamped, mm: its bore, or the hub of a stiff shaft. `None` is
    /// 3.5 modules below the root circle. Only [`ToothModel::Coupled`] uses it.
    pub hub_radius: [Option<f64>; 2],
    /// The model of the deformation of teeth.
    pub tooth_model: ToothModel,
    /// The treatment of tips without clearance.
    pub tip_rule: TipRule,
    /// Torque on the pinion T1, N·mm.
    pub pinion_torque: f64,
    /// Materials.
    pub material: [Material; 2],
}

/// Smallest and largest length accepted, mm. Wide enough for watches and ring mills; narrow
/// enough that no intermediate product can overflow.
const LENGTH: (f64, f64) = (1e-4, 1e6);

impl PairInput {
    /// Checks that every number is finite and inside the domain of the model.
    ///
    /// # Errors
    /// Names the first field that is not.
    pub fn validate(&self) -> Result<(), InputError> {
        let length = |field, value: f64| {
            check_range(
                field,
                value,
                LENGTH.0..=LENGTH.1,
                "a length between 1e-4 and 1e6 mm",
            )
        };
        for (field, z) in ["teeth[0]", "teeth[1]"].into_iter().zip(self.teeth) {
            check_range(field, f64::from(z), 4.0..=10_000.0, "between 4 and 10000")?;
        }
        match self.size {
            Size::CentreDistance(a) => length("centre_distance", a)?,
            Size::NormalModule(m) => length("normal_module", m)?,
            Size::Both {
                normal_module,
                centre_distance,
            } => {
                length("normal_module", normal_module)?;
                length("centre_distance", centre_distance)?;
            }
        }
        let degree = std::f64::consts::PI / 180.0;
        check_range(
            "pressure_angle",
            self.pressure_angle,
            degree..=45.000_001 * degree,
            "an angle between 1 and 45 degrees, in radians",
        )?;
        check_range(
            "helix_angle",
            self.helix_angle,
            -60.000_001 * degree..=60.000_001 * degree,
            "an angle between -60 and 60 degrees, in radians",
        )?;
        for width in self.face_width {
            length("face_width", width)?;
        }
        for (names, values, range, expected) in [
            (
                ["profile_shift[0]", "profile_shift[1]"],
                self.profile_shift,
                -10.0..=10.0,
                "between -10 and 10 modules",
            ),
            (
                ["tool_addendum[0]", "tool_addendum[1]"],
                self.tool_addendum,
                0.0..=10.0,
                "between 0 and 10 modules",
            ),
            (
                ["tool_dedendum[0]", "tool_dedendum[1]"],
                self.tool_dedendum,
                0.0..=10.0,
                "between 0 and 10 modules",
            ),
            (
                ["tip_radius[0]", "tip_radius[1]"],
                self.tip_radius,
                0.0..=LENGTH.1,
                "a length from 0 to 1e6 mm",
            ),
        ] {
            check_range(names[0], values[0], range.clone(), expected)?;
            check_range(names[1], values[1], range, expected)?;
        }
        for (field, rho) in ["root_radius[0]", "root_radius[1]"]
            .into_iter()
            .zip(self.root_radius)
        {
            check_range(
                field,
                rho,
                1e-9..=LENGTH.1,
                "a length above 0 (from 1e-9 to 1e6 mm)",
            )?;
        }
        for (field, d) in ["tip_diameter[0]", "tip_diameter[1]"]
            .into_iter()
            .zip(self.tip_diameter)
        {
            d.map_or(Ok(()), |d| length(field, d))?;
        }
        for (field, radius) in ["hub_radius[0]", "hub_radius[1]"]
            .into_iter()
            .zip(self.hub_radius)
        {
            radius.map_or(Ok(()), |radius| length(field, radius))?;
        }
        check_range(
            "pinion_torque",
            self.pinion_torque,
            0.0..=1e15,
            "a torque from 0 to 1e15 N mm",
        )?;
        let [pinion, gear] = &self.material;
        pinion.validate([
            "material[0].youngs_modulus_mpa",
            "material[0].poisson_ratio",
        ])?;
        gear.validate([
            "material[1].youngs_modulus_mpa",
            "material[1].poisson_ratio",
        ])
    }

    /// The compliance (1 − ν²)/(π E) of each gear's surface, 1/MPa: in line contact a load per length w flattens it by
    /// twice this times w, times a logarithm.
    pub(crate) fn surface_compliance(&self) -> [f64; 2] {
        self.material
            .map(|one| one.plane() / (PI * one.youngs_modulus_mpa))
    }

    /// E* of the contact, MPa, with 1/E* = (1 − ν1²)/E1 + (1 − ν2²)/E2.
    pub(crate) fn contact_modulus(&self) -> f64 {
        let [pinion, gear] = &self.material;
        let ratio = pinion.youngs_modulus_mpa / gear.youngs_modulus_mpa;
        pinion.youngs_modulus_mpa / (pinion.plane() + gear.plane() * ratio)
    }

    /// The harmonic mean 2 E1 E2/(E1 + E2) of both gears' moduli, MPa.
    pub(crate) fn mean_modulus(&self) -> f64 {
        let [first, second] = self.material.map(|one| one.youngs_modulus_mpa);
        first / (0.5 + 0.5 * (first / second))
    }
}

impl Material {
    /// Checks that every number is finite and inside the domain of the model.
    fn validate(&self, fields: [&'static str; 2]) -> Result<(), InputError> {
        let (modulus, poisson) = (self.youngs_modulus_mpa, self.poisson_ratio);
        check_range(fields[0], modulus, 1e-3..=1e9, "from 1e-3 to 1e9 MPa")?;
        check_range(fields[1], poisson, 0.0..=0.499, "between 0 and 0.499")
    }

    /// 1 − ν², by which plane strain stiffens.
    fn plane(&self) -> f64 {
        1.0 - self.poisson_ratio * self.poisson_ratio
    }
}

/// Fineness of the division of the path of contact and of the mesh period.
///
/// Both numbers are minima: nodes and phases are added where the solution has kinks, and [`ToothModel::WholeFaceBeam`]
/// takes twice as many cells. Errors fall with the square of both. The default, 64 cells and 32 phases, is off by at
/// most 0.04 % of ΔSTE in the median and 0.17 % at the 95th percentile; the crate's front page has the table that it was
/// chosen from.
/// [`ToothModel::Coupled`] costs more with every phase, and its [default](Self::of) is 24 phases.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Discretisation {
    /// Cells along the path of contact.
    pub cells: usize,
    /// Mesh phases in one base pitch.
    pub phases: usize,
}

impl Default for Discretisation {
    fn default() -> Self {
        Self {
            cells: 64,
            phases: 32,
        }
    }
}

impl Discretisation {
    /// The default of a tooth model.
    #[must_use]
    pub fn of(model: ToothModel) -> Self {
        match model {
            ToothModel::Coupled => Self {
                phases: 24,
                ..Self::default()
            },
            _ => Self::default(),
        }
    }

    /// The grid that is `times` as fine in both numbers. An error that falls with the square of both is
    /// 4/3 of the difference between a grid and the one twice as fine.
    #[must_use]
    pub const fn refined(self, times: usize) -> Self {
        Self {
            cells: times * self.cells,
            phases: times * self.phases,
        }
    }

    /// Checks that neither number is too small to mean anything or too large to be stored.
    ///
    /// # Errors
    /// Names the field that is out of its domain.
    pub fn validate(&self) -> Result<(), InputError> {
        let check = |field, value: usize| {
            if (4..=1_000_000).contains(&value) {
                Ok(())
            } else {
                Err(InputError {
                    field,
                    value: value as f64,
                    expected: "between 4 and 1000000",
                })
            }
        };
        check("cells", self.cells)?;
        check("phases", self.phases)
    }
}

/// Refuses a value outside `range`, and with it every NaN and infinity.
pub(crate) fn check_range(
    field: &'static str,
    value: f64,
    range: std::ops::RangeInclusive<f64>,
    expected: &'static str,
) -> Result<(), InputError> {
    if range.contains(&value) {
        Ok(())
    } else {
        Err(InputError {
            field,
            value,
            expected,
        })
    }
}
