//! Campaigns and stores that a study refuses.

use problem::Campaign;

/// The campaign of a study that simulates designs has an external simulator.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "campaign {campaign} is simulated by an external program, which this command does not start: it \
     simulates with the built-in model; give it a copy of the campaign without the section [simulator]"
)]
pub struct ExternalSimulator {
    pub campaign: String,
}

/// Refuses campaigns that a study cannot simulate.
///
/// # Errors
///
/// The campaign's simulator is an external program.
pub fn require_built_in(campaign: &Campaign) -> Result<(), ExternalSimulator> {
    if campaign.is_external() {
        let campaign = campaign.name.clone();
        return Err(ExternalSimulator { campaign });
    }
    Ok(())
}

/// The campaign of a study of gears is of another kind.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("campaign {campaign} has kind = \"external\": this command is for campaigns of gears")]
pub struct NoGears {
    pub campaign: String,
}

/// Refuses campaigns that design no gears.
///
/// # Errors
///
/// The campaign is of another kind.
pub fn require_gears(campaign: &Campaign) -> Result<(), NoGears> {
    match campaign.gears() {
        Some(_) => Ok(()),
        None => Err(NoGears {
            campaign: campaign.name.clone(),
        }),
    }
}

/// The campaign of a store is not finished.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{store} is not finished (stage {stage}): finish it with `coordinator run` first")]
pub struct UnfinishedCampaign {
    pub store: String,
    /// The first unfinished stage.
    pub stage: String,
}
