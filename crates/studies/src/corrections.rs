//! `coordinator corrections`: the robust optimum with and without profile corrections.

use std::path::Path;

use anyhow::Context as _;
use problem::file::{CorrectionsSection, PairCorrections};
use problem::formulation::Problem;
use problem::formulation::gears::ALL_VARIABLES;
use problem::optimise::Solution;
use problem::{Campaign, Design, PairFile};
use rayon::prelude::*;
use results::number::{MISSING, fixed};
use results::report::write_file;
use results::row;
use results::table::{Cell, Column, Table};
use stats::IntervalEstimate;

use crate::direct::{self, Search, Start};
use crate::refusal::require_built_in;
use crate::samples;
use crate::table::{
    CRITERIA, Document, PageTable, criteria_cells, percentile_cells, with_interval,
};

/// A set of profile corrections that a search may use.
#[derive(Debug, Clone, PartialEq)]
pub struct Space {
    /// The corrections, in words.
    pub name: &'static str,
    /// The ranges of the corrections.
    section: CorrectionsSection,
}

/// The outcome of the searches with one set of corrections.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// The corrections that were allowed.
    pub space: Space,
    /// Number of designs tried, over all starts.
    pub evaluations: u64,
    /// Number of analyses without random wear.
    pub plain_calls: u64,
    /// Number of analyses with random wear.
    pub worn_calls: u64,
    /// The best feasible design and its P90 from verification samples, if a search met one.
    pub best: Option<(Solution, IntervalEstimate)>,
}

/// The sets that a campaign asks to compare: flanks as they are, then with corrections.
///
/// # Errors
///
/// The campaign has no section `[corrections]`, or an external simulator.
pub fn spaces(campaign: &Campaign) -> anyhow::Result<Vec<Space>> {
    require_built_in(campaign)?;
    let sections = campaign.gears();
    let section = sections.and_then(|sections| sections.corrections.as_ref());
    let section = section.with_context(|| {
        format!(
            "campaign {} has no section [corrections]: give it bounds, such as tip_relief_um = \
             [0.0, 30.0] with tip_relief_length_mm = [0.5, 4.0], or crowning_um = [0.0, 10.0]",
            campaign.name
        )
    })?;
    let mut spaces = vec![Space {
        name: "none",
        section: CorrectionsSection::default(),
    }];
    let has_relief = section.tip_relief_um.is_some();
    if has_relief {
        spaces.push(Space {
            name: "tip relief",
            section: CorrectionsSection {
                crowning_um: None,
                ..section.clone()
            },
        });
    }
    if section.crowning_um.is_some() {
        spaces.push(Space {
            name: match has_relief {
                true => "tip relief and crowning",
                false => "crowning",
            },
            section: section.clone(),
        });
    }
    Ok(spaces)
}

impl Space {
    /// The problem of a campaign whose designs have these corrections.
    #[must_use]
    pub fn problem(&self, campaign: &Campaign) -> Problem {
        Problem::new(campaign.clone()).with_corrections(&self.section)
    }
}

/// Searches with the corrections of `space`, the `number`th of its campaign, from the campaign's
/// number of starts; the first of them begins at the best design `without` corrections and with the
/// least corrections.
///
/// # Errors
///
/// A search fails.
pub fn run(
    campaign: &Campaign,
    space: &Space,
    base: &Design,
    number: u64,
    without: Option<&Outcome>,
) -> anyhow::Result<Outcome> {
    let problem = space.problem(campaign);
    let known = without.and_then(|outcome| Some(&outcome.best.as_ref()?.0.design));
    let searches: anyhow::Result<Vec<Search>> = (0..campaign.optimise.starts)
        .into_par_iter()
        .map(|start| {
            let from = known.filter(|_| start == 0);
            let start = Start {
                number,
                start,
                base,
                from,
            };
            direct::search(&problem, start)
        })
        .collect();
    let searches = searches?;
    let sum = |of: fn(&Search) -> u64| searches.iter().map(of).sum();
    let best = searches
        .iter()
        .filter_map(|search| search.best.as_ref())
        .min_by(|a, b| a.criterion.total_cmp(&b.criterion));
    let best = match best {
        Some(best) => {
            let verified = samples::verification(&problem, &best.design)?;
            Some((best.clone(), campaign.sampling.verified(&verified)?))
        }
        None => None,
    };
    Ok(Outcome {
        space: space.clone(),
        evaluations: sum(|search| search.evaluations),
        plain_calls: sum(|search| search.plain_calls),
        worn_calls: sum(|search| search.worn_calls),
        best,
    })
}

