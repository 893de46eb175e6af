//! Unit tests of the solver's inner parts, on pairs made for them.

use crate::Kernel;
use crate::general::plain as input;
use crate::geometry::Geometry;
use crate::input::{Discretisation, PairInput, Wear, WearLaw};
use crate::mesh::{Mesh, Scratch};
use crate::pair::Pair;
use crate::path::{Path, Touch, Window};

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
