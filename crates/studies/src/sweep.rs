//! `coordinator sweep`: the whole procedure for several numbers of teeth.
//!
//! Each number is a campaign with a store of its own. The stores hold the whole state of a sweep: a killed sweep
//! continues, and a finished one only writes its tables.

use std::path::{Path, PathBuf};

use anyhow::Context as _;
use problem::formulation::Problem;
use problem::{Approach, Campaign, FileError};
use results::number::{MISSING, fixed};
use results::optima::{Optima, VerifiedOptimum};
use results::report::charts::{self, PercentileSeries};
use results::report::write_file;
use results::row;
use results::status;
use results::table::{Cell, Column, Table};
use stats::IntervalEstimate;
use store::Store;

use crate::table::{
    CRITERIA, Document, PageTable, criteria_cells, percentile_cells, with_interval,
};

/// Numbers of teeth, ascending and without gaps.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Teeth(std::ops::RangeInclusive<u32>);

impl Teeth {
    /// The numbers of teeth that the simulator accepts.
    const SENSIBLE: std::ops::RangeInclusive<u32> = 4..=2000;

    /// Every number, ascending.
    pub fn iter(&self) -> impl Iterator<Item = u32> {
        self.0.clone()
    }
}

impl std::str::FromStr for Teeth {
    type Err = String;

    /// Reads `17..30` (without 30), `17..=30` (with it) or `17`.
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let number = |text: &str| -> Result<u32, String> {
            let wrong = || format!("{text:?} is not a number of teeth from 4 to 2000");
            let number = text.trim().parse().map_err(|_| wrong())?;
            if Self::SENSIBLE.contains(&number) {
                Ok(number)
            } else {
                Err(wrong())
            }
        };
        let range = if let Some((first, last)) = text.split_once("..=") {
            number(first)?..=number(last)?
        } else if let Some((first, end)) = text.split_once("..") {
            number(first)?..=number(end)? - 1
        } else {
            number(text)?..=number(text)?
        };
        if range.is_empty() {
            return Err(format!(
                "{text:?} holds no number: 17..30 is 17 to 29, 17..=30 is 17 to 30"
            ));
        }
        Ok(Self(range))
    }
}

/// One campaign of a sweep.
#[derive(Debug, Clone, PartialEq)]
pub struct Member {
    /// The pinion's teeth.
    pub teeth: u32,
    pub campaign: Campaign,
    /// The text of its file.
    pub file_text: String,
    pub db: PathBuf,
    /// The folder of its report.
    pub report: PathBuf,
}

/// The campaigns of a sweep, with their places in the folder `out`.
///
/// # Errors
///
/// With one of the numbers the campaign is not valid; `file` names the campaign's file.
pub fn members(
    file: &str,
    campaign: &Campaign,
    teeth: &Teeth,
    out: &Path,
) -> Result<Vec<Member>, FileError> {
    teeth
        .iter()
        .map(|teeth| {
            let (campaign, file_text) = campaign.with_pinion_teeth(file, teeth)?;
            Ok(Member {
                teeth,
                db: out.join(format!("{}.db", campaign.name)),
                report: out.join(format!("{}-report", campaign.name)),
                campaign,
                file_text,
            })
        })
        .collect()
}

