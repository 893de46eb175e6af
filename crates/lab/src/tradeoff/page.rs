//! The page of all studies.

use problem::Campaign;
use results::report::{TradeoffPage, TradeoffRow, TradeoffStudy};

use crate::tradeoff::size::Size;
use crate::tradeoff::study::Study;

/// The page of the studies. The `facts` name the machine and the program of the measurements.
#[must_use]
pub fn page(
    campaign: &Campaign,
    size: Size,
    studies: &[Study],
    facts: Vec<(String, String)>,
) -> TradeoffPage {
    let lead = format!(
        "The cost of methods and settings on this machine, and the distance of their results from converged ones ({} \
         run). Dashed lines join the Pareto front: settings that no other one beats in both cost and error; \
         in the studies Cores and Growth they are power laws. Circles mark the campaign's own settings and the recommended ones.",
        size.name()
    );
    let notes = [
        "Times are CPU times, except in the studies Runner and Cores, which measure elapsed time. Times vary by a few \
         percent from run to run; errors are the same in every run.",
    ];
    TradeoffPage {
        campaign: campaign.name.clone(),
        digest: campaign.digest(),
        lead,
        facts,
        studies: studies.iter().map(of_study).collect(),
        notes: notes.map(str::to_owned).to_vec(),
    }
}

fn of_study(study: &Study) -> TradeoffStudy {
    let views = study.views();
    let recommended: Vec<_> = views.iter().filter_map(|view| view.recommended()).collect();
    let rows = study.table.rows.iter().map(|row| {
        let is_recommended = recommended.iter().any(|one| std::ptr::eq(*one, row));
        let marks = [
            (row.is_campaign, "campaign"),
            (is_recommended, "recommended"),
        ];
        let marks = marks
            .iter()
            .filter(|(holds, _)| *holds)
            .map(|(_, mark)| *mark);
        TradeoffRow {
            panel: row.panel.clone(),
            method: row.method.clone(),
            setting: row.setting.clone(),
            mark: marks.collect::<Vec<_>>().join(", "),
            values: row.values.clone(),
        }
    });
    TradeoffStudy {
        anchor: study.kind.name().to_owned(),
        title: study.kind.title().to_owned(),
        lead: study.kind.lead().to_owned(),
        charts: views.iter().map(|view| view.chart()).collect(),
        columns: study.table.columns.clone(),
        rows: rows.collect(),
        csv: format!("{}.csv", study.kind.name()),
    }
}
