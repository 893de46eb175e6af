//! The tooth model of coupled cells, and gaps along the face with any model. The crate `lab` compares it
//! with finite elements.

use gear::{
    Corrections, Discretisation, Error, FlankClass, Kernel, Pair, PairInput, Scatter, ToothModel,
    Wear, WearLaw,
};
use stats::streams::{Purpose, stream};

use crate::general::plain;

const WEAR: Wear = Wear {
    law: WearLaw::Archard { max_depth_um: 3.0 },
    kernel: Kernel::SquaredExponential,
    range: 0.2,
    variance: 0.01,
};

fn coupled() -> PairInput {
    PairInput {
        tooth_model: ToothModel::Coupled,
        ..plain()
    }
}

fn spur() -> PairInput {
    PairInput {
        helix_angle: 0.0,
        ..coupled()
    }
}

fn delta(input: &PairInput, corrections: &Corrections) -> f64 {
    let grid = Discretisation::of(input.tooth_model);
    let pair = Pair::with_corrections(input, corrections, &grid).unwrap();
    pair.unworn().delta_ste_um
}

/// A spur gear's ends of the face are alike. A helical gear's are not.
#[test]
fn the_sign_of_a_helix_slope_matters_to_helical_gears_only() {
    let with = |input: &PairInput, slope: f64| {
        delta(input, &Corrections::default().with_helix_slope(slope))
    };
    for model in [ToothModel::Coupled, ToothModel::WeberBanaschek] {
        let of = |input: PairInput| PairInput {
            tooth_model: model,
            ..input
        };
        let (plus, minus) = (with(&of(spur()), 0.05), with(&of(spur()), -0.05));
        assert!((plus / minus - 1.0).abs() < 1e-6, "{model}: {plus} {minus}");
        assert!(
            (plus / with(&of(spur()), 0.0) - 1.0).abs() > 0.01,
            "{model}"
        );
        let (plus, minus) = (with(&of(coupled()), 0.02), with(&of(coupled()), -0.02));
        assert!((plus / minus - 1.0).abs() > 1e-3, "{model}: {plus} {minus}");
    }
}

/// A misalignment is a helix slope that is measured across the shafts, and one undoes the other.
#[test]
fn a_helix_slope_can_undo_a_misalignment() {
    let cos_bb = Pair::new(&coupled(), &Discretisation::default())
        .unwrap()
        .geometry()
        .beta_b
        .cos();
    let out_of_line = Corrections::default().with_misalignment(0.015);
    let undone = out_of_line.with_helix_slope(-0.015 * cos_bb);
    let none = delta(&coupled(), &Corrections::default());
    assert!((delta(&coupled(), &out_of_line) / none - 1.0).abs() > 0.02);
    // The slopes differ by rounding.
    assert!((delta(&coupled(), &undone) / none - 1.0).abs() < 1e-6);
}

/// Without random numbers a sample is the pair with mean wear.
#[test]
fn a_sample_of_zeros_is_the_mean_wear() {
    for input in [coupled(), spur()] {
        let grid = Discretisation::of(ToothModel::Coupled);
        let pair = Pair::new(&input, &grid).unwrap();
        let zeros = pair.sampler(&WEAR).at(&[]);
        assert_eq!(zeros, pair.archard(&WEAR).analysis.delta_ste_um);
    }
}

/// Samples depend on their random numbers alone, not on those before them.
#[test]
fn samples_do_not_depend_on_their_order() {
    let pair = Pair::new(&coupled(), &Discretisation::of(ToothModel::Coupled)).unwrap();
    let mut sampler = pair.sampler(&WEAR);
    let mut draw = |k| sampler.draw(&mut stream(1, Purpose::Test, 0, k));
    let forwards: Vec<u64> = (0..40).map(|k| draw(k).to_bits()).collect();
    let backwards: Vec<u64> = (0..40).rev().map(|k| draw(k).to_bits()).collect();
    assert!(forwards.iter().eq(backwards.iter().rev()));
}

/// Helix slopes and misalignment scatter the samples of all that know the face, spur gears too, and leave
/// the wear's random numbers alone.
#[test]
fn helix_slopes_and_misalignment_scatter() {
    let class = Scatter::of_class(FlankClass::new(7).unwrap());
    let shafts = Scatter {
        flank_class: None,
        misalignment: 0.02,
    };
    for model in ToothModel::ALL {
        for helix_angle in [0.0, 15_f64.to_radians()] {
            let input = PairInput {
                tooth_model: *model,
                helix_angle,
                ..plain()
            };
            let pair = Pair::new(&input, &Discretisation::of(*model)).unwrap();
            let may_tilt = model.knows_the_face();
            let modes = |scatter| pair.sampler_with(&WEAR, scatter).modes();
            let wear = modes(Scatter::default());
            assert_eq!(modes(class) - wear, if may_tilt { 4 } else { 2 });
            assert_eq!(modes(shafts) - wear, usize::from(may_tilt));
            let draw = |scatter| {
                pair.sampler_with(&WEAR, scatter)
                    .draw_profile(&mut stream(3, Purpose::Test, 0, 0))
            };
            let (even, tilted) = (draw(Scatter::default()), draw(shafts));
            assert_eq!(even.depth, tilted.depth, "{model}");
            assert_eq!(tilted.tilt != 0.0, may_tilt);
            assert_eq!(
                even.delta_ste_um != tilted.delta_ste_um,
                may_tilt,
                "{model}"
            );
        }
    }
}

/// With a stiffer hub the pair is stiffer.
#[test]
fn the_hub_moves_the_mean() {
    let mean = |hub: Option<f64>| {
        let input = PairInput {
            hub_radius: [hub, None],
            ..coupled()
        };
        let grid = Discretisation::of(ToothModel::Coupled);
        let unworn = Pair::new(&input, &grid).unwrap().unworn();
        unworn.ste_um.iter().sum::<f64>() / unworn.ste_um.len() as f64
    };
    let usual = mean(None);
    assert!(mean(Some(19.0)) < usual && usual < mean(Some(8.0)));
    let input = PairInput {
        hub_radius: [Some(22.0), None],
        ..coupled()
    };
    let refused = Pair::new(&input, &Discretisation::default()).unwrap_err();
    assert!(
        matches!(&refused, Error::Input(error) if error.field == "hub_radius[0]"),
        "{refused}"
    );
}

#[test]
fn a_face_of_many_pitches_is_refused() {
    let input = PairInput {
        face_width: 300.0,
        ..coupled()
    };
    let refused = Pair::new(&input, &Discretisation::default()).unwrap_err();
    assert!(
        matches!(&refused, Error::Input(error) if error.field == "face_width"),
        "{refused}"
    );
}
