//! Unit tests of the solver's inner parts, on pairs made for them.

use std::f64::consts::PI;

use crate::general::plain as input;
use crate::geometry::Geometry;
use crate::input::{Discretisation, Member, PairInput, Size, Wear, WearLaw};
use crate::mesh::{Mesh, Scratch};
use crate::pair::Pair;
use crate::path::{Path, Touch, Window};
use crate::tooth::Tooth;
use crate::{Kernel, gear_outline};

fn pair() -> Pair {
    Pair::new(&input(), &Discretisation::default()).expect("the test's pair is feasible")
}

/// A geometry with the given contact ratios; only the fields that the path reads are changed.
fn with_ratios(eps_alpha: f64, eps_beta: f64) -> Geometry {
    let mut geometry = Geometry::new(&input()).expect("the test's pair is feasible");
    geometry.s_out = geometry.s_in + eps_alpha * geometry.base_pitch;
    geometry.face_width = eps_beta * geometry.base_pitch / geometry.beta_b.tan();
    geometry
}

/// Total length of the windows at the phase `phi`, in base pitches.
fn covered(path: &Path, phi: f64) -> f64 {
    let mut windows: Vec<Window> = Vec::new();
    path.windows_at(phi, &mut windows);
    windows
        .iter()
        .map(|w| w.weight * (w.hi.s - w.lo.s))
        .sum::<f64>()
        / path.base_pitch
}

/// Shortest and longest total contact line, in units of p_bt/sin β_b, from the fractional parts of
/// the contact ratios: L_min = ε_α ε_β − n_α n_β + max(0, n_α + n_β − 1), L_max with
/// min(n_α, n_β) instead of the maximum. The mean is ε_α ε_β.
#[test]
fn contact_line_length_extremes() {
    for (eps_alpha, eps_beta, min, max) in [
        (1.293, 0.3636, Some(0.3636), Some(0.6566)),
        // KISSsoft prints 483.685 mm for p_bt = 41.8913 mm and β_b = 9.39129°.
        (
            1.4628,
            1.4213,
            Some(483.685 * 9.391_29_f64.to_radians().sin() / 41.8913),
            None,
        ),
        (1.491_878_5, 1.088_683_9, Some(1.5806), Some(1.6692)),
        (1.66, 1.0, Some(1.66), Some(1.66)),
        (2.0, 0.37, Some(0.74), Some(0.74)),
        (1.7, 1.6, Some(2.6), Some(2.9)),
        (1.3, 7.45, None, None),
        (0.9, 0.35, None, None),
    ] {
        let disc = Discretisation {
            cells: 32,
            phases: 200,
        };
        let path = Path::new(
            &with_ratios(eps_alpha, eps_beta),
            &disc,
            Touch::Everywhere,
            None,
            &[],
            &[],
        );
        let lengths: Vec<f64> = path.phases.iter().map(|&phi| covered(&path, phi)).collect();
        let least = lengths.iter().copied().fold(f64::MAX, f64::min);
        let most = lengths.iter().copied().fold(0.0, f64::max);
        let (na, nb) = (eps_alpha.fract(), eps_beta.fract());
        let base = eps_alpha * eps_beta - na * nb;
        // Phases lie on the kinks of this piecewise-linear function, so its extremes are exact.
        assert!(
            (least - (base + (na + nb - 1.0).max(0.0))).abs() < 1e-9,
            "{least}"
        );
        assert!((most - (base + na.min(nb))).abs() < 1e-9, "{most}");
        // Published to four digits.
        assert!(min.is_none_or(|min| (least - min).abs() < 1e-4));
        assert!(max.is_none_or(|max| (most - max).abs() < 1e-4));
    }
}

