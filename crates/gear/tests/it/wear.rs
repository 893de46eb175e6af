//! The law of wear that takes each flank's own sliding.

use gear::paper::MAX_DEPTH_UM;
use gear::{
    Discretisation, Kernel, LocalAmount, Member, Pair, PairInput, PlainSum, Size, ToothModel, Wear,
    WearLaw,
};
use stats::streams::{Purpose, stream};

use crate::support::{WEAR, figure_7, linear, plain};

/// A spur pair of module 2 with 20 and 40 teeth and standard racks.
fn spur() -> PairInput {
    PairInput {
        teeth: [20, 40],
        helix_angle: 0.0,
        face_width: [20.0; 2],
        profile_shift: [0.0; 2],
        tip_radius: [0.0; 2],
        size: Size::NormalModule(2.0),
        pinion_torque: 100e3,
        tooth_model: ToothModel::HertzBeam,
        ..plain()
    }
}

fn fine(input: &PairInput) -> Pair {
    let disc = Discretisation {
        cells: 1024,
        phases: 128,
    };
    Pair::new(input, &disc).unwrap()
}

fn local(amount: LocalAmount) -> Wear {
    Wear {
        law: WearLaw::LocalArchard { amount },
        ..WEAR
    }
}

fn cycles(coefficient: f64, pinion_cycles: f64) -> Wear {
    local(LocalAmount::Cycles {
        coefficient,
        pinion_cycles,
    })
}

fn deepest(depth: &[Vec<f64>; 2]) -> f64 {
    depth.iter().flatten().fold(0.0, |most, &d| most.max(d))
}

/// One pair of teeth carries F_bt/b = 100 000/(20 cos 20°)/20 = 266.044 N/mm between s = 5.532 and 7.686 mm.
/// L = 60 sin 20° = 20.52121 mm, v1 = s and v2 = (L − s)/2. At s = 6, v2 = 7.26060: ζ1 = −0.210101 and
/// ζ2 = 0.173622. At s = 7.5, v2 = 6.51060: ζ1 = 0.131919 and ζ2 = −0.151967. With k n1 = 1e-4 mm²/N and
/// k n2 = 5e-5 mm²/N the depths follow. Both flanks roll without sliding at the pitch point.
#[test]
fn depths_of_a_spur_pair_computed_by_hand() {
    let pair = fine(&spur());
    let worn = pair.archard(&cycles(1e-9, 1e5));
    for (s, expected_um) in [
        (6.0, [5.58960, 2.30956]),
        (7.5, [3.50964, 2.02150]),
        (20.521_209 / 3.0, [0.0, 0.0]),
    ] {
        for (depth, expected) in worn.depth.iter().zip(expected_um) {
            let found = 1e3 * linear(&worn.s, depth, s);
            assert!((found - expected).abs() < 2e-3, "{s}: {found} {expected}");
        }
    }
}

/// The share of the load at the ends of the path follows from the compliances of the two pairs of teeth in
/// contact. ζ1 = −4.25823 where the path starts, at s = 1.78189 mm, and ζ2 = −1.51768 where it ends, at
/// s = 11.43638 mm. The gear has half the pinion's cycles.
#[test]
fn the_root_of_the_pinion_wears_deeper_than_that_of_the_gear() {
    let pair = fine(&spur());
    let g = pair.geometry();
    let share = |s: f64, partner: f64| {
        let [own, other] = [s, partner].map(|s| 1.0 / pair.compliance(s));
        own / (own + other)
    };
    let start = share(g.s_in, g.s_in + g.base_pitch);
    let end = share(g.s_out, g.s_out - g.base_pitch);
    let expected = start / end * (4.258_23 / 1.517_68) / 0.5;
    let [pinion, gear] = pair.archard(&cycles(1e-9, 1e5)).depth;
    let ratio = pinion[0] / gear.last().unwrap();
    assert!((ratio / expected - 1.0).abs() < 1e-4, "{ratio} {expected}");
    // At one place the ratio does not depend on the load: v2/v1 · Z2/Z1.
    let at_start = pinion[0] / gear[0];
    assert!((at_start - 2.0 * 5.258_23).abs() < 1e-3, "{at_start}");
}

