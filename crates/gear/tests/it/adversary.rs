//! Random and hostile pairs, and the properties that must hold for each of them. Shared by the tests, which spend a
//! small fixed budget on them, and by the `fuzz` example, which spends any.

use std::collections::BTreeMap;

use gear::{
    Corrections, Discretisation, Error, Kernel, LocalAmount, Material, Member, Pair, PairInput,
    ReliefShape, Size, TipRelief, TipRule, ToothModel, Wear, WearLaw, gear_outline, rating,
};
use rand::RngExt as _;
use stats::streams::StreamRng;

const DISC: Discretisation = Discretisation {
    cells: 12,
    phases: 8,
};

/// Numbers outside every domain, at its ends, and not numbers at all.
const HOSTILE: [f64; 10] = [
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

/// Number of times each outcome was met: `feasible`, `input`, or the code of a refusal.
pub(crate) type Outcomes = BTreeMap<&'static str, u64>;

/// Simulates `count` pairs and checks each. Half of them come from workshop gears to the corners
/// of the accepted domain, with a hostile number put into one in eight; the others lie on the
/// boundary between a feasible pair and a refused one, where something is about to vanish.
///
/// # Errors
/// Describes the first pair that broke something.
pub(crate) fn run(count: u64, rng: &mut StreamRng) -> Result<Outcomes, String> {
    let mut outcomes = Outcomes::new();
    let mut sides: [Option<PairInput>; 2] = [None, None];
    let mut tried = 0;
    while tried < count {
        let mut candidate = input(rng);
        if rng.random_range(0..8) == 0 {
            sabotage(&mut candidate, rng);
        }
        let feasible = attempt(&candidate, rng, &mut outcomes)?;
        tried += 1;
        if candidate.validate().is_ok() {
            sides[usize::from(feasible)] = Some(candidate);
        }
        if tried % 32 == 0
            && let [Some(refused), Some(accepted)] = &sides
        {
            let (mut low, mut high) = (0.0, 1.0);
            for _ in 0..32 {
                let middle = 0.5 * (low + high);
                let between = blend(accepted, refused, middle);
                if attempt(&between, rng, &mut outcomes)? {
                    low = middle;
                } else {
                    high = middle;
                }
                tried += 1;
            }
        }
    }
    Ok(outcomes)
}

/// Simulates one pair; says whether it is feasible.
fn attempt(
    input: &PairInput,
    rng: &mut StreamRng,
    outcomes: &mut Outcomes,
) -> Result<bool, String> {
    let corrections = corrections(input, rng);
    let outcome = match Pair::with_corrections(input, &corrections, &DISC) {
        Ok(pair) => {
            let wear = wear(rng, pair.geometry().normal_module);
            check(&pair, &wear, rng)
                .map_err(|what| format!("{what}\n{input:?}\n{corrections:?}\n{wear:?}"))?;
            "feasible"
        }
        Err(Error::Infeasible(reason)) => {
            let text = reason.to_string();
            if text.contains("NaN") || text.contains("inf") && !text.contains("infeasible") {
                return Err(format!("{text}\n{input:?}"));
            }
            reason.code()
        }
        Err(Error::Input(_)) => "input",
    };
    *outcomes.entry(outcome).or_insert(0) += 1;
    Ok(outcome == "feasible")
}

/// The pair a part of the way from `a` to `b`; what cannot be divided is taken from `a`.
fn blend(a: &PairInput, b: &PairInput, part: f64) -> PairInput {
    let mix = |a: f64, b: f64| a + part * (b - a);
    let both = |a: [f64; 2], b: [f64; 2]| [mix(a[0], b[0]), mix(a[1], b[1])];
    PairInput {
        pressure_angle: mix(a.pressure_angle, b.pressure_angle),
        helix_angle: mix(a.helix_angle, b.helix_angle),
        face_width: both(a.face_width, b.face_width),
        profile_shift: both(a.profile_shift, b.profile_shift),
        tool_addendum: both(a.tool_addendum, b.tool_addendum),
        tool_dedendum: both(a.tool_dedendum, b.tool_dedendum),
        tip_radius: both(a.tip_radius, b.tip_radius),
        root_radius: both(a.root_radius, b.root_radius),
        ..a.clone()
    }
}

/// Puts hostile numbers into one to three fields.
fn sabotage(input: &mut PairInput, rng: &mut StreamRng) {
    for _ in 0..rng.random_range(1..4) {
        let value = HOSTILE[rng.random_range(0..HOSTILE.len())];
        let i = rng.random_range(0..2);
        match rng.random_range(0..12) {
            0 => input.size = Size::CentreDistance(value),
            1 => input.size = Size::NormalModule(value),
            2 => input.pressure_angle = value,
            3 => input.helix_angle = value,
            4 => input.face_width[i] = value,
            5 => input.profile_shift[i] = value,
            6 => input.tool_addendum[i] = value,
            7 => input.tool_dedendum[i] = value,
            8 => input.tip_radius[i] = value,
            9 => input.root_radius[i] = value,
            10 => input.tip_diameter[i] = Some(value),
            _ => input.pinion_torque = value,
        }
    }
}

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
pub(crate) fn input(rng: &mut StreamRng) -> PairInput {
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
        face_width: [m * if wild {
            log_uniform(rng, 1e-3, 1e3)
        } else {
            ranged(rng, 2.0, 40.0)
        }; 2],
        profile_shift,
        tool_addendum,
        tool_dedendum,
        tip_radius,
        root_radius,
        hub_radius: [None; 2],
        tip_diameter: [0, 1].map(|i| {
            (rng.random_range(0..12) == 0).then(|| m * f64::from(teeth[i]) * ranged(rng, 0.9, 1.2))
        }),
        tooth_model: ToothModel::ALL[rng.random_range(0..ToothModel::ALL.len())],
        tip_rule: TipRule::ALL[rng.random_range(0..2)],
        pinion_torque: if rng.random_range(0..10) == 0 {
            0.0
        } else {
            log_uniform(rng, 1e-6, 1e3) * m * m * m * 1e3
        }
        .min(1e15),
        material: [Material {
            youngs_modulus_mpa: log_uniform(rng, 1.0, 1e6),
            poisson_ratio: ranged(rng, 0.0, 0.499),
        }; 2],
    }
}

