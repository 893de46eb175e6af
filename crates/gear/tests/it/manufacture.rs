//! Random profile slope deviations.

use gear::{
    Corrections, Discretisation, FlankClass, Pair, PairInput, Sampler, Size, TOLERANCE_IN_SD,
    ToothModel, Wear, WearLaw,
};
use stats::streams::{Purpose, stream};

use crate::corrections::{corrected, everything, slice_sum};
use crate::support::{WEAR, balance, figure_7, linear, pair, plain};

/// No wear.
const NONE: Wear = Wear {
    law: WearLaw::Archard { max_depth_um: 0.0 },
    ..WEAR
};

fn class(number: u32) -> FlankClass {
    FlankClass::new(number).expect("the tests' classes exist")
}

/// ΔSTE in µm with the mean wear and the slope deviations `f`, mm.
fn deviated(pair: &Pair, wear: &Wear, f: [f64; 2]) -> f64 {
    let six = class(6);
    let mut sampler = pair.sampler_with(wear, gear::Scatter::of_class(six));
    let tolerances = six.slope_tolerances(pair.geometry());
    let mut coefficients = vec![0.0; pair.sampler(wear).modes()];
    coefficients.extend([0, 1].map(|gear| f[gear] * TOLERANCE_IN_SD / tolerances[gear]));
    sampler.at(&coefficients)
}

/// The gap of the slope deviations `f` at `s`, from the definition: material stands out at the tip of
/// the gear whose deviation is positive, half of f in the transverse plane.
fn slope_gap(pair: &Pair, f: [f64; 2], s: f64) -> f64 {
    let g = pair.geometry();
    let share = (s - g.s_in) / (g.s_out - g.s_in);
    let (pinion_out, gear_out) = (f[0] * (share - 0.5), f[1] * (0.5 - share));
    -(pinion_out + gear_out) * g.beta_b.cos()
}

/// Rigid spur teeth touch in one place, the one with the smallest gap. Along a base pitch that is
/// the same end of the slope, |f2 − f1|/ε_α, from one base pitch to the next.
#[test]
fn rigid_spur_teeth_climb_their_slope_once_a_pitch() {
    let mut input = PairInput {
        helix_angle: 0.0,
        ..plain()
    };
    input
        .material
        .iter_mut()
        .for_each(|one| one.youngs_modulus_mpa = 1e9);
    let pair = pair(&input);
    let eps_alpha = pair.geometry().eps_alpha;
    assert!((1.2..1.9).contains(&eps_alpha));
    for f in [
        [0.012_f64, 0.0],
        [-0.012, 0.0],
        [0.0, 0.012],
        [0.004, -0.011],
    ] {
        let expected = 1e3 * (f[1] - f[0]).abs() / eps_alpha;
        let found = deviated(&pair, &NONE, f);
        assert!(
            (found / expected - 1.0).abs() < 2e-3,
            "{f:?}: {found} against {expected}"
        );
    }
}

/// The definition of the model, with slices that have a place on the path, for every kind of slice.
#[test]
fn deviated_pairs_agree_with_a_slice_sum() {
    let realistic = PairInput {
        tooth_model: ToothModel::WeberBanaschek,
        ..plain()
    };
    let prismatic = PairInput {
        tooth_model: ToothModel::PrismaticBeam,
        ..figure_7()
    };
    let none = Corrections::default();
    for (input, corrections, wear) in [
        (figure_7(), none, NONE),
        (figure_7(), everything(), NONE),
        (prismatic, none, WEAR),
        (realistic.clone(), none, WEAR),
        (realistic, everything(), WEAR),
    ] {
        let pair = corrected(&input, &corrections);
        let worn = pair.archard(&wear);
        for f in [[0.008, -0.003], [-0.008, 0.003]] {
            // Slices are balanced above zero: a constant changes no ΔSTE.
            let gap =
                |s: f64| 0.02 + 2.0 * linear(&worn.s, &worn.depth[0], s) + slope_gap(&pair, f, s);
            let ste: Vec<f64> = (0..96)
                .map(|k| {
                    slice_sum(
                        &pair,
                        &gap,
                        f64::from(k) / 96.0 * pair.geometry().base_pitch,
                    )
                })
                .collect();
            let expected = range(&ste);
            let found = deviated(&pair, &wear, f);
            assert!(
                (found / expected - 1.0).abs() < 0.01,
                "{} {f:?}: {found} against {expected}",
                input.tooth_model
            );
        }
    }
}

