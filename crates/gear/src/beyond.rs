//! Contact beyond the ends of the path: the tip corner of one gear on the flank of its mate.
//!
//! Teeth that bend meet before the path of contact begins and part after it ends. There the tip
//! corner of one gear runs on the mate's flank, and the unloaded flanks are apart by the corner's
//! separation from that flank, which the contact sees as a gap. Lengths are in the transverse
//! section, the gap is along the flank's normal.
//!
//! Left out: the turn of the normal and the change of the lever arm, and the pressure of the corner.

use crate::geometry::Geometry;
use crate::input::Member;

/// Number of steps of the table of separations.
const STEPS: usize = 60;
/// The end of the table, in base pitches beyond the end of the path.
const TABLE_END: f64 = 0.6;

/// The separation of the tip corners, as tables over the distance beyond both ends of the path.
#[derive(Debug, Clone)]
pub(crate) struct Beyond {
    step: f64,
    /// Gap before the start of the path (the gear's tip corner) and after its end (the pinion's),
    /// mm along the flank's normal.
    gap: [Vec<f64>; 2],
}

impl Beyond {
    pub(crate) fn new(geometry: &Geometry) -> Self {
        let step = TABLE_END * geometry.base_pitch / STEPS as f64;
        let normal = geometry.beta_b.cos();
        let table = |member| {
            (0..=STEPS)
                .map(|k| normal * separation(geometry, member, step * k as f64))
                .collect()
        };
        Self {
            step,
            gap: [table(Member::Gear), table(Member::Pinion)],
        }
    }

    /// The distances before and after the path at which the gap has grown to `limit`, mm; at most
    /// 0.6 base pitches.
    pub(crate) fn reach(&self, limit: f64) -> [f64; 2] {
        self.gap.each_ref().map(|gap| {
            let beyond = gap.iter().position(|&g| g > limit).unwrap_or(STEPS);
            self.step * beyond as f64
        })
    }

    /// Gap at the distance `before` mm before the start of the path, or `after` mm after its end; zero
    /// on the path itself.
    pub(crate) fn gap(&self, before: f64, after: f64) -> f64 {
        let (table, distance) = if before > 0.0 {
            (&self.gap[0], before)
        } else if after > 0.0 {
            (&self.gap[1], after)
        } else {
            return 0.0;
        };
        let place = (distance / self.step).min(STEPS as f64);
        let k = (place as usize).min(STEPS - 1);
        table[k] + (place - k as f64) * (table[k + 1] - table[k])
    }
}

/// Separation of the tip corner of `member` from the mate's flank at the distance `x` beyond the end
/// of the path, along the mate's base circle, mm.
fn separation(geometry: &Geometry, member: Member, x: f64) -> f64 {
    let (own, mate) = (member.index(), 1 - member.index());
    let (r_b, r_b_mate) = (geometry.r_b[own], geometry.r_b[mate]);
    let end = match member {
        Member::Pinion => geometry.s_out,
        Member::Gear => geometry.path_length - geometry.s_in,
    };
    // Angle of the corner from the base tangent point's radius: its involute's polar angle and the
    // gear's rotation.
    let theta = (end / r_b).atan() - end / r_b + (end + x) / r_b;
    let radius = r_b.hypot(end);
    // The corner as seen from the mate's axis.
    let (across, along) = (
        radius * theta.sin() - geometry.path_length,
        radius * theta.cos() - (r_b + r_b_mate),
    );
    let distance = across.hypot(along);
    if distance <= r_b_mate {
        // Inside the mate's base circle there is no flank to touch.
        return geometry.base_pitch;
    }
    let roll = ((distance - r_b_mate) * (distance + r_b_mate)).sqrt() / r_b_mate;
    let flank = roll.atan() - roll + (geometry.path_length - end - x) / r_b_mate;
    r_b_mate * (flank - (-across).atan2(-along)).abs()
}