/// The finished campaigns of the folder `out` with other numbers of teeth, which belong in the same tables.
///
/// # Errors
///
/// The folder has the sweep of another campaign, or cannot be read.
pub async fn earlier(
    file: &str,
    campaign: &Campaign,
    teeth: &Teeth,
    out: &Path,
) -> anyhow::Result<Vec<Member>> {
    let mut earlier = Vec::new();
    let Ok(entries) = std::fs::read_dir(out) else {
        return Ok(earlier);
    };
    let mut names: Vec<PathBuf> = Vec::new();
    for entry in entries {
        names.push(entry?.path());
    }
    names.sort();
    for path in names
        .iter()
        .filter(|path| path.extension() == Some("db".as_ref()))
    {
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        let number = stem.strip_prefix(&format!("{}-z", campaign.name));
        let found = number.and_then(|number| number.parse::<u32>().ok());
        if found.is_some_and(|found| teeth.0.contains(&found)) {
            continue;
        }
        let other = || {
            anyhow::anyhow!(
                "{} has the sweep of another campaign, whose tables would be replaced: choose another folder with --out",
                out.display()
            )
        };
        let only = found.with_context(other)?.to_string().parse::<Teeth>();
        let only = only.map_err(anyhow::Error::msg)?;
        let member = members(file, campaign, &only, out)?.remove(0);
        let status = status_of(&member).await?.with_context(other)?;
        if status.campaign_digest != member.campaign.digest() {
            return Err(other());
        }
        if status.finished {
            earlier.push(member);
        }
    }
    Ok(earlier)
}

/// Whether a campaign is finished; `false` without a store.
///
/// # Errors
///
/// The store cannot be read.
pub async fn is_finished(member: &Member) -> anyhow::Result<bool> {
    let status = status_of(member).await?;
    let digest = member.campaign.digest();
    Ok(status.is_some_and(|status| status.finished && status.campaign_digest == digest))
}

/// The status of a campaign; `None` without a store.
async fn status_of(member: &Member) -> anyhow::Result<Option<status::Status>> {
    let store = match Store::open_read_only(&member.db).await {
        Ok(store) => store,
        Err(store::Error::NoStore { .. }) => return Ok(None),
        Err(error) => return Err(error.into()),
    };
    let status = status::read(&store).await;
    store.close().await?;
    Ok(Some(status?))
}

/// The outcome of one approach for one number of teeth.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// Teeth of pinion and mate.
    pub teeth: [u32; 2],
    /// The optimum of the approach.
    pub verified: VerifiedOptimum,
}

impl Outcome {
    fn approach(&self) -> Approach {
        self.verified.optimum.approach
    }

    /// The verified percentile; `None` without a design or with too few samples.
    fn p90(&self) -> Option<IntervalEstimate> {
        self.verified.measure
    }
}

/// The outcomes in the store of a finished campaign, one per approach.
///
/// # Errors
///
/// The store cannot be read.
pub async fn outcomes(member: &Member) -> anyhow::Result<Vec<Outcome>> {
    let store = Store::open_read_only(&member.db).await?;
    let problem = Problem::new(member.campaign.clone());
    let optima = Optima::read(&store, &problem).await?;
    store.close().await?;
    let sections = member.campaign.gears();
    let teeth = sections.map_or([0; 2], |sections| sections.pair.teeth());
    let outcome = |verified: &VerifiedOptimum| Outcome {
        teeth,
        verified: verified.clone(),
    };
    Ok(optima.iter().map(outcome).collect())
}

/// Writes `sweep.csv`, `sweep.md` and `sweep.svg` into `out`; returns what it wrote.
///
/// # Errors
///
/// A file cannot be written.
pub fn write_tables(
    out: &Path,
    campaign: &Campaign,
    outcomes: &[Outcome],
) -> anyhow::Result<Document> {
    let name = &campaign.name;
    let measure = campaign.measure_name();
    let figures = all_figures(campaign, outcomes);
    write_file(out, "sweep.csv", figures.csv()?)?;
    let mut page = format!(
        "# {name} over tooth numbers\n\n\
         {measure} of ΔSTE in µm at the optimum of each approach, with its 95 % interval, from \
         verification samples.\n\n{}",
        summary(outcomes).markdown()
    );
    for outcome in outcomes {
        if let Err(why) = outcome.verified.optimum.found_or_sentence() {
            page += &format!(
                "\n{} teeth, {}: no feasible design. {why}\n",
                outcome.teeth[0],
                outcome.approach().name()
            );
        }
    }
    match charts::teeth(&measure, &lines(outcomes)) {
        Ok(chart) => {
            write_file(out, "sweep.svg", chart.standalone())?;
            page += &format!("\n![{measure} against the number of teeth](sweep.svg)\n");
        }
        Err(why) => page += &format!("\n{why}\n"),
    }
    write_file(out, "sweep.md", &page)?;
    Ok(Document {
        page,
        tables: vec![("sweep", figures)],
    })
}

