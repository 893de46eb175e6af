//! The ways in which a campaign designs.

use serde::{Deserialize, Serialize};

use crate::Campaign;

/// One of the paper's four ways to design the pair (section IV.D), and one beyond it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Approach {
    /// 1) ΔSTE without wear, eleven variables.
    NoWear,
    /// 2) ΔSTE with Archard's wear, six variables.
    Archard,
    /// 3) The kriging mean of P90, six variables.
    Kriging,
    /// 4) The best feasible point of the DoE.
    BestOfDoe,
    /// The kriging prediction of P90 after rounds of infill, for campaigns with an enrichment.
    EnrichedKriging,
}

impl Approach {
    /// All of them, those of the paper's Table 5 first and in its order.
    pub const ALL: [Self; 5] = [
        Self::NoWear,
        Self::Archard,
        Self::Kriging,
        Self::BestOfDoe,
        Self::EnrichedKriging,
    ];

    /// Those of a campaign: the fifth only if it has an enrichment.
    pub fn of(campaign: &Campaign) -> impl Iterator<Item = Self> + use<> {
        let enriches = campaign.enrichment.is_some();
        let belongs = move |approach: &Self| *approach != Self::EnrichedKriging || enriches;
        Self::ALL.into_iter().filter(belongs)
    }

    /// The approaches that run an optimiser.
    pub const OPTIMISED: [Self; 3] = [Self::NoWear, Self::Archard, Self::Kriging];

    /// The name in tables, exports and on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::NoWear => "no-wear",
            Self::Archard => "archard",
            Self::Kriging => "kriging",
            Self::BestOfDoe => "best-of-doe",
            Self::EnrichedKriging => "enriched-kriging",
        }
    }

    /// The number in the paper's Table 5; it also names random streams and jobs.
    #[must_use]
    pub const fn number(self) -> u64 {
        match self {
            Self::NoWear => 1,
            Self::Archard => 2,
            Self::Kriging => 3,
            Self::BestOfDoe => 4,
            Self::EnrichedKriging => 5,
        }
    }
}
