//! The approaches to an optimal design.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// One of the paper's four approaches (section IV.D), or a further one.
/// [`Problem::approaches`](crate::formulation::Problem::approaches) lists those of a campaign.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "kebab-case")]
pub enum Approach {
    /// 1) Minimises the nominal response (for a gear pair, ΔSTE without wear) over all variables.
    #[serde(rename = "no-wear")]
    Nominal = 1,
    /// 2) Minimises the response without random effects: for a gear pair, ΔSTE with Archard's wear.
    #[serde(rename = "archard", alias = "baseline")]
    Baseline = 2,
    /// 3) Minimises the kriging mean of the measure, such as P90.
    Kriging = 3,
    /// 4) Takes the best feasible point of the DoE.
    BestOfDoe = 4,
    /// Minimises the kriging prediction of the measure after rounds of infill, in campaigns with an
    /// enrichment.
    EnrichedKriging = 5,
    /// Minimises the sampled measure itself, with the same random numbers at every design and
    /// without a model.
    Direct = 6,
}

impl Approach {
    /// All approaches, first those of the paper's Table 5 in its order.
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

    /// The name in the store and, for a gear campaign, in tables, exports and on the command line.
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

    /// The approach of this name.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        let mut all = Self::ALL.into_iter();
        all.find(|approach| approach.name() == name)
    }

    /// The approach with this number.
    #[must_use]
    pub fn numbered(number: u64) -> Option<Self> {
        let mut all = Self::ALL.into_iter();
        all.find(|approach| approach.number() == number)
    }

    /// The number of the approach, which also identifies random streams and jobs; 1 to 4 are those of the paper's Table 5.
    #[must_use]
    pub const fn number(self) -> u64 {
        self as u64
    }
}