/// The approaches that occur, in their order.
fn approaches(outcomes: &[Outcome]) -> Vec<Approach> {
    Approach::ALL
        .into_iter()
        .filter(|approach| {
            outcomes
                .iter()
                .any(|outcome| outcome.approach() == *approach)
        })
        .collect()
}

/// One line per number of teeth, one column per approach.
fn summary(outcomes: &[Outcome]) -> PageTable {
    let approaches = approaches(outcomes);
    let mut header = vec!["teeth".to_owned(), "best approach".to_owned()];
    header.extend(approaches.iter().map(|approach| approach.name().to_owned()));
    header.push("module of the best, mm".to_owned());
    let mut table = PageTable::new(header);
    let mut rest = outcomes;
    while let Some(first) = rest.first() {
        let (group, others) = rest.split_at(
            rest.iter()
                .position(|outcome| outcome.teeth != first.teeth)
                .unwrap_or(rest.len()),
        );
        rest = others;
        let best = group
            .iter()
            .filter_map(|outcome| Some((outcome, outcome.p90()?)))
            .min_by(|(_, a), (_, b)| a.value.total_cmp(&b.value))
            .map(|(outcome, _)| outcome);
        let mut line = vec![
            format!("{} : {}", first.teeth[0], first.teeth[1]),
            best.map_or("none feasible", |outcome| outcome.approach().name())
                .to_owned(),
        ];
        line.extend(approaches.iter().map(|approach| {
            let Some(outcome) = group.iter().find(|outcome| outcome.approach() == *approach) else {
                return MISSING.to_owned();
            };
            outcome
                .p90()
                .map_or_else(|| "none feasible".to_owned(), |p90| with_interval(&p90))
        }));
        let found = best.and_then(|outcome| outcome.verified.optimum.feasible());
        line.push(found.map_or_else(
            || MISSING.to_owned(),
            |found| fixed(found.criteria.gears().normal_module_mm, 3),
        ));
        table.rows.push(line);
    }
    table
}

fn all_figures(campaign: &Campaign, outcomes: &[Outcome]) -> Table {
    let problem = Problem::new(campaign.clone());
    let names = problem.variables().iter().map(|variable| &*variable.name);
    let mut columns = ["teeth_p", "teeth_r"].map(Column::whole).to_vec();
    columns.push(Column::text("approach"));
    columns.extend(names.map(Column::number));
    columns.push(Column::number("criterion_um"));
    columns.extend(campaign.sampling.measure_columns().map(Column::number));
    columns.push(Column::number("normal_module_mm"));
    columns.extend(CRITERIA.map(Column::number));
    columns.extend([Column::whole("simulator_calls"), Column::text("remark")]);
    let mut table = Table::new(columns);
    for outcome in outcomes {
        let [pinion, mate] = outcome.teeth;
        let mut line = row![pinion, mate, outcome.approach().name()].to_vec();
        let optimum = &outcome.verified.optimum;
        let found = optimum.found.as_ref().ok();
        match found {
            Some(found) => line.extend(found.design.values().iter().copied().map(Cell::from)),
            None => line.extend(problem.variables().iter().map(|_| Cell::Missing)),
        }
        line.push(found.map(|found| found.criterion).into());
        line.extend(percentile_cells(outcome.p90()));
        let criteria = found.map(|found| found.criteria.gears());
        line.push(criteria.map(|criteria| criteria.normal_module_mm).into());
        line.extend(criteria_cells(criteria.as_ref()));
        let remark = optimum.found_or_sentence().err();
        line.extend(row![
            optimum.cost.simulator_calls,
            remark.unwrap_or_default()
        ]);
        table.rows.push(line);
    }
    table
}

