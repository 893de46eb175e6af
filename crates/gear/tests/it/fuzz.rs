//! A fixed budget of random and hostile inputs: never a panic, a NaN or an endless loop.

use std::collections::BTreeMap;

use gear::{
    Discretisation, Error, Kernel, Material, Member, Pair, PairInput, Size, TipRule, ToothModel,
    Wear, gear_outline,
};
use rand::RngExt as _;
use stats::streams::StreamRng;

use crate::support::{STEEL, rng};

/// Uniform in the logarithm.
fn log_uniform(rng: &mut StreamRng, low: f64, high: f64) -> f64 {
    (low.ln() + rng.random::<f64>() * (high / low).ln()).exp()
}

/// A value from the range, or now and then one of its ends.
fn ranged(rng: &mut StreamRng, low: f64, high: f64) -> f64 {
    match rng.random_range(0..20) {
        0 => low,
        1 => high,
        _ => low + (high - low) * rng.random::<f64>(),
    }
}

/// Inputs from workshop gears to the corners of the accepted domain.
fn input(rng: &mut StreamRng) -> PairInput {
    let wild = rng.random_range(0..3) == 0;
    let teeth = if wild {
        [0, 1].map(|_| log_uniform(rng, 4.0, 10_000.0) as u32)
    } else {
        [0, 1].map(|_| rng.random_range(8..80))
    };
    let m = if wild {
        log_uniform(rng, 1e-4, 1e6)
    } else {
        log_uniform(rng, 0.5, 20.0)
    };
    let size = if rng.random_range(0..2) == 0 {
        Size::NormalModule(m)
    } else {
        Size::CentreDistance((m * f64::from(teeth[0] + teeth[1]) / 2.0).min(1e6))
    };
    let mut both = |low: f64, high: f64| [0, 1].map(|_| ranged(rng, low, high));
    let reach = if wild { 3.0 } else { 1.0 };
    let profile_shift = both(-0.5 * reach, reach);
    let tool_addendum = both(if wild { 0.0 } else { 0.9 }, 0.5 + reach);
    let tool_dedendum = both(if wild { 0.0 } else { 0.8 }, 0.4 + reach);
    let tip_radius = both(0.0, 0.3 * reach).map(|rho| rho * m);
    let root_radius = both(if wild { 0.0 } else { 0.05 }, 0.4 * reach).map(|rho| rho * m);
    let spur = rng.random_range(0..4) == 0;
    PairInput {
        teeth,
        size,
        pressure_angle: if wild {
            ranged(rng, 1.0, 45.0)
        } else {
            ranged(rng, 14.0, 28.0)
        }
        .to_radians(),
        helix_angle: if spur {
            [0.0, 1e-300, 1e-9, -1e-5][rng.random_range(0..4)]
        } else {
            ranged(rng, -60.0, 60.0).to_radians()
        },
        face_width: m * if wild {
            log_uniform(rng, 1e-3, 1e3)
        } else {
            ranged(rng, 2.0, 40.0)
        },
        profile_shift,
        tool_addendum,
        tool_dedendum,
        tip_radius,
        root_radius,
        tip_diameter: [0, 1].map(|i| {
            (rng.random_range(0..12) == 0).then(|| m * f64::from(teeth[i]) * ranged(rng, 0.9, 1.2))
        }),
        tooth_model: ToothModel::ALL[rng.random_range(0..2)],
        tip_rule: TipRule::ALL[rng.random_range(0..2)],
        pinion_torque: if rng.random_range(0..10) == 0 {
            0.0
        } else {
            log_uniform(rng, 1e-6, 1e3) * m * m * m * 1e3
        }
        .min(1e15),
        material: Material {
            youngs_modulus_mpa: log_uniform(rng, 1.0, 1e6),
            poisson_ratio: ranged(rng, 0.0, 0.499),
            ..STEEL
        },
    }
}

fn wear(rng: &mut StreamRng, m: f64) -> Wear {
    Wear {
        max_depth: (m * log_uniform(rng, 1e-6, 1.0)).min(1e3),
        kernel: Kernel::ALL[rng.random_range(0..5)],
        range: log_uniform(rng, 0.02, 10.0),
        variance: log_uniform(rng, 1e-4, 10.0),
    }
}

