//! Sections that the campaign file and the pair file have in common.

use serde::{Deserialize, Serialize};

use super::FileError;
use super::validate::Source;

/// `[load]`
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Load {
    /// Torque on the pinion, N·m.
    pub pinion_torque_nm: f64,
}

/// `[material]`, the same for both gears.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Material {
    /// Young's modulus, GPa.
    pub youngs_modulus_gpa: f64,
    /// Poisson's ratio.
    pub poisson_ratio: f64,
    /// Yield stress, MPa: the limit of the root stress.
    pub yield_mpa: f64,
    /// Permissible contact pressure, MPa.
    pub hertz_limit_mpa: f64,
}

/// `[wear]`
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Wear {
    /// The mean profile; left out of the digest where it is Archard's, as in files of before it.
    #[serde(default, skip_serializing_if = "WearLaw::is_default")]
    pub law: WearLaw,
    /// Largest depth of Archard's profile per flank, µm; given with that law only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max_depth_um: Option<f64>,
    /// Depth per pressure and sliding, 1/MPa; given with the signed law only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub coefficient_per_mpa: Option<f64>,
    /// Covariance of the random field; see [`gear::Kernel`].
    pub kernel: String,
    /// Range of the random field, rad of roll angle.
    pub range_rad: f64,
    /// Variance of the random field, whose mean is 1.
    pub variance: f64,
}

/// The law of the mean wear; see [`gear::WearLaw`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum WearLaw {
    /// Material goes wherever the flanks slide, to the same greatest depth on every pair.
    #[default]
    Archard,
    /// With the sign of the sliding velocity and one coefficient for all pairs, as in the paper.
    Signed,
}

impl WearLaw {
    fn is_default(&self) -> bool {
        *self == Self::default()
    }
}

impl Default for Wear {
    /// Archard's law with the paper's random field.
    fn default() -> Self {
        Self {
            law: WearLaw::Archard,
            max_depth_um: Some(3.5),
            coefficient_per_mpa: None,
            kernel: gear::Kernel::SquaredExponential.to_string(),
            range_rad: 0.2,
            variance: 0.01,
        }
    }
}

impl Load {
    pub(super) fn validate(&self, source: Source<'_>) -> Result<(), FileError> {
        source.positive("load.pinion_torque_nm", self.pinion_torque_nm)
    }
}

impl Material {
    pub(super) fn validate(&self, source: Source<'_>) -> Result<(), FileError> {
        source.positive("material.youngs_modulus_gpa", self.youngs_modulus_gpa)?;
        source.between("material.poisson_ratio", self.poisson_ratio, 0.0, 0.5)?;
        source.positive("material.yield_mpa", self.yield_mpa)?;
        source.positive("material.hertz_limit_mpa", self.hertz_limit_mpa)
    }

    /// The simulator's material, in MPa.
    #[must_use]
    pub fn to_gear(&self) -> gear::Material {
        gear::Material {
            youngs_modulus_mpa: self.youngs_modulus_gpa * 1e3,
            poisson_ratio: self.poisson_ratio,
            yield_mpa: self.yield_mpa,
            hertz_limit_mpa: self.hertz_limit_mpa,
        }
    }
}

impl Wear {
    pub(super) fn validate(&self, source: Source<'_>) -> Result<(), FileError> {
        self.law(source)?;
        parse_name::<gear::Kernel>(source, "wear.kernel", &self.kernel)?;
        source.positive("wear.range_rad", self.range_rad)?;
        source.not_negative("wear.variance", self.variance)
    }

    /// The simulator's law; each law has a number of its own, and refuses the other's.
    fn law(&self, source: Source<'_>) -> Result<gear::WearLaw, FileError> {
        let depth = ("wear.max_depth_um", self.max_depth_um);
        let coefficient = ("wear.coefficient_per_mpa", self.coefficient_per_mpa);
        let (own, other, name) = match self.law {
            WearLaw::Archard => (depth, coefficient, "archard"),
            WearLaw::Signed => (coefficient, depth, "signed"),
        };
        if let Some(found) = other.1 {
            return Err(source.refuse(other.0, found, format!("absent when law is \"{name}\"")));
        }
        let Some(value) = own.1 else {
            return Err(source.refuse(own.0, "missing", format!("given when law is \"{name}\"")));
        };
        Ok(match self.law {
            WearLaw::Archard => {
                source.not_negative(own.0, value)?;
                let max_depth = value * 1e-3;
                gear::WearLaw::Archard { max_depth }
            }
            WearLaw::Signed => {
                let sensible = (0.0..=1.0).contains(&value);
                source.require(sensible, own.0, value, "from 0 to 1, in 1/MPa")?;
                gear::WearLaw::Signed { coefficient: value }
            }
        })
    }

    /// The simulator's wear, in mm and rad.
    ///
    /// # Panics
    ///
    /// Never for a validated section: law and kernel were read before.
    #[must_use]
    pub fn to_gear(&self) -> gear::Wear {
        let nowhere = Source { file: "", text: "" };
        gear::Wear {
            law: self.law(nowhere).expect("validation has read this law"),
            kernel: self
                .kernel
                .parse()
                .expect("validation has parsed this name"),
            range: self.range_rad,
            variance: self.variance,
        }
    }
}

/// Who simulates.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SimulatorKind {
    /// The gear model of this program.
    #[default]
    BuiltIn,
    /// A program that every worker is started with.
    External,
}

/// `[simulator]`, optional.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SimulatorSection {
    /// Who simulates; the built-in model if the section is absent.
    pub kind: SimulatorKind,
    /// How many designs an external program simulates when a worker starts, to prove that all
    /// workers run the same one; see [`SimulatorSection::probe_designs`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub probe_designs: Option<u32>,
}

impl SimulatorSection {
    /// The designs of the model digest if the file does not say.
    const PROBE_DESIGNS: u32 = 3;

    /// How many designs the model digest of an external program rests on. With none it rests on
    /// the version alone that the program gives itself: for simulations that take very long.
    #[must_use]
    pub fn probe_designs(&self) -> u32 {
        self.probe_designs.unwrap_or(Self::PROBE_DESIGNS)
    }

    /// Whether the section says no more than its absence would.
    pub(super) fn is_default(&self) -> bool {
        *self == Self::default()
    }

    pub(super) fn validate(&self, source: Source<'_>) -> Result<(), FileError> {
        let most = crate::probe::DESIGNS;
        match (self.kind, self.probe_designs) {
            (SimulatorKind::BuiltIn, Some(found)) => Err(source.refuse(
                "simulator.probe_designs",
                found,
                "absent: it is for kind = \"external\"",
            )),
            (SimulatorKind::External, Some(found)) => source.require(
                found <= most,
                "simulator.probe_designs",
                found,
                &format!("a whole number from 0 to {most}"),
            ),
            (_, None) => Ok(()),
        }
    }
}

/// Parses a name such as a kernel's; the error lists what would be right.
pub(super) fn parse_name<T>(source: Source<'_>, key: &str, name: &str) -> Result<T, FileError>
where
    T: std::str::FromStr,
    T::Err: std::fmt::Display,
{
    name.parse()
        .map_err(|error: T::Err| source.refuse(key, name, format!("a known name: {error}")))
}