/// The windows repeat after one base pitch and cover ε_α ε_β base pitches on average, whether the
/// face is narrow or so wide that pairs covering the whole path are counted instead of listed.
#[test]
fn windows_repeat_after_a_base_pitch() {
    for (eps_alpha, eps_beta) in [(1.4, 0.4), (1.4, 3.7), (0.8, 40.2)] {
        let path = Path::new(
            &with_ratios(eps_alpha, eps_beta),
            &Discretisation::default(),
            Touch::Everywhere,
            None,
            &[],
            &[],
        );
        let (first, last) = (
            covered(&path, 0.0),
            covered(&path, path.base_pitch * (1.0 - 1e-12)),
        );
        assert!((first - last).abs() < 1e-9 * first, "{first} {last}");
        // The mean over a period is ε_α ε_β; the trapezoidal rule is exact between the kinks.
        let count = path.phases.len();
        let mean: f64 = (0..count)
            .map(|k| {
                let next = path.phases.get(k + 1).copied().unwrap_or(path.base_pitch);
                let ends = [path.phases[k], next.min(path.base_pitch * (1.0 - 1e-12))];
                0.5 * (next - path.phases[k])
                    * ends.map(|phi| covered(&path, phi)).iter().sum::<f64>()
            })
            .sum::<f64>()
            / path.base_pitch;
        assert!((mean / (eps_alpha * eps_beta) - 1.0).abs() < 1e-9, "{mean}");
    }
}

#[test]
fn nodes_and_phases_increase() {
    for beta in [0.0, 1e-6, 0.01, 0.3] {
        let mut input = input();
        input.helix_angle = beta;
        let pair = Pair::new(&input, &Discretisation::default()).expect("feasible");
        let path = &pair.mesh.frame.path;
        assert!(path.s.windows(2).all(|w| w[0] < w[1]));
        assert!(path.phases.windows(2).all(|w| w[0] < w[1]));
        assert!(path.phases[0] == 0.0 && path.phases.last().expect("phases") < &path.base_pitch);
    }
}

/// A uniform gap shifts δ by itself and leaves its variation alone.
#[test]
fn uniform_gap_shifts_the_deflection() {
    let pair = pair();
    let mut scratch = Scratch::default();
    let nodes = pair.path().len();
    let unworn = pair.mesh.solve(&vec![0.0; nodes], &mut scratch);
    let before = scratch.delta.clone();
    let gap = 0.02;
    let worn = pair.mesh.solve(&vec![gap; nodes], &mut scratch);
    for (before, after) in before.iter().zip(&scratch.delta) {
        assert!((after - before - gap).abs() < 1e-13);
    }
    assert!(((worn.max - worn.min) - (unworn.max - unworn.min)).abs() < 1e-13);
}

/// Σ ∫ max(0, δ − g)/q ds = F_bt w/b at every phase, integrated independently of prefix sums, for
/// a rough gap that separates in several places.
#[test]
fn load_balance_with_many_valleys() {
    let pair = pair();
    let mesh: &Mesh = &pair.mesh;
    let path = &mesh.frame.path;
    let mean = pair.unworn().ste_um[0] * 1e-3;
    let gap: Vec<f64> = path
        .s
        .iter()
        .enumerate()
        .map(|(k, s)| mean * (1.0 + (3.0 * s).sin() + 0.7 * ((k * k) as f64).sin()).max(0.0))
        .collect();
    let mut scratch = Scratch::default();
    mesh.solve(&gap, &mut scratch);
    let target = pair.base_force() * path.window / pair.geometry().face_width;
    let mut separated = 0;
    for (k, &delta) in scratch.delta.iter().enumerate() {
        let mut force = 0.0;
        for window in path.windows(k) {
            const STEPS: usize = 20_000;
            let h = (window.hi.s - window.lo.s) / STEPS as f64;
            for step in 0..STEPS {
                let place = path.place(window.lo.s + (step as f64 + 0.5) * h);
                let linear =
                    |v: &[f64]| v[place.cell] + place.u * (v[place.cell + 1] - v[place.cell]);
                let closed = delta - linear(&gap);
                separated += usize::from(closed < 0.0);
                force += closed.max(0.0) * linear(&mesh.frame.stiffness) * h;
            }
        }
        // The midpoint rule's error at the kinks of max(0, ·).
        assert!(
            (force / target - 1.0).abs() < 1e-5,
            "phase {k}: {force} against {target}"
        );
    }
    assert!(
        separated > 0,
        "the test's gap should open the contact somewhere"
    );
}

