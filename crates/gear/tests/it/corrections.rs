//! Tip relief and crowning.

use gear::{
    Corrections, Discretisation, Member, Pair, PairInput, ReliefShape, Size, TipRelief, ToothModel,
};
use stats::streams::{Purpose, stream};

use crate::support::{WEAR, balance, figure_7, linear, plain, tip_separation};

pub(crate) fn corrected(input: &PairInput, corrections: &Corrections) -> Pair {
    Pair::with_corrections(input, corrections, &Discretisation::default())
        .expect("the test's design is feasible")
}

fn relief(amount: f64, length: f64, shape: ReliefShape) -> TipRelief {
    TipRelief {
        amount,
        length,
        shape,
    }
}

/// Both tips relieved, differently, and the face crowned.
pub(crate) fn everything() -> Corrections {
    Corrections::default()
        .with_tip_relief(Member::Pinion, relief(0.006, 2.5, ReliefShape::Linear))
        .with_tip_relief(Member::Gear, relief(0.004, 3.5, ReliefShape::Parabolic))
        .with_crowning(0.005)
}

#[test]
fn no_correction_changes_no_bit() {
    let nothing = Corrections::default()
        .with_tip_relief(Member::Pinion, relief(0.0, 1e6, ReliefShape::Linear));
    for corrections in [Corrections::default(), nothing] {
        let (a, b) = (
            Pair::new(&figure_7(), &Discretisation::default()).unwrap(),
            corrected(&figure_7(), &corrections),
        );
        assert_eq!(a.unworn(), b.unworn());
        assert_eq!(a.archard(&WEAR), b.archard(&WEAR));
        let draw = |pair: &Pair| {
            pair.sampler(&WEAR)
                .draw(&mut stream(1, Purpose::Test, 0, 0))
        };
        assert_eq!(draw(&a).to_bits(), draw(&b).to_bits());
    }
}

/// δ/cos β_b in µm at the phase `phi` mm, from slices with a place on the face.
pub(crate) fn slice_sum(pair: &Pair, worn: &dyn Fn(f64) -> f64, phi: f64) -> f64 {
    const SLICES: usize = 8000;
    let (g, corrections) = (pair.geometry(), pair.corrections());
    let dz = g.face_width / SLICES as f64;
    let beyond = if pair.input().tooth_model == ToothModel::WeberBanaschek {
        0.3 * g.base_pitch
    } else {
        0.0
    };
    let mut slices = Vec::new();
    for k in 0..SLICES {
        let share = (k as f64 + 0.5) / SLICES as f64;
        let crown = corrections.crowning * (2.0 * share - 1.0).powi(2);
        let mut s = g.s_in - g.base_pitch + phi - share * g.face_width * g.beta_b.tan();
        while s <= g.s_out + beyond {
            if s >= g.s_in - beyond {
                let at = s.clamp(g.s_in, g.s_out);
                let mut gap = crown + worn(at);
                if s != at {
                    gap += tip_separation(g, s < g.s_in, (s - at).abs());
                }
                let from_tips = [g.s_out - at, at - g.s_in];
                for (relief, from_tip) in corrections.tip_relief.iter().zip(from_tips) {
                    let Some(relief) = relief else { continue };
                    if from_tip < relief.length {
                        let x = 1.0 - from_tip / relief.length;
                        let parabolic = relief.shape == ReliefShape::Parabolic;
                        gap += relief.amount * if parabolic { x * x } else { x };
                    }
                }
                slices.push((gap, dz / pair.compliance(s)));
            }
            s += g.base_pitch;
        }
    }
    1e3 * balance(&slices, pair.base_force()) / g.beta_b.cos()
}

fn compare_with_slices(input: &PairInput, corrections: &Corrections) {
    let pair = corrected(input, corrections);
    let archard = pair.archard(&WEAR);
    let depth = |s: f64| 2.0 * linear(&archard.s, &archard.depth[0], s);
    for (analysis, worn) in [
        (pair.unworn(), &(|_| 0.0) as &dyn Fn(f64) -> f64),
        (archard.analysis.clone(), &depth),
    ] {
        for k in (0..analysis.phases.len()).step_by(9) {
            let phi = analysis.phases[k] * pair.geometry().base_pitch;
            let expected = slice_sum(&pair, worn, phi);
            // One slice in 8000 at each end of a line, the crown's straight pieces, and 1/q and
            // parabolic relief taken as straight between nodes.
            assert!(
                (analysis.ste_um[k] / expected - 1.0).abs() < 1e-3,
                "{corrections:?} at {}: {} against {expected}",
                analysis.phases[k],
                analysis.ste_um[k]
            );
        }
    }
}

#[test]
fn corrections_agree_with_a_slice_sum() {
    let reliefs = Corrections {
        crowning: 0.0,
        ..everything()
    };
    let crown = Corrections::default().with_crowning(0.008);
    for corrections in [reliefs, crown, everything()] {
        compare_with_slices(&figure_7(), &corrections);
        compare_with_slices(
            &PairInput {
                tooth_model: ToothModel::WeberBanaschek,
                face_width: [90.0; 2],
                ..plain()
            },
            &corrections,
        );
    }
}

