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

/// Gap of the tip corner, in mean deflections, up to which there may be contact beyond the path.
const REACH: f64 = 2.5;
/// Deflection of a pair of steel teeth under an even load of 1 N/mm, mm. Only the reach depends on it.
const TYPICAL_COMPLIANCE: f64 = 1.0 / 14_000.0;
/// Young's modulus of the typical compliance, MPa.
const STEEL: f64 = 206e3;
/// The smallest gap, in modules, up to which there may be contact beyond the path.
const LEAST_REACH: f64 = 1.0 / 300.0;
/// Number of steps of the table of separations.
const STEPS: usize = 60;
/// The end of the table, in base pitches beyond the end of the path.
const TABLE_END: f64 = 0.6;

/// The separation of the tip corners, as tables over the distance beyond both ends of the path.
#[derive(Debug, Clone)]
pub(crate) struct TipSeparation {
    step: f64,
    /// Gap before the start of the path (the gear's tip corner) and after its end (the pinion's),
    /// mm along the flank's normal.
    gap: [Vec<f64>; 2],
    /// The distances before and after the path up to which there may be contact, mm; at most
    /// 0.6 base pitches.
    pub(crate) reach: [f64; 2],
}

impl TipSeparation {
    /// `base_force` is the load on all contact lines, N; `youngs_modulus` in MPa.
    pub(crate) fn new(geometry: &Geometry, base_force: f64, youngs_modulus: f64) -> Self {
        let step = TABLE_END * geometry.base_pitch / STEPS as f64;
        let normal = geometry.beta_b.cos();
        let table = |member| {
            (0..=STEPS)
                .map(|k| normal * separation(geometry, member, step * k as f64))
                .collect()
        };
        let gap: [Vec<f64>; 2] = [table(Member::Gear), table(Member::Pinion)];
        let compliance = TYPICAL_COMPLIANCE * STEEL / youngs_modulus;
        let even = base_force / geometry.face_width * compliance;
        let limit = (REACH * even / (0.8 * geometry.eps_alpha).max(1.0))
            .max(LEAST_REACH * geometry.normal_module);
        let reach = gap.each_ref().map(|gap| {
            let beyond = gap.iter().position(|&g| g > limit).unwrap_or(STEPS);
            step * beyond as f64
        });
        Self { step, gap, reach }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::general;

    /// The corner leaves its path along the tangent of the mate's flank: the separation starts with the
    /// square of the distance, and the mate's flank, turned until it touches the corner, is on it.
    #[test]
    fn tip_corners_part_slowly_from_the_mates_flank() {
        let geometry = Geometry::new(&general::plain()).unwrap();
        for member in Member::BOTH {
            let at = |x: f64| separation(&geometry, member, x);
            assert!(at(0.0).abs() < 1e-12);
            let (near, far) = (at(0.01), at(0.02));
            assert!((far / near - 4.0).abs() < 0.1, "{near} {far}");
            // Turning the mate by the separation over its base radius brings its involute to the corner.
            let (own, mate) = (member.index(), 1 - member.index());
            let (r_b, r_b_mate) = (geometry.r_b[own], geometry.r_b[mate]);
            let end = geometry.tangent_length(
                member,
                if member == Member::Pinion {
                    geometry.s_out
                } else {
                    geometry.s_in
                },
            );
            let x = 0.2 * geometry.base_pitch;
            let involute = |roll: f64, turn: f64, r: f64| {
                // Contact point on the line of action at the roll angle `roll`, turned back with the gear.
                let angle = roll.atan() - roll + turn;
                let radius = r * roll.hypot(1.0);
                [radius * angle.sin(), radius * angle.cos()]
            };
            let corner = involute(end / r_b, (end + x) / r_b, r_b);
            let distance = |roll: f64, turn: f64| {
                let turned = (geometry.path_length - end - x + turn) / r_b_mate;
                let [across, along] = involute(roll, turned, r_b_mate);
                // The mate's axis is at (L, r_b1 + r_b2), its flank faces back.
                let [dx, dy] = [
                    geometry.path_length - across - corner[0],
                    r_b + r_b_mate - along - corner[1],
                ];
                dx.hypot(dy)
            };
            let least = |turn: f64| {
                (0..20_000)
                    .map(|k| distance(f64::from(k) * 1e-4, turn))
                    .fold(f64::INFINITY, f64::min)
            };
            assert!(at(x) > 0.02);
            let apart = least(0.0);
            assert!(
                (apart / at(x) - 1.0).abs() < 0.05,
                "{member}: {apart} {}",
                at(x)
            );
            let closed = least(at(x)).min(least(-at(x)));
            assert!(closed < 2e-3, "{member}: {closed}");
        }
    }
}
