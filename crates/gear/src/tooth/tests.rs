//! Teeth against independent figures: the rolling rack, sums over the drawn outline, another integration.

use std::f64::consts::PI;

use super::Tooth;
use crate::gear_outline;
use crate::general::plain as input;
use crate::geometry::Geometry;
use crate::input::{Discretisation, Member, Size};
use crate::pair::Pair;

/// The fillet is where the rack corner has been: rolling the rack, no corner circle ever reaches
/// deeper into the tooth, and at some position it touches.
#[test]
fn fillet_is_the_envelope_of_the_rack_corner() {
    for (teeth, shift, addendum, rho) in [
        (23, 0.2, 1.25, 0.6),
        (12, 0.0, 1.25, 0.5),
        (40, -0.4, 1.4, 0.3),
        (23, 1.2, 1.0, 0.8),
    ] {
        let mut input = input();
        (input.teeth[0], input.profile_shift[0]) = (teeth, shift);
        (input.tool_addendum[0], input.root_radius[0]) = (addendum, rho);
        (input.helix_angle, input.tool_dedendum[1]) = (0.0, 0.6);
        let geometry = Geometry::new(&input).expect("feasible");
        let tooth = Tooth::new(&input, &geometry, Member::Pinion).expect("feasible");
        let (m, r) = (geometry.normal_module, geometry.r[0]);
        let depth = m * (addendum - shift) - rho;
        let tan = input.pressure_angle.tan();
        let half_width =
            PI * m / 4.0 - (addendum * m - rho) * tan - rho / input.pressure_angle.cos();
        let [(fillet, [start, end]), _] = tooth.pieces();
        for k in 0..9 {
            let (x, y) = fillet(start + (end - start) * f64::from(k) / 8.0);
            let mut nearest = f64::MAX;
            for k in -40_000..40_000 {
                let roll = f64::from(k) * 3e-5;
                // The corner's centre in the gear's frame when the rack has moved by r·roll.
                let along = PI * m / 2.0 - half_width + r * roll;
                let up = r - depth;
                let (sin, cos) = roll.sin_cos();
                let (cx, cy) = (along * cos - up * sin, along * sin + up * cos);
                nearest = nearest.min((x - cx).hypot(y - cy));
            }
            // The roll step of 3e-5 rad resolves the nearest approach to about 1e-7 mm.
            assert!(
                (nearest - rho).abs() < 1e-6,
                "{teeth} teeth: {nearest} against {rho}"
            );
        }
    }
}

/// The running moments against a fine trapezoidal sum over the drawn outline of a spur tooth.
#[test]
fn bending_compliance_agrees_with_the_outline() {
    // 4000 points on each curve: the trapezoidal rule is good to about 1e-6.
    let pair = outline_compliance([23, 37], [0.2, 0.1], [1.0, 1.0], 1e-5);
    assert!(pair.geometry().undercut == [false; 2] && pair.geometry().pointed == [false; 2]);
    // The drawing of an undercut tooth leaves out up to eight steps of the trochoid's last part.
    let pair = outline_compliance([12, 37], [-0.1, 0.1], [1.0, 0.6], 1e-3);
    assert!(pair.geometry().undercut[0]);
    let pair = outline_compliance([17, 37], [0.9, 0.1], [1.3, 0.8], 1e-5);
    assert!(pair.geometry().pointed[0]);
}

