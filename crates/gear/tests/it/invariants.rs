//! Properties that hold for every correct simulator, on random general pairs.

use gear::paper::{MAX_DEPTH_UM, SIGNED_WEAR};
use gear::{
    Discretisation, LocalAmount, Member, Pair, PairInput, Size, ToothModel, Wear, WearLaw,
    gear_outline, mesh_placement,
};
use proptest::prelude::*;
use stats::streams::{Purpose, stream};

use crate::general::{config, feasible, pairs};
use crate::support::{WEAR, figure_7, in_the_box, pair, plain, rng};

/// Models whose compliance does not depend on the load, and those whose teeth are slices.
const LINEAR: [ToothModel; 3] = [
    ToothModel::HertzBeam,
    ToothModel::WholeFaceBeam,
    ToothModel::PrismaticBeam,
];
const SLICED: [ToothModel; 3] = [
    ToothModel::HertzBeam,
    ToothModel::WeberBanaschek,
    ToothModel::PrismaticBeam,
];

/// The paper's depth on the deepest place of both flanks.
const LOCAL: WearLaw = WearLaw::LocalArchard {
    amount: LocalAmount::MaxDepth {
        max_depth_um: MAX_DEPTH_UM,
    },
};

fn close(a: f64, b: f64, relative: f64) -> bool {
    (a - b).abs() <= relative * a.abs().max(b.abs())
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

fn scaled(wear: &Wear, k: f64) -> Wear {
    Wear {
        law: wear.law.scaled(k),
        ..*wear
    }
}

proptest! {
    #![proptest_config(config(48, 2009))]

    /// 1: without load nothing deflects, and an unloaded pair does not wear.
    #[test]
    fn no_load_no_error(input in pairs()) {
        let pair = feasible!(&PairInput { pinion_torque: 0.0, ..input });
        prop_assert!(pair.unworn().ste_um.iter().all(|&ste| ste == 0.0));
        prop_assert_eq!(pair.unworn().delta_ste_um, 0.0);
        for wear in [WEAR, SIGNED_WEAR, Wear { law: LOCAL, ..WEAR }] {
            let worn = pair.archard(&wear);
            prop_assert_eq!(worn.analysis.delta_ste_um, 0.0);
            prop_assert!(worn.depth.iter().flatten().all(|&depth| depth == 0.0));
        }
    }

    /// 2: linear compliance without a gap scales with the torque.
    #[test]
    fn linear_in_the_torque(input in pairs(), k in 0.1..50.0_f64) {
        for tooth_model in LINEAR {
            let a = feasible!(&PairInput { tooth_model, ..input.clone() });
            let more = PairInput { pinion_torque: k * input.pinion_torque, ..input.clone() };
            let b = feasible!(&PairInput { tooth_model, ..more });
            prop_assert!(close(k * a.unworn().delta_ste_um, b.unworn().delta_ste_um, 1e-9));
            for (a, b) in a.unworn().ste_um.iter().zip(&b.unworn().ste_um) {
                prop_assert!(close(k * a, *b, 1e-12));
            }
        }
    }

    /// 3: an integer overlap ratio has no transmission error variation, worn, separated or not, as
    /// long as teeth are slices.
    #[test]
    fn integer_overlap_is_silent(input in pairs(), n in 1..4_u32) {
        let Size::NormalModule(m) = input.size else { unreachable!() };
        let face_width = f64::from(n) * std::f64::consts::PI * m / input.helix_angle.sin();
        for tooth_model in SLICED {
            let pair = feasible!(&PairInput { face_width: [face_width; 2], tooth_model, ..input.clone() });
            let mean = mean(&pair.unworn().ste_um);
            prop_assert!(pair.unworn().delta_ste_um < 1e-9 * mean);
            // Deep enough to separate the ends of the path for some inputs.
            let deep = WearLaw::Archard { max_depth_um: 3.0 * mean };
            for law in [deep, SIGNED_WEAR.law] {
                let wear = Wear { law, ..WEAR };
                let worn = pair.archard(&wear).analysis;
                prop_assert!(worn.delta_ste_um < 1e-9 * mean, "{}", worn.delta_ste_um / mean);
                let draw = pair.sampler(&wear).draw(&mut stream(1, Purpose::Test, 0, 0));
                prop_assert!(draw < 1e-9 * mean, "{}", draw / mean);
            }
        }
    }

    /// 8: a geometrically similar pair with k³ the torque has k times the error and wear, and the
    /// same stresses.
    #[test]
    fn similarity(input in pairs(), k in 0.2..5.0_f64) {
        let Size::NormalModule(m) = input.size else { unreachable!() };
        let large = PairInput {
            size: Size::NormalModule(k * m),
            face_width: [k * input.face_width[0]; 2],
            tip_radius: input.tip_radius.map(|r| k * r),
            root_radius: input.root_radius.map(|r| k * r),
            pinion_torque: k * k * k * input.pinion_torque,
            ..input.clone()
        };
        for &tooth_model in ToothModel::ALL {
            let a = feasible!(&PairInput { tooth_model, ..input.clone() });
            let b = feasible!(&PairInput { tooth_model, ..large.clone() });
            prop_assert!(close(k * a.unworn().delta_ste_um, b.unworn().delta_ste_um, 1e-8));
            let pressures = [a.unworn().hertz_pressure_mpa, b.unworn().hertz_pressure_mpa];
            prop_assert!(close(pressures[0], pressures[1], 1e-9));
            for (a, b) in a.root_stress().iter().zip(&b.root_stress()) {
                prop_assert!(close(a.stress_mpa, b.stress_mpa, 1e-9));
            }
            // The signed law's depth grows with the distance from the pitch point by itself.
            let wears = [(scaled(&WEAR, m), scaled(&WEAR, k * m)), (SIGNED_WEAR, SIGNED_WEAR)];
            for (wear, more) in wears {
                prop_assert!(close(
                    k * a.archard(&wear).analysis.delta_ste_um,
                    b.archard(&more).analysis.delta_ste_um,
                    1e-7
                ));
            }
        }
    }

    /// 8: E and torque together change the stresses alone.
    #[test]
    fn stiffer_material_under_more_load(input in pairs(), k in 0.1..10.0_f64) {
        let mut other = input.clone();
        other.pinion_torque *= k;
        other.material.iter_mut().for_each(|one| one.youngs_modulus_mpa *= k);
        for &tooth_model in ToothModel::ALL {
            let a = feasible!(&PairInput { tooth_model, ..input.clone() });
            let b = feasible!(&PairInput { tooth_model, ..other.clone() });
            prop_assert!(close(a.unworn().delta_ste_um, b.unworn().delta_ste_um, 1e-8));
            prop_assert!(close(
                k * a.unworn().hertz_pressure_mpa, b.unworn().hertz_pressure_mpa, 1e-9
            ));
            prop_assert!(close(
                a.archard(&SIGNED_WEAR).analysis.delta_ste_um,
                b.archard(&scaled(&SIGNED_WEAR, 1.0 / k)).analysis.delta_ste_um,
                1e-7
            ));
            for (a, b) in a.root_stress().iter().zip(&b.root_stress()) {
                prop_assert!(close(k * a.stress_mpa, b.stress_mpa, 1e-9));
            }
        }
    }

    /// 9: which gear is called the pinion, and the hand of the helix, change nothing.
    #[test]
    fn exchange_and_hand(input in pairs()) {
        let swap = |v: [f64; 2]| [v[1], v[0]];
        let [z1, z2] = input.teeth;
        let exchanged = PairInput {
            teeth: [z2, z1],
            profile_shift: swap(input.profile_shift),
            tool_addendum: swap(input.tool_addendum),
            tool_dedendum: swap(input.tool_dedendum),
            tip_radius: swap(input.tip_radius),
            root_radius: swap(input.root_radius),
            pinion_torque: input.pinion_torque * f64::from(z2) / f64::from(z1),
            ..input.clone()
        };
        for &tooth_model in ToothModel::ALL {
        let a = feasible!(&PairInput { tooth_model, ..input.clone() });
        let left = PairInput { helix_angle: -input.helix_angle, ..input.clone() };
        let left = feasible!(&PairInput { tooth_model, ..left });
        prop_assert_eq!(a.unworn(), left.unworn());
        let b = feasible!(&PairInput { tooth_model, ..exchanged.clone() });
        prop_assert!(close(a.sliding().max, b.sliding().max, 1e-10));
        prop_assert!(close(a.sliding().pinion_root, b.sliding().gear_root, 1e-10));
        if tooth_model == ToothModel::Coupled {
            // Its strips and phases start at the other end.
            let (a, b) = (a.unworn().delta_ste_um, b.unworn().delta_ste_um);
            prop_assert!((a - b).abs() < 0.05 * a + 0.05, "{} {}", a, b);
            continue;
        }
        // Kinks of the path are placed symmetrically, so only rounding differs.
        prop_assert!(close(a.unworn().delta_ste_um, b.unworn().delta_ste_um, 1e-7));
        prop_assert!(close(
            a.archard(&WEAR).analysis.delta_ste_um, b.archard(&WEAR).analysis.delta_ste_um, 1e-6
        ));
        // The signed law takes off the one gear's flank what it adds to the other's.
        let [[one, _], [other, _]] = [&a, &b].map(|pair| pair.archard(&SIGNED_WEAR).depth);
        let most = one.iter().fold(0.0_f64, |most, depth| most.max(depth.abs()));
        for (one, other) in one.iter().zip(other.iter().rev()) {
            prop_assert!((one + other).abs() <= 1e-6 * most, "{one} {other}");
        }
        // The local law wears each flank as before, whichever gear it belongs to.
        let local = Wear { law: LOCAL, ..WEAR };
        let [[pinion, gear], [other_pinion, other_gear]] =
            [&a, &b].map(|pair| pair.archard(&local).depth);
        for (one, other) in pinion
            .iter()
            .chain(&gear)
            .zip(other_gear.iter().rev().chain(other_pinion.iter().rev()))
        {
            prop_assert!((one - other).abs() <= 1e-5 * 1e-3 * MAX_DEPTH_UM, "{one} {other}");
        }
        let (a, b) = (a.root_stress(), b.root_stress());
        prop_assert!(close(a[0].stress_mpa, b[1].stress_mpa, 1e-9));
        }
    }

    /// 10: no sliding and no wear at the pitch point, the given depth at the deepest place.
    #[test]
    fn wear_profile(input in pairs()) {
        let pair = feasible!(&input);
        let worn = pair.archard(&WEAR);
        let g = pair.geometry();
        prop_assume!(g.s_pitch > g.s_in && g.s_pitch < g.s_out);
        prop_assert_eq!(&worn.depth[0], &worn.depth[1]);
        let (least, at) = worn
            .depth[0]
            .iter()
            .zip(&worn.s)
            .fold((f64::MAX, 0.0), |best, (&d, &s)| if d < best.0 { (d, s) } else { best });
        prop_assert!(least < 1e-15 && (at - g.s_pitch).abs() < 1e-12 * g.path_length);
        let deepest = worn.depth[0].iter().fold(0.0, |most: f64, &d| most.max(d));
        prop_assert!(close(1e3 * deepest, MAX_DEPTH_UM, 1e-14));
        let signed = pair.archard(&SIGNED_WEAR);
        for (s, depth) in signed.s.iter().zip(&signed.depth[0]) {
            prop_assert!(depth * (g.s_pitch - s) >= 0.0, "{s}: {depth}");
        }
    }

    /// 12: a vanishing helix tends to the spur pair.
    #[test]
    fn small_helix_tends_to_spur(input in pairs()) {
        // Weber's approach differs by 0.3 %: a spur tooth has no corner that touches first.
        for tooth_model in LINEAR {
            let at = |helix_angle| PairInput { helix_angle, tooth_model, ..input.clone() };
            let spur = feasible!(&at(0.0)).unworn().delta_ste_um;
            let mut last = f64::MAX;
            for beta in [1e-4, 1e-6] {
                last = (feasible!(&at(beta)).unworn().delta_ste_um / spur - 1.0).abs();
            }
            // The window at 1e-6 rad is 2e-5 mm: kinks of the stiffness move by that much, and the
            // nodes at the ends of the path lie otherwise.
            prop_assert!(last < 3e-4, "{last}");
        }
    }

    /// Flanks drawn in mesh touch and do not overlap near the pitch point.
    #[test]
    fn drawn_flanks_touch(input in pairs(), phase in -0.5..0.5_f64) {
        let pair = feasible!(&input);
        prop_assume!(pair.interference().is_clear());
        let g = pair.geometry();
        let places = mesh_placement(&pair, phase);
        let [pinion, gear] = [Member::Pinion, Member::Gear].map(|member| {
            let place = places[member.index()];
            gear_outline(&pair, member, 60).into_iter().map(|p| place.apply(p)).collect::<Vec<_>>()
        });
        let near = |points: &[[f64; 2]]| -> Vec<[f64; 2]> {
            let (x, reach) = (g.r[0], 4.0 * g.normal_module);
            points
                .iter()
                .copied()
                .filter(|p| (p[0] - x).abs() < reach && p[1].abs() < reach)
                .collect()
        };
        let (pinion, gear) = (near(&pinion), near(&gear));
        let distance = pinion
            .iter()
            .flat_map(|a| gear.iter().map(move |b| (a[0] - b[0]).hypot(a[1] - b[1])))
            .fold(f64::MAX, f64::min);
        // Points on a flank are about 2.5 m/60 apart, so touching flanks have points this close.
        prop_assert!(distance < 0.03 * g.normal_module, "{distance}");
    }
}

/// 3, with the face one part in 10⁹ off the integer: the error must not jump.
#[test]
fn near_integer_overlap_is_nearly_silent() {
    let exact = std::f64::consts::PI * 2.0 / 15_f64.to_radians().sin();
    for off in [-1e-9, 1e-9] {
        let pair = pair(&PairInput {
            face_width: [exact * (1.0 + off); 2],
            ..plain()
        });
        let unworn = pair.unworn();
        assert!(
            unworn.delta_ste_um < 1e-7 * mean(&unworn.ste_um),
            "{}",
            unworn.delta_ste_um
        );
    }
}

/// 11: Jensen's inequality for the convex ΔSTE while every slice touches.
#[test]
fn random_wear_is_no_quieter_than_its_mean() {
    let pair = pair(&figure_7());
    // Far less than the deflection of about 5 µm: nothing separates.
    let wear = Wear {
        law: WearLaw::Archard { max_depth_um: 0.2 },
        ..WEAR
    };
    let mut sampler = pair.sampler(&wear);
    let draws: Vec<f64> = (0..2000)
        .map(|k| sampler.draw(&mut stream(3, Purpose::Test, 0, k)))
        .collect();
    let average = mean(&draws);
    let variance = draws.iter().map(|d| (d - average).powi(2)).sum::<f64>() / 1999.0;
    let error = (variance / 2000.0).sqrt();
    let of_mean = pair.archard(&wear).analysis.delta_ste_um;
    assert!(
        average > of_mean - 3.0 * error,
        "{average} ± {error} against {of_mean}"
    );
}

/// The same generator gives the same bits, whatever was drawn before.
#[test]
fn draws_are_reproducible() {
    let mut rng = rng(5);
    let designs: Vec<PairInput> = (0..40).map(|_| in_the_box(&mut rng)).collect();
    let mut compared = 0;
    for input in designs {
        let Ok(pair) = Pair::new(&input, &Discretisation::default()) else {
            continue;
        };
        let draw =
            |sampler: &mut gear::Sampler, k| sampler.draw(&mut stream(9, Purpose::Test, 1, k));
        let mut forward = pair.sampler(&WEAR);
        let a: Vec<u64> = (0..5).map(|k| draw(&mut forward, k).to_bits()).collect();
        let again = Pair::new(&input, &Discretisation::default()).unwrap();
        let mut backward = again.sampler(&WEAR);
        let mut b: Vec<u64> = (0..5)
            .rev()
            .map(|k| draw(&mut backward, k).to_bits())
            .collect();
        b.reverse();
        assert_eq!(a, b);
        let profile = backward.draw_profile(&mut stream(9, Purpose::Test, 1, 3));
        assert_eq!(profile.delta_ste_um.to_bits(), a[3]);
        compared += 1;
    }
    assert!(compared > 20);
}

/// Figure 2: profiles scatter about the mean wear with the given standard deviation.
#[test]
fn random_profiles_have_the_stated_mean_and_variance() {
    let pair = pair(&figure_7());
    let worn = pair.archard(&WEAR);
    let mut sampler = pair.sampler(&WEAR);
    let node = worn.depth[0]
        .iter()
        .position(|&d| d == 1e-3 * MAX_DEPTH_UM)
        .unwrap();
    let count = 4000;
    let mut ratios = [Vec::new(), Vec::new()];
    for k in 0..count {
        let profile = sampler.draw_profile(&mut stream(4, Purpose::Test, 0, k));
        for (ratios, depth) in ratios.iter_mut().zip(&profile.depth) {
            ratios.push(depth[node] / (1e-3 * MAX_DEPTH_UM));
        }
    }
    let covariance = |a: &[f64], b: &[f64]| {
        let (ma, mb) = (mean(a), mean(b));
        a.iter()
            .zip(b)
            .map(|(a, b)| (a - ma) * (b - mb))
            .sum::<f64>()
            / (count - 1) as f64
    };
    for r in &ratios {
        // Four standard errors of a mean and of a variance of 4000 normals.
        assert!((mean(r) - 1.0).abs() < 4.0 * 0.1 / 4000_f64.sqrt());
        assert!((covariance(r, r) / 0.01 - 1.0).abs() < 4.0 * (2.0 / 4000_f64).sqrt());
    }
    assert!(covariance(&ratios[0], &ratios[1]).abs() < 4.0 * 0.01 / 4000_f64.sqrt());
}

/// The pressures along the path peak at the analysis's figure, and without wear they are the unworn
/// ones.
#[test]
fn pressures_along_the_path_peak_at_the_criterion() {
    let peak = |pressure: &[f64]| pressure.iter().fold(0.0, |most: f64, &p| most.max(p));
    for tooth_model in SLICED {
        let pair = pair(&PairInput {
            tooth_model,
            ..figure_7()
        });
        assert_eq!(pair.path().len(), pair.pressure().len());
        assert_eq!(peak(pair.pressure()), pair.unworn().hertz_pressure_mpa);
        let worn = pair.archard(&WEAR);
        assert_eq!(peak(&worn.pressure), worn.analysis.hertz_pressure_mpa);
        assert_ne!(worn.pressure, pair.pressure());
        let unworn = pair.archard(&scaled(&WEAR, 0.0));
        // Between two steps of the mesh the approach is computed for an unworn pair, and interpolated
        // for a worn one.
        for (a, b) in unworn.pressure.iter().zip(pair.pressure()) {
            assert!(close(*a, *b, 2e-3), "{tooth_model}: {a} and {b}");
        }
    }
}
