//! The optional section `[enrichment]` of the campaign file.

use enrich::Criterion;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::FileError;
use super::validate::Source;

/// `[enrichment]`, optional: infill points in rounds, on top of the DoE.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Enrichment {
    /// The infill criterion: the value of an observation.
    #[serde(default)]
    pub criterion: Criterion,
    /// Maximum number of samples in total, including those of the DoE.
    pub samples: u32,
    /// Maximum number of rounds.
    pub rounds: u32,
    /// Number of infill points in a round.
    pub points_per_round: u32,
    /// Samples of a new design, and of each repetition at an existing one.
    pub samples_per_point: u32,
    /// Tolerance δ of the stopping rule, in the response's unit: the enrichment ends when it expects to gain
    /// less.
    pub tolerance: f64,
}

impl Enrichment {
    pub(super) fn validate(&self, source: Source<'_>) -> Result<(), FileError> {
        let count = |key, value, low, high| source.count(key, value, low, high);
        count("enrichment.samples", self.samples, 1, 1_000_000_000)?;
        count("enrichment.rounds", self.rounds, 1, 10_000)?;
        count(
            "enrichment.points_per_round",
            self.points_per_round,
            1,
            1000,
        )?;
        // With fewer samples no percentile can be estimated.
        count(
            "enrichment.samples_per_point",
            self.samples_per_point,
            4,
            1_000_000,
        )?;
        source.positive("enrichment.tolerance", self.tolerance)
    }

    /// Whether this section is `held` with the same or a larger budget.
    pub(super) fn extends(&self, held: &Self) -> bool {
        let same = Self {
            samples: held.samples,
            rounds: held.rounds,
            ..*self
        };
        same == *held && self.samples >= held.samples && self.rounds >= held.rounds
    }
}

#[cfg(test)]
mod tests {
    use crate::Campaign;

    const ENRICHED: &str = include_str!("../../../../campaigns/enriched.toml");

    #[test]
    fn the_shipped_file_has_a_fifth_of_the_papers_analyses_in_all() {
        let campaign = Campaign::parse("enriched.toml", ENRICHED).unwrap();
        let paper = Campaign::parse("paper.toml", Campaign::PAPER).unwrap();
        let section = campaign.enrichment.unwrap();
        let full = paper.doe.designs * paper.sampling.samples_per_design;
        assert_eq!(section.samples, full / 5);
        assert_eq!(
            campaign.sampling.samples_per_design,
            section.samples_per_point
        );
        // The campaigns do not differ in anything else.
        let mut same = campaign.clone();
        same.name.clone_from(&paper.name);
        same.doe = paper.doe.clone();
        same.sampling = paper.sampling.clone();
        same.enrichment = None;
        assert_eq!(same, paper);
        let again = Campaign::from_json(&campaign.to_json()).unwrap();
        assert_eq!(again, campaign);
    }

    #[test]
    fn bad_values_are_refused_by_key() {
        for (from, to, key) in [
            ("samples = 18000 ", "samples = 0 ", "enrichment.samples"),
            ("rounds = 100 ", "rounds = 0 ", "enrichment.rounds"),
            (
                "points_per_round = 24 ",
                "points_per_round = 1001 ",
                "enrichment.points_per_round",
            ),
            (
                "samples_per_point = 36 ",
                "samples_per_point = 3 ",
                "enrichment.samples_per_point",
            ),
            (
                "tolerance = 0.003 ",
                "tolerance = 0.0 ",
                "enrichment.tolerance",
            ),
            (
                "criterion = \"expected-quantile-improvement\"",
                "criterion = \"luck\"",
                "enrichment.criterion is \"luck\"",
            ),
            ("rounds = 100 ", "turns = 100 ", "turns"),
            ("rounds = 100 ", "", "missing field `rounds`"),
        ] {
            assert!(ENRICHED.contains(from), "{from}");
            let text = ENRICHED.replacen(from, to, 1);
            let message = Campaign::parse("c.toml", &text).unwrap_err().to_string();
            assert!(message.contains(key), "{to}: {message}");
        }
        let text = ENRICHED
            .replace("compare_with_paper = true", "compare_with_paper = false")
            .replace("control = \"linearised\"", "control = \"none\"")
            + "\n[simulator]\nkind = \"external\"\n";
        let message = Campaign::parse("c.toml", &text).unwrap_err().to_string();
        assert!(message.contains("enrichment is present"), "{message}");
    }

    #[test]
    fn it_may_be_added_to_a_campaign_and_given_more_samples() {
        let held = Campaign::parse("enriched.toml", ENRICHED).unwrap();
        let mut larger = held.clone();
        let section = larger.enrichment.as_mut().unwrap();
        (section.samples, section.rounds) = (20_000, 200);
        assert!(larger.extends(&held) && !held.extends(&larger));
        let mut without = held.clone();
        without.enrichment = None;
        assert!(held.extends(&without) && !without.extends(&held));
        let mut other = held.clone();
        other.enrichment.as_mut().unwrap().tolerance = 0.1;
        assert!(!other.extends(&held));
    }
}
