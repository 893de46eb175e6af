//! What the built-in model draws of a pair of gears.

use gear::Member;

use crate::report::data::{ContactPattern, GearDrawing, GearOutline, SteCurves};

/// Points on each flank of a drawn gear.
const OUTLINE_POINTS: usize = 24;

/// Parts of a flank along the path of contact and across the face in the contact pattern.
const PATTERN_PARTS: [usize; 2] = [30, 20];

/// The gears of a pair in mesh, for [`super::chart_gears`].
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
/// [`super::chart_contact`].
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
/// [`super::chart_ste`].
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
