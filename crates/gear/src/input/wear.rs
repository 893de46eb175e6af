//! The law of wear and its random field.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{InputError, check_range, named};

/// The mean wear W on each flank at the place s of the path of contact, with p the greatest unworn
/// Hertz pressure there over the mesh period, MPa, and s_P the pitch point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum WearLaw {
    /// Archard's law: W = W_max · p|s − s_P| over its maximum. Material goes wherever the flanks
    /// slide, and the deepest place of every pair has the same depth. The law to design with.
    Archard {
        /// Depth W_max of the deepest place, µm on each flank.
        max_depth_um: f64,
    },
    /// W = coefficient · p (s_P − s), as the 2009 paper computed it: the sliding velocity with its
    /// sign, and one coefficient for all pairs. Material goes before the pitch point and is
    /// **added** beyond it, which no wear does.
    Signed {
        /// Depth per pressure and sliding, 1/MPa.
        coefficient: f64,
    },
    /// Archard's law with the sliding distance of each flank: W_i = k n_i w |ζ_i| / cos β_b. ζ_i is the
    /// [specific sliding](crate::Geometry::specific_sliding) of flank i, w the line load that belongs to
    /// p, N/mm, and w/cos β_b the integral of the pressure along the profile. The gear has
    /// n_2 = n_1 Z1/Z2 mesh cycles. A root wears deeper than the tip that slides on it, because less of
    /// the root's profile passes through the contact. The model is that of Flodin and Andersson,
    /// Simulation of mild wear in spur gears, Wear 207 (1997).
    LocalArchard {
        /// The depth, or the wear that gives it.
        amount: LocalAmount,
    },
}

/// The amount of wear of [`WearLaw::LocalArchard`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LocalAmount {
    /// The deepest place of both flanks is given. The ratio of the flanks' depths is that of the law.
    MaxDepth {
        /// Depth of that place, µm.
        max_depth_um: f64,
    },
    /// The wear coefficient and the number of mesh cycles are given.
    Cycles {
        /// Archard's coefficient k, worn volume per normal force and sliding distance, mm²/N.
        coefficient: f64,
        /// Mesh cycles n_1 of each tooth of the pinion, which are its revolutions.
        pinion_cycles: f64,
    },
}

impl WearLaw {
    /// Whether the depth may be negative.
    pub(crate) const fn adds_material(self) -> bool {
        matches!(self, Self::Signed { .. })
    }

    /// The same law with `factor` times the depth everywhere.
    #[must_use]
    pub const fn scaled(self, factor: f64) -> Self {
        match self {
            Self::Archard { max_depth_um } => Self::Archard {
                max_depth_um: factor * max_depth_um,
            },
            Self::Signed { coefficient } => Self::Signed {
                coefficient: factor * coefficient,
            },
            Self::LocalArchard { amount } => Self::LocalArchard {
                amount: amount.scaled(factor),
            },
        }
    }
}

impl LocalAmount {
    /// `factor` times the depth everywhere, by as many times the cycles where these are given.
    const fn scaled(self, factor: f64) -> Self {
        match self {
            Self::MaxDepth { max_depth_um } => Self::MaxDepth {
                max_depth_um: factor * max_depth_um,
            },
            Self::Cycles {
                coefficient,
                pinion_cycles,
            } => Self::Cycles {
                coefficient,
                pinion_cycles: factor * pinion_cycles,
            },
        }
    }
}

/// Wear of the flanks: how deep, and how its random multiplier varies along a flank.
///
/// The multiplier is Gaussian with mean 1. Where it falls below zero it counts as zero: wear does not
/// change its direction. With a variance of 0.01 that never happens, with 0.25 at one place in 44,
/// which raises the mean depth by 0.4 %.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wear {
    /// The mean profile.
    pub law: WearLaw,
    /// Correlation of the random multiplier.
    pub kernel: Kernel,
    /// Correlation range, rad of roll angle.
    pub range: f64,
    /// Variance of the multiplier, whose mean is 1.
    pub variance: f64,
    /// The share of the law's depth that is worn off, evenly distributed between these two numbers: a gear that wears
    /// evenly over its life is met at a random time of it. `None` is the whole depth.
    pub life: Option<[f64; 2]>,
}

