//! The designs that the approaches found, as table rows (Table 5).

use problem::formulation::Constraint;
use problem::optimise::Solution;
use problem::{Approach, GearCriteria};

use super::cells::{Value, limited};
use crate::number::{MISSING, fixed, shortest, signed, significant};
use crate::optima::VerifiedOptimum;
use crate::report::contents::{GearFigures, Report};
use crate::report::paper;
use crate::report::quantity::{approach_name, criterion_name};

/// One approach in both halves of the table.
pub(super) struct ApproachRow<'a> {
    pub(super) label: &'static str,
    pub(super) criterion_name: String,
    pub(super) verified: &'a VerifiedOptimum,
    /// The design, or why there is none.
    pub(super) design: Result<DesignCells, String>,
    /// By how much P90 changes on a finer grid.
    pub(super) converged: Option<String>,
    /// The constraints without a column.
    pub(super) further: Vec<Value>,
    /// The paper's row, where it has one and the campaign compares itself with it.
    pub(super) paper: Option<PaperCells>,
}

/// A design, found or printed.
pub(super) struct DesignCells {
    /// The six coefficients.
    pub(super) variables: Vec<String>,
    /// The four radii in mm and the helix angle in degrees.
    pub(super) others: Vec<String>,
    pub(super) criterion: String,
    /// ε_γ, ζ, σ_vm, p_H, interference margin.
    pub(super) constraints: Vec<Value>,
}

/// The paper's row for an approach.
pub(super) struct PaperCells {
    pub(super) design: DesignCells,
    pub(super) p90: String,
    pub(super) cost: &'static str,
}

impl ApproachRow<'_> {
    /// Whether the approach has one row in the second half of the table, without further limits and without a row of
    /// the paper.
    pub(super) fn is_single(&self) -> bool {
        self.paper.is_none() && self.further.is_empty()
    }

    pub(super) fn feasible(&self) -> Value {
        let is_feasible = self.verified.keeps_limits();
        Value {
            text: if is_feasible { "yes" } else { "no" }.to_owned(),
            marked: !is_feasible,
        }
    }
}

/// Table 5.
pub(super) fn approaches<'a>(report: &'a Report, gears: &GearFigures) -> Vec<ApproachRow<'a>> {
    let measure = report.snapshot.measure_name();
    let row = |verified: &'a VerifiedOptimum| {
        let optimum = &verified.optimum;
        let approach = optimum.approach;
        let illustration = gears.illustrations.get(&approach);
        let converged = illustration.and_then(|shown| shown.grid_difference_um);
        let further = verified
            .constraints
            .iter()
            .filter(|limit| is_further(limit));
        ApproachRow {
            label: approach_name(report.problem(), approach),
            criterion_name: criterion_name(approach, &measure),
            design: optimum
                .found_or_sentence()
                .map(|found| found_cells(found, &verified.constraints)),
            converged: converged.map(difference),
            further: limited(further),
            paper: gears.paper.as_ref().and_then(|_| paper_cells(approach)),
            verified,
        }
    };
    report.snapshot.optima.iter().map(row).collect()
}

/// A difference of P90 in µm.
pub(super) fn difference(value: f64) -> String {
    signed(value, 4)
}

fn found_cells(found: &Solution, constraints: &[Constraint]) -> DesignCells {
    let variables = found.design.gears().values();
    DesignCells {
        variables: coefficients(&variables),
        others: others(&variables),
        criterion: fixed(found.criterion, 2),
        constraints: constraint_cells(constraints, &found.criteria.gears()),
    }
}

fn paper_cells(approach: Approach) -> Option<PaperCells> {
    let row = paper::approach(approach)?;
    let design = paper::printed(row.figure)?;
    let constraints = [
        fixed(design.contact_ratio, 2),
        fixed(design.specific_slip, 2),
        fixed(design.von_mises_mpa, 0),
        fixed(design.pressure_mpa, 0),
        MISSING.to_owned(),
    ];
    Some(PaperCells {
        design: DesignCells {
            variables: coefficients(&design.variables),
            others: others(&design.variables),
            criterion: fixed(row.criterion, 2),
            constraints: constraints.map(Value::from).into(),
        },
        p90: fixed(row.p90_um, 2),
        cost: row.cost,
    })
}

fn coefficients(variables: &[f64; 11]) -> Vec<String> {
    let coefficients = variables[..6].iter();
    coefficients.map(|value| shortest(*value, 2..=3)).collect()
}

fn others(variables: &[f64; 11]) -> Vec<String> {
    let decimals = [4, 4, 4, 4, 2];
    let others = variables[6..].iter().zip(decimals);
    others
        .map(|(value, decimals)| fixed(*value, decimals))
        .collect()
}

/// The constraints that have a column each.
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

/// Whether a constraint has no column.
fn is_further(constraint: &Constraint) -> bool {
    !COLUMNS.contains(&&*constraint.name) && !is_interference(constraint)
}

/// ε_γ, ζ, σ_vm, p_H and the least interference margin, marked where a limit is broken.
fn constraint_cells(constraints: &[Constraint], criteria: &GearCriteria) -> Vec<Value> {
    let is_broken = |of: &dyn Fn(&Constraint) -> bool| {
        let mut constraints = constraints.iter();
        constraints.any(|constraint| of(constraint) && !constraint.holds())
    };
    let margins = criteria
        .clearance_mm
        .iter()
        .chain(&criteria.flank_margin_mm);
    let margin = margins.copied().fold(f64::INFINITY, f64::min);
    // A difference within rounding errors counts as zero.
    let is_zero = margin.abs() <= 1e-9 * criteria.normal_module_mm;
    let margin = if is_zero { 0.0 } else { margin };
    let values = [
        fixed(criteria.contact_ratio, 3),
        significant(criteria.specific_sliding, 4),
        significant(criteria.root_stress_mpa, 3),
        significant(criteria.hertz_pressure_mpa, 3),
    ];
    let columns = COLUMNS.iter().zip(values).map(|(name, text)| Value {
        text,
        marked: is_broken(&|constraint| constraint.name == *name),
    });
    let margin = Value {
        text: significant(margin, 2),
        marked: is_broken(&is_interference),
    };
    columns.chain([margin]).collect()
}
