//! The section about the campaign as a whole.

use crate::number::{count, percent};
use crate::report::contents::Report;
use crate::report::{facts, paper};

/// Size and origin of the campaign, and the designs that could not be simulated.
pub(super) struct CampaignView<'a> {
    pub(super) samples_digest: &'a str,
    /// Label and value.
    pub(super) tiles: Vec<(String, String)>,
    /// Reason, number of designs, and their share of all.
    pub(super) refused: Vec<[String; 3]>,
}

impl<'a> CampaignView<'a> {
    pub(super) fn new(report: &'a Report) -> Self {
        let snapshot = &report.snapshot;
        let all = f64::from(snapshot.problem.campaign().doe.designs);
        let refused = snapshot.refusals().into_iter();
        Self {
            samples_digest: &snapshot.samples_digest,
            tiles: tiles(report),
            refused: refused
                .map(|(reason, designs)| {
                    let share = percent(designs as f64 / all);
                    [reason, count(designs), share]
                })
                .collect(),
        }
    }
}

fn tiles(report: &Report) -> Vec<(String, String)> {
    let snapshot = &report.snapshot;
    let campaign = snapshot.problem.campaign();
    let (designs, k) = (campaign.doe.designs, campaign.sampling.samples_per_design);
    let simulable = snapshot.simulable();
    let share = percent(simulable as f64 / f64::from(designs));
    let mut simulable = format!("{} ({share})", count(simulable));
    if report.paper().is_some() {
        let (of_paper, all) = (paper::SIMULABLE, paper::DESIGNS);
        simulable += &format!("; paper {of_paper} of {all}");
    }
    let tiles = [
        ("Seed", snapshot.campaign.seed.to_string()),
        ("Program version", snapshot.campaign.program_version.clone()),
        ("Designs n", count(designs.into())),
        ("Samples per design k", count(k.into())),
        ("Simulable designs", simulable),
        ("Simulator calls", count(snapshot.simulator_calls())),
    ];
    let tiles = tiles.map(|(label, value)| (label.to_owned(), value));
    tiles.into_iter().chain(facts::facts(snapshot)).collect()
}
