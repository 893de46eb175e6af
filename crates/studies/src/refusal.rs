//! Campaigns and stores that a study refuses.

use campaign::Campaign;

/// A campaign with an external simulator: a study simulates designs of its own, with the built-in
/// model.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "campaign {campaign} is simulated by an external program: this command simulates by itself, with \
     the built-in model only"
)]
pub struct External {
    /// The campaign's name.
    pub campaign: String,
}

/// Refuses campaigns that a study cannot simulate.
///
/// # Errors
///
/// The campaign's simulator is an external program.
pub fn require_built_in(campaign: &Campaign) -> Result<(), External> {
    if campaign.is_external() {
        let campaign = campaign.name.clone();
        return Err(External { campaign });
    }
    Ok(())
}

/// A study of gears was requested for a campaign of another kind.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("campaign {campaign} has kind = \"external\": this command is for campaigns of gears")]
pub struct NoGears {
    /// The campaign's name.
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

/// The campaign of a store is not finished, as a study needs it.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "{store} is not finished (stage {stage}): finish it with `coordinator run`, then ask again"
)]
pub struct Unfinished {
    /// The store's file.
    pub store: String,
    /// The first stage that is not done.
    pub stage: String,
}
