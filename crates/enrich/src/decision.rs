//! What a round decides.

use serde::{Deserialize, Serialize};

/// Half-width of a two-sided 95 % interval of the standard normal distribution.
pub(crate) const Z95: f64 = 1.959_963_984_540_054;

/// An observation to make.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "infill", deny_unknown_fields)]
pub enum Infill {
    /// A new design.
    New {
        /// Its variables, in the caller's units; feasible by the exact constraints.
        x: Vec<f64>,
        /// How many samples to take.
        samples: u32,
        /// What the criterion expects of it, µm.
        value_um: f64,
        /// Why it was chosen.
        reason: Reason,
    },
    /// More samples at a design that is there.
    More {
        /// Which entry of [`State::sampled`](crate::State::sampled).
        design: usize,
        /// How many samples to add.
        samples: u32,
        /// What the criterion expects of them, µm.
        value_um: f64,
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
    /// No model could be fitted or none prefers any place: it is far from all other designs.
    SpaceFilling,
}

/// The best design so far, by the model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Recommendation {
    /// Which entry of [`State::sampled`](crate::State::sampled): the feasible one with the lowest upper quantile.
    pub design: usize,
    /// Its variables.
    pub x: Vec<f64>,
    /// The model's prediction of the response there, µm.
    pub predicted_um: f64,
    /// The model's 95 % interval for the noise-free response there, µm.
    pub interval_um: (f64, f64),
    /// The standard deviation of an estimate of the response from one sample, µm; that of k samples
    /// is smaller by √k.
    pub sd_of_sample_um: f64,
}

impl Recommendation {
    /// Half the width of the interval, µm.
    #[must_use]
    pub fn half_width_um(&self) -> f64 {
        0.5 * (self.interval_um.1 - self.interval_um.0)
    }
}

/// Why the enrichment ends.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "stop", deny_unknown_fields)]
pub enum Stop {
    /// The expected improvement was below δ in this round and the one before, in every basin and in
    /// the whole box, and the half-width of the recommendation's interval is below δ.
    Converged {
        /// The larger of the two expected improvements, µm.
        expected_improvement_um: f64,
        /// The half-width, µm.
        half_width_um: f64,
    },
    /// The samples left do not pay for another observation.
    Budget {
        /// How many are left.
        samples: u32,
    },
    /// There were as many rounds as there may be.
    Rounds {
        /// How many.
        rounds: usize,
    },
    /// Every infill point of two rounds in a row failed.
    OnlyFailures,
    /// No feasible design was found to observe.
    NothingFeasible,
}

/// Something about a round that its user should know.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "note", deny_unknown_fields)]
pub enum Note {
    /// Several entries of the state are at one place; they were merged.
    Merged {
        /// How many entries were merged into others.
        entries: usize,
    },
    /// Responses that are no numbers were taken as failures.
    NotNumbers {
        /// How many.
        entries: usize,
    },
    /// All responses are equal: nothing can be learned from them.
    Plateau,
    /// The model hardly prefers its covariance to a constant plus noise: noise hides the signal.
    NoStructure,
    /// No model could be fitted.
    NoModel {
        /// Why.
        reason: String,
    },
    /// No sampled design is feasible yet.
    NoFeasibleDesign,
    /// Near the best design the covariance was fitted anew, since the model of all designs is too
    /// coarse there.
    LocalRefit {
        /// Which entry of the state the trust region is around.
        design: usize,
        /// Root mean square of its leave-one-out residuals near the best design, and of those of
        /// the local model, on the modelled scale.
        global_rmse: f64,
        /// See `global_rmse`.
        local_rmse: f64,
    },
    /// An infill point fell on an existing design, which gets more samples instead.
    Repeated {
        /// Which entry of the state.
        design: usize,
    },
    /// Every infill point of the last round failed.
    RoundFailed,
}

/// What a round decides.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Decision {
    /// The round, from 0: how many came before.
    pub round: usize,
    /// The observations to make; none if the enrichment stops, or if nothing is worth the effort: then the next
    /// round looks a second time, with other random numbers, before the enrichment stops.
    pub infill: Vec<Infill>,
    /// The best design so far; none without a model or a feasible design.
    pub recommendation: Option<Recommendation>,
    /// The most that the criterion expects of any observation, µm; none where no model could tell.
    pub expected_improvement_um: Option<f64>,
    /// Why to stop, if so.
    pub stop: Option<Stop>,
    /// What is to be known of the round.
    pub notes: Vec<Note>,
    /// How often the exact constraints were evaluated.
    pub constraint_evaluations: u64,
}
