//! The decision of a round.

use serde::{Deserialize, Serialize};

use crate::{Note, Stop};

/// Half-width of a two-sided 95 % interval of the standard normal distribution.
pub(crate) const Z95: f64 = 1.959_963_984_540_054;

/// An observation to make.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "infill", deny_unknown_fields)]
pub enum Infill {
    /// A new design.
    New {
        /// Variables of the design, in the caller's units; feasible by the exact constraints.
        x: Vec<f64>,
        /// Number of samples to take.
        samples: u32,
        /// Value of the observation by the criterion.
        value: f64,
        /// Why the design was chosen.
        reason: Reason,
    },
    /// More samples at a design that was sampled before.
    More {
        /// The design's index in [`State::sampled`](crate::State::sampled).
        design: usize,
        /// Number of samples to add.
        samples: u32,
        /// Value of the samples by the criterion.
        value: f64,
    },
}

/// Why a new design was chosen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Reason {
    /// The criterion is highest there within the trust region.
    Local,
    /// The criterion is highest there in the whole box.
    Global,
    /// No model could choose, so the design is far from all others.
    SpaceFilling,
}

/// The best design so far, by the model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Recommendation {
    /// Index of the design in [`State::sampled`](crate::State::sampled): the feasible design with
    /// the lowest upper quantile in the best basin.
    pub design: usize,
    /// Variables of the design.
    pub x: Vec<f64>,
    /// The model's prediction of the response there.
    pub predicted: f64,
    /// The model's 95 % interval for the noise-free response there.
    pub interval: (f64, f64),
    /// The standard deviation of an estimate of the response from one sample; that of k samples
    /// is smaller by √k.
    pub sd_of_sample_um: f64,
}

impl Recommendation {
    /// Half the width of the interval.
    #[must_use]
    pub fn half_width(&self) -> f64 {
        0.5 * (self.interval.1 - self.interval.0)
    }
}

/// The decision of a round.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Decision {
    /// The number of the round, from 0.
    pub round: usize,
    /// The observations to make. Empty if the enrichment stops, or if nothing is worth the effort:
    /// the next round then searches again with other random numbers before the enrichment stops.
    pub infill: Vec<Infill>,
    /// The best design so far; `None` without a model or a feasible design.
    pub recommendation: Option<Recommendation>,
    /// The highest value that the criterion gives to any observation; `None` without a model. A
    /// value below δ holds for every basin and the whole box.
    pub expected_improvement: Option<f64>,
    /// The reason to stop; `None` if the enrichment goes on.
    pub stop: Option<Stop>,
    /// Notes on the round for its user.
    pub notes: Vec<Note>,
    /// Number of evaluations of the exact constraints.
    pub constraint_evaluations: u64,
}
