use super::*;

pub(super) const PAIR: &str = r#"[pair]
teeth = [23, 37]
normal_module_mm = 2.0
pressure_angle_deg = 20.0
helix_angle_deg = 0.0
face_width_mm = 25.0
profile_shift = [0.2, 0.1]
tool_addendum = [1.25, 1.25]
tool_dedendum = [1.0, 1.0]
tip_radius_mm = [0.1, 0.1]
root_radius_mm = [0.6, 0.6]
[load]
pinion_torque_nm = 100.0
[material]
youngs_modulus_gpa = 206.0
poisson_ratio = 0.3
contact_limit_mpa = 1500.0
bending_limit_mpa = 860.0
"#;

const UNWORN: Request = Request {
    wear: WearChoice::None,
    seed: 1,
    samples: 30,
};

fn simulated(text: &str) -> Simulation {
    run(&PairFile::parse("p.toml", text).unwrap(), UNWORN).unwrap()
}

fn broken(simulation: &Simulation) -> Vec<&str> {
    let broken = simulation.constraints.iter().filter(|c| !c.holds());
    broken.map(|constraint| &*constraint.name).collect()
}

#[test]
fn a_sound_pair_holds_the_default_constraints() {
    let sound = simulated(PAIR);
    assert!(sound.simulable && sound.feasible, "{:?}", broken(&sound));
    let names: Vec<&str> = sound.constraints.iter().map(|c| &*c.name).collect();
    assert_eq!(
        names,
        [
            "contact pressure",
            "pinion tip clearance",
            "mate tip clearance",
            "pinion flank margin",
            "mate flank margin"
        ]
    );
    assert!(describe(&sound).ends_with("feasible: all 5 constraints hold\n"));
}

/// The class acts on random flanks only, and the text says which scatter it includes.
#[test]
fn a_flank_class_scatters_random_samples_and_is_named() {
    let text = format!("{PAIR}[manufacture]\nflank_class = 6\n");
    let parsed = |text: &str| PairFile::parse("p.toml", text).unwrap();
    let (of_class, perfect) = (parsed(&text), parsed(PAIR));
    for (wear, state) in [
        (WearChoice::None, "unworn"),
        (WearChoice::Archard, "mean wear"),
    ] {
        let request = Request { wear, ..UNWORN };
        let simulation = run(&of_class, request).unwrap();
        let [mut simulation, mut without] = [simulation, run(&perfect, request).unwrap()];
        let said = describe(&simulation);
        assert!(said.contains("profile slope tolerance"), "{said}");
        // The data sheet has the tolerances of the class; nothing else depends on it.
        for one in [&mut simulation, &mut without] {
            one.figures.as_mut().unwrap().sheet.clear();
        }
        assert!(simulation == without);
        // The figures that depend on wear say which wear they are for.
        for figure in ["contact pressure", "ΔSTE"] {
            let named = format!("\n{figure}, {state} ");
            assert!(describe(&simulation).contains(&named), "{named}");
        }
    }
    let random = Request {
        wear: WearChoice::Random,
        ..UNWORN
    };
    let (with, without) = (
        run(&of_class, random).unwrap(),
        run(&perfect, random).unwrap(),
    );
    let json = to_json(&with).unwrap();
    // 0.4 m + 0.001 d + 4 = 4.8 + 0.046 or 0.074, times the root of two.
    let tolerances = [23.0, 37.0].map(|z| (4.8 + 0.002 * z) * 2_f64.sqrt());
    let manufacture = &json["manufacture"];
    assert_eq!(manufacture["flank_class"], 6);
    for gear in 0..2 {
        let tolerance = manufacture["slope_tolerance_um"][gear].as_f64().unwrap();
        assert!((tolerance - tolerances[gear]).abs() < 1e-9, "{tolerance}");
    }
    assert!(to_json(&without).unwrap().get("manufacture").is_none());
    let spread = |simulation: &Simulation| simulation.figures.clone().unwrap().sd_um.unwrap();
    assert!(spread(&with) > 1.2 * spread(&without));
    for part in [
        "6: profile slopes ±6.85, ±6.89 µm",
        "pitch and form deviations, dynamics",
    ] {
        assert!(describe(&with).contains(part), "{}", describe(&with));
        assert!(!describe(&without).contains(part));
    }
    let folder = tempfile::tempdir().unwrap();
    let subject = Subject {
        title: "p",
        program_version: "1.2.3",
        file: &of_class,
        request: random,
    };
    let page = write_page(&subject, &with, folder.path()).unwrap().unwrap();
    let html = std::fs::read_to_string(page).unwrap();
    assert!(html.contains("Slope deviations are not drawn.") && html.contains("±6.85"));
}