/// Every number that the pair gives away is finite and of the right sign.
fn check(pair: &Pair, wear: &Wear, rng: &mut StreamRng) -> Result<(), String> {
    let fine = |name: &str, values: &[f64], floor: f64| {
        values
            .iter()
            .all(|v| v.is_finite() && *v >= floor)
            .then_some(())
            .ok_or_else(|| format!("{name}: {values:?}"))
    };
    let sliding = pair.sliding();
    fine(
        "sliding",
        &[sliding.pinion_root, sliding.pinion_tip, sliding.gear_root],
        f64::MIN,
    )?;
    fine("g_s", &[sliding.max], 0.0)?;
    fine("violation", &[pair.interference().worst_violation()], 0.0)?;
    for stress in pair.root_stress() {
        fine(
            "stress",
            &[stress.stress_mpa, stress.nominal_mpa, stress.chord],
            0.0,
        )?;
        fine("notch", &[stress.notch_factor], 1.0)?;
    }
    fine("stiffness", &[pair.pitch_stiffness()], f64::MIN_POSITIVE)?;
    for analysis in [pair.unworn(), pair.archard(wear).analysis] {
        fine("STE", &analysis.ste_um, 0.0)?;
        fine(
            "ΔSTE, pressure",
            &[analysis.delta_ste_um, analysis.hertz_pressure_mpa],
            0.0,
        )?;
    }
    let mut sampler = pair.sampler(wear);
    fine("draws", &[sampler.draw(rng), sampler.draw(rng)], 0.0)
}

#[test]
fn no_input_breaks_the_simulator() {
    let mut rng = rng(77);
    let disc = Discretisation {
        cells: 24,
        phases: 12,
    };
    let mut seen: BTreeMap<&str, usize> = BTreeMap::new();
    for k in 0..20_000 {
        let input = input(&mut rng);
        match Pair::new(&input, &disc) {
            Ok(pair) => {
                *seen.entry("feasible").or_insert(0) += 1;
                let wear = wear(&mut rng, pair.geometry().normal_module);
                if let Err(what) = check(&pair, &wear, &mut rng) {
                    panic!("input {k}: {what}\n{input:?}\n{wear:?}");
                }
                if k % 50 == 0 {
                    for member in Member::BOTH {
                        let outline = gear_outline(&pair, member, 6);
                        assert!(
                            outline.iter().flatten().all(|v| v.is_finite()),
                            "input {k}: outline of {input:?}"
                        );
                    }
                }
            }
            Err(Error::Infeasible(reason)) => {
                *seen.entry(reason.code()).or_insert(0) += 1;
                assert!(!reason.to_string().contains("NaN"), "input {k}: {reason}");
            }
            Err(Error::Input(_)) => *seen.entry("input").or_insert(0) += 1,
        }
    }
    assert!(
        seen["feasible"] > 3_000,
        "the fuzz should reach the solver often: {seen:?}"
    );
    assert!(
        seen.len() >= 10,
        "the fuzz should see most refusals: {seen:?}"
    );
}

/// Numbers outside every domain, and not numbers at all.
#[test]
fn hostile_numbers_are_refused() {
    let mut rng = rng(78);
    let hostile = [
        f64::NAN,
        f64::INFINITY,
        f64::NEG_INFINITY,
        f64::MAX,
        f64::MIN,
        -1.0,
        -0.0,
        0.0,
        f64::MIN_POSITIVE,
        1e300,
    ];
    for _ in 0..4_000 {
        let mut input = input(&mut rng);
        for _ in 0..rng.random_range(1..4) {
            let value = hostile[rng.random_range(0..hostile.len())];
            let i = rng.random_range(0..2);
            match rng.random_range(0..12) {
                0 => input.size = Size::CentreDistance(value),
                1 => input.size = Size::NormalModule(value),
                2 => input.pressure_angle = value,
                3 => input.helix_angle = value,
                4 => input.face_width = value,
                5 => input.profile_shift[i] = value,
                6 => input.tool_addendum[i] = value,
                7 => input.tool_dedendum[i] = value,
                8 => input.tip_radius[i] = value,
                9 => input.root_radius[i] = value,
                10 => input.tip_diameter[i] = Some(value),
                _ => input.pinion_torque = value,
            }
        }
        let disc = Discretisation {
            cells: 8,
            phases: 8,
        };
        if let Ok(pair) = Pair::new(&input, &disc) {
            let wear = wear(&mut rng, pair.geometry().normal_module);
            if let Err(what) = check(&pair, &wear, &mut rng) {
                panic!("{what}\n{input:?}");
            }
        }
    }
}

/// A wear that does not validate gives NaN at worst.
#[test]
fn an_invalid_wear_does_not_panic() {
    let pair = crate::support::pair(&crate::support::plain());
    for (max_depth, range, variance) in [
        (f64::NAN, 0.2, 0.01),
        (1e-3, 0.0, 0.01),
        (1e-3, 0.2, f64::NAN),
        (-1.0, -1.0, -1.0),
    ] {
        let wear = Wear {
            max_depth,
            kernel: Kernel::Exponential,
            range,
            variance,
        };
        assert!(wear.validate().is_err());
        let _ = pair.archard(&wear);
        let _ = pair.sampler(&wear).draw(&mut rng(1));
    }
}
