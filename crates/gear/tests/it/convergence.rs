//! The default discretisation against the converged reference, on random designs of the paper's box
//! and on random helical pairs of other helix angles and fillets.

use gear::paper::SIGNED_WEAR;
use gear::{Discretisation, Pair, PairInput, Size, ToothModel};
use rand::RngExt as _;
use stats::streams::{Purpose, stream};

use crate::support::{WEAR, in_the_box, plain, rng};

const DESIGNS: usize = 20;

fn quantile(errors: &mut [f64], p: f64) -> f64 {
    errors.sort_by(f64::total_cmp);
    errors[((errors.len() - 1) as f64 * p).round() as usize]
}

fn check(what: &str, errors: &mut [f64]) {
    let (median, high) = (quantile(errors, 0.5), quantile(errors, 0.95));
    assert!(
        median <= 1e-3 && high <= 5e-3,
        "{what}: median {median:.1e}, 95th percentile {high:.1e} of {} errors",
        errors.len()
    );
}

fn errors(next: &mut dyn FnMut() -> PairInput) {
    let coarse = Discretisation::default();
    let (mut unworn, mut pressure, mut archard, mut random) = (vec![], vec![], vec![], vec![]);
    let mut signed = vec![];
    while unworn.len() < DESIGNS {
        let input = next();
        let Ok(a) = Pair::new(&input, &coarse) else {
            continue;
        };
        let b = Pair::converged(&input, &WEAR, 1e-6).expect("feasible on any grid");
        assert!(b.change <= 1e-6, "{}: {input:?}", b.change);
        let b = b.pair;
        let relative = |a: f64, b: f64| (a / b - 1.0).abs();
        unworn.push(relative(a.unworn().delta_ste_um, b.unworn().delta_ste_um));
        pressure.push(relative(
            a.unworn().hertz_pressure_mpa,
            b.unworn().hertz_pressure_mpa,
        ));
        archard.push(relative(
            a.archard(&WEAR).analysis.delta_ste_um,
            b.archard(&WEAR).analysis.delta_ste_um,
        ));
        signed.push(relative(
            a.archard(&SIGNED_WEAR).analysis.delta_ste_um,
            b.archard(&SIGNED_WEAR).analysis.delta_ste_um,
        ));
        let (mut a, mut b) = (a.sampler(&WEAR), b.sampler(&WEAR));
        assert_eq!(a.modes(), b.modes());
        for k in 0..4 {
            let draw = |sampler: &mut gear::Sampler| {
                sampler.draw(&mut stream(1, Purpose::Test, unworn.len() as u64, k))
            };
            random.push(relative(draw(&mut a), draw(&mut b)));
        }
    }
    check("unworn", &mut unworn);
    check("pressure", &mut pressure);
    check("archard", &mut archard);
    check("signed", &mut signed);
    check("random", &mut random);
}

#[test]
fn paper_box() {
    let mut rng = rng(10);
    errors(&mut || in_the_box(&mut rng));
}

#[test]
fn other_helix_angles_and_fillets_of_realistic_teeth() {
    let mut rng = rng(11);
    errors(&mut || PairInput {
        helix_angle: rng.random_range(0.02..0.6),
        tip_radius: [rng.random_range(0.0..0.8), rng.random_range(0.0..0.8)],
        root_radius: [rng.random_range(0.2..1.5), rng.random_range(0.2..1.5)],
        tooth_model: ToothModel::WeberBanaschek,
        ..in_the_box(&mut rng)
    });
}

#[test]
fn whole_and_prismatic_teeth() {
    for (tooth_model, number) in [
        (ToothModel::WholeFaceBeam, 13),
        (ToothModel::PrismaticBeam, 14),
    ] {
        let mut rng = rng(number);
        errors(&mut || PairInput {
            tooth_model,
            helix_angle: rng.random_range(0.0..0.6),
            ..in_the_box(&mut rng)
        });
    }
}

#[test]
fn spur_pairs() {
    let mut rng = rng(12);
    errors(&mut || PairInput {
        helix_angle: 0.0,
        ..in_the_box(&mut rng)
    });
}

/// The reference of a pair that has no variation: its change is compared with the mean error.
#[test]
fn silent_pairs_converge_at_once() {
    let mut input = plain();
    let Size::NormalModule(m) = input.size else {
        unreachable!("the plain pair is given by its module")
    };
    input.face_width = [std::f64::consts::PI * m / input.helix_angle.sin(); 2];
    let converged = Pair::converged(&input, &WEAR, 1e-6).expect("feasible");
    assert!(converged.change <= 1e-6 && converged.discretisation.cells <= 512);
    for analysis in [
        converged.pair.unworn(),
        converged.pair.archard(&WEAR).analysis,
    ] {
        assert!(analysis.delta_ste_um < 1e-9 * analysis.ste_um[0]);
    }
}

#[test]
fn a_tolerance_out_of_reach_is_reported() {
    let converged = Pair::converged(&plain(), &WEAR, 0.0).expect("feasible");
    assert!(converged.change > 0.0 && converged.discretisation.cells == 32_768);
}
