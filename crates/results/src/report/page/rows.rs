//! Table rows as text.

use campaign::formulation::Constraint;
use campaign::optimise::Solution;
use campaign::{Approach, GearCriteria};
use gear::paper::printed::ACCURATE_SAMPLES;
use stats::OrderStatistic;

use crate::optima::VerifiedOptimum;
use crate::report::charts::Response;
use crate::report::data::{GearData, ModelFigure, ReportData};
use crate::report::error::Error;
use crate::report::number::{
    MISSING, count, fixed, relative_gap, seconds, signed_percent, significant,
};
use crate::report::paper;
use crate::report::quantity::{NamedValue, approach_name, criterion_name};

/// A gap beyond this share of the paper's figure is marked.
const NOTABLE_GAP: f64 = 0.20;

/// Significant digits of named variables and limited quantities.
const DIGITS: usize = 5;

/// Below this p value a sample is said not to be normal.
const LEVEL: f64 = 0.05;

const CONTACT_RATIO: &str = "contact ratio <var>r</var><sub>c</sub>";
const SPECIFIC_SLIP: &str = "specific slip <var>g</var><sub>s</sub>";
const VON_MISES: &str = "root stress <var>σ</var><sub>vm</sub>";
const PRESSURE: &str = "contact pressure <var>p</var><sub>H</sub>";

/// A number that may deserve a mark.
pub(super) struct Value {
    pub(super) text: String,
    pub(super) marked: bool,
}

impl Value {
    fn plain(text: String) -> Self {
        Self {
            text,
            marked: false,
        }
    }
}

pub(super) struct PreliminaryRow {
    pub(super) number: usize,
    pub(super) variables: Vec<String>,
    pub(super) samples: String,
    pub(super) mean: String,
    pub(super) sd: String,
    pub(super) p90: String,
    pub(super) lilliefors: Value,
    pub(super) variance: String,
    pub(super) p90_sd: String,
    pub(super) paper_mean: String,
    pub(super) paper_sd: String,
    pub(super) paper_p90: String,
    pub(super) paper_variance: String,
    pub(super) paper_p90_sd: String,
}

/// Tables 1 and 2. The paper's figures stand beside a design only if it is the paper's design.
pub(super) fn preliminary(data: &GearData) -> Vec<PreliminaryRow> {
    let rows = data.preliminary.iter().enumerate();
    rows.map(|(i, design)| {
        let paper = paper::preliminary(&design.variables);
        let printed = |pick: fn(&paper::PreliminaryRow) -> f64, decimals| {
            paper.map_or_else(|| MISSING.to_owned(), |row| fixed(pick(row), decimals))
        };
        PreliminaryRow {
            number: i + 1,
            variables: variables(&design.variables),
            samples: count(design.samples as u64),
            mean: fixed(design.mean_um, 2),
            sd: fixed(design.sd_um, 2),
            p90: fixed(design.p90_um, 2),
            lilliefors: Value {
                text: significant(design.lilliefors_p, 2),
                marked: design.lilliefors_p < LEVEL,
            },
            variance: significant(design.p90_variance_um2, 2),
            p90_sd: significant(design.p90_variance_um2.sqrt(), 2),
            paper_mean: printed(|row| row.mean_um, 2),
            paper_sd: printed(|row| row.sd_um, 2),
            paper_p90: printed(|row| row.p90_um, 2),
            paper_variance: printed(|row| row.p90_variance_um2, 3),
            paper_p90_sd: printed(|row| row.p90_sd_um, 2),
        }
    })
    .collect()
}

pub(super) struct ResponseRow {
    pub(super) name: String,
    pub(super) designs: String,
    pub(super) mean: String,
    pub(super) range: String,
    pub(super) paper_mean: String,
    pub(super) paper_range: String,
}

/// Table 3, over the designs whose response is finite.
pub(super) fn responses(data: &GearData, percentile: &str) -> Vec<ResponseRow> {
    let responses = [Response::Unworn, Response::Archard, Response::Percentile];
    let rows = responses.into_iter().zip(&paper::RESPONSES);
    rows.map(|(response, paper)| {
        let values: Vec<f64> = data
            .doe
            .iter()
            .map(|p| response.of(p))
            .filter(|v| v.is_finite())
            .collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let least = values.iter().copied().fold(f64::NAN, f64::min);
        let greatest = values.iter().copied().fold(f64::NAN, f64::max);
        ResponseRow {
            name: response.label(percentile),
            designs: count(values.len() as u64),
            mean: fixed(mean, 2),
            range: range(least, greatest),
            paper_mean: fixed(paper.mean_um, 2),
            paper_range: range(paper.min_um, paper.max_um),
        }
    })
    .collect()
}

