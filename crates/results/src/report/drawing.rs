//! Drawings and curves of a pair of gears, by the built-in model.

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use gear::Member;
use gear::inspection::{active_path, form_radii};
use problem::Approach;
use stages::optima::Optimum;

use super::torque::{RandomFlanks, TorqueCurves, over_torque};
use crate::finer_grid::difference_um;
use crate::snapshot::Snapshot;

/// Points on each flank of a drawn gear.
const OUTLINE_POINTS: usize = 24;

/// Depth of a magnified tip relief, in modules.
const RELIEF_DEPTH: f64 = 0.15;

/// Parts of a flank along the path of contact and across the face in the contact pattern.
const PATTERN_PARTS: [usize; 2] = [90, 60];
/// Parts of the face between whose middles the pattern is linear; the model's slices are not much narrower.
const FACE_PARTS: usize = 20;

/// Drawings and curves of a pair.
#[derive(Debug, Clone, PartialEq)]
pub struct Illustration {
    /// The measure on a finer grid less that on the campaign's grid, from the same wear, µm.
    pub grid_difference_um: Option<f64>,
    /// The gears in mesh.
    pub drawing: GearDrawing,
    /// Static transmission error over one mesh period.
    pub ste: SteCurves,
    /// Contact pressure over the flank.
    pub contact: Option<ContactPattern>,
    /// ΔSTE over the torque.
    pub torque: Option<TorqueCurves>,
}

/// Two gears in mesh, positioned in one transverse plane; all lengths in mm, y upwards.
#[derive(Debug, Clone, PartialEq)]
pub struct GearDrawing {
    pub pinion: GearOutline,
    pub mate: GearOutline,
    /// Ends of the path of contact.
    pub line_of_action: Option<[[f64; 2]; 2]>,
    /// Face width, mm.
    pub face_width_mm: f64,
    /// Rotation of the far end of the face against the near one, for pinion and mate, radians anticlockwise;
    /// zero for spur gears.
    pub twist_rad: [f64; 2],
    /// The flanks with their tip relief, magnified; `None` without any.
    pub relief: Option<MagnifiedRelief>,
}

/// Flanks with a tip relief that would be too small to see at the scale of the gears.
#[derive(Debug, Clone, PartialEq)]
pub struct MagnifiedRelief {
    /// By how much the depth is magnified.
    pub factor: f64,
    /// The relieved parts of the flanks of pinion and mate, in the frame of the drawing.
    pub flanks: [Vec<Vec<[f64; 2]>>; 2],
}

/// One gear's outline.
#[derive(Debug, Clone, PartialEq)]
pub struct GearOutline {
    /// Points of the outline in order: all round the gear, or the teeth near the contact only.
    pub outline: Vec<[f64; 2]>,
    /// Centre of the gear.
    pub centre: [f64; 2],
    /// Radius of the operating pitch circle.
    pub pitch_radius_mm: Option<f64>,
    /// Radius of the base circle.
    pub base_radius_mm: Option<f64>,
}

/// Static transmission error over one mesh period.
#[derive(Debug, Clone, PartialEq)]
pub struct SteCurves {
    /// Mesh phase as a share of the period, usually 0 to 1.
    pub phase: Vec<f64>,
    /// STE of the unworn gears at each phase, µm; may be empty.
    pub unworn_um: Vec<f64>,
    /// STE with Archard's wear at each phase, µm; may be empty.
    pub worn_um: Vec<f64>,
    /// ΔSTE of the unworn and the worn gears, µm. Extremes lie between the phases, so that it is more than the
    /// curves show.
    pub delta_um: [f64; 2],
}

/// Contact pressure along the path of contact.
#[derive(Debug, Clone, PartialEq)]
pub struct PressureCurves {
    /// Places on the path of contact, mm from the pitch point; negative where the pinion's root is
    /// in contact.
    pub place_mm: Vec<f64>,
    /// Largest pressure over the mesh period at each place on unworn flanks, MPa; may be empty.
    pub unworn_mpa: Vec<f64>,
    /// Largest pressure with Archard's wear, MPa; may be empty.
    pub worn_mpa: Vec<f64>,
}

