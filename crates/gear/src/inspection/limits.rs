//! The limits of a data sheet's measures that follow from allowances.

use super::{Sheet, base_tangent_length, over_balls};
use crate::geometry::Geometry;
use crate::input::Member;
use crate::unloaded::UnloadedPair;

/// Permitted deviations of a pair from its nominal dimensions, mm. Arrays are [pinion, mate].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Allowances {
    /// Upper and lower allowances E_sns and E_sni of the normal tooth thickness; negative where teeth are thinner.
    pub tooth_thickness: [[f64; 2]; 2],
    /// Tolerance ± of the centre distance.
    pub centre_distance: f64,
}

/// Upper and lower limits, mm, of a pair's measures. Arrays are [pinion, mate].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Normal tooth thicknesses at the reference circles s_n.
    pub tooth_thickness: [[f64; 2]; 2],
    /// Base tangent lengths W_k over the sheet's number of teeth; absent where no span can be measured.
    pub span: [Option<[f64; 2]>; 2],
    /// Dimensions over the sheet's balls M_dK; absent where no common ball touches the flanks.
    pub over_balls: [Option<[f64; 2]>; 2],
    /// Normal backlash j_bn: the greatest is that of the thinnest teeth and the greatest distance. Changes of the
    /// working pressure angle within the tolerance are neglected.
    pub normal_backlash: [f64; 2],
}

impl Limits {
    /// The limits of the measures in `sheet`, which is that of `pair`.
    #[must_use]
    pub fn new(pair: &UnloadedPair, sheet: &Sheet, allowances: &Allowances) -> Self {
        let g = pair.geometry();
        let thickness = allowances.tooth_thickness;
        let limits = |i: usize, of: &dyn Fn(&Geometry) -> f64| {
            thickness[i].map(|allowance| of(&thicker(g, i, allowance)))
        };
        let span = Member::BOTH.map(|member| {
            let teeth = sheet.span[member.index()]?.teeth;
            Some(limits(member.index(), &|g| {
                base_tangent_length(g, member, teeth)
            }))
        });
        let over = Member::BOTH.map(|member| {
            let ball = sheet.over_balls[member.index()]?.ball;
            Some(limits(member.index(), &|g| over_balls(g, member, ball)))
        });
        let distance = 2.0 * allowances.centre_distance * g.alpha_wt.sin() * g.beta_b.cos();
        let backlash = |limit: usize, distance: f64| {
            let lost = thickness[0][limit] + thickness[1][limit];
            sheet.normal_backlash - lost * g.alpha_n.cos() + distance
        };
        Self {
            tooth_thickness: [0, 1].map(|i| thickness[i].map(|one| sheet.tooth_thickness[i] + one)),
            span,
            over_balls: over,
            normal_backlash: [backlash(1, distance), backlash(0, -distance)],
        }
    }
}

/// The geometry with normal teeth of gear `i` that are thicker by `allowance` mm at the reference circle.
fn thicker(geometry: &Geometry, i: usize, allowance: f64) -> Geometry {
    let mut changed = geometry.clone();
    changed.psi_b[i] += allowance / (2.0 * geometry.r[i] * geometry.beta.cos());
    changed
}