pub(super) struct SimilarRow {
    pub(super) number: usize,
    pub(super) variables: Vec<String>,
    pub(super) archard: String,
    pub(super) p90: String,
    pub(super) interval: String,
    pub(super) samples: String,
    pub(super) paper_archard: String,
    pub(super) paper_p90: String,
}

/// Table 4.
pub(super) fn similar(data: &GearData) -> Vec<SimilarRow> {
    let rows = data.similar.iter().enumerate();
    rows.map(|(i, design)| {
        let paper = paper::similar(&design.variables);
        let printed = |pick: fn(&paper::SimilarRow) -> f64| {
            paper.map_or_else(|| MISSING.to_owned(), |row| fixed(pick(row), 2))
        };
        SimilarRow {
            number: i + 1,
            variables: variables(&design.variables),
            archard: fixed(design.delta_ste_archard_um, 2),
            p90: percentile(design.p90),
            interval: interval(design.p90),
            samples: count(design.p90.map_or(0, |p90| p90.n) as u64),
            paper_archard: printed(|row| row.delta_ste_archard_um),
            paper_p90: printed(|row| row.p90_um),
        }
    })
    .collect()
}

/// One approach in both halves of Table 5.
pub(super) struct ApproachRow {
    pub(super) label: &'static str,
    pub(super) criterion_name: String,
    /// The design, or why there is none.
    pub(super) design: Result<DesignCells, String>,
    pub(super) calls: String,
    pub(super) cpu: String,
    /// The paper's row, where it has one and it is wanted.
    pub(super) paper: Option<PaperCells>,
}

pub(super) struct DesignCells {
    pub(super) variables: Vec<String>,
    pub(super) others: Vec<String>,
    pub(super) criterion: String,
    pub(super) p90: String,
    pub(super) interval: String,
    /// By how much P90 changes on the converged grid.
    pub(super) converged: Option<String>,
    /// r_c, g_s, σ_vm, p_H, interference margin.
    pub(super) constraints: Vec<Value>,
    /// Whatever else is limited.
    pub(super) further: Vec<Value>,
    pub(super) feasible: Value,
}

impl ApproachRow {
    /// Whether the row of the other variables and the constraints stands alone.
    pub(super) fn is_single(&self) -> bool {
        let further = self.design.as_ref().is_ok_and(|d| !d.further.is_empty());
        self.paper.is_none() && !further
    }
}

pub(super) struct PaperCells {
    pub(super) variables: Vec<String>,
    pub(super) others: Vec<String>,
    pub(super) criterion: String,
    pub(super) p90: String,
    pub(super) constraints: Vec<String>,
    pub(super) cost: &'static str,
}

/// Table 5, of a gear campaign.
pub(super) fn approaches(data: &ReportData, gears: &GearData) -> Vec<ApproachRow> {
    let rows = data.optima.iter();
    rows.map(|verified| {
        let optimum = &verified.optimum;
        ApproachRow {
            label: approach_name(&data.problem, optimum.approach),
            criterion_name: criterion_name(optimum.approach, &data.header.percentile),
            design: optimum.found_or_sentence().map(|found| DesignCells {
                converged: gears
                    .illustrations
                    .get(&optimum.approach)
                    .and_then(|illustration| illustration.converged_difference_um)
                    .map(difference),
                ..design_cells(verified, found)
            }),
            calls: count(optimum.cost.simulator_calls),
            cpu: seconds(optimum.cost.cpu_seconds),
            paper: match gears.compare_with_paper {
                true => paper_cells(optimum.approach),
                false => None,
            },
        }
    })
    .collect()
}

/// P90 as the paper verifies it, by (8) from as many samples, µm: for its Table 5.
pub(in crate::report) fn p90_by_paper_um(data: &ReportData, verified: &VerifiedOptimum) -> f64 {
    let samples = verified.samples();
    let samples = &samples[..samples.len().min(ACCURATE_SAMPLES)];
    let estimate = data.problem.campaign().sampling.papers_estimate(samples);
    estimate.map_or(f64::NAN, |estimate| estimate.p90)
}

