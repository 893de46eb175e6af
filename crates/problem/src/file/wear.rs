//! `[wear]`: the law of the mean wear and its amount, and the random field.

use gear::paper::{MAX_DEPTH_UM, WEAR};
use gear::{Kernel, LocalAmount, Wear, WearLaw};
use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize, Serializer, de::Error as _};

use super::FileError;
use super::validate::{InvalidValue, Source};

/// `[wear]`: the mean wear, whose law follows from the amount that is given, and its random field.
///
/// The defaults belong to the 2009 paper: the depth is the one that fits its tables, see the documentation of `gear::paper`.
#[derive(Debug, Clone, Copy, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(super) struct WearSection {
    /// The law of the mean wear. If absent, it follows from the number that is given; only
    /// `"local-archard"` with `max_depth_um` needs the name.
    #[serde(skip_serializing_if = "Option::is_none")]
    law: Option<LawName>,
    /// Archard's law: material is removed wherever the flanks slide, and the deepest place of every flank has
    /// this depth, µm. With `law = "local-archard"` the deepest place of both flanks together has it. This,
    /// `coefficient_per_mpa` or `wear_coefficient_mm2_per_n` is given; without them it is 3.5 µm.
    #[serde(skip_serializing_if = "Option::is_none")]
    max_depth_um: Option<f64>,
    /// The paper's law: the depth per pressure and sliding, 1/MPa, the same for all pairs. The depth has the sign
    /// of the sliding velocity.
    #[serde(skip_serializing_if = "Option::is_none")]
    coefficient_per_mpa: Option<f64>,
    /// Archard's law with each flank's own sliding: the worn volume per force and sliding distance, mm²/N. Given
    /// with `pinion_cycles`.
    #[serde(skip_serializing_if = "Option::is_none")]
    wear_coefficient_mm2_per_n: Option<f64>,
    /// Number of revolutions of the pinion over which the flanks wear with `wear_coefficient_mm2_per_n`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pinion_cycles: Option<f64>,
    /// Covariance of the random field.
    kernel: Kernel,
    /// Range of the random field, rad of roll angle.
    range_rad: f64,
    /// Variance of the random field, whose mean is 1.
    variance: f64,
    /// Range of the worn share of the depth. The share is random, with a uniform distribution between the two numbers,
    /// as for a pair that wears at a constant rate and is observed at a random time of its life. `[0.0, 1.0]` is a
    /// whole life from new to worn. If absent, every pair has the whole depth.
    #[serde(skip_serializing_if = "Option::is_none")]
    life: Option<[f64; 2]>,
}

impl Default for WearSection {
    fn default() -> Self {
        let mut section = Self::from(WEAR);
        // The default depth applies only if no other number gives the amount of wear.
        section.max_depth_um = None;
        section
    }
}

/// The name of a law of the mean wear.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
enum LawName {
    /// Pressure times distance from the pitch point, with the same depth on both flanks.
    Archard,
    /// The law of the paper, which adds material beyond the pitch point.
    Signed,
    /// Line load times the specific sliding of each flank, so that roots wear deeper than tips.
    LocalArchard,
}

/// The number that a section gives for its law.
enum Amount {
    MaxDepth(f64),
    PerMpa(f64),
    Cycles(LocalAmount),
}

impl Amount {
    /// The key of the number, and the laws that take it.
    const fn place(&self) -> (&'static str, &'static str) {
        match self {
            Self::MaxDepth(_) => ("max_depth_um", "\"archard\" or \"local-archard\""),
            Self::PerMpa(_) => ("coefficient_per_mpa", "\"signed\""),
            Self::Cycles(_) => ("wear_coefficient_mm2_per_n", "\"local-archard\""),
        }
    }
}

impl WearSection {
    fn law(&self) -> Result<WearLaw, InvalidValue> {
        let amount = self.amount()?;
        match (self.law, amount) {
            (None | Some(LawName::Archard), Amount::MaxDepth(max_depth_um)) => {
                Ok(WearLaw::Archard { max_depth_um })
            }
            (None | Some(LawName::Signed), Amount::PerMpa(coefficient)) => {
                Ok(WearLaw::Signed { coefficient })
            }
            (Some(LawName::LocalArchard), Amount::MaxDepth(max_depth_um)) => {
                Ok(WearLaw::LocalArchard {
                    amount: LocalAmount::MaxDepth { max_depth_um },
                })
            }
            (None | Some(LawName::LocalArchard), Amount::Cycles(amount)) => {
                Ok(WearLaw::LocalArchard { amount })
            }
            (Some(law), amount) => {
                let (key, laws) = amount.place();
                let expected = format!("{laws} beside {key}");
                Err(InvalidValue::new("wear.law", &law, expected))
            }
        }
    }

