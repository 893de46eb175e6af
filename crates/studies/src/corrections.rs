//! `coordinator corrections`: the robust optimum with and without profile corrections.

use std::path::Path;

use anyhow::Context as _;
use campaign::file::PairCorrections;
use campaign::file::Sampling;
use campaign::formulation::Problem;
use campaign::formulation::gears::VARIABLE_NAMES;
use campaign::{Campaign, Design, PairFile};
use report::Percentile;
use results::percentile::percentile;

use crate::direct::{self, Corrected, Found, Search, Space};
use crate::refusal::require_built_in;
use crate::simulations::{Simulations, at_once};
use crate::table::{NOTHING, Table, Written, exact, maybe_exact, with_interval, write};

/// The results of the searches with one set of corrections.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// The corrections that were allowed.
    pub space: Space,
    /// Designs tried, over all starts.
    pub evaluations: u64,
    /// Analyses without random wear.
    pub plain_calls: u64,
    /// Analyses with random wear.
    pub worn_calls: u64,
    /// The best design and its P90 from verification samples, if any design satisfied the constraints.
    pub best: Option<(Found, Percentile)>,
}

/// The spaces that a campaign asks to compare: flanks as they are, then with corrections.
///
/// # Errors
///
/// The campaign has no bounds for corrections, or they are not its simulator's.
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
    Ok(std::iter::once(Space::plain())
        .chain(Space::relieved(section))
        .chain(Space::crowned(section))
        .collect())
}

/// Searches with the corrections of `space`, the `number`th of its campaign, from the campaign's
/// number of starts; the first of them begins at the best design `without` corrections.
///
/// # Errors
///
/// The errors of the simulations.
pub fn run(
    simulations: &dyn Simulations,
    problem: &Problem,
    base: &Design,
    space: &Space,
    number: u64,
    without: Option<&Row>,
) -> anyhow::Result<Row> {
    let known = without
        .and_then(|row| row.best.as_ref())
        .map(|(found, _)| problem.unit_point(&problem.free_values(&found.design.variables.into())));
    let runs: Vec<Search> = at_once(0..problem.campaign().optimise.starts, |start| {
        let from = known.as_ref().filter(|_| start == 0).map(|unit| &unit[..]);
        direct::search(simulations, problem, base, space, number, start, from)
    })?;
    let sum = |of: fn(&Search) -> u64| runs.iter().map(of).sum();
    let best = runs
        .iter()
        .filter_map(|run| run.found)
        .min_by(|a, b| a.p90_um.total_cmp(&b.p90_um));
    let best = match best {
        Some(found) => {
            let request = direct::verification(problem, &found.design);
            let answer = simulations.simulate(&[request])?.remove(0);
            let fresh = answer.samples_of("the best design")?;
            Some((found, percentile(&problem.campaign().sampling, &fresh)))
        }
        None => None,
    };
    Ok(Row {
        space: space.clone(),
        evaluations: sum(|run| run.evaluations),
        plain_calls: sum(|run| run.plain_calls),
        worn_calls: sum(|run| run.worn_calls),
        best,
    })
}

/// Writes `corrections.csv`, `corrections.md` and a pair file of each best design into `out`; returns
/// the tables.
///
/// # Errors
///
/// A file cannot be written.
pub fn write_tables(out: &Path, campaign: &Campaign, rows: &[Row]) -> anyhow::Result<Written> {
    let sampling = &campaign.sampling;
    let figures = all_figures(sampling, rows);
    write(out, "corrections.csv", figures.csv()?)?;
    let page = format!(
        "# {} with and without profile corrections\n\n\
         {} of ΔSTE in µm from {} verification samples with its 95 % interval, at the best of {} direct \
         searches of {} designs each. Relief is amount × length.\n\n{}",
        campaign.name,
        sampling.percentile_name(),
        campaign.verify.first(),
        campaign.optimise.starts,
        campaign.optimise.evaluations,
        summary(sampling, rows).markdown()
    );
    write(out, "corrections.md", &page)?;
    let sections = campaign.gears().context("corrections are of gears")?;
    for row in rows {
        let Some((found, _)) = &row.best else {
            continue;
        };
        let file = PairFile {
            corrections: PairCorrections::of_gear(&found.design.corrections),
            ..PairFile::of_design(sections, &found.design.variables)
        };
        let name = format!("pair-{}.toml", row.space.name().replace(' ', "-"));
        write(out, &name, file.to_toml())?;
    }
    Ok(Written {
        page,
        tables: vec![("corrections", figures)],
    })
}

