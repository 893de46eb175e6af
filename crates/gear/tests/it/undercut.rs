//! Where the involute starts, against a rack that rolls over the gear step by step. The rack knows no
//! trochoid: a point of the flank is cut away if it ever lies inside the rack's tooth.

use std::f64::consts::FRAC_PI_4;

use gear::{Geometry, Infeasibility, PairInput, Size};
use proptest::prelude::*;

use crate::general::{config, plain};

/// Depth of penetration, in modules, that counts as rounding.
const TOUCH: f64 = 1e-12;
/// Positions of the rack, in modules from the middle, among which the deepest penetrations are looked for.
const REACH: f64 = 8.0;
const POSITIONS: usize = 1600;
/// Points of the flank.
const POINTS: usize = 150;

/// A gear of module 1 and the tooth of the rack that cuts the space at its side. The rack lies in the
/// normal section, where its corner is a circle; along the rolling line the transverse section is
/// 1/cos β times as long.
struct RollingRack {
    /// Reference and base radius.
    r: f64,
    r_b: f64,
    /// Half angle of the space at the reference circle.
    half_space: f64,
    tan_alpha_t: f64,
    cos_beta: f64,
    alpha_n: f64,
    /// Centre of the rack's corner, from the middle of the rack's tooth and from the rolling line.
    corner: [f64; 2],
    rho: f64,
}

impl RollingRack {
    /// The rack and the gear of the pinion.
    fn new(input: &PairInput) -> Self {
        let (alpha_n, cos_beta) = (input.pressure_angle, input.helix_angle.cos());
        let tan_n = alpha_n.tan();
        let z = f64::from(input.teeth[0]);
        let r = z / (2.0 * cos_beta);
        let tan_alpha_t = tan_n / cos_beta;
        let (addendum, shift) = (input.tool_addendum[0], input.profile_shift[0]);
        let rho = input.root_radius[0];
        Self {
            r,
            r_b: r * tan_alpha_t.atan().cos(),
            half_space: (FRAC_PI_4 - shift * tan_n) * 2.0 / z,
            tan_alpha_t,
            cos_beta,
            alpha_n,
            corner: [
                FRAC_PI_4 - (addendum - rho) * tan_n - rho / alpha_n.cos(),
                rho - (addendum - shift),
            ],
            rho,
        }
    }

    /// How far the involute's point with the tangent length `t` lies inside the rack's tooth when the rack
    /// has rolled by `u`; negative outside.
    fn penetration(&self, t: f64, u: f64) -> f64 {
        let involute = |tan: f64| tan - tan.atan();
        let angle = self.half_space - involute(self.tan_alpha_t) + involute(t / self.r_b);
        let (sin, cos) = (angle - u / self.r).sin_cos();
        let radius = self.r_b.hypot(t);
        let (x, y) = ((radius * sin + u) * self.cos_beta, radius * cos - self.r);
        // The tooth is all that is within ρ of a sharp wedge with the corner's centres as its corners.
        let (dx, dy) = (x.abs() - self.corner[0], y - self.corner[1]);
        let (sin, cos) = self.alpha_n.sin_cos();
        let (along, across) = (dx * sin + dy * cos, dx * cos - dy * sin);
        let distance = if across <= 0.0 && dy >= 0.0 {
            0.0
        } else if along >= 0.0 {
            across
        } else if dx > 0.0 {
            dx.hypot(dy)
        } else {
            -dy
        };
        self.rho - distance
    }

    /// The deepest penetration of the point over all positions of the rack.
    fn deepest(&self, t: f64) -> f64 {
        let step = 2.0 * REACH / POSITIONS as f64;
        let at = |k: usize| self.penetration(t, k as f64 * step - REACH);
        let mut deepest = f64::NEG_INFINITY;
        let mut values = [at(0), at(1), at(2)];
        for k in 3..=POSITIONS {
            if values[1] >= values[0] && values[1] >= values[2] {
                let middle = (k - 2) as f64 * step - REACH;
                deepest = deepest.max(self.refined(t, middle - step, middle + step));
            }
            values = [values[1], values[2], at(k)];
        }
        deepest
    }