/// In full contact the solution from Newton's method and the ratio of prefix sums agree: a deep
/// gap on one node that no window touches forces the former.
#[test]
fn newton_agrees_with_the_closed_form() {
    let narrow = PairInput {
        face_width: [8.0; 2],
        ..input()
    };
    let pair = Pair::new(&narrow, &Discretisation::default()).expect("feasible");
    let nodes = pair.path().len();
    let mut scratch = Scratch::default();
    let flat = pair.mesh.solve(&vec![0.0; nodes], &mut scratch);
    let mut gap = vec![0.0; nodes];
    // Just above the largest deflection, so that the closed form is refused at every phase.
    let ramp = 1e-7;
    for (k, g) in gap.iter_mut().enumerate() {
        *g = ramp * flat.min * k as f64 / nodes as f64;
    }
    let tilted = pair.mesh.solve(&gap, &mut scratch);
    assert!((tilted.max / flat.max - 1.0).abs() < 2.0 * ramp);
    gap[nodes - 1] = 2.0 * flat.max;
    pair.mesh.solve(&gap, &mut scratch);
    let phases_without_the_end: Vec<usize> = (0..pair.mesh.frame.path.phases.len())
        .filter(|&k| {
            pair.mesh
                .frame
                .path
                .windows(k)
                .iter()
                .all(|w| w.hi.cell + 2 < nodes)
        })
        .collect();
    assert!(!phases_without_the_end.is_empty());
    for k in phases_without_the_end {
        let newton = scratch.delta[k];
        gap[nodes - 1] = 0.0;
        let mut other = Scratch::default();
        pair.mesh.solve(&gap, &mut other);
        gap[nodes - 1] = 2.0 * flat.max;
        assert!((newton / other.delta[k] - 1.0).abs() < 1e-12);
    }
}

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

/// Deep wear of a short range gives a ΔSTE with every kernel.
#[test]
fn wear_of_any_kernel_is_drawn() {
    let pair = pair();
    for &kernel in Kernel::ALL {
        let wear = Wear {
            law: WearLaw::Archard { max_depth_um: 20.0 },
            kernel,
            range: 0.05,
            variance: 0.3,
            life: None,
        };
        let mut sampler = pair.sampler(&wear);
        let mut rng = stats::streams::stream(1, stats::streams::Purpose::Test, 0, 0);
        for _ in 0..50 {
            let draw = sampler.draw(&mut rng);
            assert!(draw.is_finite() && draw > 0.0, "{kernel}: {draw}");
        }
    }
}

#[test]
fn a_draw_is_the_response_at_its_coefficients_and_all_but_linear_in_them() {
    use stats::streams::{Purpose, stream};
    let pair = pair();
    let wear = Wear {
        law: WearLaw::Archard { max_depth_um: 3.5 },
        kernel: Kernel::SquaredExponential,
        range: 0.2,
        variance: 0.01,
        life: None,
    };
    let mut sampler = pair.sampler(&wear);
    let modes = sampler.modes();
    let archard = pair.archard(&wear).analysis.delta_ste_um;
    assert_eq!(sampler.at(&vec![0.0; modes]), archard);
    assert_eq!(sampler.at(&[]), archard, "what is missing is zero");
    let slopes = sampler.slopes();
    let (mut linear, mut rest) = (0.0, 0.0);
    for sample in 0..200 {
        let rng = || stream(1, Purpose::Test, 0, sample);
        let drawn = sampler.draw(&mut rng());
        let coefficients: Vec<f64> = crate::draw_coefficients(&mut rng(), modes).collect();
        assert_eq!(drawn, sampler.at(&coefficients));
        let control: f64 = slopes.iter().zip(&coefficients).map(|(a, b)| a * b).sum();
        linear += control * control;
        rest += (drawn - archard - control).powi(2);
    }
    assert!(rest < 0.1 * linear, "{rest} of {linear}");
}