/// The limit of a load case is one of P90, which takes random pairs.
#[test]
fn limits_of_load_cases_are_held_against_random_pairs() {
    let text = PAIR.replace(
        "[material]",
        "[[load.cases]]\nname = \"worn\"\ndelta_ste_max_um = 1e-3\n[material]",
    );
    let file = PairFile::parse("p.toml", &text).unwrap();
    let archard = Request {
        wear: WearChoice::Archard,
        ..UNWORN
    };
    let without = run(&file, archard).unwrap();
    assert!(
        without
            .warnings
            .iter()
            .any(|one| one.contains("add --wear random"))
    );
    let random = Request {
        wear: WearChoice::Random,
        ..UNWORN
    };
    let with = run(&file, random).unwrap();
    let broken: Vec<&str> = with
        .constraints
        .iter()
        .filter(|one| !one.holds())
        .map(|one| &*one.name)
        .collect();
    assert_eq!(broken, ["P90 of ΔSTE, case worn"]);
    assert!(!with.feasible && without.feasible);
}

/// With one case, the measure over all cases is that of the case; of two, it is at least that of each.
#[test]
fn the_measure_over_all_load_cases_stands_beside_that_of_each() {
    let random = Request {
        wear: WearChoice::Random,
        ..UNWORN
    };
    let p90s = |cases: &str| {
        let file = PairFile::parse("p.toml", &PAIR.replace("[material]", cases)).unwrap();
        let json = to_json(&run(&file, random).unwrap()).unwrap();
        let each = json["cases"].as_array().unwrap().iter();
        let each: Vec<f64> = each.map(|one| one["p90_um"].as_f64().unwrap()).collect();
        let all = json["all_cases"].clone();
        (
            each,
            all["p90_um"].as_f64().unwrap(),
            all["combination"].clone(),
        )
    };
    let (each, all, _) = p90s("[[load.cases]]\nwear = 1.0\n[material]");
    assert_eq!(each, [all]);
    let two = "[[load.cases]]\nwear = 1.0\n[[load.cases]]\npinion_torque_nm = 150.0\n[material]";
    let (each, all, how) = p90s(two);
    assert_eq!(how, "greatest");
    assert!(each.iter().all(|p90| all >= *p90), "{each:?} {all}");
    let weighted = two
        .replace("wear = 1.0", "wear = 1.0\nweight = 1.0")
        .replace("150.0", "150.0\nweight = 3.0");
    let (each, all, how) = p90s(&weighted);
    assert_eq!(how, "weighted mean");
    // Percentiles of a mean are about the mean of the percentiles.
    let expected = 0.25 * each[0] + 0.75 * each[1];
    assert!((all / expected - 1.0).abs() < 0.05, "{each:?} {all}");
}

/// A pair whose error by the grid is small has no warning; two figures that differ by a fifth have.
#[test]
fn the_grid_is_judged_by_one_twice_as_fine() {
    let simulation = simulated(PAIR);
    let figures = simulation.figures.clone().unwrap();
    let finer = figures.finer_grid.unwrap();
    let share = |coarse: f64, fine: f64| (coarse / fine - 1.0).abs();
    let of_delta = share(figures.delta_ste_um, finer.delta_ste_um);
    assert!(of_delta > 0.0 && of_delta < 0.05, "{of_delta}");
    assert!(share(figures.hertz_pressure_mpa, finer.hertz_pressure_mpa) < 0.05);
    let is_of_grid = |one: &String| one.contains("on a grid twice as fine");
    assert!(!simulation.warnings.iter().any(is_of_grid));
    assert!(describe(&simulation).contains("on a grid twice as fine     ΔSTE"));
    let doubts = finer.doubts(1.2 * finer.delta_ste_um, finer.hertz_pressure_mpa);
    assert_eq!(doubts.len(), 1, "{doubts:?}");
    assert!(doubts[0].starts_with("ΔSTE is ") && doubts[0].ends_with("of the order of 20 %"));
}

