use crate::Campaign;

/// The warnings of the shipped campaign after this replacement.
fn warnings(from: &str, to: &str) -> Vec<String> {
    assert!(Campaign::WEAR.contains(from), "{from}");
    let text = Campaign::WEAR.replacen(from, to, 1);
    Campaign::parse("c.toml", &text).unwrap().warnings()
}

#[test]
fn the_examples_that_init_writes_have_no_warnings() {
    for text in [Campaign::PAIR, Campaign::EXTERNAL[0]] {
        let warnings = Campaign::parse("c.toml", text).unwrap().warnings();
        assert!(warnings.is_empty(), "{warnings:?}");
    }
}

#[test]
fn a_campaign_is_warned_of_doubtful_units_and_of_frozen_values_outside_its_bounds() {
    for (from, to, part) in [
        (
            "youngs_modulus_gpa = 200.0",
            "youngs_modulus_gpa = 0.2",
            "material.youngs_modulus_gpa is 0.2 GPa, less than that of soft plastics",
        ),
        (
            "youngs_modulus_gpa = 200.0",
            "youngs_modulus_gpa = 206000.0",
            "206000 GPa: did you mean 206?",
        ),
        (
            "face_width_mm = 10.0",
            "face_width_mm = 0.01",
            "pair.face_width_mm is 0.01 mm",
        ),
        (
            "face_width_mm = 10.0",
            "face_width_mm = 10000.0",
            "from 0.5 to 1000 mm",
        ),
        (
            "pinion_torque_nm = 200.0",
            "pinion_torque_nm = 0.2",
            "load.pinion_torque_nm is 0.2 N·m: its line load F_t/b is 0.382 N/mm",
        ),
        (
            "pinion_torque_nm = 200.0",
            "pinion_torque_nm = 200000.0",
            "load.pinion_torque_nm is 200000 N·m",
        ),
        (
            "[material]",
            "[[load.cases]]\nname = \"start\"\npinion_torque_nm = 300000.0\n[material]",
            "pinion_torque_nm of the load case \"start\" is 300000 N·m",
        ),
        (
            "[material]",
            "[[load.cases]]\nwear = 50.0\n[material]",
            "wear of the load case \"case_1\" is 50, that many times the depth of [wear]: did you mean 0.5?",
        ),
        (
            "variance = 0.01",
            "variance = 10.0",
            "wear.variance is 10: the wear depth has a standard deviation of 3.16 times its mean",
        ),
        (
            "helix_angle_deg = [0.0, 30.0]",
            "helix_angle_deg = [-30.0, 30.0]",
            "bounds.helix_angle_deg is -30: left and right hand give the same results",
        ),
        (
            "[doe]",
            "[corrections]\ntip_relief_um = [0.0, 0.02]\ntip_relief_length_mm = [0.5, 6.0]\n[doe]",
            "corrections.tip_relief_um is at most 0.02 µm: did you mean 20?",
        ),
        (
            "max_depth_um = 3.5",
            "max_depth_um = 3500.0",
            "wear.max_depth_um is 3500 µm, which is 3.5 mm",
        ),
        (
            "helix_angle_deg = 30.0",
            "helix_angle_deg = 35.0",
            "frozen.helix_angle_deg is 35: bounds.helix_angle_deg allows 0 to 30",
        ),
        (
            "tip_radius_mm = [0.0003, 0.19]",
            "tip_radius_mm = [0.0003, 19.0]",
            "frozen.tip_radius_mm of the mate is 19 mm",
        ),
        (
            "root_radius_mm = [0.64, 0.23]",
            "root_radius_mm = [0.0064, 0.23]",
            "frozen.root_radius_mm of the pinion is 0.0064 mm",
        ),
    ] {
        let warnings = warnings(from, to);
        assert_eq!(warnings.len(), 1, "{to}: {warnings:?}");
        assert!(warnings[0].contains(part), "{to}: {warnings:?}");
    }
}

/// The frozen radii are then outside their bounds, too.
#[test]
fn a_centre_distance_in_metres_is_not_taken_for_a_torque_in_another_unit() {
    let warnings = warnings("centre_distance_mm = 110.0", "centre_distance_mm = 0.11");
    let module = "pair.centre_distance_mm is 0.11 mm, for a module of about 0.0052 mm";
    assert!(warnings[0].starts_with(module), "{warnings:?}");
    assert!(
        !warnings.iter().any(|one| one.contains("torque")),
        "{warnings:?}"
    );
}

#[test]
fn a_centre_distance_that_no_usual_shift_gives_is_named_with_those_that_one_gives() {
    for (from, to, is_warned) in [
        ("109.293", "109.293", false),
        ("109.293", "0.109293", true),
        ("109.293", "95.0", true),
        ("109.293", "150.0", true),
        ("gear_teeth = 47", "gear_teeth = 11", true),
        ("helix_angle_deg = 15.0", "helix_angle_deg = 60.0", true),
        (
            "helix_angle_deg = 15.0",
            "helix_angle_deg = [0.0, 60.0]",
            false,
        ),
    ] {
        assert!(Campaign::PAIR.contains(from), "{from}");
        let text = Campaign::PAIR.replacen(from, to, 1);
        let warnings = Campaign::parse("c.toml", &text).unwrap().warnings();
        let found = warnings
            .iter()
            .find(|one| one.contains("centre_distance_mm"));
        assert_eq!(found.is_some(), is_warned, "{to}: {warnings:?}");
        // From the involute equation, solved by bisection, with sums of -1.1 and 2.6.
        let expected = "profile shifts of the mate from -1 to 2 give 104.85 to 115.31 mm";
        if from == "109.293" && is_warned {
            assert!(found.unwrap().contains(expected), "{found:?}");
        }
    }
}

#[test]
fn a_given_module_bounds_the_frozen_radii_exactly() {
    let text = Campaign::WEAR.replacen("centre_distance_mm = 110.0", "normal_module_mm = 4.0", 1);
    let warned = |radius: &str| {
        let text = text.replacen("root_radius_mm = [0.64, 0.23]", radius, 1);
        let campaign = Campaign::parse("c.toml", &text).unwrap();
        campaign.warnings().len()
    };
    // The bounds: 0.05 to 1 times a module of 4 mm.
    assert_eq!(warned("root_radius_mm = [0.2, 4.0]"), 0);
    assert_eq!(warned("root_radius_mm = [0.19, 4.1]"), 2);
}
