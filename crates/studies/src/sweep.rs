//! `coordinator sweep`: the whole procedure for several numbers of teeth.
//!
//! Each number is a campaign of its own with its own store. The stores hold all that a sweep has
//! done: a killed sweep continues, and a finished one only writes its tables.

use std::path::{Path, PathBuf};

use campaign::file::Sampling;
use campaign::formulation::Problem;
use campaign::formulation::gears::VARIABLE_NAMES;
use campaign::{Approach, Campaign, Criteria, FileError, GearCriteria, GearVariables};
use report::{Percentile, PercentileSeries};
use results::percentile::percentile;
use results::status;
use stages::optima::{self, approach_of, optimum_design};
use store::Store;

use crate::table::{Document, NOTHING, Table, exact, maybe_exact, with_interval, write};

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
    /// The campaign.
    pub campaign: Campaign,
    /// The text of its file.
    pub file_text: String,
    /// Its store.
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

/// Whether a campaign is finished in its store. False without a store.
///
/// # Errors
///
/// The store cannot be read.
pub async fn is_finished(member: &Member) -> anyhow::Result<bool> {
    let store = match Store::open_read_only(&member.db).await {
        Ok(store) => store,
        Err(store::Error::NoStore { .. }) => return Ok(false),
        Err(error) => return Err(error.into()),
    };
    let status = status::read(&store).await;
    store.close().await?;
    let status = status?;
    Ok(status.finished && status.campaign_digest == member.campaign.digest())
}

/// The result of one approach for one number of teeth.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Teeth of pinion and mate.
    pub teeth: [u32; 2],
    /// The approach.
    pub approach: Approach,
    /// Number of calls of the simulator.
    pub simulator_calls: u64,
    /// The approach's design, or the reason why it has none.
    pub optimum: Result<Optimum, String>,
}

/// The design that an approach found.
#[derive(Debug, Clone, PartialEq)]
pub struct Optimum {
    /// The variables of the pair.
    pub variables: GearVariables,
    /// The value that the approach minimised, µm.
    pub criterion: f64,
    /// The criteria of the pair.
    pub criteria: GearCriteria,
    /// The verified percentile, µm.
    pub p90: Percentile,
}

/// The results in the store of a finished campaign, one row per approach.
///
/// # Errors
///
/// The store cannot be read.
pub async fn rows(member: &Member) -> anyhow::Result<Vec<Row>> {
    let store = Store::open_read_only(&member.db).await?;
    let problem = Problem::new(member.campaign.clone());
    let mut rows = Vec::new();
    for row in optima::stored(&store).await? {
        let Some(approach) = approach_of(&row.approach) else {
            continue;
        };
        let criteria: Option<Criteria> = serde_json::from_str(&row.criteria_json)?;
        let optimum = match (optimum_design(&problem, &row), criteria) {
            (Some(design), Some(criteria)) => {
                let samples = optima::verification_samples(&store, &row).await?;
                Ok(Optimum {
                    variables: design.gears(),
                    criterion: row.criterion,
                    criteria: criteria.gears(),
                    p90: percentile(&member.campaign.sampling, &samples),
                })
            }
            _ => Err(row.note),
        };
        rows.push(Row {
            teeth: member
                .campaign
                .gears()
                .map_or([0; 2], |sections| sections.pair.teeth()),
            approach,
            simulator_calls: row.simulator_calls,
            optimum,
        });
    }
    store.close().await?;
    Ok(rows)
}

/// Writes `sweep.csv`, `sweep.md` and `sweep.svg` into `out`; returns what it wrote.
///
/// # Errors
///
/// A file cannot be written.
pub fn write_tables(out: &Path, campaign: &Campaign, rows: &[Row]) -> anyhow::Result<Document> {
    let sampling = &campaign.sampling;
    let name = &campaign.name;
    let percentile = sampling.percentile_name();
    let figures = all_figures(sampling, rows);
    write(out, "sweep.csv", figures.csv()?)?;
    let mut page = format!(
        "# {name} over tooth numbers\n\n\
         {percentile} of ΔSTE in µm at the optimum of each approach, with its 95 % interval, from \
         verification samples.\n\n{}",
        summary(rows).markdown()
    );
    for row in rows {
        if let Err(why) = &row.optimum {
            page += &format!(
                "\n{} teeth, {}: no feasible design. {why}\n",
                row.teeth[0],
                row.approach.name()
            );
        }
    }
    match report::chart_teeth(&percentile, &lines(rows)) {
        Ok(svg) => {
            write(out, "sweep.svg", svg)?;
            page += &format!("\n![{percentile} against the number of teeth](sweep.svg)\n");
        }
        Err(why) => page += &format!("\n{why}\n"),
    }
    write(out, "sweep.md", &page)?;
    Ok(Document {
        page,
        tables: vec![("sweep", figures)],
    })
}

/// The approaches that occur, in their order.
fn approaches(rows: &[Row]) -> Vec<Approach> {
    Approach::ALL
        .into_iter()
        .filter(|approach| rows.iter().any(|row| row.approach == *approach))
        .collect()
}