/// Writes `corrections.csv`, `corrections.md` and a pair file of each best design into `out`; returns
/// the tables.
///
/// # Errors
///
/// A file cannot be written.
pub fn write_tables(
    out: &Path,
    campaign: &Campaign,
    outcomes: &[Outcome],
) -> anyhow::Result<Document> {
    let figures = all_figures(campaign, outcomes);
    write_file(out, "corrections.csv", figures.csv()?)?;
    let page = format!(
        "# {} with and without profile corrections\n\n\
         {} of ΔSTE in µm from {} verification samples with its 95 % interval, at the best of {} direct \
         searches of {} designs each. Relief is amount × length.\n\n{}",
        campaign.name,
        campaign.measure_name(),
        campaign.verify.first(),
        campaign.optimise.starts,
        campaign.optimise.evaluations,
        summary(campaign, outcomes).markdown()
    );
    write_file(out, "corrections.md", &page)?;
    for outcome in outcomes {
        let problem = outcome.space.problem(campaign);
        let (Some((found, _)), Some(gears), Some(sections)) =
            (&outcome.best, problem.gears(), campaign.gears())
        else {
            continue;
        };
        let corrections = gears.corrections(&found.design);
        let file = PairFile {
            corrections: PairCorrections::of_gear(&corrections),
            ..PairFile::of_design(sections, &found.design.gears())
        };
        let name = format!("pair-{}.toml", outcome.space.name.replace(' ', "-"));
        write_file(out, &name, file.to_toml())?;
    }
    Ok(Document {
        page,
        tables: vec![("corrections", figures)],
    })
}

fn summary(campaign: &Campaign, outcomes: &[Outcome]) -> PageTable {
    let measure = campaign.measure_name();
    let mut table = PageTable::new([
        "corrections",
        &format!("{measure}, µm"),
        &format!("{measure} in the search, µm"),
        "relief of the pinion",
        "relief of the mate",
        "crowning, µm",
        "contact ratio",
        "specific sliding",
        "contact pressure, MPa",
        "root stress, MPa",
        "analyses without and with random wear",
    ]);
    for outcome in outcomes {
        let mut line = vec![outcome.space.name.to_owned()];
        match &outcome.best {
            Some((found, p90)) => {
                let (values, criteria) = (found.design.values(), found.criteria.gears());
                let relief = |amount: f64, length: f64| match length > 0.0 {
                    true => format!("{} µm × {} mm", fixed(amount, 1), fixed(length, 2)),
                    false => MISSING.to_owned(),
                };
                line.push(with_interval(p90));
                line.push(fixed(found.criterion, 3));
                // Amount and length of the pinion's relief and the mate's, then the crowning.
                let corrections = &values[ALL_VARIABLES..];
                let reliefs = corrections.chunks_exact(2);
                let crowning = reliefs.remainder();
                line.extend(reliefs.map(|of_gear| relief(of_gear[0], of_gear[1])));
                line.extend(crowning.iter().map(|crowning| fixed(*crowning, 2)));
                line.push(fixed(criteria.contact_ratio, 3));
                line.push(fixed(criteria.specific_sliding, 3));
                line.push(fixed(criteria.hertz_pressure_mpa, 0));
                line.push(fixed(criteria.root_stress_mpa, 0));
            }
            None => {
                line.push("none feasible".to_owned());
                line.extend(std::iter::repeat_n(MISSING.to_owned(), 8));
            }
        }
        line.push(format!("{} + {}", outcome.plain_calls, outcome.worn_calls));
        table.rows.push(line);
    }
    table
}