/// A difference of P90 in µm with its sign.
pub(super) fn difference(value: f64) -> String {
    let digits = fixed(value.abs(), 4);
    let is_zero = digits.bytes().all(|digit| matches!(digit, b'0' | b'.'));
    let sign = match (is_zero, value < 0.0) {
        (true, _) => "±",
        (false, true) => "−",
        (false, false) => "+",
    };
    format!("{sign}{digits}")
}

/// A limited quantity with its name, marked where it breaks its limit.
pub(super) fn limited(constraint: &Constraint) -> Value {
    let value = NamedValue {
        name: constraint.name.to_string(),
        unit: constraint.unit.to_string(),
        value: constraint.value,
    };
    Value {
        text: named(&value),
        marked: !constraint.holds(),
    }
}

/// A quantity with its name, as in `tip land = 0.62 mm`.
pub(super) fn named(value: &NamedValue) -> String {
    let number = crate::report::summary::with_unit(value.value, DIGITS, &value.unit);
    format!("{} = {number}", value.name)
}

/// The cells of a design, without its difference on the converged grid.
fn design_cells(verified: &VerifiedOptimum, found: &Solution) -> DesignCells {
    let variables_of = found.design.gears().values();
    DesignCells {
        variables: variables(&variables_of[..6]),
        others: others(&variables_of),
        criterion: fixed(found.criterion, 2),
        p90: percentile(verified.percentile),
        interval: interval(verified.percentile),
        converged: None,
        constraints: constraints(&verified.constraints, &found.criteria.gears()),
        further: further(&verified.constraints).map(limited).collect(),
        feasible: match found.feasible {
            true => Value::plain("yes".to_owned()),
            false => Value {
                text: "no".to_owned(),
                marked: true,
            },
        },
    }
}

/// The quantities that have a column each.
const COLUMNS: [&str; 4] = [
    "contact ratio",
    "specific sliding",
    "root stress",
    "contact pressure",
];

/// A margin of interference is limited by zero.
fn is_interference(constraint: &Constraint) -> bool {
    constraint.unit == "mm" && constraint.limit == 0.0
}

/// What is limited besides the columns of the table.
fn further(constraints: &[Constraint]) -> impl Iterator<Item = &Constraint> {
    let all = constraints.iter();
    all.filter(|limit| !COLUMNS.contains(&&*limit.name) && !is_interference(limit))
}

/// r_c, g_s, σ_vm, p_H and the least interference margin, marked where a limit is broken.
fn constraints(limits: &[Constraint], criteria: &GearCriteria) -> Vec<Value> {
    let is_broken = |of: &dyn Fn(&Constraint) -> bool| {
        let mut limits = limits.iter();
        limits.any(|limit| of(limit) && !limit.holds())
    };
    let margins = criteria
        .clearance_mm
        .iter()
        .chain(&criteria.flank_margin_mm);
    let margin = margins.copied().fold(f64::INFINITY, f64::min);
    let values = [
        fixed(criteria.contact_ratio, 3),
        significant(criteria.specific_sliding, 4),
        significant(criteria.root_stress_mpa, 3),
        significant(criteria.hertz_pressure_mpa, 3),
    ];
    let columns = COLUMNS.iter().zip(values).map(|(name, text)| Value {
        text,
        marked: is_broken(&|limit| limit.name == *name),
    });
    let margin = Value {
        text: significant(margin, 2),
        marked: is_broken(&is_interference),
    };
    columns.chain([margin]).collect()
}

fn paper_cells(approach: Approach) -> Option<PaperCells> {
    let row = paper::approach(approach)?;
    let design = paper::printed(row.figure)?;
    Some(PaperCells {
        variables: variables(&row.variables),
        others: others(&design.variables),
        criterion: fixed(row.criterion, 2),
        p90: fixed(row.p90_um, 2),
        constraints: vec![
            fixed(design.contact_ratio, 2),
            fixed(design.specific_slip, 2),
            fixed(design.von_mises_mpa, 0),
            fixed(design.pressure_mpa, 0),
            MISSING.to_owned(),
        ],
        cost: row.cost,
    })
}

/// One printed design with its compared figures.
pub(super) struct ComparedDesign {
    pub(super) figure: u8,
    pub(super) name: &'static str,
    /// The compared figures, or why there are none.
    pub(super) rows: Result<Vec<ComparedRow>, String>,
}