    /// The only number of a law that the section gives.
    fn amount(&self) -> Result<Amount, InvalidValue> {
        let cycles = match (self.wear_coefficient_mm2_per_n, self.pinion_cycles) {
            (Some(coefficient), Some(pinion_cycles)) => Some(LocalAmount::Cycles {
                coefficient,
                pinion_cycles,
            }),
            (None, None) => None,
            (Some(_), None) => {
                return Err(InvalidValue::missing(
                    "wear.pinion_cycles",
                    "given beside wear_coefficient_mm2_per_n: the depth grows with the cycles",
                ));
            }
            (None, Some(cycles)) => {
                return Err(InvalidValue::new(
                    "wear.pinion_cycles",
                    &cycles,
                    "absent without wear_coefficient_mm2_per_n",
                ));
            }
        };
        match (self.max_depth_um, self.coefficient_per_mpa, cycles) {
            (Some(max_depth_um), None, None) => Ok(Amount::MaxDepth(max_depth_um)),
            (None, Some(coefficient), None) => Ok(Amount::PerMpa(coefficient)),
            (None, None, Some(cycles)) => Ok(Amount::Cycles(cycles)),
            (None, None, None) if self.law == Some(LawName::Signed) => Err(InvalidValue::missing(
                "wear.coefficient_per_mpa",
                "given with law = \"signed\"",
            )),
            (None, None, None) => Ok(Amount::MaxDepth(MAX_DEPTH_UM)),
            (Some(_), Some(coefficient), _) => Err(InvalidValue::new(
                "wear.coefficient_per_mpa",
                &coefficient,
                "absent beside max_depth_um: each is the number of another law",
            )),
            (depth, _, Some(_)) => {
                let other = match depth {
                    Some(_) => "max_depth_um: the depth follows from the cycles",
                    None => "coefficient_per_mpa: each is the number of another law",
                };
                Err(InvalidValue::new(
                    "wear.wear_coefficient_mm2_per_n",
                    &self.wear_coefficient_mm2_per_n,
                    format!("absent beside {other}"),
                ))
            }
        }
    }
}

impl TryFrom<WearSection> for Wear {
    type Error = InvalidValue;

    fn try_from(section: WearSection) -> Result<Self, InvalidValue> {
        Ok(Self {
            law: section.law()?,
            kernel: section.kernel,
            range: section.range_rad,
            variance: section.variance,
            life: section.life,
        })
    }
}

impl From<Wear> for WearSection {
    fn from(wear: Wear) -> Self {
        let mut section = Self {
            law: None,
            max_depth_um: None,
            coefficient_per_mpa: None,
            wear_coefficient_mm2_per_n: None,
            pinion_cycles: None,
            kernel: wear.kernel,
            range_rad: wear.range,
            variance: wear.variance,
            life: wear.life,
        };
        match wear.law {
            WearLaw::Archard { max_depth_um } => section.max_depth_um = Some(max_depth_um),
            WearLaw::Signed { coefficient } => section.coefficient_per_mpa = Some(coefficient),
            WearLaw::LocalArchard { amount } => {
                section.law = Some(LawName::LocalArchard);
                match amount {
                    LocalAmount::MaxDepth { max_depth_um } => {
                        section.max_depth_um = Some(max_depth_um);
                    }
                    LocalAmount::Cycles {
                        coefficient,
                        pinion_cycles,
                    } => {
                        section.wear_coefficient_mm2_per_n = Some(coefficient);
                        section.pinion_cycles = Some(pinion_cycles);
                    }
                }
            }
        }
        section
    }
}

pub(super) fn serialize<S: Serializer>(wear: &Wear, to: S) -> Result<S::Ok, S::Error> {
    WearSection::from(*wear).serialize(to)
}

pub(super) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Wear, D::Error> {
    let section = WearSection::deserialize(from)?;
    section.try_into().map_err(D::Error::custom)
}

/// The wear of a file without the section.
pub(super) const fn default() -> Wear {
    WEAR
}

pub(super) fn validate(wear: &Wear, source: Source<'_>) -> Result<(), FileError> {
    match wear.law {
        WearLaw::Archard { max_depth_um }
        | WearLaw::LocalArchard {
            amount: LocalAmount::MaxDepth { max_depth_um },
        } => {
            source.within("wear.max_depth_um", max_depth_um, 0.0, 1e6, "µm")?;
        }
        WearLaw::LocalArchard {
            amount:
                LocalAmount::Cycles {
                    coefficient,
                    pinion_cycles,
                },
        } => {
            let key = "wear.wear_coefficient_mm2_per_n";
            source.within(key, coefficient, 0.0, 1e-3, "mm²/N")?;
            source.within("wear.pinion_cycles", pinion_cycles, 0.0, 1e12, "")?;
        }
        WearLaw::Signed { coefficient } => {
            source.within("wear.coefficient_per_mpa", coefficient, 0.0, 1.0, "1/MPa")?;
        }
    }
    source.within("wear.range_rad", wear.range, 1e-6, 1e6, "rad")?;
    source.within("wear.variance", wear.variance, 0.0, 1e3, "")?;
    let life = wear.life.unwrap_or([0.0, 1.0]);
    source.ordered("wear.life", life, 0.0, 100.0)
}
