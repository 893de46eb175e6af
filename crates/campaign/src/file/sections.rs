//! Sections common to the campaign file and the pair file.

use std::time::Duration;

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

/// `[wear]`
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Wear {
    /// The law of the mean wear.
    // The default is left out of the digest, so that files without the key keep theirs.
    #[serde(default, skip_serializing_if = "WearLaw::is_default")]
    pub law: WearLaw,
    /// Largest depth of Archard's profile per flank, in µm; only with that law.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max_depth_um: Option<f64>,
    /// Depth per pressure and sliding, in 1/MPa; only with the signed law.
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
    /// Material is removed wherever the flanks slide, to the same greatest depth on every pair.
    #[default]
    Archard,
    /// The depth has the sign of the sliding velocity, and one coefficient holds for all pairs, as in the
    /// paper.
    Signed,
}

impl WearLaw {
    fn is_default(&self) -> bool {
        *self == Self::default()
    }
}

/// `[manufacture]`, optional. Without it flanks are as designed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manufacture {
    /// Flank tolerance class of both gears by ISO 1328-1, from 1 to 11; see [`gear::FlankClass`].
    pub flank_class: u32,
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
        source.between("load.pinion_torque_nm", self.pinion_torque_nm, 0.0, 1e12)
    }
}

impl Manufacture {
    pub(super) fn validate(&self, source: Source<'_>) -> Result<(), FileError> {
        let (finest, coarsest) = (gear::FlankClass::FINEST, gear::FlankClass::COARSEST);
        source.count(
            "manufacture.flank_class",
            self.flank_class,
            finest,
            coarsest,
        )
    }

    /// The random effects besides the wear, and the neglected ones, in words.
    #[must_use]
    pub fn describe(&self) -> String {
        format!(
            "flank class {} of ISO 1328-1: profile slopes deviate at random, alike on all teeth of a \
             gear; no pitch, form or helix deviations, no dynamics",
            self.flank_class
        )
    }

    /// The simulator's class; `None` for an invalid number.
    #[must_use]
    pub fn to_gear(&self) -> Option<gear::FlankClass> {
        gear::FlankClass::new(self.flank_class)
    }
}

impl Wear {
    pub(super) fn validate(&self, source: Source<'_>) -> Result<(), FileError> {
        self.law(source)?;
        parse_name::<gear::Kernel>(source, "wear.kernel", &self.kernel)?;
        source.within("wear.range_rad", self.range_rad, 1e-6, 1e6, "rad")?;
        source.within("wear.variance", self.variance, 0.0, 1e3, "")
    }

    /// The simulator's law. Each law requires its own number and refuses the other's.
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
                source.within(own.0, value, 0.0, 1e6, "µm")?;
                let max_depth = value * 1e-3;
                gear::WearLaw::Archard { max_depth }
            }
            WearLaw::Signed => {
                source.within(own.0, value, 0.0, 1.0, "1/MPa")?;
                gear::WearLaw::Signed { coefficient: value }
            }
        })
    }

    /// The simulator's wear, in mm and rad.
    ///
    /// # Panics
    ///
    /// Never for a validated section: law and kernel were parsed before.
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

/// The kind of simulator.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SimulatorKind {
    /// The gear model of this program.
    #[default]
    BuiltIn,
    /// A program that every worker starts.
    External,
}

/// `[simulator]`, optional.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SimulatorSection {
    /// The simulator; the built-in model if the section is absent.
    pub kind: SimulatorKind,
    /// Number of designs that an external program simulates when a worker starts, to verify that
    /// all workers run the same program; see [`SimulatorSection::probe_designs`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub probe_designs: Option<u32>,
    /// Number of times that a failing request is tried before its failure is final; 3 if absent. An
    /// attempt counts only if the program answers something else in between.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub attempts: Option<u32>,
    /// How long, in seconds, everything may fail before the campaign goes on without what fails; 60
    /// if absent. A shorter outage, such as of a licence server, costs nothing but time.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub retry_s: Option<f64>,
}

impl SimulatorSection {
    /// Default number of designs behind the model digest.
    const PROBE_DESIGNS: u32 = 3;
    /// Default of [`SimulatorSection::attempts`].
    const ATTEMPTS: u32 = 3;
    /// Default of [`SimulatorSection::retry_s`].
    const RETRY_S: f64 = 60.0;

    /// Number of designs behind the model digest of an external program. With 0 the digest depends
    /// only on the version that the program reports; this is meant for simulations that take very
    /// long.
    #[must_use]
    pub fn probe_designs(&self) -> u32 {
        self.probe_designs.unwrap_or(Self::PROBE_DESIGNS)
    }

    /// Number of times that a failing request is tried.
    #[must_use]
    pub fn attempts(&self) -> u32 {
        self.attempts.unwrap_or(Self::ATTEMPTS)
    }

    /// How long everything may fail.
    #[must_use]
    pub fn retry_for(&self) -> Duration {
        Duration::from_secs_f64(self.retry_s.unwrap_or(Self::RETRY_S))
    }

    /// The section without the keys that no result depends on.
    pub(super) const fn without_retries(mut self) -> Self {
        self.attempts = None;
        self.retry_s = None;
        self
    }

    /// Whether the section has the same effect as its absence.
    pub(super) fn is_default(&self) -> bool {
        *self == Self::default()
    }

    pub(super) fn validate(&self, source: Source<'_>) -> Result<(), FileError> {
        if let Some(attempts) = self.attempts {
            source.count("simulator.attempts", attempts, 1, 1000)?;
        }
        if let Some(seconds) = self.retry_s {
            source.within("simulator.retry_s", seconds, 0.0, 1e6, "s")?;
        }
        let keys = [
            ("probe_designs", self.probe_designs.map(f64::from)),
            ("attempts", self.attempts.map(f64::from)),
            ("retry_s", self.retry_s),
        ];
        let mut given = keys.into_iter();
        if self.kind == SimulatorKind::BuiltIn
            && let Some((key, Some(found))) = given.find(|(_, value)| value.is_some())
        {
            let key = format!("simulator.{key}");
            return Err(source.refuse(&key, found, "absent: it is for kind = \"external\""));
        }
        let most = crate::probe::DESIGNS;
        self.probe_designs.map_or(Ok(()), |found| {
            source.require(
                found <= most,
                "simulator.probe_designs",
                found,
                &format!("a whole number from 0 to {most}"),
            )
        })
    }
}

/// Parses a name such as a kernel's. The error lists the valid names.
pub(super) fn parse_name<T>(source: Source<'_>, key: &str, name: &str) -> Result<T, FileError>
where
    T: std::str::FromStr,
    T::Err: std::fmt::Display,
{
    name.parse()
        .map_err(|error: T::Err| source.refuse(key, name, format!("a known name: {error}")))
}
