//! `coordinator sizing`: pairs with other teeth and modules, each at its own optimum, in the order of their percentiles.
//!
//! Each pair of tooth numbers within a tolerance of the gear ratio, with each module, is a size. A direct search
//! finds the best design of a size (see [`direct`]), and the best sizes get verification samples.

use std::path::Path;

use anyhow::{Context as _, bail};
use problem::formulation::Problem;
use problem::optimise::Solution;
use problem::{Campaign, PairFile};
use rayon::prelude::*;
use results::number::fixed;
use results::report::charts::{self, PercentileSeries};
use results::report::write_file;
use results::row;
use results::table::{Cell, Column, Table};
use stats::IntervalEstimate;

use crate::direct::{self, Start};
use crate::sweep::Teeth;
use crate::table::{
    CRITERIA, Document, PageTable, criteria_cells, percentile_cells, with_interval,
};
use crate::{finished, samples};

/// The most sizes of a study.
const MOST_SIZES: usize = 2000;

/// The sizes to search.
#[derive(Debug, Clone, PartialEq)]
pub struct Range {
    /// Teeth of the pinion.
    pub teeth: Teeth,
    /// Largest relative deviation of the ratio from the campaign's.
    pub ratio_tolerance: f64,
    /// Normal modules, mm; empty for the campaign's size.
    pub modules_mm: Vec<f64>,
}

/// One size: a campaign with its teeth and module.
#[derive(Debug, Clone, PartialEq)]
pub struct Size {
    /// Teeth of pinion and mate.
    pub teeth: [u32; 2],
    /// The normal module, mm; `None` for the campaign's.
    pub module_mm: Option<f64>,
    campaign: Campaign,
}

/// The best design of a size.
#[derive(Debug, Clone, PartialEq)]
pub struct Sized {
    pub size: Size,
    /// The best feasible design, if the searches met one.
    pub best: Option<Solution>,
    /// The measure from verification samples, for the best sizes.
    pub verified: Option<IntervalEstimate>,
}

impl Range {
    /// The sizes of a campaign, by their teeth and then their modules.
    ///
    /// # Errors
    ///
    /// No mate is within the tolerance, there are too many sizes, or the campaign is invalid with one of them.
    pub fn sizes(&self, file: &str, campaign: &Campaign) -> anyhow::Result<Vec<Size>> {
        let sections = campaign.gears().context("sizes are of gears")?;
        let pair = &sections.pair;
        let [pinion, mate] = pair.teeth().map(f64::from);
        let ratio = pair.gear_ratio.unwrap_or(mate / pinion);
        if !self.modules_mm.is_empty() && pair.normal_module_mm.is_none() {
            bail!(
                "the module of campaign {} follows from its centre distance: leave out --modules, or give \
                 pair.normal_module_mm",
                campaign.name
            );
        }
        let modules: Vec<Option<f64>> = match self.modules_mm.is_empty() {
            true => vec![None],
            false => self.modules_mm.iter().copied().map(Some).collect(),
        };
        let mut sizes = Vec::new();
        for pinion in self.teeth.iter() {
            let exact = f64::from(pinion) * ratio;
            let room = 1e-9 + exact * self.ratio_tolerance;
            let mates = (exact - room).ceil() as u32..=(exact + room).floor() as u32;
            for mate in mates {
                for &module_mm in &modules {
                    let teeth = [pinion, mate];
                    sizes.push(Size {
                        teeth,
                        module_mm,
                        campaign: campaign.with_size(file, teeth, module_mm)?,
                    });
                    if sizes.len() > MOST_SIZES {
                        bail!(
                            "more than {MOST_SIZES} sizes: narrow --teeth, --ratio-tolerance or --modules"
                        );
                    }
                }
            }
        }
        if sizes.is_empty() {
            bail!(
                "no whole number of teeth is within {} % of the ratio {ratio:.4}: widen --ratio-tolerance or --teeth",
                100.0 * self.ratio_tolerance
            );
        }
        Ok(sizes)
    }
}

/// Searches every size, and verifies the best `top` of them; the best comes first.
///
/// # Errors
///
/// A search fails.
pub fn run(sizes: Vec<Size>, top: usize) -> anyhow::Result<Vec<Sized>> {
    let searched: anyhow::Result<Vec<Sized>> = sizes.into_par_iter().map(search).collect();
    let mut all = searched?;
    let criterion = |one: &Sized| {
        one.best
            .as_ref()
            .map_or(f64::INFINITY, |best| best.criterion)
    };
    // Stable, so that equal ones keep the order of the sizes.
    all.sort_by(|a, b| criterion(a).total_cmp(&criterion(b)));
    let verified: anyhow::Result<Vec<Option<IntervalEstimate>>> = all
        .iter()
        .take(top)
        .map(|one| {
            let Some(best) = &one.best else {
                return Ok(None);
            };
            let problem = Problem::new(one.size.campaign.clone());
            let drawn = samples::verification(&problem, &best.design)?;
            Ok(Some(problem.campaign().sampling.verified(&drawn)?))
        })
        .collect();
    for (one, verified) in all.iter_mut().zip(verified?) {
        one.verified = verified;
    }
    // A search judges by the samples that it chose by; among the best, verification samples decide.
    let first = top.min(all.len());
    let judged = |one: &Sized| one.verified.map_or(f64::INFINITY, |measure| measure.value);
    all[..first].sort_by(|a, b| judged(a).total_cmp(&judged(b)));
    Ok(all)
}

