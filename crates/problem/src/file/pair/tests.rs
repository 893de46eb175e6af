use gear::{Discretisation, Pair};

use crate::formulation::Problem;

use super::*;
use crate::Campaign;

/// A pair file with every section, and with every key whose value is a number or a list of two.
const FULL: &str = r#"[pair]
teeth = [20, 22]
centre_distance_mm = 110.0
pressure_angle_deg = 18.0
helix_angle_deg = 30.0
face_width_mm = 10.0
profile_shift = [0.49, 0.49]
tool_addendum = [1.20, 1.11]
tool_dedendum = [1.00, 1.09]
tip_radius_mm = [0.0003, 0.19]
root_radius_mm = [0.64, 0.23]
[load]
pinion_torque_nm = 200.0
[material]
youngs_modulus_gpa = 200.0
poisson_ratio = 0.29
contact_limit_mpa = 1550.0
bending_limit_mpa = 860.0
[wear]
max_depth_um = 3.5
kernel = "squared-exponential"
range_rad = 0.2
variance = 0.01
[manufacture]
flank_class = 6
[corrections]
tip_relief_um = [6.0, 4.0]
tip_relief_length_mm = [2.0, 1.5]
tip_relief_shape = "parabolic"
crowning_um = 5.0
[constraints]
contact_ratio_min = 1.3
transverse_contact_ratio_min = 1.0
specific_sliding_max = 2.0
hertz_pressure_max_mpa = 1400.0
root_stress_max_mpa = 700.0
tip_clearance_min_modules = 0.1
tip_land_min_modules = 0.2
flank_margin_min_mm = 0.1
root_safety_min = 1.4
flank_safety_min = 1.1
"#;

fn parse(text: &str) -> Result<PairFile, String> {
    PairFile::parse("p.toml", text).map_err(|error| error.to_string())
}

fn changed(from: &str, to: &str) -> String {
    assert!(FULL.contains(from), "{from}");
    FULL.replacen(from, to, 1)
}

#[test]
fn corrections_and_constraints_are_read_in_the_simulators_units() {
    let file = parse(FULL).unwrap();
    let corrections = file.corrections();
    let [pinion, mate] = corrections.tip_relief.map(Option::unwrap);
    assert!((pinion.amount - 6e-3).abs() < 1e-15 && (mate.amount - 4e-3).abs() < 1e-15);
    assert_eq!([pinion.length, mate.length], [2.0, 1.5]);
    assert_eq!(pinion.shape, gear::ReliefShape::Parabolic);
    assert!((corrections.crowning - 5e-3).abs() < 1e-15);
    assert_eq!(file.limits().tip_land_min_modules, Some(0.2));
    assert_eq!(file.limits().flank_safety_min, Some(1.1));

    let relieved = changed("tip_relief_um = [6.0, 4.0]", "tip_relief_um = [0.0, 4.0]").replacen(
        "length_mm = [2.0, 1.5]",
        "length_mm = [0.0, 1.5]",
        1,
    );
    let corrections = parse(&relieved).unwrap().corrections();
    assert!(corrections.tip_relief[0].is_none() && corrections.tip_relief[1].is_some());
}

#[test]
fn optional_keys_have_their_defaults() {
    let (plain, _) = FULL.split_once("[wear]").unwrap();
    let file = parse(plain).unwrap();
    assert_eq!(file.to_gear().tooth_model, gear::ToothModel::Coupled);
    assert_eq!(file.to_gear().tip_rule, gear::TipRule::AsCut);
    assert_eq!(file.corrections(), gear::Corrections::default());
    assert_eq!(file.limits(), GearLimits::default());
    assert_eq!(file.wear, wear::default());
    // If one key is given, the others have their defaults.
    let rough = parse(&format!("{plain}[wear]\nvariance = 0.04\n")).unwrap();
    let expected = gear::Wear {
        variance: 0.04,
        ..wear::default()
    };
    assert_eq!(rough.wear, expected);
    assert_eq!(
        parse(&format!("{plain}[corrections]\n"))
            .unwrap()
            .corrections(),
        gear::Corrections::default()
    );
}

