//! Table rows as text.

use crate::charts::Response;
use crate::data::{ApproachResult, Limits, ModelFigure, Optimum, Percentile, ReportData};
use crate::error::Error;
use crate::number::{MISSING, count, fixed, relative_gap, seconds, signed_percent, significant};
use crate::paper;
use crate::problem::NamedValue;

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
pub(super) fn preliminary(data: &ReportData) -> Vec<PreliminaryRow> {
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
pub(super) fn responses(data: &ReportData) -> Vec<ResponseRow> {
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
            name: response.label(&data.header.percentile),
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
pub(super) fn similar(data: &ReportData) -> Vec<SimilarRow> {
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
            p90: fixed(design.p90.value, decimals(&design.p90)),
            interval: interval(&design.p90),
            samples: count(design.p90.samples as u64),
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

/// Table 5.
pub(super) fn approaches(data: &ReportData) -> Vec<ApproachRow> {
    let rows = data.approaches.iter();
    rows.map(|result| ApproachRow {
        label: result.approach.label(),
        criterion_name: result.approach.criterion(&data.header.percentile),
        design: result
            .outcome
            .as_ref()
            .map(|optimum| design_cells(optimum, &data.limits))
            .map_err(Clone::clone),
        calls: count(result.simulator_calls),
        cpu: seconds(result.cpu_seconds),
        paper: if data.compare_with_paper {
            paper_cells(result)
        } else {
            None
        },
    })
    .collect()
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
pub(super) fn limited((value, holds): &(NamedValue, bool)) -> Value {
    Value {
        text: named(value),
        marked: !holds,
    }
}

/// A quantity with its name, as in `tip land = 0.62 mm`.
pub(super) fn named(value: &NamedValue) -> String {
    let number = crate::summary::with_unit(value.value, DIGITS, &value.unit);
    format!("{} = {number}", value.name)
}

fn design_cells(optimum: &Optimum, limits: &Limits) -> DesignCells {
    // Rounding in the last bits is no violation.
    const SLACK: f64 = 1e-9;
    let most = |value: f64, bound: f64, digits: usize| Value {
        text: significant(value, digits),
        marked: value > bound * (1.0 + SLACK),
    };
    let values = &optimum.constraints;
    DesignCells {
        variables: variables(&optimum.variables[..6]),
        others: others(&optimum.variables),
        criterion: fixed(optimum.criterion, 2),
        p90: fixed(optimum.p90.value, decimals(&optimum.p90)),
        interval: interval(&optimum.p90),
        converged: optimum.converged_difference_um.map(difference),
        constraints: vec![
            Value {
                text: fixed(values.contact_ratio, 3),
                marked: limits
                    .contact_ratio_min
                    .is_some_and(|least| values.contact_ratio < least * (1.0 - SLACK)),
            },
            most(
                values.specific_slip,
                limits.specific_slip_max.unwrap_or(f64::INFINITY),
                4,
            ),
            most(values.von_mises_mpa, limits.von_mises_max_mpa, 3),
            most(values.pressure_mpa, limits.pressure_max_mpa, 3),
            Value {
                text: significant(values.interference_margin_mm, 2),
                marked: values.interference_margin_mm < -SLACK,
            },
        ],
        further: values.further.iter().map(limited).collect(),
        feasible: if optimum.feasible {
            Value::plain("yes".to_owned())
        } else {
            Value {
                text: "no".to_owned(),
                marked: true,
            }
        },
    }
}

fn paper_cells(result: &ApproachResult) -> Option<PaperCells> {
    let row = paper::approach(result.approach)?;
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
pub(super) fn printed(data: &ReportData) -> Result<Vec<ComparedDesign>, Error> {
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

/// The decimals with which both ends of an interval differ from its middle, at least the paper's two.
pub(super) fn decimals(p90: &Percentile) -> usize {
    let differs = |decimals: &usize| {
        let [low, value, high] =
            [p90.low, p90.value, p90.high].map(|value| fixed(value, *decimals));
        low != value && value != high
    };
    (2..6).find(differs).unwrap_or(2)
}

fn interval(p90: &Percentile) -> String {
    if p90.low.is_finite() || p90.high.is_finite() {
        let decimals = decimals(p90);
        let [low, high] = [p90.low, p90.high].map(|value| fixed(value, decimals));
        format!("[{low} ; {high}]")
    } else {
        MISSING.to_owned()
    }
}

fn range(least: f64, greatest: f64) -> String {
    if least.is_finite() {
        format!("[{} ; {}]", fixed(least, 2), fixed(greatest, 2))
    } else {
        MISSING.to_owned()
    }
}