#[test]
fn every_limit_of_the_file_is_held_against_its_figure() {
    let figures = |simulation: &Simulation| simulation.figures.clone().unwrap();
    let sound = figures(&simulated(PAIR));
    let module = sound.normal_module_mm;
    // Limits 1 % above and below the figure.
    for (key, value, largest, names) in [
        (
            "contact_ratio_min",
            [sound.contact_ratio.total; 2],
            false,
            &["contact ratio"][..],
        ),
        (
            "transverse_contact_ratio_min",
            [sound.contact_ratio.transverse; 2],
            false,
            &["transverse contact ratio"],
        ),
        (
            "specific_sliding_max",
            [sound.specific_sliding.max; 2],
            true,
            &["specific sliding"],
        ),
        (
            "hertz_pressure_max_mpa",
            [sound.hertz_pressure_mpa; 2],
            true,
            &["contact pressure"],
        ),
        (
            "root_stress_max_mpa",
            sound.root_stress_mpa,
            true,
            &["root stress"],
        ),
        (
            "tip_clearance_min_modules",
            sound.clearance_mm.map(|c| c / module),
            false,
            &["pinion tip clearance", "mate tip clearance"],
        ),
        (
            "tip_land_min_modules",
            sound.tip_land_mm.map(|land| land / module),
            false,
            &["pinion tip land", "mate tip land"],
        ),
        (
            "flank_margin_min_mm",
            sound.flank_margin_mm,
            false,
            &["pinion flank margin", "mate flank margin"],
        ),
        (
            "root_safety_min",
            sound.iso_6336.root_safety.map(Option::unwrap),
            false,
            &["pinion root safety S_F", "mate root safety S_F"],
        ),
        (
            "flank_safety_min",
            sound.iso_6336.flank_safety,
            false,
            &["pinion flank safety S_H", "mate flank safety S_H"],
        ),
    ] {
        let [least, most] = [value[0].min(value[1]), value[0].max(value[1])];
        let (good, bad) = if largest {
            (1.01 * most, 0.99 * least)
        } else {
            (0.99 * least, 1.01 * most)
        };
        let with = |limit: f64| simulated(&format!("{PAIR}[constraints]\n{key} = {limit:?}\n"));
        assert_eq!(broken(&with(good)), [""; 0], "{key}");
        let bad = with(bad);
        assert_eq!(broken(&bad), names, "{key}");
        assert!(bad.simulable && !bad.feasible);
        for name in names {
            let text = describe(&bad);
            assert!(text.contains(&format!("  {name} = ")), "{key}: {text}");
        }
    }
}

/// The pinion's undercut takes 0.44 mm of the path of contact: without it, the contact ratio is 1.268.
#[test]
fn an_undercut_flank_is_held_against_the_limits_as_it_is_left() {
    let text = r"
[pair]
teeth = [12, 30]
normal_module_mm = 3.0
pressure_angle_deg = 20.0
helix_angle_deg = 0.0
face_width_mm = 20.0
profile_shift = [0.0, 0.0]
tool_addendum = [1.4, 1.25]
tool_dedendum = [1.0, 0.64]
tip_radius_mm = [0.0, 0.0]
root_radius_mm = [1.14, 1.14]
[load]
pinion_torque_nm = 20.0
[material]
youngs_modulus_gpa = 206.0
poisson_ratio = 0.3
contact_limit_mpa = 1500.0
bending_limit_mpa = 860.0
[constraints]
contact_ratio_min = 1.25
specific_sliding_max = 4.0
";
    let undercut = simulated(text);
    assert!(undercut.simulable && !undercut.feasible);
    let figures = undercut.figures.as_ref().unwrap();
    assert!((figures.contact_ratio.transverse - 1.218).abs() < 5e-4);
    assert!((figures.flank_margin_mm[0] + 0.443).abs() < 5e-4);
    assert!((figures.specific_sliding.max - 3.7957).abs() < 5e-4);
    // 5.69 on the whole path.
    assert_eq!(broken(&undercut), ["contact ratio", "pinion flank margin"]);
}