/// Whole teeth are springs 1/(Q_B/b + Q_H/(b f)) with the gap of the middle of their line.
#[test]
fn whole_teeth_agree_with_a_sum_of_springs() {
    let pair = pair(&PairInput {
        tooth_model: ToothModel::WholeFaceBeam,
        ..figure_7()
    });
    let (g, material) = (pair.geometry(), pair.input().material[0]);
    let hertz = 4.0 * (1.0 - material.poisson_ratio.powi(2))
        / (std::f64::consts::PI * material.youngs_modulus_mpa);
    let window = g.face_width * g.beta_b.tan();
    for f in [[0.008, -0.003], [-0.008, 0.003]] {
        let at = |phi: f64| {
            let mut springs = Vec::new();
            let mut end = g.s_in + phi * g.base_pitch;
            while end - window < g.s_out {
                let (lo, hi) = ((end - window).max(g.s_in), end.min(g.s_out));
                if lo < hi {
                    let (middle, share) = (0.5 * (lo + hi), (hi - lo) / window);
                    let beams = pair.compliance(middle) - hertz;
                    let gap = 0.02 + slope_gap(&pair, f, middle);
                    springs.push((gap, g.face_width / (beams + hertz / share)));
                }
                end += g.base_pitch;
            }
            1e3 * balance(&springs, pair.base_force()) / g.beta_b.cos()
        };
        let ste: Vec<f64> = (0..2000).map(|k| at(f64::from(k) / 2000.0)).collect();
        let (expected, found) = (range(&ste), deviated(&pair, &NONE, f));
        assert!(
            (found / expected - 1.0).abs() < 3e-3,
            "{f:?}: {found} against {expected}"
        );
    }
}

fn range(values: &[f64]) -> f64 {
    let most = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    most - values.iter().copied().fold(f64::INFINITY, f64::min)
}

#[test]
fn gears_that_deviate_alike_fit() {
    for &tooth_model in ToothModel::ALL {
        let pair = pair(&PairInput {
            tooth_model,
            ..figure_7()
        });
        let worn = pair.archard(&WEAR).analysis.delta_ste_um;
        let alike = deviated(&pair, &WEAR, [0.009; 2]);
        assert!((alike / worn - 1.0).abs() < 1e-9, "{tooth_model}: {alike}");
    }
}

/// Two equal gears are interchangeable.
#[test]
fn equal_gears_exchange_their_deviations() {
    let input = PairInput {
        teeth: [25, 25],
        profile_shift: [0.1; 2],
        ..plain()
    };
    for corrections in [
        Corrections::default(),
        Corrections::default().with_crowning(0.005),
    ] {
        let pair = corrected(&input, &corrections);
        for f in [[0.007, 0.0], [0.006, -0.004]] {
            let one = deviated(&pair, &WEAR, f);
            let other = deviated(&pair, &WEAR, [f[1], f[0]]);
            assert!((one / other - 1.0).abs() < 1e-6, "{one} {other}");
            let as_designed = pair.archard(&WEAR).analysis.delta_ste_um;
            assert!((one / as_designed - 1.0).abs() > 0.01, "{one}");
        }
    }
}

/// Any gap that depends on s alone is silent with an integer overlap.
#[test]
fn integer_overlap_is_silent_with_deviations() {
    let mut input = plain();
    let Size::NormalModule(m) = input.size else {
        unreachable!("the plain pair is given by its module")
    };
    input.face_width = [2.0 * std::f64::consts::PI * m / input.helix_angle.sin(); 2];
    let silent = pair(&input);
    let ste_um = silent.unworn().ste_um[0];
    assert!(deviated(&silent, &WEAR, [0.009, -0.009]) < 1e-9 * ste_um);
}