    /// The deepest penetration between two positions with one maximum between them, by golden sections.
    fn refined(&self, t: f64, mut low: f64, mut high: f64) -> f64 {
        let share = (5_f64.sqrt() - 1.0) / 2.0;
        for _ in 0..45 {
            let (a, b) = (high - share * (high - low), low + share * (high - low));
            if self.penetration(t, a) < self.penetration(t, b) {
                low = a;
            } else {
                high = b;
            }
        }
        self.penetration(t, 0.5 * (low + high))
    }

    /// The tangent length at which the flank up to `end` starts, and whether the rack cuts the involute
    /// below it; otherwise the rack does not reach the involute below it. `None` if nothing of the flank is left.
    fn involute_start(&self, end: f64) -> Option<(f64, bool)> {
        let points: Vec<f64> = (0..=POINTS)
            .map(|k| end * (k as f64 + 1e-3) / (POINTS as f64 + 1e-3))
            .collect();
        let missing = |t: f64| self.deepest(t).abs() > TOUCH;
        let last = points.iter().rposition(|&t| missing(t));
        let Some(last) = last else {
            return Some((0.0, false));
        };
        let is_cut = self.deepest(points[last]) > 0.0;
        let (mut low, mut high) = (points[last], *points.get(last + 1)?);
        for _ in 0..30 {
            let middle = 0.5 * (low + high);
            if missing(middle) {
                low = middle;
            } else {
                high = middle;
            }
        }
        Some((high, is_cut))
    }
}

/// Pairs of module 1 with pinions of 8 to 30 teeth; half of them are spur gears. The mate's tip is short,
/// so that it does not reach the pinion's base circle.
fn pinions() -> impl Strategy<Value = PairInput> {
    (
        8_u32..=30,
        -0.5..0.8_f64,
        1.0..1.5_f64,
        0.1..1.0_f64,
        17.0..25.0_f64,
        prop_oneof![Just(0.0), 3.0..32.0_f64],
    )
        .prop_map(|(z, shift, addendum, corner, alpha, beta)| {
            let alpha = f64::to_radians(alpha);
            // The largest corner that the rack's tooth has room for.
            let room = (FRAC_PI_4 - addendum * alpha.tan()) * alpha.cos() / (1.0 - alpha.sin());
            PairInput {
                teeth: [z, 60],
                size: Size::NormalModule(1.0),
                pressure_angle: alpha,
                helix_angle: f64::to_radians(beta),
                profile_shift: [shift, 0.3],
                tool_addendum: [addendum, 1.25],
                tool_dedendum: [1.0, 0.0],
                tip_radius: [0.0; 2],
                root_radius: [corner * room, 0.2],
                ..plain()
            }
        })
}