#[test]
fn a_tip_pressed_into_the_root_is_named_with_value_unit_and_limit() {
    let pressed =
        simulated(&PAIR.replace("tool_dedendum = [1.0, 1.0]", "tool_dedendum = [1.3, 1.0]"));
    assert!(pressed.simulable && !pressed.feasible);
    assert_eq!(broken(&pressed), ["pinion tip clearance"]);
    let clearance = pressed.figures.as_ref().unwrap().clearance_mm[0];
    let sentence = format!("  pinion tip clearance = {clearance:.4} mm beyond its limit of 0 mm\n");
    assert!(clearance < 0.0 && describe(&pressed).ends_with(&sentence));
    let json = to_json(&pressed).unwrap();
    let row = &json["constraints"][1];
    assert_eq!(row["name"], "pinion tip clearance");
    assert_eq!(row["value"].as_f64(), Some(clearance));
    assert_eq!((&row["unit"], &row["limit"]), (&"mm".into(), &0.0.into()));
    assert_eq!(
        (&row["holds"], &json["feasible"]),
        (&false.into(), &false.into())
    );
    assert_eq!(json["schema_version"], 3);
}

#[test]
fn a_pair_that_is_not_simulable_has_a_reason_and_no_constraints() {
    let none = simulated(&PAIR.replace("[0.2, 0.1]", "[-3.0, -3.0]"));
    assert!(!none.simulable && !none.feasible && none.constraints.is_empty());
    let reason = none.reason.as_deref().unwrap();
    assert_eq!(
        describe(&none),
        format!("the pair cannot be simulated: {reason}\n")
    );
}

#[test]
fn corrections_of_the_file_change_the_transmission_error() {
    let ste = |text: &str| simulated(text).figures.unwrap().delta_ste_um;
    let relief = "[corrections]\ntip_relief_um = [6.0, 6.0]\ntip_relief_length_mm = [2.0, 2.0]\n";
    let (plain, relieved) = (ste(PAIR), ste(&format!("{PAIR}{relief}")));
    assert!(relieved < 0.8 * plain, "{relieved} against {plain}");
    let crowned = ste(&format!("{PAIR}[corrections]\ncrowning_um = 10.0\n"));
    assert!(
        (crowned / plain - 1.0).abs() > 1e-3,
        "{crowned} and {plain}"
    );
}

/// A spur pinion without profile shift: s_a = d_a (π/(2 z) + inv α − inv α_a).
#[test]
fn a_tip_land_is_the_thickness_at_the_tip_circle() {
    let spur = simulated(&PAIR.replace("[0.2, 0.1]", "[0.0, 0.0]"));
    let land = spur.figures.unwrap().tip_land_mm[0];
    let (z, m, alpha) = (23.0_f64, 2.0, 20_f64.to_radians());
    let tip = (z * alpha.cos() / (z + 2.0)).acos();
    let inv = |a: f64| a.tan() - a;
    let half = std::f64::consts::PI / (2.0 * z) + inv(alpha) - inv(tip);
    let expected = m * (z + 2.0) * half;
    assert!((land - expected).abs() < 1e-12, "{land} against {expected}");
}

