//! Invariants of the loaded contact over general pairs, where they need the solver's inner parts:
//! arbitrary gaps, places between the phases, contact ratios chosen freely. The others are in
//! `tests/it/invariants.rs`.

use proptest::prelude::*;
use stats::streams::{Purpose, stream};

use crate::corrections::Lead;
use crate::general::{self, config, feasible};
use crate::geometry::Geometry;
use crate::input::{
    Discretisation, Kernel, LocalAmount, Member, PairInput, ToothModel, Wear, WearLaw,
};
use crate::mesh::{Mesh, Scratch};
use crate::pair::Pair;
use crate::path::{Path, Touch, Window};

/// General pairs whose teeth are slices, of every tooth model with slices.
fn pairs() -> impl Strategy<Value = PairInput> {
    let sliced = prop::sample::select(vec![
        ToothModel::HertzBeam,
        ToothModel::WeberBanaschek,
        ToothModel::PrismaticBeam,
    ]);
    (general::pairs(), sliced).prop_map(|(input, tooth_model)| PairInput {
        tooth_model,
        ..input
    })
}

/// General pairs with teeth of every model.
fn all_pairs() -> impl Strategy<Value = PairInput> {
    (pairs(), any::<bool>()).prop_map(|(input, whole)| {
        if whole {
            PairInput {
                tooth_model: ToothModel::WholeFaceBeam,
                ..input
            }
        } else {
            input
        }
    })
}

/// A gap of two waves, up to `most` of the pair's mean deflection, at least zero.
fn waves(pair: &Pair, most: f64, a: f64, b: f64) -> Vec<f64> {
    let ste = pair.unworn().ste_um;
    let mean = ste.iter().sum::<f64>() / ste.len() as f64 / pair.to_ste_um(1.0);
    let path = &pair.mesh.frame.path;
    let phase = |s: f64| (s - path.s_in) / path.base_pitch;
    path.nodes()
        .iter()
        .map(|&s| {
            let wave = (9.0 * a * phase(s) + b).sin() + (25.0 * b * phase(s) + a).sin();
            mean * most * 0.25 * (2.0 + wave)
        })
        .collect()
}

fn span(pair: &Pair, gap: &[f64], scratch: &mut Scratch) -> f64 {
    let extremes = pair.mesh.solve(gap, scratch);
    extremes.max - extremes.min
}

/// A geometry with the given contact ratios; only the fields that the path reads are changed.
fn with_ratios(input: &PairInput, eps_alpha: f64, eps_beta: f64) -> Option<Geometry> {
    let mut geometry = Geometry::new(input).ok()?;
    let length = eps_alpha * geometry.base_pitch;
    (length < 0.9 * geometry.path_length).then_some(())?;
    geometry.s_in = 0.5 * (geometry.path_length - length);
    geometry.s_out = geometry.s_in + length;
    geometry.face_width = eps_beta * geometry.base_pitch / geometry.beta_b.tan();
    Some(geometry)
}

/// Total length of the windows at the phase `phi`, in base pitches.
fn covered(path: &Path, phi: f64) -> f64 {
    let mut windows: Vec<Window> = Vec::new();
    path.windows_at(phi, &mut windows);
    let lengths = windows.iter().map(|w| w.weight * (w.hi.s - w.lo.s));
    lengths.sum::<f64>() / path.base_pitch
}

/// The lines of whole teeth at the phase `phi`, with the load F/b that each carries when the
/// deflection is `delta`.
fn springs(pair: &Pair, gap: &[f64], phi: f64, delta: f64) -> Vec<([f64; 2], f64)> {
    let (path, g) = (&pair.mesh.frame.path, pair.geometry());
    let hertz = 2.0 * pair.input().surface_compliance().iter().sum::<f64>();
    let mut springs = Vec::new();
    let mut end = path.s_in + phi;
    while end < path.s_out + path.window {
        let (lo, hi) = ((end - path.window).max(path.s_in), end.min(path.s_out));
        end += path.base_pitch;
        if hi <= lo {
            continue;
        }
        let place = path.place(0.5 * (lo + hi));
        let beams = Member::BOTH.map(|member| {
            let t = g.tangent_length(member, place.s);
            pair.tooth_compliance(member, g.r_b[member.index()].hypot(t))
        });
        let share = (hi - lo) / path.window;
        let (g0, g1) = (gap[place.cell], gap[place.cell + 1]);
        let closed = (delta - g0 - place.u * (g1 - g0)).max(0.0);
        springs.push(([lo, hi], closed / (beams[0] + beams[1] + hertz / share)));
    }
    springs
}