#[test]
fn the_pair_file_of_a_design_is_the_campaigns_simulator_input() {
    for text in [Campaign::WEAR, Campaign::PAPER] {
        let campaign = Campaign::parse("c.toml", text).unwrap();
        let problem = Problem::new(campaign.clone());
        let (gears, sections) = (problem.gears().unwrap(), campaign.gears().unwrap());
        let x = [0.1, 0.7 / 3.0, 1.3, 1.21, 1.1, 0.9];
        let design = problem.design(&x, problem.base());
        let file = parse(&PairFile::of_design(sections, &design).to_toml()).unwrap();
        assert_eq!(file.to_gear(), gears.pair_input(&design));
        assert_eq!(&file.wear, gears.wear());
        assert_eq!(file.corrections(), gear::Corrections::default());
        assert_eq!(file.limits(), sections.constraints);
        assert_eq!(file.scatter(), gears.scatter());
        let mut of_class = sections.clone();
        let flank_class = gear::FlankClass::new(6).unwrap();
        of_class.manufacture = Some(Manufacture {
            flank_class: Some(flank_class),
            ..Default::default()
        });
        let file = parse(&PairFile::of_design(&of_class, &design).to_toml()).unwrap();
        assert_eq!(file.scatter().flank_class, gear::FlankClass::new(6));
    }
    let full = parse(FULL).unwrap();
    assert_eq!(parse(&full.to_toml()).unwrap(), full);
}

/// The file refuses every number that the simulator would refuse, in its own units.
#[test]
fn what_is_accepted_is_no_bad_input_of_the_simulator() {
    let extremes = [
        "-1e308", "-60.0", "-1.0", "-1e-9", "0.0", "5e-324", "1e-12", "1e-9", "1e-7", "1e-6",
        "1e-5", "1e-4", "1e-3", "0.499", "0.4999", "0.5", "1.0", "44.9", "45.0", "60.0", "1000.0",
        "1e4", "1e6", "1.1e6", "1e9", "1e12", "1e13", "1e16", "1e308", "inf", "nan",
    ];
    let (mut accepted, mut refused) = (0, 0);
    for line in FULL
        .lines()
        .filter(|line| line.contains('=') && !line.contains('"'))
    {
        let (key, value) = line.split_once(" = ").unwrap();
        for extreme in extremes {
            let new = if value.starts_with('[') {
                format!("{key} = [{extreme}, {extreme}]")
            } else {
                format!("{key} = {extreme}")
            };
            let text = FULL.replacen(line, &new, 1);
            match parse(&text) {
                Err(message) => {
                    refused += 1;
                    assert!(message.starts_with("p.toml, line "), "{new}: {message}");
                    // With a wide face, the file's crowning is too large.
                    let named = message.contains(key) || message.contains("whose contact ratio");
                    assert!(named, "{new}: {message}");
                }
                Ok(file) => {
                    accepted += 1;
                    let pair = Pair::with_corrections(
                        &file.to_gear(),
                        &file.corrections(),
                        &Discretisation {
                            cells: 8,
                            phases: 4,
                        },
                    );
                    assert!(
                        !matches!(pair, Err(gear::Error::Input(_))),
                        "{new}: {pair:?}"
                    );
                    file.wear.validate().unwrap();
                }
            }
        }
    }
    assert!(accepted > 100 && refused > 100, "{accepted}, {refused}");
}

#[test]
fn a_file_of_the_other_kind_is_refused_as_such() {
    let message = parse(Campaign::PAIR).unwrap_err();
    assert!(
        message.contains("format belongs to a campaign file") && message.contains("check"),
        "{message}"
    );
    let message = Campaign::parse("p.toml", FULL).unwrap_err().to_string();
    assert!(
        message.starts_with("p.toml, line 2: pair.teeth belongs to a pair file")
            && message.contains("simulate --pair"),
        "{message}"
    );
}

