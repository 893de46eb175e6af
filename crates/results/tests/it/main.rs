//! Results read from a store.

use problem::Campaign;
use store::{CampaignRow, Store};
use tempfile::TempDir;

mod live;
mod report;
mod status;

/// The store of the paper's campaign before its first design.
async fn new_store() -> (TempDir, Store) {
    let folder = tempfile::tempdir().unwrap();
    let campaign = Campaign::parse("paper.toml", Campaign::PAPER).unwrap();
    let row = CampaignRow {
        name: campaign.name.clone(),
        file_text: Campaign::PAPER.to_owned(),
        digest: campaign.digest(),
        seed: campaign.seed,
        program_version: "0".to_owned(),
        model_digest: None,
    };
    let path = folder.path().join("s.db");
    let store = Store::create_or_open(&path, &row).await.unwrap();
    (folder, store)
}
