//! `[wear]`: the law of the mean wear, by the number that it takes, and the random field.

use gear::{Kernel, Wear, WearLaw};
use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize, Serializer, de::Error as _};

use super::FileError;
use super::validate::{Invalid, Source};

/// `[wear]`: the law of the mean wear, by the number that it takes, and its random field.
#[derive(Debug, Clone, Copy, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct WearSection {
    /// Archard's law: material is removed wherever the flanks slide, and the deepest place of every flank has
    /// this depth, µm. Either this or `coefficient_per_mpa` is given.
    #[serde(skip_serializing_if = "Option::is_none")]
    max_depth_um: Option<f64>,
    /// The paper's law: the depth per pressure and sliding, 1/MPa, the same for all pairs. The depth has the sign
    /// of the sliding velocity.
    #[serde(skip_serializing_if = "Option::is_none")]
    coefficient_per_mpa: Option<f64>,
    /// Covariance of the random field.
    kernel: Kernel,
    /// Range of the random field, rad of roll angle.
    range_rad: f64,
    /// Variance of the random field, whose mean is 1.
    variance: f64,
}

impl TryFrom<WearSection> for Wear {
    type Error = Invalid;

    fn try_from(section: WearSection) -> Result<Self, Invalid> {
        let law = match (section.max_depth_um, section.coefficient_per_mpa) {
            (Some(max_depth_um), None) => WearLaw::Archard { max_depth_um },
            (None, Some(coefficient)) => WearLaw::Signed { coefficient },
            (Some(_), Some(coefficient)) => {
                return Err(Invalid::new(
                    "wear.coefficient_per_mpa",
                    &coefficient,
                    "absent beside max_depth_um: each is the number of another law",
                ));
            }
            (None, None) => {
                return Err(Invalid::missing(
                    "wear.max_depth_um",
                    "given, unless coefficient_per_mpa is",
                ));
            }
        };
        Ok(Self {
            law,
            kernel: section.kernel,
            range: section.range_rad,
            variance: section.variance,
        })
    }
}

impl From<Wear> for WearSection {
    fn from(wear: Wear) -> Self {
        let (max_depth_um, coefficient_per_mpa) = match wear.law {
            WearLaw::Archard { max_depth_um } => (Some(max_depth_um), None),
            WearLaw::Signed { coefficient } => (None, Some(coefficient)),
        };
        Self {
            max_depth_um,
            coefficient_per_mpa,
            kernel: wear.kernel,
            range_rad: wear.range,
            variance: wear.variance,
        }
    }
}

pub(super) fn serialize<S: Serializer>(wear: &Wear, to: S) -> Result<S::Ok, S::Error> {
    WearSection::from(*wear).serialize(to)
}

pub(super) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Wear, D::Error> {
    let section = WearSection::deserialize(from)?;
    section.try_into().map_err(D::Error::custom)
}

/// Archard's law with the paper's random field: the wear of a pair file without the section.
pub(super) fn default() -> Wear {
    Wear {
        law: WearLaw::Archard { max_depth_um: 3.5 },
        kernel: Kernel::SquaredExponential,
        range: 0.2,
        variance: 0.01,
    }
}

pub(super) fn validate(wear: &Wear, source: Source<'_>) -> Result<(), FileError> {
    match wear.law {
        WearLaw::Archard { max_depth_um } => {
            source.within("wear.max_depth_um", max_depth_um, 0.0, 1e6, "µm")?;
        }
        WearLaw::Signed { coefficient } => {
            source.within("wear.coefficient_per_mpa", coefficient, 0.0, 1.0, "1/MPa")?;
        }
    }
    source.within("wear.range_rad", wear.range, 1e-6, 1e6, "rad")?;
    source.within("wear.variance", wear.variance, 0.0, 1e3, "")
}