#[test]
fn bad_values_are_refused_by_line_and_key_in_the_files_units() {
    for (from, to, what) in [
        (
            "pressure_angle_deg = 18.0",
            "pressure_angle_deg = 0.5",
            "line 4: pair.pressure_angle_deg is 0.5, but must be a number from 1 to 45 degrees",
        ),
        (
            "helix_angle_deg = 30.0",
            "helix_angle_deg = 61.0",
            "line 5: pair.helix_angle_deg is 61.0, but must be a number from -60 to 60 degrees",
        ),
        (
            "face_width_mm = 10.0",
            "face_width_mm = 1e7",
            "line 6: pair.face_width_mm is 10000000.0, but must be a number from 0.0001 to 1000000 mm",
        ),
        (
            "poisson_ratio = 0.29",
            "poisson_ratio = 0.4995",
            "line 16: material.poisson_ratio is 0.4995, but must be a number from 0 to 0.499",
        ),
        (
            "max_depth_um = 3.5",
            "max_depth_um = 1e7",
            "wear.max_depth_um",
        ),
        (
            "tip_relief_um = [6.0, 4.0]",
            "tip_relief_um = [-6.0, 4.0]",
            "corrections.tip_relief_um is -6.0, but must be a number from 0 to 1000 µm",
        ),
        (
            "tip_relief_um = [6.0, 4.0]",
            "",
            "corrections.tip_relief_length_mm is [2.0, 1.5], but must be absent without tip_relief_um",
        ),
        (
            "tip_relief_length_mm = [2.0, 1.5]",
            "tip_relief_length_mm = [0.0, 1.5]",
            "corrections.tip_relief_length_mm is 0.0",
        ),
        (
            "tip_relief_length_mm = [2.0, 1.5]",
            "tip_relief_length_mm = [2.0, 40.0]",
            "corrections.tip_relief_length_mm is 40.0, but must be at most 19.2",
        ),
        (
            "tip_relief_length_mm = [2.0, 1.5]",
            "tip_relief_diameter_mm = [120.0, 121.0]\ntip_relief_length_mm = [2.0, 1.5]",
            "corrections.tip_relief_diameter_mm is [120.0, 121.0], but must be absent beside tip_relief_length_mm",
        ),
        (
            "tip_relief_length_mm = [2.0, 1.5]",
            "tip_relief_diameter_mm = [111.0, 500.0]",
            "corrections.tip_relief_diameter_mm is 500.0, but must be from 104.1219 to below 124.8720 mm for the mate",
        ),
        (
            "tip_relief_length_mm = [2.0, 1.5]",
            "tip_relief_diameter_mm = [95.0, 123.0]",
            "corrections.tip_relief_diameter_mm is 95.0, but must be greater: it makes the relief",
        ),
        (
            "face_width_mm = 10.0",
            "face_width_mm = [10.0, 11.0, 12.0]",
            "face_width_mm must be a number, or the numbers of pinion and mate, [b1, b2]",
        ),
        (
            "[corrections]",
            "[allowances]\ntooth_thickness_um = { pinion = [-90.0, -60.0], mate = [-60.0, -90.0] }\n[corrections]",
            "allowances.tooth_thickness_um is [-90.0, -60.0], but must be [upper, lower] with lower ≤ upper for the pinion",
        ),
        (
            "flank_class = 6",
            "flank_class = 12",
            "line 25: manufacture.flank_class is 12, but must be a whole number from 1 to 11",
        ),
        (
            "flank_class = 6",
            "flank_class = 0",
            "line 25: manufacture.flank_class is 0",
        ),
        (
            "flank_class = 6",
            "flank_class = 6.5",
            "line 25: manufacture.flank_class: invalid type",
        ),
        ("flank_class = 6", "", "line 24: manufacture is empty"),
        ("\"parabolic\"", "\"round\"", "\"linear\" or \"parabolic\""),
        (
            "face_width_mm = 10.0",
            "face_width_mm = 10.0\ntooth_model = \"whole-face-beam\"",
            "corrections.crowning_um is 5.0, but must be zero with the tooth model whole-face-beam",
        ),
        (
            "face_width_mm = 10.0",
            "face_width_mm = 300.0",
            "pair.face_width_mm is 300.0, but must be a face width whose overlap ratio is at most 8",
        ),
        (
            "face_width_mm = 10.0",
            "face_width_mm = 10.0\nhub_radius_mm = [20.0, 200.0]",
            "pair.hub_radius_mm is 200.0, but must be a radius below the root circle",
        ),
        (
            "face_width_mm = 10.0",
            "face_width_mm = 5000.0",
            "corrections.crowning_um is 5.0, but must be zero for a pair whose contact ratio",
        ),
        (
            "tip_land_min_modules = 0.2",
            "tip_land_min_modules = -0.2",
            "constraints.tip_land_min_modules",
        ),
        (
            "contact_ratio_min = 1.3",
            "contact_ratio_min = 0.0",
            "constraints.contact_ratio_min",
        ),
        (
            "root_safety_min",
            "root_safety_max",
            "unknown field `root_safety_max`",
        ),
    ] {
        let message = parse(&changed(from, to)).unwrap_err();
        assert!(message.starts_with("p.toml, line "), "{message}");
        assert!(message.contains(what), "{to}: {message}");
    }
}

