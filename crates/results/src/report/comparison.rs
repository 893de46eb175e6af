//! The paper's figures beside a campaign's, as one flat list and as Markdown.

use std::fmt::Write as _;

use gear::paper::readings::{self, Group, Score};

use crate::report::charts::Response;
use crate::report::data::{GearData, ReportData};
use crate::report::number::{fixed, relative_gap, signed_percent, significant};
use crate::report::page::p90_by_paper_um;
use crate::report::paper;
use crate::report::quantity::approach_name;

/// A gap beyond this share of the paper's figure gets a sentence.
const NOTABLE_GAP: f64 = 0.20;

/// One printed figure beside ours.
#[derive(Debug, Clone, PartialEq)]
pub struct Comparison {
    /// The table or figure, as in `Table 4 #3`.
    pub place: String,
    /// What is compared, with its unit.
    pub quantity: String,
    /// The paper's figure.
    pub paper: f64,
    /// Ours; NaN when there is none.
    pub ours: f64,
}

impl Comparison {
    /// Ours over the paper's, minus one; NaN when there is none.
    #[must_use]
    pub fn gap(&self) -> f64 {
        relative_gap(self.ours, self.paper)
    }
}

/// Every printed figure of the paper that the campaign has an answer to.
#[must_use]
pub fn comparisons(data: &ReportData) -> Vec<Comparison> {
    let none = GearData::default();
    let gears = data.gears.as_ref().unwrap_or(&none);
    let mut list = Vec::new();
    let mut add = |place: &str, quantity: &str, paper: f64, ours: f64| {
        list.push(Comparison {
            place: place.to_owned(),
            quantity: quantity.to_owned(),
            paper,
            ours,
        });
    };
    for printed in &paper::PRINTED {
        let Some(Ok(ours)) = gears
            .printed
            .iter()
            .find(|design| design.figure == printed.figure)
            .map(|design| design.outcome.as_ref())
        else {
            continue;
        };
        let place = format!("Figure {}", printed.figure);
        add(
            &place,
            "r_c",
            printed.contact_ratio,
            ours.contact_ratio.value,
        );
        add(
            &place,
            "g_s",
            printed.specific_slip,
            ours.specific_slip.value,
        );
        add(
            &place,
            "σ_vm, MPa",
            printed.von_mises_mpa,
            ours.von_mises_mpa.value,
        );
        add(
            &place,
            "F, MPa",
            printed.pressure_mpa,
            ours.pressure_mpa.value,
        );
        add(
            &place,
            &format!("{}, µm", printed.criterion),
            printed.criterion_um,
            ours.criterion.value,
        );
        if let Some(p90) = printed.p90_um {
            add(&place, "P90, µm", p90, ours.p90_um.value);
        }
    }
    for (number, row) in paper::PRELIMINARY.iter().enumerate() {
        let Some(ours) = gears
            .preliminary
            .iter()
            .find(|ours| ours.variables == row.variables)
        else {
            continue;
        };
        let place = format!("Table 1 #{}", number + 1);
        add(&place, "mean of ΔSTE, µm", row.mean_um, ours.mean_um);
        add(&place, "SD of ΔSTE, µm", row.sd_um, ours.sd_um);
        add(&place, "P90, µm", row.p90_um, ours.p90_um);
    }
    let columns = [
        ("ΔSTE without wear, µm", Response::Unworn),
        ("ΔSTE with Archard’s wear, µm", Response::Archard),
        ("P90, µm", Response::Percentile),
    ];
    for (row, (name, response)) in paper::RESPONSES.iter().zip(columns) {
        let values: Vec<f64> = gears
            .doe
            .iter()
            .map(|point| response.of(point))
            .filter(|value| value.is_finite())
            .collect();
        if values.is_empty() {
            continue;
        }
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let low = values.iter().copied().fold(f64::INFINITY, f64::min);
        let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        add("Table 3", &format!("mean {name}"), row.mean_um, mean);
        add("Table 3", &format!("least {name}"), row.min_um, low);
        add("Table 3", &format!("greatest {name}"), row.max_um, high);
    }
    for (number, row) in paper::SIMILAR.iter().enumerate() {
        let Some(ours) = gears
            .similar
            .iter()
            .find(|ours| ours.variables == row.variables)
        else {
            continue;
        };
        let place = format!("Table 4 #{}", number + 1);
        add(
            &place,
            "ΔSTE with Archard’s wear, µm",
            row.delta_ste_archard_um,
            ours.delta_ste_archard_um,
        );
        add(
            &place,
            "P90, µm",
            row.p90_um,
            ours.p90.map_or(f64::NAN, |p90| p90.value),
        );
    }
    for row in &paper::APPROACHES {
        let Some(verified) = data.optima.of(row.approach) else {
            continue;
        };
        let Ok(found) = &verified.optimum.found else {
            continue;
        };
        let name = approach_name(&data.problem, row.approach);
        let place = format!("Table 5, {}", name.to_lowercase());
        add(
            &place,
            "criterion at its own optimum, µm",
            row.criterion,
            found.criterion,
        );
        add(
            &place,
            "P90 at its own optimum, µm",
            row.p90_um,
            p90_by_paper_um(data, verified),
        );
    }
    list
}

/// The comparison as a Markdown page. `scores` are the fitted readings of the paper and `own` is that
/// of the campaign; `remarks` gives the sentence of a row whose gap is large.
#[must_use]
pub fn comparison_markdown(
    data: &ReportData,
    scores: &[Score],
    own: &Score,
    remarks: impl Fn(&Comparison) -> Option<String>,
) -> String {
    let mut page = String::from("# The paper's figures beside this model's\n\n");
    // Writing to a string does not fail.
    let header = &data.header;
    let _ = writeln!(
        page,
        "Written by `coordinator compare` from the campaign “{}”: {} designs of {} samples, seed \
         {}, program version {}. Samples digest `{}`. Tables 1 and 5 rest on {} verification samples and \
         equation (8), as the paper's do, other percentiles on order statistics of 4000 and more.\n",
        header.campaign,
        header.designs,
        header.samples_per_design,
        header.seed,
        header.program_version,
        header.samples_digest,
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
        header.simulable,
        header.designs,
        paper::SIMULABLE,
        paper::DESIGNS
    );
    page += "| where | what | paper | ours | gap |\n|---|---|---:|---:|---:|\n";
    let list = comparisons(data);
    let mut sentences: Vec<(String, String)> = Vec::new();
    for row in &list {
        let gap = row.gap();
        let large = gap.abs() > NOTABLE_GAP;
        let mark = if large { " ▲" } else { "" };
        let _ = writeln!(
            page,
            "| {} | {} | {} | {} | {}{mark} |",
            row.place,
            row.quantity,
            significant(row.paper, 4),
            significant(row.ours, 3),
            signed_percent(gap),
        );
        if large {
            let sentence = remarks(row).unwrap_or_else(|| "no explanation is known".to_owned());
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