/// Helical and spur: the depth from cycles is that of the line load, and the greatest depth gives the same
/// flanks.
#[test]
fn depth_and_cycles_give_the_same_flanks() {
    for input in [spur(), plain(), figure_7()] {
        let pair = Pair::new(&input, &Discretisation::default()).unwrap();
        let g = pair.geometry();
        let [coefficient, pinion_cycles] = [2e-10, 3e6];
        let worn = pair.archard(&cycles(coefficient, pinion_cycles));
        let [material, _] = input.material;
        let nu = material.poisson_ratio;
        let modulus = material.youngs_modulus_mpa / (2.0 * (1.0 - nu * nu));
        for ((&s, &p), (pinion, gear)) in worn
            .s
            .iter()
            .zip(pair.pressure())
            .zip(worn.depth[0].iter().zip(&worn.depth[1]))
        {
            // w/cos β_b with w = p² π R/E*, and R = R_t/cos β_b.
            let radius = s * (g.path_length - s) / (g.path_length * g.beta_b.cos().powi(2));
            let load = p * p * std::f64::consts::PI * radius / modulus;
            let [z1, z2] = input.teeth.map(f64::from);
            let (v1, v2) = (s, (g.path_length - s) * z1 / z2);
            let each = coefficient * pinion_cycles * load;
            let expected = [
                each * (v2 - v1).abs() / v1,
                each * z1 / z2 * (v2 - v1).abs() / v2,
            ];
            let most = deepest(&worn.depth);
            assert!((pinion - expected[0]).abs() < 1e-9 * most, "{pinion}");
            assert!((gear - expected[1]).abs() < 1e-9 * most, "{gear}");
        }
        let max_depth_um = 1e3 * deepest(&worn.depth);
        let by_depth = pair.archard(&local(LocalAmount::MaxDepth { max_depth_um }));
        for (a, b) in worn
            .depth
            .iter()
            .flatten()
            .zip(by_depth.depth.iter().flatten())
        {
            assert!((a - b).abs() <= 1e-15 * max_depth_um, "{a} {b}");
        }
        let [a, b] = [worn, by_depth].map(|worn| worn.analysis.delta_ste_um);
        assert!((a / b - 1.0).abs() < 1e-9, "{a} {b}");
        let more = Wear {
            law: cycles(coefficient, pinion_cycles).law.scaled(2.0),
            ..WEAR
        };
        let twice = deepest(&pair.archard(&more).depth);
        assert!((twice / (2e-3 * max_depth_um) - 1.0).abs() < 1e-14);
    }
}

/// The greatest depth is that of the deepest place of both flanks, and the worn pair is the one with the gap of
/// both.
#[test]
fn the_gap_has_the_depth_of_each_flank() {
    let pair = fine(&spur());
    let wear = local(LocalAmount::MaxDepth {
        max_depth_um: MAX_DEPTH_UM,
    });
    let worn = pair.archard(&wear);
    assert!((1e3 * deepest(&worn.depth) / MAX_DEPTH_UM - 1.0).abs() < 1e-15);
    let [pinion, gear] = &worn.depth;
    let gap: Vec<f64> = pinion.iter().zip(gear).map(|(a, b)| a + b).collect();
    let sum = PlainSum::new(&pair, &worn.s, [8192, 1]).delta_ste_um(&gap);
    let ratio = worn.analysis.delta_ste_um / sum;
    assert!((ratio - 1.0).abs() < 1e-3, "{ratio}");
    // Coefficients of zero are the mean wear.
    let mean = pair.sampler(&wear).at(&[]);
    assert!((mean / worn.analysis.delta_ste_um - 1.0).abs() < 1e-12);
}