fn outline_compliance(teeth: [u32; 2], shift: [f64; 2], tip: [f64; 2], tolerance: f64) -> Pair {
    let mut input = input();
    input.helix_angle = 0.0;
    input.tip_radius = [0.0; 2];
    (input.teeth, input.profile_shift, input.tool_dedendum) = (teeth, shift, tip);
    let pair = Pair::new(&input, &Discretisation::default()).expect("feasible");
    for member in Member::BOTH {
        let i = member.index();
        let outline = gear_outline(&pair, member, 4000);
        let g = pair.geometry();
        // The first tooth's right flank: up from the root circle's end to the tip's land.
        let root_end = outline
            .iter()
            .position(|p| p[0].hypot(p[1]) > g.r_f[i] * (1.0 + 1e-9));
        let start = root_end.expect("the outline leaves the root circle") - 1;
        let flank: Vec<[f64; 2]> = outline[start..]
            .iter()
            .copied()
            .take_while(|p| p[0].hypot(p[1]) < g.r_a[i] - 1e-9)
            .collect();
        for fraction in [0.3, 0.6, 0.9] {
            let s = g.s_in + fraction * (g.s_out - g.s_in);
            let tau = g.tangent_length(member, s);
            let r = g.r_b[i].hypot(tau);
            let t = tau / g.r_b[i];
            let alpha_f = t.atan() - (g.psi_b[i] - (t - t.atan()));
            let top = g.r_b[i] / alpha_f.cos();
            let integral: f64 = flank
                .windows(2)
                .filter(|w| w[1][1] <= top)
                .map(|w| {
                    let f = |p: [f64; 2]| (top - p[1]).powi(2) / (2.0 * p[0]).powi(3);
                    0.5 * (f(w[0]) + f(w[1])) * (w[1][1] - w[0][1])
                })
                .sum();
            let material = input.material[member.index()];
            let nu = material.poisson_ratio;
            let expected = alpha_f.cos().powi(2) * 12.0 * (1.0 - nu * nu)
                / material.youngs_modulus_mpa
                * integral;
            let ours = pair.tooth_compliance(member, r);
            assert!(
                (ours / expected - 1.0).abs() < tolerance,
                "{teeth:?} {member}: {ours} against {expected}"
            );
        }
    }
    pair
}

/// M2 = ∫ (Y − y)²/(2x)³ dy and ∫ dy/(2x) below the height `top`, by trapezoidal sums over ever more
/// points of the outline, extrapolated (Romberg): nothing in common with the adaptive rule but the
/// outline. The second pair is the change in the last step.
fn romberg(tooth: &Tooth, top: f64) -> ([f64; 2], [f64; 2]) {
    let (mut sums, mut changes) = ([0.0; 2], [0.0; 2]);
    for (curve, [from, mut to]) in tooth.pieces() {
        if curve(from).1 >= top {
            continue;
        }
        if curve(to).1 > top {
            let mut below = from;
            for _ in 0..60 {
                let middle = 0.5 * (below + to);
                *(if curve(middle).1 > top {
                    &mut to
                } else {
                    &mut below
                }) = middle;
            }
        }
        let trapezoid = |count: i32| {
            let mut last: Option<(f64, [f64; 2])> = None;
            let mut sum = [0.0; 2];
            for k in 0..=count {
                // Denser upwards, where the tooth is thin.
                let part = 1.0 - (1.0 - f64::from(k) / f64::from(count)).powi(3);
                let (x, y) = curve(from + (to - from) * part);
                let f = [(top - y).powi(2) / (2.0 * x).powi(3), 0.5 / x];
                if let Some((y0, f0)) = last {
                    for i in 0..2 {
                        sum[i] += 0.5 * (f[i] + f0[i]) * (y - y0);
                    }
                }
                last = Some((y, f));
            }
            sum
        };
        let mut row = [256, 512, 1024, 2048].map(trapezoid).to_vec();
        let mut power = 4.0;
        let mut last = row[3];
        while row.len() > 1 {
            last = row[row.len() - 1];
            row = row
                .windows(2)
                .map(|w| [0, 1].map(|i| (power * w[1][i] - w[0][i]) / (power - 1.0)))
                .collect();
            power *= 4.0;
        }
        for i in 0..2 {
            sums[i] += row[0][i];
            changes[i] += (row[0][i] - last[i]).abs();
        }
    }
    (sums, changes)
}