impl ComparedDesign {
    /// How many table rows the design takes.
    pub(super) fn height(&self) -> usize {
        self.rows.as_ref().map_or(1, Vec::len)
    }
}

pub(super) struct ComparedRow {
    /// Markup, not text.
    pub(super) quantity: &'static str,
    pub(super) unit: &'static str,
    pub(super) paper: String,
    pub(super) model: String,
    pub(super) gap: Value,
    pub(super) note: String,
}

/// Figures 6 to 10, the paper beside the model.
pub(super) fn printed(data: &GearData) -> Result<Vec<ComparedDesign>, Error> {
    let designs = data.printed.iter();
    designs
        .map(|design| {
            let printed = paper::printed(design.figure).ok_or(Error::UnknownFigure {
                figure: design.figure,
            })?;
            let rows = design.outcome.as_ref().map_err(Clone::clone).map(|model| {
                let mut rows = vec![
                    compared(
                        CONTACT_RATIO,
                        "",
                        printed.contact_ratio,
                        &model.contact_ratio,
                    ),
                    compared(
                        SPECIFIC_SLIP,
                        "",
                        printed.specific_slip,
                        &model.specific_slip,
                    ),
                    compared(
                        VON_MISES,
                        "MPa",
                        printed.von_mises_mpa,
                        &model.von_mises_mpa,
                    ),
                    compared(PRESSURE, "MPa", printed.pressure_mpa, &model.pressure_mpa),
                    compared(
                        printed.criterion,
                        "µm",
                        printed.criterion_um,
                        &model.criterion,
                    ),
                ];
                if let Some(p90) = printed.p90_um {
                    rows.push(compared("P90 from 500 samples", "µm", p90, &model.p90_um));
                }
                rows
            });
            Ok(ComparedDesign {
                figure: design.figure,
                name: printed.name,
                rows,
            })
        })
        .collect()
}

fn compared(
    quantity: &'static str,
    unit: &'static str,
    paper: f64,
    model: &ModelFigure,
) -> ComparedRow {
    let gap = relative_gap(model.value, paper);
    let large = paper.abs() >= 100.0;
    ComparedRow {
        quantity,
        unit,
        // To the decimals that the paper prints.
        paper: fixed(paper, if large { 0 } else { 2 }),
        model: fixed(model.value, if large { 0 } else { 2 }),
        gap: Value {
            text: signed_percent(gap),
            marked: gap.abs() > NOTABLE_GAP,
        },
        note: model.note.clone(),
    }
}

/// The six coefficients, to three decimals where they need the third.
fn variables(values: &[f64]) -> Vec<String> {
    values
        .iter()
        .map(|&v| {
            let hundredths = (100.0 * v - (100.0 * v).round()).abs() < 1e-6;
            fixed(v, if hundredths { 2 } else { 3 })
        })
        .collect()
}

/// The four radii in mm and the helix angle in degrees.
fn others(variables: &[f64; 11]) -> Vec<String> {
    variables[6..]
        .iter()
        .enumerate()
        .map(|(i, &v)| if i < 4 { fixed(v, 4) } else { fixed(v, 2) })
        .collect()
}

/// A percentile with the decimals that its interval needs, at least the paper's two.
fn percentile(p90: Option<OrderStatistic>) -> String {
    let value = p90.map_or(f64::NAN, |p90| p90.value);
    fixed(value, p90.map_or(2, |p90| decimals(&p90)))
}

/// The decimals with which both ends of an interval differ from its middle, at least the paper's two.
fn decimals(p90: &OrderStatistic) -> usize {
    let Some((low, high)) = p90.interval else {
        return 2;
    };
    let differs = |decimals: &usize| {
        let [low, value, high] = [low, p90.value, high].map(|value| fixed(value, *decimals));
        low != value && value != high
    };
    (2..6).find(differs).unwrap_or(2)
}

fn interval(p90: Option<OrderStatistic>) -> String {
    let Some((p90, (low, high))) = p90.and_then(|p90| Some((p90, p90.interval?))) else {
        return MISSING.to_owned();
    };
    let [low, high] = [low, high].map(|end| fixed(end, decimals(&p90)));
    format!("[{low} ; {high}]")
}

fn range(least: f64, greatest: f64) -> String {
    if least.is_finite() {
        format!("[{} ; {}]", fixed(least, 2), fixed(greatest, 2))
    } else {
        MISSING.to_owned()
    }
}