fn lines(outcomes: &[Outcome]) -> Vec<PercentileSeries> {
    let line = |approach: Approach| {
        let of_approach = outcomes.iter().filter(|one| one.approach() == approach);
        let mut line = PercentileSeries {
            name: approach.name().to_owned(),
            points: Vec::new(),
            infeasible: Vec::new(),
        };
        for outcome in of_approach {
            let teeth = f64::from(outcome.teeth[0]);
            match outcome.p90() {
                Some(p90) => line.points.push((teeth, p90)),
                None => line.infeasible.push(teeth),
            }
        }
        line
    };
    approaches(outcomes).into_iter().map(line).collect()
}

#[cfg(test)]
mod tests {
    use problem::optimise::Solution;
    use stages::cost::Cost;
    use stages::optima::{NoOptimum, Optimum};
    use stages::verification::Verification;

    use super::*;

    #[test]
    fn ranges_are_read_as_rust_writes_them() {
        let read = |text: &str| -> Vec<u32> { text.parse::<Teeth>().unwrap().iter().collect() };
        assert_eq!(read("17..20"), [17, 18, 19]);
        assert_eq!(read("17..=20"), [17, 18, 19, 20]);
        assert_eq!(read("21"), [21]);
        for wrong in [
            "",
            "20..17",
            "17..17",
            "3..9",
            "17..2001..",
            "a..b",
            "17..=1e3",
        ] {
            assert!(wrong.parse::<Teeth>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_number_without_a_feasible_design_is_a_line_of_the_table() {
        let campaign = Campaign::parse("paper.toml", Campaign::PAPER).unwrap();
        let design = stages::references::design(gear::paper::printed::Place::Figure(7));
        let problem = Problem::new(campaign);
        let gears = problem.gears().unwrap();
        let criteria = gears.pair_criteria(&gears.pair(&design).unwrap(), 1000.0);
        let found = Solution {
            design,
            criterion: 1.0,
            criteria: criteria.into(),
            feasible: true,
        };
        let optimum = |approach, found| Optimum {
            approach,
            found,
            cost: Cost::default(),
            note: "No run found a design.".to_owned(),
        };
        let none = || Err(NoOptimum::NoneSimulable);
        let verification = Verification {
            samples: [[1.0; 30], [1.2; 30]].concat().into(),
            wanted: 60,
        };
        let optima = [
            ([19, 21], optimum(Approach::Nominal, none()), None),
            ([19, 21], optimum(Approach::Baseline, none()), None),
            ([20, 22], optimum(Approach::Nominal, none()), None),
            (
                [20, 22],
                optimum(Approach::Baseline, Ok(found)),
                Some(verification),
            ),
        ];
        let outcomes = optima.map(|(teeth, optimum, verification)| {
            let optima = Optima::new(&problem, vec![(optimum, verification)]);
            Outcome {
                teeth,
                verified: optima.iter().next().unwrap().clone(),
            }
        });
        let table = summary(&outcomes);
        assert_eq!(table.rows.len(), 2);
        assert_eq!(table.rows[0][1], "none feasible");
        assert_eq!(table.rows[1][1], "archard");
        assert!(
            table.rows[1][3].starts_with("1.20 ["),
            "{:?}",
            table.rows[1]
        );
        let all = all_figures(problem.campaign(), &outcomes);
        assert_eq!(all.rows.len(), 4);
        assert!(all.csv().is_ok(), "every row is complete");
        let drawn: Vec<_> = lines(&outcomes)
            .into_iter()
            .map(|line| (line.points.len(), line.infeasible))
            .collect();
        assert_eq!(drawn, [(0, vec![19.0, 20.0]), (1, vec![19.0])]);
        let chart = charts::teeth("P90", &lines(&outcomes))
            .unwrap()
            .standalone();
        assert!(chart.contains("archard: none feasible"), "{chart}");
    }
}