/// The profile of one gear between its active diameters: its modification and its wear.
#[derive(Debug, Clone, PartialEq)]
pub struct FlankProfile {
    /// `pinion` or `mate`.
    pub gear: &'static str,
    /// Active root and tip diameter, mm.
    pub diameters_mm: [f64; 2],
    /// Roll angles, degrees.
    pub roll_angle_deg: Vec<f64>,
    /// Depth of the tip relief, µm normal to the flank.
    pub modification_um: Vec<f64>,
    /// Depth of the mean wear, µm; may be empty.
    pub wear_um: Vec<f64>,
}

/// Contact pressure over the flank of one tooth.
#[derive(Debug, Clone, PartialEq)]
pub struct ContactPattern {
    /// Whether the flanks have the mean wear.
    pub is_worn: bool,
    /// Middles of even parts of the path of contact, mm from the pitch point; negative where the pinion's
    /// root is in contact.
    pub place_mm: Vec<f64>,
    /// Middles of even parts of the face, mm.
    pub across_mm: Vec<f64>,
    /// Pressure when the line of contact passes, MPa: a row for each place on the path.
    pub pressure_mpa: Vec<Vec<f64>>,
    /// The greatest pressure of the pair, MPa, as its constraint states it.
    pub peak_mpa: f64,
    /// The lines of contact at one moment: place across the face and place on the path of both ends.
    pub lines: Vec<[[f64; 2]; 2]>,
}

/// Drawings and curves of the optima; empty for an external simulator.
pub(super) fn illustrations(snapshot: &Snapshot) -> BTreeMap<Approach, Illustration> {
    let problem = &snapshot.problem;
    let built_in = !problem.campaign().is_external();
    let Some(gears) = problem.gears().filter(|_| built_in) else {
        return BTreeMap::new();
    };
    let random = RandomFlanks {
        scatter: gears.scatter(),
        seed: problem.campaign().seed,
        samples: u32::MAX,
    };
    let illustration = |optimum: &Optimum| {
        let found = optimum.found.as_ref().ok()?;
        let pair = gears.pair(&found.design).ok()?;
        let illustration = Illustration {
            grid_difference_um: difference_um(problem, &found.design),
            drawing: drawing(&pair),
            ste: ste(&pair, gears.wear()),
            contact: Some(contact(&pair, Some(gears.wear()))),
            torque: Some(over_torque(&pair, Some(gears.wear()), Some(random))),
        };
        Some((optimum.approach, illustration))
    };
    let optima = snapshot.optima.iter();
    optima
        .filter_map(|verified| illustration(&verified.optimum))
        .collect()
}

/// The gears of a pair in mesh, for [`charts::gears`](super::charts::gears).
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
        relief: magnified_relief(pair),
    }
}