fn all_figures(campaign: &Campaign, outcomes: &[Outcome]) -> Table {
    let measure = campaign.sampling.measure_columns();
    let searched = measure[0].replace("_um", "_searched_um");
    let problem = Problem::new(campaign.clone()).with_corrections(&CorrectionsSection::default());
    let variables = problem.variables();
    let mut columns = vec![Column::text("corrections")];
    columns.extend(
        variables
            .iter()
            .map(|variable| Column::number(&*variable.name)),
    );
    columns.extend(measure.into_iter().chain([searched]).map(Column::number));
    columns.extend(CRITERIA.map(Column::number));
    columns.extend(["evaluations", "plain_calls", "worn_calls"].map(Column::whole));
    let mut table = Table::new(columns);
    for outcome in outcomes {
        let (found, p90) = outcome
            .best
            .as_ref()
            .map(|(found, p90)| (found, *p90))
            .unzip();
        let mut line = row![outcome.space.name].to_vec();
        match found {
            Some(found) => line.extend(found.design.values().iter().copied().map(Cell::from)),
            None => line.extend(variables.iter().map(|_| Cell::Missing)),
        }
        line.extend(percentile_cells(p90));
        line.push(found.map(|found| found.criterion).into());
        let criteria = found.map(|found| found.criteria.gears());
        line.extend(criteria_cells(criteria.as_ref()));
        line.extend([outcome.evaluations, outcome.plain_calls, outcome.worn_calls].map(Cell::from));
        table.rows.push(line);
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    fn campaign(section: &str) -> Campaign {
        let mut text = Campaign::PAPER.to_owned();
        for (from, to) in [
            ("evaluations = 12000", "evaluations = 500"),
            ("restart_at = 6000", "restart_at = 250"),
            ("starts = 3", "starts = 2"),
            ("half_width = 0.005 ", "samples = 60 "),
            ("samples_per_design = 30", "samples_per_design = 8"),
        ] {
            assert!(text.contains(from), "{from}");
            text = text.replacen(from, to, 1);
        }
        Campaign::parse("c.toml", &format!("{text}\n{section}")).unwrap()
    }

    #[test]
    fn a_campaign_without_bounds_for_corrections_is_told_so() {
        let error = spaces(&campaign("")).unwrap_err().to_string();
        assert!(error.contains("has no section [corrections]"), "{error}");
    }

    #[test]
    fn designs_with_corrections_are_compared_with_one_without() {
        let campaign = campaign(
            "[corrections]\ntip_relief_um = [0.0, 20.0]\ntip_relief_length_mm = [0.5, 4.0]",
        );
        let spaces = spaces(&campaign).unwrap();
        assert_eq!(spaces.len(), 2, "no crowning was asked for");
        let base = spaces[0].problem(&campaign).base().clone();
        let without = run(&campaign, &spaces[0], &base, 0, None).unwrap();
        let with = run(&campaign, &spaces[1], &base, 1, Some(&without)).unwrap();
        assert_eq!(
            with,
            run(&campaign, &spaces[1], &base, 1, Some(&without)).unwrap()
        );
        let problem = spaces[1].problem(&campaign);
        let gears = problem.gears().unwrap();
        assert_eq!([without.evaluations, with.evaluations], [1000, 1000]);
        let bare = without.best.as_ref().expect("the searches end feasible");
        let none = gear::Corrections::default();
        assert_eq!(gears.corrections(&bare.0.design), none);
        let corrected = with.best.as_ref().expect("the searches end feasible");
        for relief in gears.corrections(&corrected.0.design).tip_relief {
            let relief = relief.expect("both tips have relief");
            assert!((0.0..=0.020).contains(&relief.amount));
            assert!((0.5..=4.0).contains(&relief.length));
        }
        for (found, p90) in [bare, corrected] {
            assert!(problem.is_feasible(&found.criteria));
            assert_eq!(p90.n, 60);
            let (low, high) = p90.interval.unwrap();
            assert!(low < p90.value && p90.value < high);
        }
        let outcomes = [without.clone(), with.clone()];
        let folder = tempfile::tempdir().unwrap();
        write_tables(folder.path(), &campaign, &outcomes).unwrap();
        for (name, (found, _)) in [("none", bare), ("tip-relief", corrected)] {
            let text = std::fs::read_to_string(folder.path().join(format!("pair-{name}.toml")));
            let file = PairFile::parse("pair.toml", &text.unwrap()).unwrap();
            assert_eq!(file.to_gear(), gears.pair_input(&found.design));
            let (written, asked) = (file.corrections(), gears.corrections(&found.design));
            for (written, asked) in written.tip_relief.iter().zip(asked.tip_relief) {
                let amounts = [*written, asked].map(|r| r.map_or(0.0, |relief| relief.amount));
                assert!((amounts[0] - amounts[1]).abs() < 1e-15, "{amounts:?}");
            }
        }
        assert_eq!(summary(&campaign, &outcomes).rows[1][0], "tip relief");
    }
}
