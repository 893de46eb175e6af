//! Published and independently computed cases.

use gear::{
    Discretisation, Material, Member, Pair, PairInput, Size, ToothModel, inspection, rating,
};
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
        face_width: [number("b"); 2],
        profile_shift: two(&case["x"]),
        tool_addendum: two(&case["ha0"]),
        tool_dedendum: two(&case["hf0"]),
        tip_radius: [0.0; 2],
        root_radius: two(&case["rho_f"]).map(|rho| rho * m),
        hub_radius: [None; 2],
        tip_diameter: [0, 1].map(|i| case["da"][i].as_f64()),
        pinion_torque: case["T1"].as_f64().unwrap_or(200e3),
        material: [Material {
            youngs_modulus_mpa: case["E"].as_f64().unwrap_or(200e3),
            poisson_ratio: case["nu"].as_f64().unwrap_or(0.29),
        }; 2],
        ..plain()
    }
}

/// A quantity of the pair by the symbol the sources print it under.
fn quantity(pair: &Pair, case: &Value, symbol: &str) -> f64 {
    let g = pair.geometry();
    let factor = |key: &str| case[key].as_f64().unwrap_or(1.0);
    let both = |key: &str| [0, 1].map(|i| case[key][i].as_f64().unwrap_or(1.0));
    let factors = rating::Factors {
        edition: rating::Edition::Of2006,
        application_factor: factor("K_A"),
        dynamic_factor: factor("K_v"),
        face_load_factor: factor("K_Hbeta"),
        transverse_load_factor: factor("K_Halpha"),
        root_factor: both("sigma_FG_over_sigma_FE"),
        flank_factor: both("sigma_HG_over_sigma_Hlim"),
        ..rating::Factors::default()
    };
    let strength = rating::Strength {
        factors,
        bending_limit_mpa: [case["sigma_FE"].as_f64(); 2],
        contact_limit_mpa: [factor("sigma_Hlim"); 2],
    };
    let rating = rating::rate(pair, factor("C_R"), &factors);
    let root_safety = strength.root_safety(rating.root_stress_mpa);
    let root_safety = root_safety.map(|safety| safety.unwrap_or(f64::NAN));
    let flank_safety = strength.flank_safety(rating.flank_stress_mpa);
    let root = &rating.root;
    let r_y = g.r[0] * case["d_y"].as_f64().unwrap_or(1.0);
    let (at_reference, at_y) = (
        inspection::flank(g, Member::Pinion, g.r[0]),
        inspection::flank(g, Member::Pinion, r_y),
    );
    let (ratio, sum) = (
        f64::from(g.teeth[1]) / f64::from(g.teeth[0]),
        g.teeth[0] + g.teeth[1],
    );
    let working = 2.0 * g.centre_distance / (1.0 + ratio);
    // Sliding speed over the speed at the working circle.
    let sliding_factor = |g_a: f64| 2.0 * g_a * (1.0 + 1.0 / ratio) / working;
    let tip_thickness =
        |member: Member| inspection::flank(g, member, g.r_a[member.index()]).normal_thickness;
    let sheet = inspection::Sheet::new(pair);
    let found = "the pair can be measured";
    let span = |member: Member| match case["spanned"][member.index()].as_u64() {
        Some(teeth) => inspection::base_tangent_length(g, member, teeth as u32),
        None => sheet.span[member.index()].expect(found).length,
    };
    let balls = |member: Member| match case["balls"].as_f64() {
        Some(ball) => inspection::over_balls(g, member, ball),
        None => sheet.over_balls[member.index()].expect(found).dimension,
    };
    let sliding = pair.sliding();
    let stress = pair.root_stress();
    match symbol {
        "alpha_t_deg" => g.alpha_t.to_degrees(),
        "alpha_wt_deg" => g.alpha_wt.to_degrees(),
        "a" => g.centre_distance,
        "d_b1" => 2.0 * g.r_b[0],
        "d_b2" => 2.0 * g.r_b[1],
        "d_f1" => 2.0 * g.r_f[0],
        "d_f2" => 2.0 * g.r_f[1],
        "d_Nf1" => sheet.active_root_diameter[0],
        "d_Nf2" => sheet.active_root_diameter[1],
        "d_Ff1" => sheet.root_form_diameter[0],
        "d_Ff2" => sheet.root_form_diameter[1],
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
        "d1" => 2.0 * g.r[0],
        "d2" => 2.0 * g.r[1],
        "r1" => g.r[0],
        "r2" => g.r[1],
        "r_a1" => g.r_a[0],
        "r_a2" => g.r_a[1],
        "r_f1" => g.r_f[0],
        "r_f2" => g.r_f[1],
        "d_w1" => sheet.working_diameter[0],
        "d_w2" => sheet.working_diameter[1],
        "y" => g.centre_distance / g.normal_module - f64::from(sum) / (2.0 * g.beta.cos()),
        "m_t" => sheet.transverse_module,
        "a_d" => sheet.reference_centre_distance,
        "h_a1" => g.r_a[0] - g.r[0],
        "h_a2" => g.r_a[1] - g.r[1],
        "h_f2" => g.r[1] - g.r_f[1],
        "h1" => g.r_a[0] - g.r_f[0],
        "p_t" => sheet.transverse_pitch,
        "AB" => g.s_out - g.s_in - g.base_pitch,
        "AD" => g.base_pitch,
        "g_a1" => g.s_out - g.s_pitch,
        "g_a2" => g.s_pitch - g.s_in,
        "h_w" => g.r_a[0] + g.r_a[1] - g.centre_distance,
        "K_ga1" => sliding_factor(g.s_out - g.s_pitch),
        "K_ga2" => sliding_factor(g.s_pitch - g.s_in),
        "inv_alpha_wt" => g.alpha_wt.tan() - g.alpha_wt,
        "inv_alpha_t" => g.alpha_t.tan() - g.alpha_t,
        "beta_b_deg" => g.beta_b.to_degrees(),
        "s_t" => at_reference.transverse_thickness,
        "s_n" | "s_n1" => sheet.tooth_thickness[0],
        "s_n2" => sheet.tooth_thickness[1],
        "k_mn1" => sheet.tip_alteration[0] * g.normal_module,
        "k_mn2" => sheet.tip_alteration[1] * g.normal_module,
        "d_Fa1" => sheet.tip_form_diameter[0],
        "d_Fa2" => sheet.tip_form_diameter[1],
        "d_Na1" => sheet.active_tip_diameter[0],
        "d_Na2" => sheet.active_tip_diameter[1],
        "k1" => f64::from(sheet.span[0].expect(found).teeth),
        "k2" => f64::from(sheet.span[1].expect(found).teeth),
        "D_M1" => sheet.over_balls[0].expect(found).ball,
        "D_M2" => sheet.over_balls[1].expect(found).ball,
        "psi_deg" => (at_reference.transverse_thickness / (2.0 * g.r[0])).to_degrees(),
        "psi_b_deg" => g.psi_b[0].to_degrees(),
        "d_y" => 2.0 * r_y,
        "alpha_yt_deg" => at_y.profile_angle.to_degrees(),
        "s_yt" => at_y.transverse_thickness,
        "rho_y" => at_y.curvature_radius,
        "beta_y_deg" => at_y.helix_angle.to_degrees(),
        "s_an1" => tip_thickness(Member::Pinion),
        "s_an2" => tip_thickness(Member::Gear),
        "W_k1" => span(Member::Pinion),
        "W_k2" => span(Member::Gear),
        "M_dK1" => balls(Member::Pinion),
        "M_dK2" => balls(Member::Gear),
        "h_Fe1" => root[0].arm,
        "h_Fe2" => root[1].arm,
        "alpha_Fen1_deg" => root[0].load_angle.to_degrees(),
        "alpha_Fen2_deg" => root[1].load_angle.to_degrees(),
        "Y_F1" => root[0].y_f,
        "Y_F2" => root[1].y_f,
        "Y_S1" => root[0].y_s,
        "Y_S2" => root[1].y_s,
        "sigma_F01" => root[0].stress_mpa,
        "sigma_F02" => root[1].stress_mpa,
        "Y_beta" => root[0].y_beta,
        "sigma_F1" => rating.root_stress_mpa[0],
        "sigma_F2" => rating.root_stress_mpa[1],
        "sigma_H" => rating.flank_stress_mpa[0],
        "S_F1" => root_safety[0],
        "S_F2" => root_safety[1],
        "S_H1" => flank_safety[0],
        "S_H2" => flank_safety[1],
        "F_t" => rating.tangential_force,
        "Z_H" => rating.z_h,
        "Z_eps" => rating.z_epsilon,
        "Z_B" => rating.z_single[0],
        "sigma_H0" => rating.contact_stress_mpa,
        "sigma_H0_over_Z_eps" => rating.contact_stress_mpa / rating.z_epsilon,
        "sigma_nominal1" => stress[0].nominal_mpa,
        "c_th" => rating.stiffness.theoretical,
        "c_prime" => rating.stiffness.single,
        "c_gamma_alpha" => rating.stiffness.mesh_alpha,
        "c_gamma_beta" => rating.stiffness.mesh_beta,
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
            let ours = quantity(&pair, &case["input"], symbol);
            checked += 1;
            if (ours - value).abs() > tolerance {
                failures.push(format!("{}: {symbol} is {ours}, not {value}", case["id"]));
            }
        }
    }
    assert!(failures.is_empty(), "{failures:#?}");
    assert!(checked > 220, "only {checked} quantities were compared");
}