pub(crate) fn wear(rng: &mut StreamRng, m: f64) -> Wear {
    Wear {
        law: match rng.random_range(0..3) {
            0 => WearLaw::Signed {
                coefficient: log_uniform(rng, 1e-10, 1.0),
            },
            1 => WearLaw::Archard {
                max_depth_um: (1e3 * m * log_uniform(rng, 1e-6, 1.0)).min(1e6),
            },
            _ => WearLaw::LocalArchard {
                amount: LocalAmount::MaxDepth {
                    max_depth_um: (1e3 * m * log_uniform(rng, 1e-6, 1.0)).min(1e6),
                },
            },
        },
        kernel: Kernel::ALL[rng.random_range(0..5)],
        range: log_uniform(rng, 0.02, 10.0),
        variance: log_uniform(rng, 1e-4, 10.0),
        life: None,
    }
}

/// Mostly no corrections; sometimes tip relief, short or longer than the path, and seldom crowning.
fn corrections(input: &PairInput, rng: &mut StreamRng) -> Corrections {
    let mut corrections = Corrections::default();
    let m = match input.size {
        Size::NormalModule(m)
        | Size::Both {
            normal_module: m, ..
        } => m,
        Size::CentreDistance(a) => 2.0 * a / f64::from(input.teeth[0] + input.teeth[1]),
    };
    // A hostile size is refused before the corrections are looked at.
    let m = if m > 1e-4 && m < 1e6 { m } else { 1.0 };
    if rng.random_range(0..4) == 0 {
        for member in Member::BOTH {
            let relief = TipRelief {
                amount: (m * log_uniform(rng, 1e-6, 1.0)).min(1e3),
                length: (m * log_uniform(rng, 1e-2, 1e2)).clamp(1e-6, 1e6),
                shape: ReliefShape::ALL[rng.random_range(0..2)],
            };
            corrections = corrections.with_tip_relief(member, relief);
        }
    }
    if rng.random_range(0..32) == 0 {
        corrections = corrections.with_crowning((m * log_uniform(rng, 1e-6, 1.0)).min(1e3));
    }
    corrections
}

/// Checks that every number that the pair returns is finite and of the right sign.
pub(crate) fn check(pair: &Pair, wear: &Wear, rng: &mut StreamRng) -> Result<(), String> {
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
    let rating = rating::rate(pair, 1.0, &rating::Factors::default());
    for root in rating.root {
        fine(
            "rated root",
            &[root.y_f, root.y_s, root.arm, root.load_angle],
            0.0,
        )?;
    }
    fine("Z_B, Z_D", &rating.z_single, 1.0)?;
    fine(
        "rated contact",
        &[
            rating.z_h,
            rating.z_e,
            rating.z_epsilon,
            rating.z_beta,
            rating.contact_stress_mpa,
        ],
        0.0,
    )?;
    for analysis in [pair.unworn(), pair.archard(wear).analysis] {
        // Material that the signed law adds shifts the error to either side.
        let floor = match wear.law {
            WearLaw::Archard { .. } | WearLaw::LocalArchard { .. } => 0.0,
            WearLaw::Signed { .. } => f64::MIN,
        };
        fine("STE", &analysis.ste_um, floor)?;
        fine(
            "ΔSTE, pressure",
            &[analysis.delta_ste_um, analysis.hertz_pressure_mpa],
            0.0,
        )?;
    }
    // The expansion of a rough field takes longer than all the rest.
    if rng.random_range(0..8) > 0 {
        return Ok(());
    }
    let mut sampler = pair.sampler(wear);
    fine("draws", &[sampler.draw(rng), sampler.draw(rng)], 0.0)?;
    fine("truncation", &sampler.truncation(), 0.0)?;
    for member in Member::BOTH {
        let outline = gear_outline(pair, member, 3);
        fine("outline", outline.as_flattened(), f64::MIN)?;
    }
    Ok(())
}
