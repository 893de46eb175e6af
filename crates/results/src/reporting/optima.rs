//! What each approach found: the design, its drawing, its curves and its runs.

use anyhow::Context as _;
use campaign::formulation::Problem;
use campaign::optimise::RunResult;
use campaign::{Approach, Criteria, Design, GearCriteria};
use gear::Member;
use gear::paper::printed::ACCURATE_SAMPLES;
use report::{
    ApproachResult, Constraints, ContactPattern, GearDrawing, GearOutline, NamedValue,
    OptimiserRun, Optimum, SteCurves,
};
use stages::names;
use stages::optima::{approach_of, optimum_design, sentence};
use store::{OptimiserRunRow, OptimumRow};

use super::problem::limited;
use super::sources::Sources;
use crate::converged::difference_um;
use crate::percentile::percentile;

/// Points on each flank of a drawn gear.
const OUTLINE_POINTS: usize = 24;

/// Parts of a flank along the path of contact and across the face in the contact pattern.
const PATTERN_PARTS: [usize; 2] = [30, 20];

/// The report's name of an approach.
pub(super) const fn report_approach(approach: Approach) -> report::Approach {
    match approach {
        Approach::Nominal => report::Approach::WithoutWear,
        Approach::Baseline => report::Approach::ArchardWear,
        Approach::Kriging => report::Approach::Kriging,
        Approach::BestOfDoe => report::Approach::BestOfDoe,
        Approach::EnrichedKriging => report::Approach::KrigingEnriched,
        Approach::Direct => report::Approach::Direct,
    }
}

pub(super) fn approaches(sources: &Sources) -> anyhow::Result<Vec<ApproachResult>> {
    Approach::ALL
        .iter()
        .filter_map(|approach| {
            sources
                .optima
                .iter()
                .find(|row| row.approach == approach.name())
        })
        .map(|row| {
            let approach = approach_of(&row.approach).context("an unknown approach")?;
            let criteria: Option<Criteria> = serde_json::from_str(&row.criteria_json)?;
            let outcome = match (optimum_design(&sources.problem, row), criteria) {
                (Some(design), Some(criteria)) => {
                    Ok(optimum(sources, row, &design, &criteria.gears()))
                }
                _ => Err(sentence(&sources.problem, row)),
            };
            Ok(ApproachResult {
                approach: report_approach(approach),
                note: if outcome.is_ok() {
                    row.note.clone()
                } else {
                    String::new()
                },
                outcome,
                simulator_calls: row.simulator_calls,
                cpu_seconds: row.cpu_seconds,
                runs: runs(sources, approach)?,
            })
        })
        .collect()
}

fn runs(sources: &Sources, approach: Approach) -> anyhow::Result<Vec<OptimiserRun>> {
    let of_approach = sources
        .runs
        .iter()
        .filter(|row| names::approach_and_start(row.stream).is_some_and(|(of, _)| of == approach));
    of_approach.map(|row| run(&sources.problem, row)).collect()
}

/// A finished run of an optimiser, for [`report::chart_convergence`].
///
/// # Errors
///
/// The row is not what this version writes.
pub fn run(problem: &Problem, row: &OptimiserRunRow) -> anyhow::Result<OptimiserRun> {
    let run: RunResult = serde_json::from_str(&row.result_json)?;
    let mut restarts: Vec<u64> = run.restarts.iter().map(|(at, _)| *at).collect();
    restarts.extend(problem.campaign().optimise.restart_at.map(u64::from));
    restarts.sort_unstable();
    Ok(OptimiserRun {
        start: run.start as usize + 1,
        best: run.history,
        restarts,
    })
}

fn optimum(
    sources: &Sources,
    row: &OptimumRow,
    design: &Design,
    criteria: &GearCriteria,
) -> Optimum {
    let samples = sources
        .verified
        .get(&row.approach)
        .map_or(&[][..], Vec::as_slice);
    let sampling = &sources.problem.campaign().sampling;
    // Drawings and curves are the built-in model's.
    let built_in = !sources.problem.campaign().is_external();
    let gears = sources.problem.gears().filter(|_| built_in);
    let pair = gears.and_then(|gears| gears.pair(design).ok());
    Optimum {
        variables: design.gears().values(),
        criterion: row.criterion,
        p90: percentile(sampling, samples),
        p90_by_paper_um: sampling
            .papers_estimate(&samples[..samples.len().min(ACCURATE_SAMPLES)])
            .map_or(f64::NAN, |estimate| estimate.p90),
        converged_difference_um: difference_um(&sources.problem, design),
        constraints: Constraints {
            contact_ratio: criteria.contact_ratio,
            specific_slip: criteria.specific_sliding,
            von_mises_mpa: criteria.root_stress_mpa,
            pressure_mpa: criteria.hertz_pressure_mpa,
            interference_margin_mm: criteria
                .clearance_mm
                .iter()
                .chain(&criteria.flank_margin_mm)
                .copied()
                .fold(f64::INFINITY, f64::min),
            further: further(&sources.problem, criteria),
        },
        feasible: row.feasible,
        drawing: pair.as_ref().map(drawing),
        ste: gears
            .zip(pair.as_ref())
            .map(|(gears, pair)| ste(pair, gears.wear())),
        contact: gears
            .zip(pair.as_ref())
            .map(|(gears, pair)| contact(pair, Some(gears.wear()))),
    }
}

