//! Published and independently computed cases.

use gear::{Discretisation, Member, Pair, PairInput, Size, ToothModel};
use serde_json::Value;

use crate::support::plain;

fn two(value: &Value) -> [f64; 2] {
    [0, 1].map(|i| {
        value[i]
            .as_f64()
            .expect("the case files hold pairs of numbers")
    })
}

fn input(case: &Value) -> PairInput {
    let number = |key: &str| case[key].as_f64().expect("the case files hold numbers");
    let m = number("m");
    let z = two(&case["z"]);
    PairInput {
        teeth: z.map(|z| z as u32),
        size: Size::NormalModule(m),
        pressure_angle: number("alpha").to_radians(),
        helix_angle: number("beta").to_radians(),
        face_width: number("b"),
        profile_shift: two(&case["x"]),
        tool_addendum: two(&case["ha0"]),
        tool_dedendum: two(&case["hf0"]),
        tip_radius: [0.0; 2],
        root_radius: two(&case["rho_f"]).map(|rho| rho * m),
        tip_diameter: [0, 1].map(|i| case["da"][i].as_f64()),
        pinion_torque: 200e3,
        ..plain()
    }
}

/// A quantity of the pair by the symbol the sources print it under.
fn quantity(pair: &Pair, symbol: &str) -> f64 {
    let g = pair.geometry();
    let sliding = pair.sliding();
    let stress = pair.root_stress();
    let diameter = |i: usize, tangent: f64| 2.0 * g.r_b[i].hypot(tangent);
    match symbol {
        "alpha_t_deg" => g.alpha_t.to_degrees(),
        "alpha_wt_deg" => g.alpha_wt.to_degrees(),
        "a" => g.centre_distance,
        "d_b1" => 2.0 * g.r_b[0],
        "d_b2" => 2.0 * g.r_b[1],
        "d_f1" => 2.0 * g.r_f[0],
        "d_f2" => 2.0 * g.r_f[1],
        "d_Nf1" => diameter(0, g.s_in),
        "d_Nf2" => diameter(1, g.path_length - g.s_out),
        "d_Ff1" => diameter(0, g.t_form[0]),
        "d_Ff2" => diameter(1, g.t_form[1]),
        "c1" => g.clearance[0],
        "c2" => g.clearance[1],
        "p_bt" => g.base_pitch,
        "L" => g.path_length,
        "g_alpha" | "AE" => g.s_out - g.s_in,
        "AC" => g.s_pitch - g.s_in,
        "eps_alpha" => g.eps_alpha,
        "eps_beta" => g.eps_beta,
        "eps_gamma" => g.contact_ratio,
        "zeta_f1" => sliding.pinion_root,
        "zeta_f2" => sliding.gear_root,
        "zeta_a1" => sliding.pinion_tip,
        "zeta_a2" => sliding.gear_tip,
        "s_Fn1" => stress[0].chord,
        "s_Fn2" => stress[1].chord,
        "rho_F1" => stress[0].fillet_radius,
        "rho_F2" => stress[1].fillet_radius,
        "F_bt" => pair.base_force(),
        "F_bn" => pair.base_force() / g.beta_b.cos(),
        _ => panic!("no quantity is called {symbol}"),
    }
}

#[test]
fn geometry_agrees_with_published_cases() {
    let file: Value = serde_json::from_str(include_str!("../data/geometry.json")).unwrap();
    let mut failures = Vec::new();
    let mut checked = 0;
    for case in file["cases"].as_array().unwrap() {
        let pair = Pair::new(&input(&case["input"]), &Discretisation::default()).unwrap();
        for expected in case["expected"].as_array().unwrap() {
            let symbol = expected[0].as_str().unwrap();
            let [value, tolerance] = [1, 2].map(|k| expected[k].as_f64().unwrap());
            let ours = quantity(&pair, symbol);
            checked += 1;
            if (ours - value).abs() > tolerance {
                failures.push(format!("{}: {symbol} is {ours}, not {value}", case["id"]));
            }
        }
    }
    assert!(failures.is_empty(), "{failures:#?}");
    assert!(checked > 90, "only {checked} quantities were compared");
}

fn finite_element_pair(file: &Value) -> Pair {
    let mut input = input(&file["input"]);
    input.tooth_model = ToothModel::WeberBanaschek;
    input.material.youngs_modulus_mpa = file["input"]["E"].as_f64().unwrap();
    input.material.poisson_ratio = file["input"]["nu"].as_f64().unwrap();
    input.pinion_torque = 235.0 * 10.0 * 8.5 * 20_f64.to_radians().cos();
    Pair::new(&input, &Discretisation::default()).unwrap()
}

/// Beam, foundation and contact against a finite-element model of the whole gears. −5 … +25 % for
/// the tooth and ±15 % for the pair: the spread of published analytical models around it.
#[test]
fn weber_banaschek_is_near_finite_elements() {
    let file: Value = serde_json::from_str(include_str!("../data/stiffness.json")).unwrap();
    let pair = finite_element_pair(&file);
    for point in file["tooth"].as_array().unwrap() {
        let member = Member::BOTH[point["member"].as_u64().unwrap() as usize];
        let q = 1e3 * pair.tooth_compliance(member, point["r"].as_f64().unwrap());
        let ratio = q / point["finite_element"].as_f64().unwrap();
        assert!((0.95..1.25).contains(&ratio), "{point}: {ratio}");
        // Printed to four digits by an independent implementation of the same formulas; 0.5 %
        // covers the digits and its quadrature.
        let same = q / point["same_formulas"].as_f64().unwrap();
        assert!((same - 1.0).abs() < 5e-3, "{point}: {q}");
    }
    let finite_element = file["single_pair_at_pitch_point"].as_f64().unwrap();
    let iso = file["iso_c_th"].as_f64().unwrap();
    let s = pair.geometry().s_pitch;
    for row in file["same_formulas_under_load"].as_array().unwrap() {
        let [load, expected] = two(row);
        let stiffness = 1e-3 / pair.compliance_under(s, load);
        assert!(
            (stiffness / expected - 1.0).abs() < 5e-3,
            "{load} N/mm: {stiffness}"
        );
        assert!((stiffness / finite_element - 1.0).abs() < 0.15);
        assert!((stiffness / iso - 1.0).abs() < 0.15);
    }
}

/// The line load of the unworn pair at the pitch point must be the one its compliance holds for.
#[test]
fn weber_banaschek_load_is_a_fixed_point() {
    let file: Value = serde_json::from_str(include_str!("../data/stiffness.json")).unwrap();
    let pair = finite_element_pair(&file);
    // Spur, single contact at the pitch point: the whole force is on one line of 10 mm.
    let load = pair.base_force() / 10.0;
    let s = pair.geometry().s_pitch;
    let ratio = pair.compliance(s) / pair.compliance_under(s, load);
    assert!((ratio - 1.0).abs() < 1e-6, "{ratio}");
}

/// The beam alone is several times stiffer than real teeth, as the documentation says.
#[test]
fn hertz_beam_is_much_stiffer() {
    let soft = Pair::new(
        &PairInput {
            tooth_model: ToothModel::WeberBanaschek,
            ..plain()
        },
        &Discretisation::default(),
    )
    .unwrap();
    let stiff = Pair::new(&plain(), &Discretisation::default()).unwrap();
    let ratio = stiff.pitch_stiffness() / soft.pitch_stiffness();
    assert!((2.0..10.0).contains(&ratio), "{ratio}");
}