/// A spur line is touched over its whole face at one phase, so its crown acts through the exact
/// solution of one parabola: w0 = ∫ max(0, δ − C (1 − 2z)²) dz, with δ ≥ C a force of δ − C/3.
#[test]
fn a_crowned_spur_pair_sinks_by_a_third_of_its_crown() {
    let input = PairInput {
        helix_angle: 0.0,
        ..plain()
    };
    let plain = corrected(&input, &Corrections::default()).unworn();
    let least = plain.ste_um.iter().copied().fold(f64::MAX, f64::min) * 1e-3;
    let crowning = 0.5 * least;
    let crowned = corrected(&input, &Corrections::default().with_crowning(crowning)).unworn();
    for (a, b) in plain.ste_um.iter().zip(&crowned.ste_um) {
        // 64 straight pieces raise the mean of the parabola by C/6144.
        let expected = a + 1e3 * crowning / 3.0;
        assert!((b / expected - 1.0).abs() < 1e-3, "{b} against {expected}");
    }
    assert!(crowned.hertz_pressure_mpa > plain.hertz_pressure_mpa);
}

/// With an integer overlap any gap that depends on s alone is silent, crowning is not.
#[test]
fn integer_overlap_is_silent_with_relief_alone() {
    let mut input = plain();
    let Size::NormalModule(m) = input.size else {
        unreachable!("the plain pair is given by its module")
    };
    input.face_width = [2.0 * std::f64::consts::PI * m / input.helix_angle.sin(); 2];
    let reliefs = Corrections {
        crowning: 0.0,
        ..everything()
    };
    let silent = corrected(&input, &reliefs);
    for analysis in [silent.unworn(), silent.archard(&WEAR).analysis] {
        assert!(analysis.delta_ste_um < 1e-9 * analysis.ste_um[0]);
    }
    let crowned = corrected(&input, &everything()).unworn();
    assert!(crowned.delta_ste_um > 1e-4 * crowned.ste_um[0]);
}

/// The purpose of tip relief: a spur pair with realistic teeth runs more quietly at its load with
/// about the relief that its deflection asks for, and less quietly with five times as much.
#[test]
fn the_right_relief_quietens_a_spur_pair() {
    let input = PairInput {
        helix_angle: 0.0,
        tooth_model: ToothModel::WeberBanaschek,
        ..plain()
    };
    let bare = corrected(&input, &Corrections::default());
    let g = bare.geometry();
    let double = g.s_out - g.s_in - g.base_pitch;
    let mean = bare.unworn().ste_um.iter().sum::<f64>() / bare.unworn().ste_um.len() as f64;
    let with = |amount: f64| {
        let relief = relief(amount, double, ReliefShape::Linear);
        let corrections = Corrections::default()
            .with_tip_relief(Member::Pinion, relief)
            .with_tip_relief(Member::Gear, relief);
        corrected(&input, &corrections).unworn().delta_ste_um
    };
    let bare = bare.unworn().delta_ste_um;
    let (right, much) = (with(1e-3 * mean), with(5e-3 * mean));
    assert!(right < 0.5 * bare, "{right} against {bare}");
    assert!(much > 1.5 * right, "{much} against {right}");
}

#[test]
fn corrections_follow_their_gear() {
    let input = figure_7();
    let swap = |v: [f64; 2]| [v[1], v[0]];
    let exchanged = PairInput {
        teeth: [input.teeth[1], input.teeth[0]],
        profile_shift: swap(input.profile_shift),
        tool_addendum: swap(input.tool_addendum),
        tool_dedendum: swap(input.tool_dedendum),
        tip_radius: swap(input.tip_radius),
        root_radius: swap(input.root_radius),
        pinion_torque: input.pinion_torque * 22.0 / 20.0,
        ..input.clone()
    };
    let mut other = everything();
    other.tip_relief.reverse();
    let (a, b) = (
        corrected(&input, &everything()),
        corrected(&exchanged, &other),
    );
    let close = |a: f64, b: f64| (a / b - 1.0).abs() < 1e-6;
    assert!(close(a.unworn().delta_ste_um, b.unworn().delta_ste_um));
    assert!(close(
        a.archard(&WEAR).analysis.delta_ste_um,
        b.archard(&WEAR).analysis.delta_ste_um
    ));
}

#[test]
fn corrected_pairs_converge() {
    let converged =
        Pair::converged_with_corrections(&figure_7(), &everything(), &WEAR, 1e-5).unwrap();
    assert!(converged.change <= 1e-5, "{}", converged.change);
    let coarse = corrected(&figure_7(), &everything());
    let error = coarse.unworn().delta_ste_um / converged.pair.unworn().delta_ste_um - 1.0;
    assert!(error.abs() < 5e-3, "{error}");
}

/// Every place of a flank is touched once a period, so the greatest pressure of a row is that of the place.
#[test]
fn the_contact_pattern_has_the_greatest_pressure_of_every_place() {
    let whole_face = PairInput {
        tooth_model: ToothModel::WholeFaceBeam,
        ..plain()
    };
    for (input, corrections) in [
        (plain(), Corrections::default()),
        (figure_7(), Corrections::default()),
        (plain(), everything()),
        (whole_face, Corrections::default()),
    ] {
        let pair = corrected(&input, &corrections);
        let expected = pair.archard(&WEAR).pressure;
        let pattern = pair.contact_pattern(Some(&WEAR), 400);
        assert_eq!(pattern.len(), expected.len());
        let most = expected.iter().copied().fold(0.0, f64::max);
        for (row, expected) in pattern.iter().zip(&expected) {
            let found = row.iter().copied().fold(0.0, f64::max);
            // The greatest value may lie between two of the parts.
            assert!((found - expected).abs() < 0.02 * most, "{found} {expected}");
        }
    }
    // A crown takes the load off the ends of the face.
    let crowned = corrected(&plain(), &Corrections::default().with_crowning(0.02));
    let pattern = crowned.contact_pattern(None, 101);
    let middle = &pattern[pattern.len() / 2];
    assert!(middle[0] == 0.0 && middle[50] > 0.0, "{middle:?}");
}