/// The phases hold the corners of the contact line's length, at the fractional parts of ε_α, ε_β and
/// their sum, as printed for 17 and 43 teeth at β = 20°.
#[test]
fn phases_lie_on_the_corners_of_the_contact_length() {
    let file: Value = serde_json::from_str(include_str!("../data/geometry.json")).unwrap();
    let cases = file["cases"].as_array().unwrap();
    let case = cases
        .iter()
        .find(|case| case["id"] == "contact_ratios_17_43_beta_20");
    let input = input(&case.expect("the case files hold the pair")["input"]);
    let phases = Pair::new(&input, &Discretisation::default())
        .unwrap()
        .unworn()
        .phases;
    for corner in [0.0, 0.08868, 0.49188, 0.58056] {
        // Half a unit of the last printed digit; phases are 0.03 apart.
        assert!(
            phases.iter().any(|phase| (phase - corner).abs() < 6e-6),
            "{corner}"
        );
    }
}

fn finite_element_pair(file: &Value) -> Pair {
    let mut input = input(&file["input"]);
    input.tooth_model = ToothModel::WeberBanaschek;
    input.material = [Material {
        youngs_modulus_mpa: file["input"]["E"].as_f64().unwrap(),
        poisson_ratio: file["input"]["nu"].as_f64().unwrap(),
    }; 2];
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

/// How root form circles shorten the path: cases D and E of the gearcore test suite (test_adv_2.py,
/// 45-digit decimal arithmetic) on its spur pair B, to 1e-12.
#[test]
fn form_circles_limit_the_path() {
    let file: Value = serde_json::from_str(include_str!("../data/geometry.json")).unwrap();
    let case = file["cases"]
        .as_array()
        .unwrap()
        .iter()
        .find(|case| case["id"] == "decimal_b_spur")
        .expect("the case files hold the spur pair B");
    let pair = Pair::new(&input(&case["input"]), &Discretisation::default()).unwrap();
    let close = |a: f64, b: f64| assert!((a / b - 1.0).abs() < 1e-12, "{a} against {b}");
    let d = inspection::active_path(pair.geometry(), [11.45, 39.2]);
    close(2.0 * d.r_nf[0], 22.9);
    close(2.0 * d.r_nf[1], 78.4);
    close(2.0 * d.r_na[0], 27.3838996158237);
    close(2.0 * d.r_na[1], 82.42948115276994);
    close(d.length, 5.779446162989436);
    close(d.eps_alpha, 0.9788599003831299);
    close(d.root_sliding[0], -1.5528009180992495);
    close(d.root_sliding[1], -1.32659469872301);
    let e = inspection::active_path(pair.geometry(), [11.3, 39.2]);
    close(2.0 * e.r_nf[0], 22.653576724323237);
    close(2.0 * e.r_nf[1], 78.4);
    close(2.0 * e.r_na[0], 27.3838996158237);
    close(2.0 * e.r_na[1], 83.2);
    close(e.length, 6.698082056287458);
}
