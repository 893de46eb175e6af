//! Messages of a round to its user: reasons to stop, and notes.

use std::fmt;

use serde::{Deserialize, Serialize};

/// Why the enrichment ends. Displayed as a sentence.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "stop", deny_unknown_fields)]
pub enum Stop {
    /// Less than δ was expected of any observation in this round and the one before, in every basin and
    /// in the whole box, and the half-width of the recommendation's interval is below δ.
    Converged {
        /// The larger of the two expected improvements.
        expected_improvement: f64,
        /// The half-width of the recommendation's 95 % interval.
        half_width: f64,
    },
    /// The samples left do not pay for any observation, or not for one that is expected to gain δ.
    Budget {
        /// Number of samples left.
        samples: u32,
    },
    /// The enrichment had as many rounds as the options allow.
    Rounds {
        /// Number of rounds.
        rounds: usize,
    },
    /// Every infill point of two rounds in a row failed.
    OnlyFailures,
    /// No feasible design was found to observe.
    NothingFeasible,
}

impl fmt::Display for Stop {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Converged {
                expected_improvement,
                half_width,
            } => write!(
                f,
                "The enrichment has converged: two rounds in a row expected an improvement of at most \
                 {expected_improvement:.4}, and the half-width of the prediction's 95 % interval is \
                 {half_width:.4}, in the unit of the response."
            ),
            Self::Budget { samples } => write!(
                f,
                "The enrichment ended because no further observation worth making fits its budget: \
                 {samples} samples are left."
            ),
            Self::Rounds { rounds } => write!(
                f,
                "The enrichment ended after {rounds} rounds, the most that the campaign allows."
            ),
            Self::OnlyFailures => {
                f.write_str("The enrichment ended because every infill point of two rounds failed.")
            }
            Self::NothingFeasible => f.write_str(
                "The enrichment ended because it found no design that satisfies every constraint.",
            ),
        }
    }
}

/// A note on a round for its user. Displayed as a sentence.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "note", deny_unknown_fields)]
pub enum Note {
    /// Several entries of the state have the same variables and were merged.
    Merged {
        /// Number of entries that were merged into others.
        entries: usize,
    },
    /// Responses that are not finite numbers were counted as failures.
    NotNumbers {
        /// Number of such responses.
        entries: usize,
    },
    /// All responses are equal, so no model can be fitted.
    Plateau,
    /// The likelihood of the model is hardly higher than that of a constant plus noise.
    NoStructure,
    /// No model could be fitted.
    NoModel {
        /// The error of the fit.
        reason: String,
    },
    /// No sampled design is feasible yet.
    NoFeasibleDesign,
    /// A model of the nearest designs replaced the model of all designs in a basin, because its
    /// leave-one-out residuals are smaller there.
    LocalRefit {
        /// The index in [`State::sampled`](crate::State::sampled) of the design at the basin's centre.
        design: usize,
        /// Root mean square of the leave-one-out residuals of the model of all designs at the nearest
        /// designs.
        global_rmse: f64,
        /// The same for the local model.
        local_rmse: f64,
    },
    /// The search chose a new design at an existing one, which gets more samples instead.
    Repeated {
        /// Index of the existing design in [`State::sampled`](crate::State::sampled).
        design: usize,
    },
    /// Every infill point of the last round failed.
    RoundFailed,
}

impl fmt::Display for Note {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Merged { entries } => write!(
                f,
                "{entries} entries repeat the variables of another design and were merged with it."
            ),
            Self::NotNumbers { entries } => write!(
                f,
                "{entries} responses are not finite numbers and count as failures."
            ),
            Self::Plateau => f.write_str(
                "All responses are equal, so the round adds designs far from all others.",
            ),
            Self::NoStructure => f.write_str(
                "The noise hides the signal: the model is hardly better than a constant.",
            ),
            Self::NoModel { reason } => {
                write!(
                    f,
                    "No model could be fitted ({reason}), so the round adds designs far from all others."
                )
            }
            Self::NoFeasibleDesign => f.write_str("No sampled design is feasible yet."),
            Self::LocalRefit {
                design,
                global_rmse,
                local_rmse,
            } => write!(
                f,
                "Around design {design} the model was fitted to the nearest designs only: its \
                 leave-one-out error there is {local_rmse:.4}, that of the model of all designs \
                 {global_rmse:.4}."
            ),
            Self::Repeated { design } => write!(
                f,
                "The search chose design {design} again, which gets more samples."
            ),
            Self::RoundFailed => f.write_str("Every infill point of the last round failed."),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stops_and_notes_are_sentences() {
        let converged = Stop::Converged {
            expected_improvement: 0.0123,
            half_width: 0.004,
        };
        assert_eq!(
            converged.to_string(),
            "The enrichment has converged: two rounds in a row expected an improvement of at most \
             0.0123, and the half-width of the prediction's 95 % interval is 0.0040, in the unit of the \
             response."
        );
        let refit = Note::LocalRefit {
            design: 7,
            global_rmse: 0.5,
            local_rmse: 0.25,
        };
        assert_eq!(
            refit.to_string(),
            "Around design 7 the model was fitted to the nearest designs only: its leave-one-out \
             error there is 0.2500, that of the model of all designs 0.5000."
        );
    }
}