fn summary(sampling: &Sampling, rows: &[Row]) -> Table {
    let percentile = sampling.percentile_name();
    let mut table = Table::new([
        "corrections",
        &format!("{percentile}, µm"),
        &format!("{percentile} in the search, µm"),
        "relief of the pinion",
        "relief of the mate",
        "crowning, µm",
        "r_c",
        "g_s",
        "F, MPa",
        "σ_vm, MPa",
        "analyses without and with random wear",
    ]);
    for row in rows {
        let mut line = vec![row.space.name().to_owned()];
        match &row.best {
            Some((found, p90)) => {
                let corrections = &found.design.corrections;
                line.push(with_interval(p90));
                line.push(format!("{:.3}", found.p90_um));
                line.extend(corrections.tip_relief.map(|relief| {
                    relief.map_or(NOTHING.to_owned(), |relief| {
                        format!("{:.1} µm × {:.2} mm", 1e3 * relief.amount, relief.length)
                    })
                }));
                line.push(format!("{:.2}", 1e3 * corrections.crowning));
                line.push(format!("{:.3}", found.criteria.contact_ratio));
                line.push(format!("{:.3}", found.criteria.specific_sliding));
                line.push(format!("{:.0}", found.criteria.hertz_pressure_mpa));
                line.push(format!("{:.0}", found.criteria.root_stress_mpa));
            }
            None => {
                line.push("none feasible".to_owned());
                line.extend(std::iter::repeat_n(NOTHING.to_owned(), 8));
            }
        }
        line.push(format!("{} + {}", row.plain_calls, row.worn_calls));
        table.rows.push(line);
    }
    table
}

fn all_figures(sampling: &Sampling, rows: &[Row]) -> Table {
    let columns = sampling.percentile_columns();
    let searched = columns[0].replace("_um", "_searched_um");
    let mut header = vec!["corrections"];
    header.extend(VARIABLE_NAMES);
    header.extend([
        "tip_relief_p_um",
        "tip_relief_length_p_mm",
        "tip_relief_r_um",
        "tip_relief_length_r_mm",
        "crowning_um",
    ]);
    header.extend(columns.iter().chain([&searched]).map(String::as_str));
    header.extend([
        "contact_ratio",
        "specific_sliding",
        "hertz_pressure_mpa",
        "root_stress_mpa",
        "evaluations",
        "plain_calls",
        "worn_calls",
    ]);
    let mut table = Table::new(header);
    for row in rows {
        let best = row.best.as_ref();
        let mut line = vec![row.space.name().to_owned()];
        match best.map(|(found, _)| found.design) {
            Some(Corrected {
                variables,
                corrections,
            }) => {
                line.extend(variables.values().map(exact));
                for relief in corrections.tip_relief {
                    line.push(maybe_exact(relief.map(|relief| 1e3 * relief.amount)));
                    line.push(maybe_exact(relief.map(|relief| relief.length)));
                }
                line.push(exact(1e3 * corrections.crowning));
            }
            None => line.extend(std::iter::repeat_n(String::new(), VARIABLE_NAMES.len() + 5)),
        }
        let of = |value: fn(&(Found, Percentile)) -> f64| maybe_exact(best.map(value));
        line.push(of(|best| best.1.value));
        line.push(of(|best| best.1.low));
        line.push(of(|best| best.1.high));
        line.push(of(|best| best.0.p90_um));
        line.push(of(|best| best.0.criteria.contact_ratio));
        line.push(of(|best| best.0.criteria.specific_sliding));
        line.push(of(|best| best.0.criteria.hertz_pressure_mpa));
        line.push(of(|best| best.0.criteria.root_stress_mpa));
        line.extend([row.evaluations, row.plain_calls, row.worn_calls].map(|n| n.to_string()));
        table.rows.push(line);
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulations::InProcess;

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
        let problem = Problem::new(campaign);
        let base = problem.base().clone();
        let here = &InProcess(&problem);
        let without = run(here, &problem, &base, &spaces[0], 0, None).unwrap();
        let with = run(here, &problem, &base, &spaces[1], 1, Some(&without)).unwrap();
        assert_eq!(
            with,
            run(here, &problem, &base, &spaces[1], 1, Some(&without)).unwrap()
        );
        assert_eq!([without.evaluations, with.evaluations], [1000, 1000]);
        let bare = without.best.as_ref().expect("the searches end feasible");
        assert_eq!(bare.0.design.corrections, gear::Corrections::default());
        let corrected = with.best.as_ref().expect("the searches end feasible");
        for relief in corrected.0.design.corrections.tip_relief {
            let relief = relief.expect("both tips have relief");
            assert!((0.0..=0.020).contains(&relief.amount));
            assert!((0.5..=4.0).contains(&relief.length));
        }
        for (found, p90) in [bare, corrected] {
            assert!(problem.is_feasible(&found.criteria.into()));
            assert_eq!(p90.samples, 60);
            assert!(p90.low < p90.value && p90.value < p90.high);
        }
        let rows = [without.clone(), with.clone()];
        let folder = tempfile::tempdir().unwrap();
        write_tables(folder.path(), problem.campaign(), &rows).unwrap();
        for (name, (found, _)) in [("none", bare), ("tip-relief", corrected)] {
            let text = std::fs::read_to_string(folder.path().join(format!("pair-{name}.toml")));
            let file = PairFile::parse("pair.toml", &text.unwrap()).unwrap();
            let gears = problem.gears().unwrap();
            let design = found.design.variables.into();
            assert_eq!(file.to_gear(), gears.pair_input(&design));
            let (written, asked) = (file.corrections(), found.design.corrections);
            for (written, asked) in written.tip_relief.iter().zip(asked.tip_relief) {
                let amounts = [*written, asked].map(|r| r.map_or(0.0, |relief| relief.amount));
                assert!((amounts[0] - amounts[1]).abs() < 1e-15, "{amounts:?}");
            }
        }
        assert_eq!(
            summary(&problem.campaign().sampling, &rows).rows[1][0],
            "tip relief"
        );
    }
}
