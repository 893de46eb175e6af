//! The comparison as a Markdown page.

use std::fmt::Write as _;

use gear::paper::readings::{self, Group, Score};

use super::figures;
use crate::number::{MISSING, fixed, signed_percent, significant};
use crate::report::{Report, paper};

/// The comparison. `scores` are the fitted readings of the paper, and `own` is that of the campaign.
pub(super) fn markdown(report: &Report, scores: &[Score], own: &Score) -> String {
    let mut page = String::from("# The paper's figures beside this model's\n\n");
    // Writing to a string does not fail.
    let snapshot = &report.snapshot;
    let campaign = snapshot.problem.campaign();
    let _ = writeln!(
        page,
        "Written by `coordinator compare` from the campaign “{}”: {} designs of {} samples, seed \
         {}, program version {}. Samples digest `{}`. As in the paper, the percentiles of Tables 1 and 5 \
         follow from {} verification samples by equation (8), and those of Table 3 from the samples of each design. \
         Other percentiles are order statistics of at least 4000 samples.\n",
        snapshot.campaign.name,
        campaign.doe.designs,
        campaign.sampling.samples_per_design,
        snapshot.campaign.seed,
        snapshot.campaign.program_version,
        snapshot.samples_digest,
        paper::ACCURATE_SAMPLES,
    );
    page += &readings::markdown(scores);
    let _ = writeln!(
        page,
        "\n## Every printed figure\n\n\
         - **Reading of the campaign.** {}. Its score is {} over all values, {} over the worn \
         designs, {} over the SDs of Table 1 and {} over Table 3; its rank correlation is {}.",
        own.reading,
        fixed(own.rms(), 3),
        fixed(own.rms_of(Group::Worn), 3),
        fixed(own.rms_of(Group::Scatter), 3),
        fixed(own.rms_of(Group::Table3), 3),
        fixed(own.rank_correlation(), 2),
    );
    let _ = writeln!(
        page,
        "- **Simulable designs.** {} of {} here, {} of {} in the paper.\n",
        snapshot.simulable(),
        campaign.doe.designs,
        paper::SIMULABLE,
        paper::DESIGNS
    );
    page += "| where | what | paper | ours | gap |\n|---|---|---:|---:|---:|\n";
    let mut sentences: Vec<(String, String)> = Vec::new();
    for row in figures(report) {
        let large = row.gap.is_some_and(|gap| gap.abs() > paper::NOTABLE_GAP);
        let mark = if large { " ▲" } else { "" };
        let _ = writeln!(
            page,
            "| {} | {} | {} | {} | {}{mark} |",
            row.place,
            row.quantity,
            significant(row.paper, 4),
            row.ours
                .map_or(MISSING.to_owned(), |ours| significant(ours, 3)),
            row.gap.map_or(MISSING.to_owned(), signed_percent),
        );
        if large {
            let unknown = || "no explanation is known".to_owned();
            let sentence = row.remark.unwrap_or_else(unknown);
            let what = format!("{}, {}", row.place, row.quantity);
            sentences.push((what, sentence));
        }
    }
    page += "\n## The gaps above 20 %\n\n";
    // Rows with one cause share one paragraph, in the order of the table.
    let mut told: Vec<String> = Vec::new();
    for (_, sentence) in &sentences {
        if told.contains(sentence) {
            continue;
        }
        told.push(sentence.clone());
        let rows: Vec<&str> = sentences
            .iter()
            .filter(|(_, other)| other == sentence)
            .map(|(what, _)| what.as_str())
            .collect();
        let _ = writeln!(page, "- *{}.* {sentence}", rows.join("; "));
    }
    page
}