/// A rack gives the same pair as its keys written out.
#[test]
fn a_rack_takes_the_place_of_its_keys() {
    let (before, rest) = FULL.split_once("tool_addendum").unwrap();
    let (_, tip) = rest.split_once("tip_radius_mm").unwrap();
    let (tip, after) = tip.split_once("root_radius_mm").unwrap();
    let (_, after) = after.split_once('\n').unwrap();
    let with = |rack: &str| format!("{before}{rack}tip_radius_mm{tip}{after}");
    let file = parse(&with("rack = \"iso-53-a\"\n")).unwrap();
    assert_eq!(parse(&file.to_toml()).unwrap(), file);
    let input = file.to_gear();
    let module = gear::Geometry::new(&input).unwrap().normal_module;
    assert_eq!(input.tool_addendum, [1.25; 2]);
    assert_eq!(input.tool_dedendum, [1.0; 2]);
    assert_eq!(input.root_radius, [0.38 * module; 2]);
    for (written, what) in [
        (
            "",
            "pair.tool_addendum is missing, but must be given, unless pair.rack is",
        ),
        (
            "rack = \"iso-53-a\"\ntool_addendum = [1.2, 1.2]\n",
            "pair.tool_addendum is [1.2, 1.2], but must be absent beside pair.rack",
        ),
    ] {
        let error = parse(&with(written)).unwrap_err();
        assert!(error.contains(what), "{error}");
    }
}

/// Both gears of a pair may have a width, allowances and diameters of relief of their own.
#[test]
fn what_each_gear_has_of_its_own_is_kept() {
    let text = changed("face_width_mm = 10.0", "face_width_mm = [12.0, 10.0]")
        .replacen("tip_relief_length_mm = [2.0, 1.5]", "tip_relief_diameter_mm = [112.0, 123.0]", 1)
        .replacen(
            "[constraints]",
            "[allowances]\ntooth_thickness_um = { pinion = [-60.0, -90.0], mate = [-80.0, -120.0] }\n[constraints]",
            1,
        );
    let file = parse(&text).unwrap();
    assert_eq!(parse(&file.to_toml()).unwrap(), file);
    let pair = Pair::with_corrections(
        &file.to_gear(),
        &file.corrections(),
        &Discretisation::default(),
    );
    let pair = pair.unwrap();
    assert_eq!(pair.geometry().face_width, 10.0);
    let starts = gear::inspection::Sheet::new(&pair).relief_diameter;
    for (start, given) in starts.into_iter().zip([112.0, 123.0]) {
        assert!((start.unwrap() - given).abs() < 1e-9, "{start:?}");
    }
}

#[test]
fn a_pair_file_is_warned_of_doubtful_units() {
    assert_eq!(parse(FULL).unwrap().warnings(), [""; 0]);
    for (from, to, part) in [
        (
            "youngs_modulus_gpa = 200.0",
            "youngs_modulus_gpa = 206000.0",
            "206000 GPa: did you mean 206?",
        ),
        ("face_width_mm = 10.0", "face_width_mm = 0.1", "is 0.1 mm"),
        (
            "max_depth_um = 3.5",
            "max_depth_um = 3500.0",
            "wear.max_depth_um is 3500 µm",
        ),
    ] {
        let warnings = parse(&changed(from, to)).unwrap().warnings();
        // The narrow face is out of the tooth model's range, too.
        let expected = 1 + usize::from(from.starts_with("face_width"));
        assert_eq!(warnings.len(), expected, "{warnings:?}");
        assert!(warnings[0].contains(part), "{warnings:?}");
    }
}