/// The best design of one size over the campaign's starts.
fn search(size: Size) -> anyhow::Result<Sized> {
    let problem = Problem::new(size.campaign.clone());
    let base = finished::searched_base(&problem)?;
    let mut best: Option<Solution> = None;
    for start in 0..size.campaign.optimise.starts {
        let start = Start {
            number: 0,
            start,
            base: &base,
            from: None,
        };
        let found = direct::search(&problem, start)?.best;
        let is_better = |found: &Solution| {
            let known = best.as_ref();
            known.is_none_or(|known| found.criterion < known.criterion)
        };
        if let Some(found) = found.filter(is_better) {
            best = Some(found);
        }
    }
    Ok(Sized {
        size,
        best,
        verified: None,
    })
}

/// Writes `sizing.csv`, `sizing.md`, `sizing.svg` and a pair file of each verified design into `out`; returns the
/// tables.
///
/// # Errors
///
/// A file cannot be written.
pub fn write_tables(out: &Path, campaign: &Campaign, all: &[Sized]) -> anyhow::Result<Document> {
    let figures = all_figures(campaign, all);
    write_file(out, "sizing.csv", figures.csv()?)?;
    let measure = campaign.measure_name();
    let feasible = all.iter().filter(|one| one.best.is_some()).count();
    let mut page = format!(
        "# {}: sizes\n\n{} sizes, {feasible} of them with a feasible design. {measure} of ΔSTE in µm at the best of {} \
         direct searches of {} designs for each size, with its 95 % interval from {} verification samples.\n\n{}",
        campaign.name,
        all.len(),
        campaign.optimise.starts,
        campaign.optimise.evaluations,
        campaign.verify.first(),
        summary(campaign, all).markdown()
    );
    for (place, one) in all.iter().enumerate() {
        let (Some(best), Some(_)) = (&one.best, one.verified) else {
            continue;
        };
        let sections = one.size.campaign.gears();
        let sections = sections.context("sizes are of gears")?;
        let file = PairFile::of_design(sections, &best.design);
        write_file(out, &format!("pair-{}.toml", place + 1), file.to_toml())?;
    }
    match charts::teeth(&measure, &lines(all)) {
        Ok(chart) => {
            write_file(out, "sizing.svg", chart.standalone())?;
            page += "\n![The best design of each size, by the samples of its search](sizing.svg)\n";
        }
        Err(why) => page += &format!("\n{why}\n"),
    }
    write_file(out, "sizing.md", &page)?;
    Ok(Document {
        page,
        tables: vec![("sizing", figures)],
    })
}

fn summary(campaign: &Campaign, all: &[Sized]) -> PageTable {
    let measure = campaign.measure_name();
    let mut table = PageTable::new([
        "pair",
        "teeth",
        "ratio",
        "module, mm",
        "centre distance, mm",
        &format!("{measure} in the search, µm"),
        &format!("{measure}, µm"),
        "file",
    ]);
    for (place, one) in all.iter().enumerate() {
        let (Some(best), Some(verified)) = (&one.best, &one.verified) else {
            continue;
        };
        let [pinion, mate] = one.size.teeth;
        let problem = Problem::new(one.size.campaign.clone());
        let unloaded = problem.gears().map(|gears| gears.unloaded(&best.design));
        let distance = unloaded
            .and_then(Result::ok)
            .map_or(f64::NAN, |pair| pair.geometry().centre_distance);
        table.rows.push(vec![
            (place + 1).to_string(),
            format!("{pinion} : {mate}"),
            fixed(f64::from(mate) / f64::from(pinion), 4),
            fixed(best.criteria.gears().normal_module_mm, 3),
            fixed(distance, 3),
            fixed(best.criterion, 3),
            with_interval(verified),
            format!("pair-{}.toml", place + 1),
        ]);
    }
    table
}

fn all_figures(campaign: &Campaign, all: &[Sized]) -> Table {
    let problem = Problem::new(campaign.clone());
    let names = problem.variables().iter().map(|variable| &*variable.name);
    let measures = campaign.sampling.measure_columns();
    let searched = measures[0].replace("_um", "_searched_um");
    let mut columns = ["teeth_p", "teeth_r"].map(Column::whole).to_vec();
    columns.push(Column::number("normal_module_mm"));
    columns.extend(names.map(Column::number));
    columns.push(Column::number(searched));
    columns.extend(measures.map(Column::number));
    columns.extend(CRITERIA.map(Column::number));
    let mut table = Table::new(columns);
    for one in all {
        let [pinion, mate] = one.size.teeth;
        let best = one.best.as_ref();
        let criteria = best.map(|best| best.criteria.gears());
        let mut line = row![pinion, mate].to_vec();
        let module = criteria.map(|criteria| criteria.normal_module_mm);
        line.push(module.or(one.size.module_mm).into());
        match best {
            Some(best) => line.extend(best.design.values().iter().copied().map(Cell::from)),
            None => line.extend(problem.variables().iter().map(|_| Cell::Missing)),
        }
        line.push(best.map(|best| best.criterion).into());
        line.extend(percentile_cells(one.verified));
        line.extend(criteria_cells(criteria.as_ref()));
        table.rows.push(line);
    }
    table
}