#[test]
fn deviations_come_after_the_wear_and_leave_it_alone() {
    let pair = pair(&figure_7());
    let six = class(6);
    let mut plain = pair.sampler(&WEAR);
    let mut none = pair.sampler_with(&WEAR, gear::Scatter::default());
    let mut scattered = pair.sampler_with(&WEAR, gear::Scatter::of_class(six));
    assert_eq!(plain.modes(), none.modes());
    assert_eq!(plain.modes() + 4, scattered.modes());
    let tolerances = six.slope_tolerances(pair.geometry());
    let draw = |sampler: &mut Sampler, k| sampler.draw_profile(&mut stream(4, Purpose::Test, 1, k));
    // Sums of f, f² and f1 f2 in units of the tolerance.
    let (mut sums, mut squares, mut product) = ([0.0; 2], [0.0; 2], 0.0);
    let count = 20_000;
    for k in 0..count {
        let scattered = draw(&mut scattered, k);
        let f = [0, 1].map(|gear| scattered.slope_deviation[gear] / tolerances[gear]);
        for gear in 0..2 {
            sums[gear] += f[gear];
            squares[gear] += f[gear] * f[gear];
        }
        product += f[0] * f[1];
        if k < 20 {
            let plain = draw(&mut plain, k);
            assert_eq!(plain, draw(&mut none, k));
            assert_eq!(plain.slope_deviation, [0.0; 2]);
            assert_eq!(plain.depth, scattered.depth);
            assert_ne!(plain.delta_ste_um, scattered.delta_ste_um);
        }
    }
    // Five standard errors of a mean, a variance and a covariance of normals of variance 1/9.
    let (count, variance) = (count as f64, 1.0_f64 / 9.0);
    let error = 5.0 / count.sqrt();
    for gear in 0..2 {
        assert!((sums[gear] / count).abs() < error * variance.sqrt());
        let spread = squares[gear] / count / variance - 1.0;
        assert!(spread.abs() < error * 2_f64.sqrt(), "{spread}");
    }
    assert!((product / count).abs() < error * variance);
}

/// The signed law takes the lowest gap off already; deviations join it.
#[test]
fn both_laws_of_wear_take_deviations_on_the_converged_grid() {
    let signed = Wear {
        law: WearLaw::Signed { coefficient: 4e-7 },
        ..WEAR
    };
    for wear in [WEAR, signed] {
        let converged = Pair::converged(&figure_7(), &wear, 1e-5).unwrap().pair;
        let coarse = Pair::new(&figure_7(), &Discretisation::default()).unwrap();
        for k in 0..20 {
            let draw = |pair: &Pair| {
                let mut sampler = pair.sampler_with(&wear, gear::Scatter::of_class(class(6)));
                sampler.draw(&mut stream(1, Purpose::Test, 3, k))
            };
            let (fine, coarse) = (draw(&converged), draw(&coarse));
            assert!(
                (coarse / fine - 1.0).abs() < 5e-3,
                "{coarse} against {fine}"
            );
        }
    }
}

/// The amount of a relief deviates by a third of its tolerance for each standard deviation, and is never below zero.
#[test]
fn amounts_of_tip_relief_scatter() {
    let relief = |amount: f64| gear::TipRelief {
        amount,
        length: 2.0,
        shape: gear::ReliefShape::Linear,
    };
    let of = |amount: f64| {
        let corrections =
            gear::Corrections::default().with_tip_relief(gear::Member::Pinion, relief(amount));
        let grid = Discretisation::default();
        Pair::with_corrections(&plain(), &corrections, &grid).unwrap()
    };
    let pair = of(0.006);
    let scatter = gear::Scatter {
        tip_relief: 0.006,
        ..gear::Scatter::default()
    };
    let mut sampler = pair.sampler_with(&NONE, scatter);
    let modes = pair.sampler(&NONE).modes();
    // One relief, one coefficient.
    assert_eq!(sampler.modes(), modes + 1);
    let mut at = |z: f64| {
        let mut coefficients = vec![0.0; modes + 1];
        coefficients[modes] = z;
        sampler.at(&coefficients)
    };
    for (z, amount) in [(0.0, 0.006), (1.0, 0.008), (-1.5, 0.003), (-9.0, 0.0)] {
        let expected = of(amount).unworn().delta_ste_um;
        assert!((at(z) - expected).abs() < 1e-9 * expected.max(1.0), "{z}");
    }
    assert_eq!(of(0.0).sampler_with(&NONE, scatter).modes(), modes);
}