impl Wear {
    /// The mean share of the law's depth.
    #[must_use]
    pub fn mean_share(&self) -> f64 {
        self.life.map_or(1.0, |[from, to]| 0.5 * (from + to))
    }

    /// Checks that depth and variance are at least zero and the range is positive.
    ///
    /// # Errors
    /// Names the first field that is out of its domain.
    pub fn validate(&self) -> Result<(), InputError> {
        match self.law {
            WearLaw::Archard { max_depth_um }
            | WearLaw::LocalArchard {
                amount: LocalAmount::MaxDepth { max_depth_um },
            } => check_range(
                "max_depth_um",
                max_depth_um,
                0.0..=1e6,
                "a depth from 0 to 1e6 µm",
            )?,
            WearLaw::LocalArchard {
                amount:
                    LocalAmount::Cycles {
                        coefficient,
                        pinion_cycles,
                    },
            } => {
                check_range(
                    "coefficient",
                    coefficient,
                    0.0..=1e-3,
                    "a coefficient from 0 to 1e-3 mm²/N",
                )?;
                check_range(
                    "pinion_cycles",
                    pinion_cycles,
                    0.0..=1e12,
                    "a number of cycles from 0 to 1e12",
                )?;
            }
            WearLaw::Signed { coefficient } => check_range(
                "coefficient",
                coefficient,
                0.0..=1.0,
                "a coefficient from 0 to 1 per MPa",
            )?,
        }
        check_range(
            "range",
            self.range,
            1e-6..=1e6,
            "a range from 1e-6 to 1e6 rad",
        )?;
        check_range(
            "variance",
            self.variance,
            0.0..=1e3,
            "a variance from 0 to 1000",
        )?;
        let Some([from, to]) = self.life else {
            return Ok(());
        };
        check_range("life[0]", from, 0.0..=1e3, "a share from 0 to 1000")?;
        check_range(
            "life[1]",
            to,
            from..=1e3,
            "at least the first share and at most 1000",
        )
    }
}

/// Correlation of the wear field between two roll angles a distance h apart, in units of the
/// range: h here stands for |θ − θ′| / range.
///
/// The field is a Karhunen–Loève expansion of at most 64 modes for each gear. The two rough kernels
/// lose some variance by it, all of it in waves shorter than a tenth of the range.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Kernel {
    /// exp(−h²): infinitely smooth. 8 modes over 2.5 ranges leave out 1e-6 of the variance.
    SquaredExponential,
    /// exp(−h): continuous, with a corner everywhere. Loses 1.3 % of the variance over 2.5 ranges.
    Exponential,
    /// (1 + √3 h) exp(−√3 h).
    #[serde(rename = "matern-3-2")]
    Matern32,
    /// (1 + √5 h + 5 h²/3) exp(−√5 h).
    #[serde(rename = "matern-5-2")]
    Matern52,
    /// 1 − 3h/2 + h³/2 up to h = 1, zero beyond; as rough as the exponential one. Loses 2.2 % of the
    /// variance over 2.5 ranges.
    Spherical,
}

named!(Kernel: SquaredExponential, Exponential, Matern32, Matern52, Spherical);

impl Kernel {
    /// The correlation at the distance `h` ≥ 0, in units of the range.
    #[must_use]
    pub fn correlation(self, h: f64) -> f64 {
        match self {
            Self::SquaredExponential => (-h * h).exp(),
            Self::Exponential => (-h).exp(),
            Self::Matern32 => {
                let k = 3_f64.sqrt() * h;
                (1.0 + k) * (-k).exp()
            }
            Self::Matern52 => {
                let k = 5_f64.sqrt() * h;
                (1.0 + k + k * k / 3.0) * (-k).exp()
            }
            Self::Spherical => {
                if h < 1.0 {
                    1.0 - h * (1.5 - 0.5 * h * h)
                } else {
                    0.0
                }
            }
        }
    }
}
