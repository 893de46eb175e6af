//! The tooth model of coupled cells, and gaps along the face with any model. The crate `lab` compares it
//! with finite elements.

use gear::paper;
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
    life: None,
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

/// Helix slopes and misalignment scatter the samples of all models that know the face, spur gears too, and leave the
/// wear's random numbers alone.
#[test]
fn helix_slopes_and_misalignment_scatter() {
    let class = Scatter::of_class(FlankClass::new(7).unwrap());
    let shafts = Scatter {
        misalignment: 0.02,
        ..Scatter::default()
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
        face_width: [300.0; 2],
        ..coupled()
    };
    let refused = Pair::new(&input, &Discretisation::default()).unwrap_err();
    assert!(
        matches!(&refused, Error::Input(error) if error.field == "face_width"),
        "{refused}"
    );
}

/// Designs drawn at random from the paper's box, free of interference, with ΔSTE of finite elements in µm, new
/// and worn by [`paper::WEAR`]. The elements are those of the cases in the crate `lab`.
const BOX_DESIGNS: [([f64; 6], f64, f64); 16] = [
    (
        [0.8121, -0.7050, 1.4730, 1.2726, 1.0933, 1.1795],
        23.56,
        23.21,
    ),
    (
        [0.1517, 1.7779, 1.4536, 1.6292, 0.8093, 1.3116],
        15.22,
        15.45,
    ),
    (
        [0.0899, 1.1947, 1.6735, 1.4411, 0.8522, 1.3287],
        18.26,
        18.23,
    ),
    (
        [1.0314, 1.5656, 1.6128, 1.6427, 1.0279, 1.0187],
        12.91,
        11.01,
    ),
    (
        [-0.8029, 1.1620, 1.0811, 1.6178, 1.2292, 0.9218],
        24.11,
        23.45,
    ),
    (
        [1.8792, 0.3793, 1.5687, 1.4649, 1.1540, 0.8604],
        13.20,
        13.49,
    ),
    (
        [0.6608, -0.3732, 1.2694, 1.4634, 1.0641, 1.1324],
        21.38,
        20.38,
    ),
    (
        [0.4942, 1.7309, 1.6484, 1.6209, 1.1451, 0.9104],
        15.89,
        14.28,
    ),
    (
        [1.8677, -0.3137, 1.6732, 1.1984, 1.5641, 0.9668],
        15.75,
        15.80,
    ),
    (
        [1.1019, -0.9735, 1.5402, 1.1765, 0.8641, 0.8612],
        25.98,
        24.41,
    ),
    (
        [-0.1391, -0.1116, 1.4002, 1.1807, 1.0557, 1.3794],
        5.36,
        5.99,
    ),
    (
        [0.7127, -0.7888, 1.1395, 1.2084, 1.0372, 0.8802],
        21.97,
        21.18,
    ),
    (
        [0.8061, -0.3035, 1.4498, 1.4201, 1.1704, 0.9002],
        19.86,
        19.77,
    ),
    (
        [0.2595, -0.2685, 1.3144, 1.3822, 1.1483, 0.9383],
        19.49,
        18.60,
    ),
    ([0.0795, 0.8930, 1.5228, 1.6569, 1.3575, 1.3911], 7.91, 8.22),
    (
        [-0.3635, 1.0801, 1.1886, 1.6090, 0.8313, 1.1012],
        18.85,
        18.94,
    ),
];

/// The model ranks designs as finite elements do, though most of these profile shifts are outside its range.
#[test]
fn designs_are_ranked_as_finite_elements_rank_them() {
    let spearman = |tooth_model: ToothModel| {
        let found = BOX_DESIGNS.map(|(variables, _, _)| {
            let input = PairInput {
                tooth_model,
                ..paper::design(variables)
            };
            let pair = Pair::new(&input, &Discretisation::of(tooth_model)).unwrap();
            let worn = pair.archard(&paper::WEAR).analysis;
            [pair.unworn().delta_ste_um, worn.delta_ste_um]
        });
        let rank = |state: usize, expected: &[f64]| {
            stats::spearman(&found.map(|both| both[state]), expected).unwrap()
        };
        [
            rank(0, &BOX_DESIGNS.map(|(_, new, _)| new)),
            rank(1, &BOX_DESIGNS.map(|(_, _, worn)| worn)),
        ]
    };
    let (coupled, slices) = (
        spearman(ToothModel::Coupled),
        spearman(ToothModel::HertzBeam),
    );
    assert!(coupled.iter().all(|rank| *rank > 0.97), "{coupled:?}");
    assert!(slices.iter().all(|rank| *rank < 0.8), "{slices:?}");
}