/// One line per number of teeth, one column per approach.
fn summary(rows: &[Row]) -> Table {
    let approaches = approaches(rows);
    let mut header = vec!["teeth".to_owned(), "best approach".to_owned()];
    header.extend(approaches.iter().map(|approach| approach.name().to_owned()));
    header.push("module of the best, mm".to_owned());
    let mut table = Table::new(header);
    let mut rest = rows;
    while let Some(first) = rest.first() {
        let (group, others) = rest.split_at(
            rest.iter()
                .position(|row| row.teeth != first.teeth)
                .unwrap_or(rest.len()),
        );
        rest = others;
        let best = group
            .iter()
            .filter_map(|row| Some((row, row.optimum.as_ref().ok()?)))
            .min_by(|a, b| a.1.p90.value.total_cmp(&b.1.p90.value));
        let mut line = vec![
            format!("{} : {}", first.teeth[0], first.teeth[1]),
            best.map_or("none feasible", |(row, _)| row.approach.name())
                .to_owned(),
        ];
        line.extend(approaches.iter().map(|approach| {
            let row = group.iter().find(|row| row.approach == *approach);
            match row.map(|row| &row.optimum) {
                Some(Ok(optimum)) => with_interval(&optimum.p90),
                Some(Err(_)) => "none feasible".to_owned(),
                None => NOTHING.to_owned(),
            }
        }));
        line.push(best.map_or_else(
            || NOTHING.to_owned(),
            |(_, optimum)| format!("{:.3}", optimum.criteria.normal_module_mm),
        ));
        table.rows.push(line);
    }
    table
}

fn all_figures(sampling: &Sampling, rows: &[Row]) -> Table {
    let columns = sampling.percentile_columns();
    let mut header = vec!["teeth_p", "teeth_r", "approach"];
    header.extend(VARIABLE_NAMES);
    header.push("criterion_um");
    header.extend(columns.iter().map(String::as_str));
    header.extend([
        "normal_module_mm",
        "contact_ratio",
        "specific_sliding",
        "hertz_pressure_mpa",
        "root_stress_mpa",
        "simulator_calls",
        "remark",
    ]);
    let mut table = Table::new(header);
    for row in rows {
        let [pinion, mate] = row.teeth.map(|teeth| teeth.to_string());
        let mut line = vec![pinion, mate, row.approach.name().to_owned()];
        let optimum = row.optimum.as_ref().ok();
        match optimum {
            Some(optimum) => line.extend(optimum.variables.values().map(exact)),
            None => line.extend(VARIABLE_NAMES.map(|_| String::new())),
        }
        let p90 = optimum.map(|optimum| optimum.p90);
        let criteria = optimum.map(|optimum| optimum.criteria);
        line.extend(
            [
                optimum.map(|optimum| optimum.criterion),
                p90.map(|p90| p90.value),
                p90.map(|p90| p90.low),
                p90.map(|p90| p90.high),
                criteria.map(|criteria| criteria.normal_module_mm),
                criteria.map(|criteria| criteria.contact_ratio),
                criteria.map(|criteria| criteria.specific_sliding),
                criteria.map(|criteria| criteria.hertz_pressure_mpa),
                criteria.map(|criteria| criteria.root_stress_mpa),
            ]
            .map(maybe_exact),
        );
        line.push(row.simulator_calls.to_string());
        line.push(row.optimum.as_ref().err().cloned().unwrap_or_default());
        table.rows.push(line);
    }
    table
}

fn lines(rows: &[Row]) -> Vec<PercentileSeries> {
    approaches(rows)
        .into_iter()
        .map(|approach| PercentileSeries {
            name: approach.name().to_owned(),
            points: rows
                .iter()
                .filter(|row| row.approach == approach)
                .filter_map(|row| Some((f64::from(row.teeth[0]), row.optimum.as_ref().ok()?.p90)))
                .collect(),
        })
        .collect()
}

#[cfg(test)]
mod tests {
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
        let variables = design.gears();
        let sampling = &problem.campaign().sampling;
        let p90 = percentile(sampling, &[[1.0; 30], [1.2; 30]].concat());
        let row = |teeth, approach, optimum| Row {
            teeth,
            approach,
            simulator_calls: 7,
            optimum,
        };
        let found = || {
            Ok(Optimum {
                variables,
                criterion: 1.0,
                criteria,
                p90,
            })
        };
        let none = || Err("No run found a design.".to_owned());
        let rows = [
            row([19, 21], Approach::Nominal, none()),
            row([19, 21], Approach::Baseline, none()),
            row([20, 22], Approach::Nominal, none()),
            row([20, 22], Approach::Baseline, found()),
        ];
        let table = summary(&rows);
        assert_eq!(table.rows.len(), 2);
        assert_eq!(table.rows[0][1], "none feasible");
        assert_eq!(table.rows[1][1], "archard");
        assert!(
            table.rows[1][3].starts_with("1.200 ["),
            "{:?}",
            table.rows[1]
        );
        let all = all_figures(sampling, &rows);
        assert_eq!(all.rows.len(), 4);
        assert!(all.csv().is_ok(), "every row is complete");
        let drawn: Vec<usize> = lines(&rows).iter().map(|line| line.points.len()).collect();
        assert_eq!(drawn, [0, 1]);
    }
}