proptest! {
    #![proptest_config(config(160, 612))]

    #[test]
    fn the_involute_starts_where_the_rolling_rack_leaves_it(input in pinions()) {
        let geometry = Geometry::new(&input);
        let geometry = geometry.map_err(|error| TestCaseError::reject(error.to_string()))?;
        // The tip is not rounded, so that the flank ends where the path does.
        let (start, is_cut) = RollingRack::new(&input)
            .involute_start(geometry.s_out)
            .ok_or_else(|| TestCaseError::fail("the rack leaves no flank"))?;
        let found = geometry.involute_start[0];
        // An undercut crosses the involute, a fillet touches it. Near the base circle both depart from it
        // with the cube of the distance.
        let resolution = match is_cut {
            _ if start.max(found) < 0.01 => 3e-3,
            true => 1e-6,
            false => 2e-4,
        };
        prop_assert!((found - start).abs() < resolution, "{found} {start} {is_cut}");
        prop_assert!(found < 0.01 || geometry.undercut[0] == is_cut, "{found} {is_cut}");
        // The flank margin counts from there, and an undercut cuts the path off there.
        let left = if is_cut { geometry.s_in.max(start) } else { geometry.s_in };
        let margin = geometry.interference().flank_margin[0];
        prop_assert!((margin - (geometry.s_in - start)).abs() < resolution);
        let eps_alpha = (geometry.s_out - left) / geometry.base_pitch;
        prop_assert!((geometry.eps_alpha_left() - eps_alpha).abs() < resolution);
        let ratio = f64::from(input.teeth[0]) / 60.0;
        let root = 1.0 - (geometry.path_length - left) * ratio / left;
        let steepness = geometry.path_length * ratio / (left * left);
        let sliding = geometry.sliding().pinion_root;
        prop_assert!((sliding - root).abs() < 2.0 * steepness * resolution, "{sliding} {root}");
    }
}

/// A pinion of 12 teeth with an addendum of 1.4 modules of the tool. The rolling rack leaves the involute at
/// 0.552958 modules.
fn undercut_pair() -> PairInput {
    PairInput {
        teeth: [12, 30],
        size: Size::NormalModule(3.0),
        pressure_angle: 20_f64.to_radians(),
        helix_angle: 0.0,
        face_width: [20.0; 2],
        profile_shift: [0.0; 2],
        tool_addendum: [1.4, 1.25],
        tool_dedendum: [1.0, 0.64],
        tip_radius: [0.0; 2],
        root_radius: [1.14; 2],
        pinion_torque: 20e3,
        ..plain()
    }
}

#[test]
fn an_undercut_takes_margin_contact_ratio_and_sliding() {
    let geometry = Geometry::new(&undercut_pair()).unwrap();
    let close = |found: f64, expected: f64, error: f64| {
        assert!((found - expected).abs() < error, "{found} {expected}");
    };
    assert_eq!(geometry.undercut, [true, false]);
    close(geometry.involute_start[0], 3.0 * 0.552_958, 5e-5);
    // L = 63 sin 20° = 21.5473 and s_in = L − √(46.92² − (45 cos 20°)²) = 1.2159.
    close(geometry.s_in, 1.2159, 5e-5);
    close(geometry.interference().flank_margin[0], -0.443, 5e-4);
    close(geometry.eps_alpha, 1.2680, 5e-5);
    close(geometry.eps_alpha_left(), 1.2180, 5e-5);
    // 1 − (L − T)/(2.5 T) with T = 1.65887 at the undercut's end instead of s_in.
    let sliding = geometry.sliding();
    close(sliding.pinion_root, -3.7957, 2e-4);
    close(sliding.gear_tip, 0.79148, 2e-5);
    close(sliding.max, 3.7957, 2e-4);
    let whole = geometry.sliding_between([geometry.s_in, geometry.s_out]);
    close(whole.pinion_root, -5.6886, 5e-4);
    assert_eq!(
        (sliding.pinion_tip, sliding.gear_root),
        (whole.pinion_tip, whole.gear_root)
    );
}

#[test]
fn a_flank_that_the_rack_cuts_away_is_refused() {
    let input = PairInput {
        tool_addendum: [1.9, 1.25],
        tip_diameter: [Some(34.4), None],
        root_radius: [0.1, 1.14],
        ..undercut_pair()
    };
    let Err(Infeasibility::NoInvoluteFlank { start, end, .. }) = Geometry::new(&input) else {
        panic!("{:?}", Geometry::new(&input));
    };
    assert!(start > end && end > 0.0, "{start} {end}");
    let in_modules = PairInput {
        size: Size::NormalModule(1.0),
        root_radius: [0.1 / 3.0, 0.38],
        ..input
    };
    let rack = RollingRack::new(&in_modules);
    assert_eq!(rack.involute_start(end / 3.0), None);
}