/// The best size for each number of pinion teeth, a line for each module.
fn lines(all: &[Sized]) -> Vec<PercentileSeries> {
    let mut modules: Vec<Option<f64>> = all.iter().map(|one| one.size.module_mm).collect();
    modules.sort_by(|a, b| a.unwrap_or(0.0).total_cmp(&b.unwrap_or(0.0)));
    modules.dedup();
    let of_module = |module: Option<f64>| {
        let mut points: Vec<(f64, IntervalEstimate)> = Vec::new();
        for one in all.iter().filter(|one| one.size.module_mm == module) {
            let teeth = f64::from(one.size.teeth[0]);
            // The best come first.
            if points.iter().any(|(known, _)| *known == teeth) {
                continue;
            }
            let searched = one.best.as_ref().map(|best| IntervalEstimate {
                n: one.size.campaign.sampling.samples_per_design as usize,
                value: best.criterion,
                interval: None,
            });
            points.extend(one.verified.or(searched).map(|measure| (teeth, measure)));
        }
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        let of_module = all.iter().filter(|one| one.size.module_mm == module);
        let mut infeasible: Vec<f64> = of_module
            .map(|one| f64::from(one.size.teeth[0]))
            .filter(|teeth| points.iter().all(|(known, _)| known != teeth))
            .collect();
        infeasible.sort_by(f64::total_cmp);
        infeasible.dedup();
        PercentileSeries {
            name: module.map_or_else(
                || "best size".to_owned(),
                |module| format!("module {module} mm"),
            ),
            infeasible,
            points,
        }
    };
    modules.into_iter().map(of_module).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn campaign() -> Campaign {
        let mut campaign = Campaign::parse("wear.toml", Campaign::WEAR).unwrap();
        campaign.optimise.evaluations = 300;
        campaign.optimise.restart_at = Some(150);
        campaign.optimise.starts = 1;
        campaign.sampling.samples_per_design = 8;
        campaign.verify.samples = Some(60);
        campaign.verify.half_width = None;
        campaign
    }

    fn range(teeth: &str, ratio_tolerance: f64) -> Range {
        Range {
            teeth: teeth.parse().unwrap(),
            ratio_tolerance,
            modules_mm: Vec::new(),
        }
    }

    /// The ratio is 1.1: 20 teeth have a mate with 22, and with 5 % those with 21 to 23.
    #[test]
    fn mates_are_within_the_tolerance_of_the_ratio() {
        let teeth = |range: Range| -> Vec<[u32; 2]> {
            let sizes = range.sizes("wear.toml", &campaign()).unwrap();
            sizes.iter().map(|size| size.teeth).collect()
        };
        assert_eq!(teeth(range("20", 0.0)), [[20, 22]]);
        assert_eq!(teeth(range("20", 0.05)), [[20, 21], [20, 22], [20, 23]]);
        let none = range("21", 0.001).sizes("wear.toml", &campaign());
        assert!(none.unwrap_err().to_string().contains("--ratio-tolerance"));
        let of_module = Range {
            modules_mm: vec![3.0],
            ..range("20", 0.0)
        };
        let error = of_module.sizes("wear.toml", &campaign()).unwrap_err();
        assert!(error.to_string().contains("--modules"), "{error}");
    }

    #[test]
    fn sizes_are_ranked_by_what_verification_says() {
        let campaign = campaign();
        let sizes = range("19..=21", 0.03).sizes("wear.toml", &campaign);
        let sizes = sizes.unwrap();
        let count = sizes.len();
        let ranked = run(sizes.clone(), 2).unwrap();
        assert_eq!(ranked, run(sizes, 2).unwrap());
        assert_eq!(ranked.len(), count);
        let verified: Vec<f64> = ranked
            .iter()
            .filter_map(|one| Some(one.verified?.value))
            .collect();
        assert_eq!(verified.len(), 2, "the best two are verified");
        assert!(verified[0] <= verified[1]);
        let folder = tempfile::tempdir().unwrap();
        let document = write_tables(folder.path(), &campaign, &ranked).unwrap();
        assert_eq!(document.tables[0].1.rows.len(), count);
        let text = std::fs::read_to_string(folder.path().join("pair-1.toml")).unwrap();
        let file = PairFile::parse("pair-1.toml", &text).unwrap();
        assert_eq!(file.pair.teeth, ranked[0].size.teeth);
        assert!(!folder.path().join("pair-3.toml").exists());
        for one in &ranked {
            let problem = Problem::new(one.size.campaign.clone());
            let mut found = one.best.iter();
            assert!(found.all(|found| problem.is_feasible(&found.criteria)));
        }
    }
}