/// Random flanks scatter about the mean depth of each flank, and the gap about their sum.
#[test]
fn samples_have_the_mean_depth_of_each_flank() {
    let pair = Pair::new(&figure_7(), &Discretisation::default()).unwrap();
    let wear = Wear {
        kernel: Kernel::SquaredExponential,
        variance: 0.01,
        ..local(LocalAmount::MaxDepth { max_depth_um: 5.0 })
    };
    let depth = pair.archard(&wear).depth;
    let mut sampler = pair.sampler(&wear);
    let count = 4000_u32;
    let mut sums = depth.clone().map(|flank| vec![0.0; flank.len()]);
    for k in 0..count {
        let profile = sampler.draw_profile(&mut stream(8, Purpose::Test, 0, u64::from(k)));
        for (sum, worn) in sums
            .iter_mut()
            .flatten()
            .zip(profile.depth.iter().flatten())
        {
            *sum += worn;
        }
    }
    let standard_error = 0.1 / f64::from(count).sqrt();
    for member in Member::BOTH {
        let i = member.index();
        for (sum, mean) in sums[i].iter().zip(&depth[i]) {
            let average = sum / f64::from(count);
            assert!(
                (average - mean).abs() <= 4.5 * standard_error * mean,
                "{member}: {average} {mean}"
            );
        }
    }
    let gaps = sums[0].iter().zip(&sums[1]);
    for ((a, b), (pinion, gear)) in gaps.zip(depth[0].iter().zip(&depth[1])) {
        let average = (a + b) / f64::from(count);
        let error = standard_error * pinion.hypot(*gear);
        assert!((average - (pinion + gear)).abs() <= 4.5 * error + 1e-18);
    }
}

/// Flanks worn under one torque are met under another one.
#[test]
fn flanks_keep_their_wear_under_another_torque() {
    let input = PairInput {
        tooth_model: ToothModel::Coupled,
        ..plain()
    };
    let pair = Pair::new(&input, &Discretisation::of(ToothModel::Coupled)).unwrap();
    let light = pair.under(0.25 * pair.input().pinion_torque).unwrap();
    let flanks = pair.flank_wear(&WEAR);
    assert_eq!(pair.worn(&flanks), pair.archard(&WEAR));
    let worn = light.worn(&flanks);
    assert_eq!(worn.depth, pair.archard(&WEAR).depth);
    // The light load's own wear has the same greatest depth by the law, but lies elsewhere along the path.
    assert_ne!(worn.depth, light.archard(&WEAR).depth);
    let new = light.worn(&flanks.clone().scaled(0.0)).analysis;
    let difference = new.delta_ste_um - light.unworn().delta_ste_um;
    assert!(difference.abs() < 1e-9, "{difference}");
    // Equal coefficients give equal flanks.
    let none = gear::Scatter::default();
    let [mut heavy, mut light] = [&pair, &light].map(|pair| pair.sampler_on(&flanks, &WEAR, none));
    assert_eq!(heavy.modes(), light.modes());
    let [a, b] = [&mut heavy, &mut light]
        .map(|sampler| sampler.draw_profile(&mut stream(3, Purpose::Wear, 0, 0)));
    assert_eq!(a.depth, b.depth);
    assert_ne!(a.delta_ste_um, b.delta_ste_um);
}

/// A share of the depth between 0 and 1 is new flanks at the one end and worn ones at the other.
#[test]
fn a_life_goes_from_new_to_worn() {
    let pair = Pair::new(&plain(), &Discretisation::default()).unwrap();
    let whole = Wear {
        variance: 0.0,
        ..WEAR
    };
    let life = Wear {
        life: Some([0.0, 1.0]),
        ..whole
    };
    let mut sampler = pair.sampler(&life);
    assert_eq!(sampler.modes(), pair.sampler(&whole).modes() + 1);
    let mut at = |z: f64| {
        let mut coefficients = vec![0.0; sampler.modes()];
        *coefficients.last_mut().unwrap() = z;
        sampler.at(&coefficients)
    };
    let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-9, "{a} {b}");
    close(at(-40.0), pair.unworn().delta_ste_um);
    close(at(40.0), pair.archard(&whole).analysis.delta_ste_um);
    close(at(0.0), pair.archard(&life).analysis.delta_ste_um);
    let half = Wear {
        law: whole.law.scaled(0.5),
        ..whole
    };
    close(at(0.0), pair.archard(&half).analysis.delta_ste_um);
}