/// What is limited besides the columns of the table, in which an interference margin is held against 0.
fn further(problem: &Problem, criteria: &GearCriteria) -> Vec<(NamedValue, bool)> {
    const COLUMNS: [&str; 4] = [
        "contact ratio",
        "specific sliding",
        "root stress",
        "contact pressure",
    ];
    problem
        .constraints(&(*criteria).into())
        .into_iter()
        .filter(|limit| !COLUMNS.contains(&&*limit.name) && limit.limit != 0.0)
        .map(limited)
        .collect()
}

/// The gears of a pair in mesh, for [`report::chart_gears`].
#[must_use]
pub fn drawing(pair: &gear::Pair) -> GearDrawing {
    let geometry = pair.geometry();
    let placements = gear::mesh_placement(pair, 0.0);
    let teeth = geometry.teeth.map(f64::from);
    let outline = |member: Member| {
        let index = member.index();
        let points = gear::gear_outline(pair, member, OUTLINE_POINTS);
        GearOutline {
            outline: points
                .into_iter()
                .map(|point| placements[index].apply(point))
                .collect(),
            centre: placements[index].centre,
            pitch_radius_mm: Some(geometry.centre_distance * teeth[index] / (teeth[0] + teeth[1])),
            base_radius_mm: Some(geometry.r_b[index]),
        }
    };
    let turn = geometry.face_width * geometry.beta.tan();
    GearDrawing {
        pinion: outline(Member::Pinion),
        mate: outline(Member::Gear),
        line_of_action: Some(path_of_contact(geometry)),
        face_width_mm: geometry.face_width,
        // Helices of opposite hands.
        twist_rad: [turn / geometry.r[0], -turn / geometry.r[1]],
    }
}

/// The ends of the path of contact, in the frame of [`gear::mesh_placement`]: pinion axis at the
/// origin, the mate's on the x axis.
fn path_of_contact(geometry: &gear::Geometry) -> [[f64; 2]; 2] {
    let (sin, cos) = geometry.alpha_wt.sin_cos();
    [geometry.s_in, geometry.s_out].map(|s| {
        [
            geometry.r_b[0] * cos + s * sin,
            geometry.r_b[0] * sin - s * cos,
        ]
    })
}

/// Contact pressure over the flank of a pair, with the mean wear or without any, for
/// [`report::chart_contact`].
#[must_use]
pub fn contact(pair: &gear::Pair, wear: Option<&gear::Wear>) -> ContactPattern {
    let geometry = pair.geometry();
    let (start, end, width) = (geometry.s_in, geometry.s_out, geometry.face_width);
    let middles = |low: f64, high: f64, parts: usize| -> Vec<f64> {
        let part = (high - low) / parts as f64;
        (0..parts).map(|k| low + part * (k as f64 + 0.5)).collect()
    };
    let along = middles(start, end, PATTERN_PARTS[0]);
    let path = pair.path();
    let rows = pair.contact_pattern(wear, PATTERN_PARTS[1]);
    let pressure_mpa = along.iter().map(|s| {
        let k = path.partition_point(|at| at < s).clamp(1, path.len() - 1);
        let share = (s - path[k - 1]) / (path[k] - path[k - 1]);
        let both = rows[k - 1].iter().zip(&rows[k]);
        both.map(|(a, b)| a + share * (b - a)).collect()
    });
    // The line of a pair of teeth ends at s on the near side of the face and farther back on the far side.
    let slope = geometry.beta_b.tan();
    let lines = (0..).map(|k| start + (f64::from(k) + 0.5) * geometry.base_pitch);
    let lines = lines.take_while(|s| *s < end + width * slope);
    let from_pitch = |s: f64| s - geometry.s_pitch;
    ContactPattern {
        is_worn: wear.is_some(),
        pressure_mpa: pressure_mpa.collect(),
        place_mm: along.iter().copied().map(from_pitch).collect(),
        across_mm: middles(0.0, width, PATTERN_PARTS[1]),
        lines: lines
            .map(|s| [[0.0, from_pitch(s)], [width, from_pitch(s - width * slope)]])
            .collect(),
    }
}

/// The transmission error of a pair over one mesh period, unworn and with the mean wear, for
/// [`report::chart_ste`].
#[must_use]
pub fn ste(pair: &gear::Pair, wear: &gear::Wear) -> SteCurves {
    let unworn = pair.unworn();
    let worn = pair.archard(wear).analysis;
    // The curve is periodic: its first point again closes the period in the chart.
    let closed = |values: Vec<f64>, end: Option<f64>| -> Vec<f64> {
        let end = end.or_else(|| values.first().copied());
        values.into_iter().chain(end).collect()
    };
    SteCurves {
        phase: closed(unworn.phases, Some(1.0)),
        unworn_um: closed(unworn.ste_um, None),
        worn_um: closed(worn.ste_um, None),
    }
}