#[test]
fn a_page_holds_the_pair_its_charts_and_their_points() {
    let folder = tempfile::tempdir().unwrap();
    let file = PairFile::parse("p.toml", PAIR).unwrap();
    for (name, wear, files) in [
        ("new", WearChoice::None, 17),
        ("worn", WearChoice::Random, 19),
    ] {
        let request = Request { wear, ..UNWORN };
        let simulation = run(&file, request).unwrap();
        let subject = Subject {
            title: "p",
            program_version: "1.2.3",
            file: &file,
            request,
        };
        let out = folder.path().join(name);
        let page = write_page(&subject, &simulation, &out).unwrap().unwrap();
        let html = std::fs::read_to_string(page).unwrap();
        // Six drawings and two profiles; with random wear the samples and the wear, too.
        let charts = if files == 19 { 10 } else { 8 };
        assert_eq!(html.matches("<svg").count(), charts);
        for part in [
            "feasible: all 5 constraints hold",
            "version 1.2.3",
            "pinion flank margin",
        ] {
            assert!(html.contains(part), "{part}");
        }
        assert_eq!(std::fs::read_dir(&out).unwrap().count(), files);
        let figures = simulation.figures.unwrap();
        let read = |file: &str| std::fs::read_to_string(out.join(file)).unwrap();
        // At the pair's own torque, ΔSTE is that of the figures.
        let over_torque = read("torque.csv");
        let own = over_torque.lines().find(|line| line.starts_with("100,"));
        let own: Vec<f64> = own
            .unwrap()
            .split(',')
            .map(|one| one.parse().unwrap())
            .collect();
        let (wanted, found) = (figures.delta_ste_um, own[if files == 19 { 2 } else { 1 }]);
        assert!((found / wanted - 1.0).abs() < 1e-9, "{found} for {wanted}");
        if let [_, _, worn, low, high] = own[..] {
            assert!(low < worn && worn < high, "{low} to {high} around {worn}");
        }
        // The extremes of the curves are those of the figures.
        let pressure = largest(&read("pressure.csv"), if files == 19 { 2 } else { 1 });
        assert_eq!(pressure, figures.hertz_pressure_mpa);
        if files == 19 {
            let depth = largest(&read("wear.csv"), 3);
            assert!((depth - 3.5).abs() < 1e-12, "{depth}");
            assert!(read("wear.csv").starts_with("from_pitch_point_mm,pinion_roll_angle_rad,"));
            assert!(read("wear.csv").contains("pinion_sample_10_um"));
        }
    }
}

/// The page draws the pinion's flank and names the depth of the mate's, where the two differ.
#[test]
fn the_wear_of_both_flanks_is_written() {
    let law = "[wear]\nlaw = \"local-archard\"\nmax_depth_um = 5.0\nkernel = \"exponential\"\n\
               range_rad = 0.2\nvariance = 0.01\n";
    let file = PairFile::parse("p.toml", &format!("{PAIR}{law}")).unwrap();
    let request = Request {
        wear: WearChoice::Archard,
        ..UNWORN
    };
    let simulation = run(&file, request).unwrap();
    let subject = Subject {
        title: "p",
        program_version: "1.2.3",
        file: &file,
        request,
    };
    let folder = tempfile::tempdir().unwrap();
    let page = write_page(&subject, &simulation, folder.path())
        .unwrap()
        .unwrap();
    let csv = std::fs::read_to_string(folder.path().join("wear.csv")).unwrap();
    let header = csv.lines().next().unwrap();
    assert!(header.ends_with("mate_roll_angle_rad,pinion_mean_depth_um,mate_mean_depth_um"));
    let [pinion, mate] = [3, 4].map(|column| largest(&csv, column));
    assert!(
        (pinion - 5.0).abs() < 1e-12 && mate < 4.0,
        "{pinion} {mate}"
    );
    let text = format!("the mean wear of the mate is at most {mate:.2} µm deep");
    assert!(std::fs::read_to_string(page).unwrap().contains(&text));
}

/// The largest value of a column of a CSV file.
fn largest(csv: &str, column: usize) -> f64 {
    let values = csv.lines().skip(1);
    let values = values.map(|line| line.split(',').nth(column).unwrap().parse::<f64>().unwrap());
    values.fold(f64::NEG_INFINITY, f64::max)
}