/// The adaptive quadrature against an independent integration over the same outline, for teeth of
/// the paper's box and general ones, undercut and pointed ones among them: the tolerance that the
/// documentation of `quadrature` states.
#[test]
fn quadrature_along_the_tooth_keeps_its_tolerance() {
    use rand::RngExt as _;
    let mut rng = stats::streams::stream(3, stats::streams::Purpose::Test, 0, 0);
    let mut errors = Vec::new();
    let (mut undercut, mut pointed, mut unclear) = (0, 0, 0);
    while errors.len() < 3000 {
        let mut input = input();
        if rng.random::<bool>() {
            input.teeth = [20, 22];
            input.size = Size::CentreDistance(110.0);
            input.pressure_angle = 18_f64.to_radians();
            input.helix_angle = rng.random_range(0.0..0.53);
        } else {
            input.teeth = [0, 1].map(|_| rng.random_range(10..90));
            input.helix_angle = rng.random_range(-0.6..0.6);
        }
        for i in 0..2 {
            input.profile_shift[i] = rng.random_range(-1.0..2.0);
            input.tool_addendum[i] = rng.random_range(0.8..1.7);
            input.tool_dedendum[i] = rng.random_range(0.8..1.7);
            input.root_radius[i] = rng.random_range(0.02..0.8);
            input.tip_radius[i] = 0.0;
        }
        let Ok(geometry) = Geometry::new(&input) else {
            continue;
        };
        for member in Member::BOTH {
            let Ok(tooth) = Tooth::new(&input, &geometry, member) else {
                continue;
            };
            let i = member.index();
            undercut += u32::from(geometry.undercut[i]);
            pointed += u32::from(geometry.pointed[i]);
            for fraction in [0.0, 0.3, 0.7, 0.9, 1.0] {
                let s = geometry.s_in + fraction * (geometry.s_out - geometry.s_in);
                let r = geometry.r_b[i].hypot(geometry.tangent_length(member, s));
                let top = tooth.load_at_radius(r).y_l;
                // A load line that crosses the axis below the root circle bends nothing.
                if top <= tooth.pieces()[0].0(0.0).1 {
                    assert_eq!(tooth.integrals(top), (0.0, 0.0));
                    continue;
                }
                let (m2, n0) = tooth.integrals(top);
                let (sums, changes) = romberg(&tooth, top);
                for (ours, (sum, change)) in [m2, n0].into_iter().zip(sums.into_iter().zip(changes))
                {
                    unclear += u32::from(change > 1e-9 * sum);
                    errors.push((ours / sum - 1.0).abs());
                }
            }
        }
    }
    errors.sort_by(f64::total_cmp);
    let quantile = |p: f64| errors[((errors.len() - 1) as f64 * p) as usize];
    assert!(
        undercut > 30 && pointed > 30,
        "{undercut} undercut, {pointed} pointed"
    );
    assert_eq!(unclear, 0, "the reference itself should stand still");
    // Measured: 4e-13, 4e-10 and 3e-9.
    assert!(quantile(0.5) < 1e-11, "{}", quantile(0.5));
    assert!(quantile(0.99) < 1e-9, "{}", quantile(0.99));
    assert!(quantile(1.0) < 1e-8, "{}", quantile(1.0));
}

/// The outline runs without gaps or folds from the root over fillet, flank and rounding to the
/// tip circle, and the rounding meets the flank in its tangent.
#[test]
fn outline_is_smooth() {
    for (teeth, shift, rounding) in [
        (23, 0.2, 0.4),
        (60, -0.3, 0.2),
        (23, 0.9, 0.0),
        (30, 0.6, 1.2),
    ] {
        let mut input = input();
        (input.teeth[0], input.profile_shift[0]) = (teeth, shift);
        input.tip_radius[0] = rounding;
        let pair = Pair::new(&input, &Discretisation::default()).expect("feasible");
        let g = pair.geometry();
        let outline = gear_outline(&pair, Member::Pinion, 200);
        let half = outline.len() / (2 * teeth as usize);
        let polar: Vec<(f64, f64)> = outline[..half]
            .iter()
            .map(|[x, y]| (x.hypot(*y), x.atan2(*y)))
            .collect();
        for (a, b) in polar.iter().zip(&polar[1..]) {
            assert!(
                b.0 >= a.0 - 1e-9 && b.1 <= a.1 + 1e-9,
                "{teeth}: {a:?} {b:?}"
            );
        }
        for (a, b) in outline.iter().zip(&outline[1..]) {
            let step = (a[0] - b[0]).hypot(a[1] - b[1]);
            assert!(step < 0.05 * g.normal_module, "{teeth}: a gap of {step}");
        }
        assert!((polar[0].0 - g.r_f[0]).abs() < 1e-9);
        if rounding < 1.0 {
            assert!((polar[half - 1].0 - g.r_a[0]).abs() < 1e-9);
        }
        // No corner: directions of neighbouring steps differ by the curvature only.
        let flank: Vec<[f64; 2]> = outline[..half]
            .iter()
            .zip(&outline[1..])
            .filter(|(a, b)| (a[0] - b[0]).hypot(a[1] - b[1]) > 1e-9)
            .map(|(a, b)| [b[0] - a[0], b[1] - a[1]])
            .collect();
        for (a, b) in flank.iter().zip(&flank[1..]).take(flank.len() - 2) {
            let turn = (a[0] * b[1] - a[1] * b[0])
                .atan2(a[0] * b[0] + a[1] * b[1])
                .abs();
            assert!(
                turn < 0.1 || rounding == 0.0 || rounding > 1.0,
                "{teeth}: a corner of {turn}"
            );
        }
    }
}
