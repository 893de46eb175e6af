//! The stages of a campaign.

use std::fmt;

use serde::{Deserialize, Serialize};

/// A stage, in the order in which a campaign waits for them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Stage {
    /// The designs of the DoE are made.
    Doe,
    /// The designs are sampled.
    Sample,
    /// The kriging model is fitted.
    Fit,
    /// The optimisers run.
    Optimise,
    /// Rounds of infill are decided and sampled.
    Enrich,
    /// The optima are verified.
    Verify,
    /// Nothing is left.
    Done,
}

impl Stage {
    /// The stages that take time, in their order.
    pub const WORK: [Self; 6] = [
        Self::Doe,
        Self::Sample,
        Self::Fit,
        Self::Optimise,
        Self::Enrich,
        Self::Verify,
    ];

    /// The stage of this name.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        let all = Self::WORK.into_iter().chain([Self::Done]);
        all.into_iter().find(|stage| stage.to_string() == name)
    }
}

/// The name in the store and in messages.
impl fmt::Display for Stage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.serialize(f)
    }
}