proptest! {
    #![proptest_config(config(64, 71))]

    /// 1: the deflection at φ is that at φ + p_bt, where the same lines have moved on by one pair,
    /// and nothing jumps where one period ends and the next begins.
    #[test]
    fn the_error_repeats_after_a_base_pitch(input in pairs(), part in 0.0..1.0_f64) {
        let pair = feasible!(&input);
        let (mesh, path) = (&pair.mesh, &pair.mesh.frame.path);
        // Beyond the path flanks are apart, worn or not.
        prop_assume!(!path.goes_beyond());
        let p = path.base_pitch;
        let phi = part * p;
        let mut area = 0.0;
        for j in -2..400 {
            let hi = path.s_in + (phi + p) + f64::from(j) * p;
            let (lo, hi) = ((hi - path.window).max(path.s_in), hi.min(path.s_out));
            const STEPS: usize = 400;
            let h = (hi - lo) / STEPS as f64;
            for step in 0..if hi > lo { STEPS } else { 0 } {
                let place = path.place(lo + (step as f64 + 0.5) * h);
                let (c0, c1) = (mesh.frame.stiffness[place.cell], mesh.frame.stiffness[place.cell + 1]);
                area += h * (c0 + place.u * (c1 - c0));
            }
        }
        let mut windows = Vec::new();
        let ours = mesh.unworn(phi, &mut windows);
        // The midpoint rule's error in 400 steps.
        prop_assert!((mesh.frame.target / area / ours - 1.0).abs() < 1e-4);
        let (first, last) =
            (mesh.unworn(0.0, &mut windows), mesh.unworn(p * (1.0 - 1e-12), &mut windows));
        prop_assert!((first / last - 1.0).abs() < 1e-8, "{first} {last}");
    }

    /// 4: an integer ε_α keeps the contact length constant, and with it the deflection when the
    /// compliance is constant, but not otherwise.
    #[test]
    fn integer_profile_ratio(input in pairs(), n in 1_u32..3, eps_beta in 0.1..0.9_f64) {
        let Some(geometry) = with_ratios(&input, f64::from(n), eps_beta) else {
            return Err(TestCaseError::reject("infeasible"));
        };
        let path = Path::new(&geometry, &Discretisation::default(), Touch::Everywhere, None, &[], &[]);
        for &phi in &path.phases {
            prop_assert!((covered(&path, phi) / (f64::from(n) * eps_beta) - 1.0).abs() < 1e-9);
        }
        let zero = vec![0.0; path.s.len()];
        let rising: Vec<f64> =
            path.s.iter().map(|s| 1e4 * (1.0 + (s - path.s_in) / path.base_pitch)).collect();
        let mut scratch = Scratch::default();
        let constant = Mesh::slices(path.clone(), vec![1e4; zero.len()], 100.0, Lead::default());
        let flat = constant.solve(&zero, &mut scratch);
        prop_assert!(flat.max - flat.min < 1e-9 * flat.max);
        let varying = Mesh::slices(path, rising, 100.0, Lead::default()).solve(&zero, &mut scratch);
        prop_assert!(varying.max - varying.min > 1e-3 * varying.max);
    }

    /// 5: extremes of the contact length from the fractional parts of the contact ratios.
    #[test]
    fn contact_length(input in pairs(), eps_alpha in 1.01..2.4_f64, eps_beta in 0.05..3.5_f64) {
        let Some(geometry) = with_ratios(&input, eps_alpha, eps_beta) else {
            return Err(TestCaseError::reject("infeasible"));
        };
        let path = Path::new(&geometry, &Discretisation::default(), Touch::Everywhere, None, &[], &[]);
        let lengths: Vec<f64> = path.phases.iter().map(|&phi| covered(&path, phi)).collect();
        let least = lengths.iter().copied().fold(f64::MAX, f64::min);
        let most = lengths.iter().copied().fold(0.0, f64::max);
        let (na, nb) = (eps_alpha.fract(), eps_beta.fract());
        let base = eps_alpha * eps_beta - na * nb;
        prop_assert!((least - base - (na + nb - 1.0).max(0.0)).abs() < 1e-8, "{least}");
        prop_assert!((most - base - na.min(nb)).abs() < 1e-8, "{most}");
    }

    /// 6: material missing everywhere alike shifts the deflection by as much and changes nothing
    /// else, worn before or not.
    #[test]
    fn uniform_wear_shifts(input in all_pairs(), most in 0.0..3.0_f64, a in 0.1..1.0_f64, more in 0.01..5.0_f64) {
        let pair = feasible!(&input);
        let gap = waves(&pair, most, a, 0.3);
        let mut scratch = Scratch::default();
        let before = span(&pair, &gap, &mut scratch);
        let deflections = scratch.delta.clone();
        let shift = more * deflections[0];
        let shifted: Vec<f64> = gap.iter().map(|g| g + shift).collect();
        let after = span(&pair, &shifted, &mut scratch);
        for (before, after) in deflections.iter().zip(&scratch.delta) {
            prop_assert!((after - before - shift).abs() < 1e-8 * after);
        }
        prop_assert!((after - before).abs() < 1e-7 * shift.max(before), "{before} {after}");
    }

    /// 7: at every phase the slices, none of which pulls, carry the load together.
    #[test]
    fn load_balance(input in pairs(), most in 0.0..6.0_f64, a in 0.1..1.0_f64, b in 0.1..1.0_f64) {
        let pair = feasible!(&input);
        let (mesh, path) = (&pair.mesh, &pair.mesh.frame.path);
        let gap = waves(&pair, most, a, b);
        let mut scratch = Scratch::default();
        mesh.solve(&gap, &mut scratch);
        let (geometry, held) = (pair.geometry(), path.hold(gap));
        for (k, &delta) in scratch.delta.iter().enumerate().step_by(5) {
            let mut force = 0.0;
            for window in path.windows(k) {
                const STEPS: usize = 1000;
                let h = (window.hi.s - window.lo.s) / STEPS as f64;
                for step in 0..STEPS {
                    let place = path.place(window.lo.s + (step as f64 + 0.5) * h);
                    let linear = |v: &[f64]| {
                        v[place.cell] + place.u * (v[place.cell + 1] - v[place.cell])
                    };
                    let separation = if path.goes_beyond() {
                        pair.beyond().gap(geometry.s_in - place.s, place.s - geometry.s_out)
                    } else {
                        0.0
                    };
                    let closed = (delta - linear(&held) - separation).max(0.0);
                    force += window.weight * closed * linear(&mesh.frame.stiffness) * h;
                }
            }
            // The midpoint rule at a few ends of contact in a thousand steps.
            prop_assert!((force / mesh.frame.target - 1.0).abs() < 2e-3, "{force} {}", mesh.frame.target);
        }
    }

    /// 7 for whole teeth: each pair is one spring, and together they carry the load.
    #[test]
    fn whole_teeth_balance(input in pairs(), most in 0.0..3.0_f64, a in 0.1..1.0_f64, b in 0.1..1.0_f64) {
        let pair = feasible!(&PairInput { tooth_model: ToothModel::WholeFaceBeam, ..input });
        let gap = waves(&pair, most, a, b);
        let mut scratch = Scratch::default();
        pair.mesh.solve(&gap, &mut scratch);
        for (&phi, &delta) in pair.mesh.frame.path.phases.iter().zip(&scratch.delta) {
            let force: f64 = springs(&pair, &gap, phi, delta).iter().map(|(_, load)| load).sum();
            // 1/Q_B is linear between the nodes in the crate and exact here.
            prop_assert!((force / pair.mesh.frame.target - 1.0).abs() < 5e-3, "{force}");
        }
    }

    /// The load that wears a place is the greatest of the lines that cover it.
    #[test]
    fn whole_teeth_wear_along_their_lines(input in pairs()) {
        let pair = feasible!(&PairInput { tooth_model: ToothModel::WholeFaceBeam, ..input });
        let (mesh, path) = (&pair.mesh, &pair.mesh.frame.path);
        let none = vec![0.0; path.s.len()];
        let mut scratch = Scratch::default();
        let peak = mesh.solve(&none, &mut scratch).max;
        let ours = mesh.greatest_load(&none, &scratch, peak, true);
        let mut most = none.clone();
        let mut windows = Vec::new();
        const PHASES: usize = 4000;
        for k in 0..PHASES {
            let phi = path.base_pitch * k as f64 / PHASES as f64;
            let delta = mesh.unworn(phi, &mut windows);
            for ([lo, hi], load) in springs(&pair, &none, phi, delta) {
                for (s, most) in path.s.iter().zip(&mut most) {
                    if (lo..=hi).contains(s) {
                        *most = most.max(load);
                    }
                }
            }
        }
        let greatest = most.iter().copied().fold(0.0, f64::max);
        for (ours, most) in ours.iter().zip(most) {
            prop_assert!((ours - most).abs() < 2e-2 * greatest, "{ours} {most} {greatest}");
        }
    }

    /// Material that the signed law adds on one side of the pitch point and takes on the other moves
    /// the error within its own bounds.
    #[test]
    fn signed_wear_shifts_within_its_range(input in all_pairs(), coefficient in 1e-8..1e-5_f64) {
        let pair = feasible!(&input);
        let law = WearLaw::Signed { coefficient };
        let worn = pair.archard(&Wear { law, ..crate::paper::WEAR });
        let bound = |pick: fn(f64, f64) -> f64| {
            pair.to_ste_um(2.0 * worn.depth[0].iter().copied().fold(0.0, pick))
        };
        let (least, most) = (bound(f64::min), bound(f64::max));
        let rounding = 1e-9 * (most - least);
        for (new, old) in worn.analysis.ste_um.iter().zip(&pair.unworn().ste_um) {
            prop_assert!(new - old >= least - rounding - 1e-9 * old, "{new} {old} {least}");
            prop_assert!(new - old <= most + rounding + 1e-9 * old, "{new} {old} {most}");
        }
    }

    /// The compliance of soft teeth belongs to the load that they carry: the greatest load at each
    /// node, put into Weber's approach anew, gives the compliance that it was found with.
    #[test]
    fn the_load_is_a_fixed_point(input in pairs()) {
        let pair = feasible!(&PairInput { tooth_model: ToothModel::WeberBanaschek, ..input });
        let (mesh, path) = (&pair.mesh, &pair.mesh.frame.path);
        let mut scratch = Scratch::default();
        let peak = mesh.solve(&vec![0.0; path.nodes().len()], &mut scratch).max;
        let greatest = mesh.greatest_load(&vec![0.0; path.nodes().len()], &scratch, peak, false);
        for ((&s, &load), &c) in path.nodes().iter().zip(&greatest).zip(path.at_nodes(&mesh.frame.stiffness)) {
            let again = pair.compliance_under(s, load);
            prop_assert!((again * c - 1.0).abs() < 2e-6, "{s}: {again} {}", 1.0 / c);
        }
    }

    /// 10: wear acts only through the sum of both flanks' depths.
    #[test]
    fn wear_acts_through_the_sum(input in all_pairs(), seed in 0_u64..1000) {
        let pair = feasible!(&input);
        let amount = LocalAmount::MaxDepth { max_depth_um: 4.0 };
        for law in [WearLaw::Archard { max_depth_um: 4.0 }, WearLaw::LocalArchard { amount }] {
            let wear = Wear {
                law,
                kernel: Kernel::ALL[seed as usize % Kernel::ALL.len()],
                range: 0.2,
                variance: 0.02,
                life: None,
            };
            let mut rng = stream(1, Purpose::Test, 0, seed);
            let profile = pair.sampler(&wear).draw_profile(&mut rng);
            let [a, b] = &profile.depth;
            let mut scratch = Scratch::default();
            let sum: Vec<f64> = a.iter().zip(b).map(|(a, b)| a + b).collect();
            let from_sum = pair.to_ste_um(span(&pair, &sum, &mut scratch));
            prop_assert!((from_sum / profile.delta_ste_um - 1.0).abs() < 1e-8);
        }
    }

    /// 11: in full contact ΔSTE follows the gap no faster than the gap's own range.
    #[test]
    fn variation_is_lipschitz(input in all_pairs(), a in 0.1..1.0_f64, b in 0.1..1.0_f64) {
        let pair = feasible!(&input);
        let (g, h) = (waves(&pair, 0.3, a, b), waves(&pair, 0.3, b, a));
        let mut scratch = Scratch::default();
        let sum: Vec<f64> = g.iter().zip(&h).map(|(g, h)| g + h).collect();
        let both = span(&pair, &sum, &mut scratch);
        let least = scratch.delta.iter().copied().fold(f64::MAX, f64::min);
        prop_assume!(sum.iter().all(|&gap| gap < least));
        let change = both - span(&pair, &g, &mut scratch);
        let range = h.iter().copied().fold(0.0, f64::max) - h.iter().copied().fold(1.0, f64::min);
        prop_assert!(change.abs() <= range * (1.0 + 1e-9), "{change} {range}");
    }

    /// 11: Jensen's inequality. In full contact ΔSTE is a convex function of the gap, so that of a
    /// mean gap is at most the mean of both.
    #[test]
    fn variation_is_convex(input in all_pairs(), a in 0.1..1.0_f64, b in 0.1..1.0_f64, t in 0.0..1.0_f64) {
        let pair = feasible!(&input);
        let (g, h) = (waves(&pair, 0.5, a, b), waves(&pair, 0.5, b, 1.0 - a));
        let mut scratch = Scratch::default();
        let mixed: Vec<f64> = g.iter().zip(&h).map(|(g, h)| (1.0 - t) * g + t * h).collect();
        let mut contact = true;
        let mut value = |gap: &[f64]| {
            let value = span(&pair, gap, &mut scratch);
            let least = scratch.delta.iter().copied().fold(f64::MAX, f64::min);
            contact &= gap.iter().all(|&gap| gap < least);
            value
        };
        let (of_g, of_h, of_mixed) = (value(&g), value(&h), value(&mixed));
        prop_assume!(contact);
        let bound = (1.0 - t) * of_g + t * of_h;
        // Extremes between the phases are found to second order.
        prop_assert!(of_mixed <= bound * (1.0 + 2e-3) + 1e-12, "{of_mixed} {bound}");
    }
}