/// The relieved flanks of all teeth, magnified by a round factor so that the greatest relief is at most 0.15
/// modules deep.
fn magnified_relief(pair: &gear::Pair) -> Option<MagnifiedRelief> {
    let amounts = pair.corrections().tip_relief.into_iter().flatten();
    let amount = amounts.map(|relief| relief.amount).fold(0.0, f64::max);
    let wanted = RELIEF_DEPTH * pair.geometry().normal_module / amount;
    let factor = [200.0, 100.0, 50.0, 20.0, 10.0, 5.0, 2.0]
        .into_iter()
        .find(|factor| amount > 0.0 && *factor <= wanted)?;
    let placements = gear::mesh_placement(pair, 0.0);
    let flanks = Member::BOTH.map(|member| {
        let profile = gear::tooth_profile(pair, member, OUTLINE_POINTS);
        let relieved = profile.chunk_by(|a, b| (a.depth > 0.0) == (b.depth > 0.0));
        let relieved = relieved.filter(|part| part[0].depth > 0.0);
        let flanks: Vec<Vec<[f64; 2]>> = relieved
            .map(|part| {
                let magnified = |point: &gear::ProfilePoint| {
                    [0, 1]
                        .map(|k| point.nominal[k] + factor * (point.modified[k] - point.nominal[k]))
                };
                part.iter().map(magnified).collect()
            })
            .collect();
        let teeth = pair.geometry().teeth[member.index()];
        let turns = (0..teeth).map(|k| TAU * f64::from(k) / f64::from(teeth));
        let placed = turns.flat_map(|turn| {
            let (sin, cos) = turn.sin_cos();
            let place = move |[x, y]: [f64; 2]| {
                placements[member.index()].apply([x * cos - y * sin, x * sin + y * cos])
            };
            let place_all = move |flank: &Vec<[f64; 2]>| flank.iter().copied().map(place).collect();
            flanks.iter().map(place_all).collect::<Vec<_>>()
        });
        placed.collect()
    });
    Some(MagnifiedRelief { factor, flanks })
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
/// [`charts::contact`](super::charts::contact).
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
    let across = middles(0.0, width, PATTERN_PARTS[1]);
    let columns = middles(0.0, width, FACE_PARTS);
    let rows = pair.contact_pattern(wear, FACE_PARTS);
    let pressure_mpa = along.iter().map(|s| {
        let (k, share) = place(path, *s);
        let both = rows[k - 1].iter().zip(&rows[k]);
        let row: Vec<f64> = both.map(|(a, b)| a + share * (b - a)).collect();
        let at = |z: &f64| {
            let (k, share) = place(&columns, *z);
            row[k - 1] + share * (row[k] - row[k - 1])
        };
        across.iter().map(at).collect()
    });
    // The line of a pair of teeth ends at s on the near side of the face and farther back on the far side.
    let slope = geometry.beta_b.tan();
    let lines = (0..).map(|k| start + (f64::from(k) + 0.5) * geometry.base_pitch);
    let lines = lines.take_while(|s| *s < end + width * slope);
    let from_pitch = |s: f64| s - geometry.s_pitch;
    let analysis = match wear {
        Some(wear) => pair.archard(wear).analysis,
        None => pair.unworn(),
    };
    ContactPattern {
        is_worn: wear.is_some(),
        peak_mpa: analysis.hertz_pressure_mpa,
        pressure_mpa: pressure_mpa.collect(),
        across_mm: across.clone(),
        place_mm: along.iter().copied().map(from_pitch).collect(),
        lines: lines
            .map(|s| [[0.0, from_pitch(s)], [width, from_pitch(s - width * slope)]])
            .collect(),
    }
}

/// The profiles of pinion and mate, with the mean wear at the places of the pair's path, mm, if it is given, for
/// [`charts::profile`](super::charts::profile).
#[must_use]
pub fn profiles(pair: &gear::Pair, wear: Option<&[Vec<f64>; 2]>) -> [FlankProfile; 2] {
    let geometry = pair.geometry();
    let active = active_path(geometry, form_radii(geometry));
    let places = pair.path().iter().copied().enumerate();
    let places: Vec<(usize, f64)> = places
        .filter(|(_, s)| (active.s_in..=active.s_out).contains(s))
        .collect();
    Member::BOTH.map(|member| {
        let i = member.index();
        let relief = pair.corrections().tip_relief[i];
        let from_tip = |s: f64| [geometry.s_out - s, s - geometry.s_in][i];
        let depth = |s| relief.map_or(0.0, |relief| 1e3 * relief.depth(from_tip(s)));
        FlankProfile {
            gear: ["pinion", "mate"][i],
            diameters_mm: [2.0 * active.r_nf[i], 2.0 * active.r_na[i]],
            roll_angle_deg: places
                .iter()
                .map(|&(_, s)| geometry.roll_angle(member, s).to_degrees())
                .collect(),
            modification_um: places.iter().map(|&(_, s)| depth(s)).collect(),
            wear_um: wear.map_or_else(Vec::new, |depths| {
                places.iter().map(|&(k, _)| 1e3 * depths[i][k]).collect()
            }),
        }
    })
}

/// The number of the place after `at`, and the share of the way to it from the place before; beyond the ends, 0 or 1.
fn place(places: &[f64], at: f64) -> (usize, f64) {
    let after = places
        .partition_point(|place| *place < at)
        .clamp(1, places.len() - 1);
    let share = (at - places[after - 1]) / (places[after] - places[after - 1]);
    (after, share.clamp(0.0, 1.0))
}

/// The transmission error of a pair over one mesh period, unworn and with the mean wear, for
/// [`charts::ste`](super::charts::ste).
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
        delta_um: [unworn.delta_ste_um, worn.delta_ste_um],
        phase: closed(unworn.phases, Some(1.0)),
        unworn_um: closed(unworn.ste_um, None),
        worn_um: closed(worn.ste_um, None),
    }
}
