//! The ways in which a campaign designs.

use serde::{Deserialize, Serialize};

/// One of the paper's four ways to design (section IV.D), or one beyond them. Which of them a campaign
/// has, [`Problem::approaches`](super::Problem::approaches) says.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Approach {
    /// 1) The response of a design as made: of a gear pair ΔSTE without wear, with all its variables.
    #[serde(rename = "no-wear")]
    Nominal,
    /// 2) The response without random effects: of a gear pair ΔSTE with Archard's wear.
    #[serde(rename = "archard")]
    Baseline,
    /// 3) The kriging mean of P90.
    Kriging,
    /// 4) The best feasible point of the DoE.
    BestOfDoe,
    /// The kriging prediction of P90 after rounds of infill, for campaigns with an enrichment.
    EnrichedKriging,
    /// The percentile itself, from the same random numbers at every design, without a model.
    Direct,
}

impl Approach {
    /// All of them, those of the paper's Table 5 first and in its order.
    pub const ALL: [Self; 6] = [
        Self::Nominal,
        Self::Baseline,
        Self::Kriging,
        Self::BestOfDoe,
        Self::EnrichedKriging,
        Self::Direct,
    ];

    /// The approaches that run an optimiser.
    pub const OPTIMISED: [Self; 4] = [Self::Nominal, Self::Baseline, Self::Kriging, Self::Direct];

    /// The name in the store and, of a gear campaign, in tables, exports and on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Nominal => "no-wear",
            Self::Baseline => "archard",
            Self::Kriging => "kriging",
            Self::BestOfDoe => "best-of-doe",
            Self::EnrichedKriging => "enriched-kriging",
            Self::Direct => "direct",
        }
    }

    /// The approach of this number.
    #[must_use]
    pub fn numbered(number: u64) -> Option<Self> {
        let mut all = Self::ALL.into_iter();
        all.find(|approach| approach.number() == number)
    }

    /// The number in the paper's Table 5; it also names random streams and jobs.
    #[must_use]
    pub const fn number(self) -> u64 {
        match self {
            Self::Nominal => 1,
            Self::Baseline => 2,
            Self::Kriging => 3,
            Self::BestOfDoe => 4,
            Self::EnrichedKriging => 5,
            Self::Direct => 6,
        }
    }
}
