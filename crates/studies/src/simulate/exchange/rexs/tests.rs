use gear::{Discretisation, UnloadedPair};
use roxmltree::{Document, Node};

use super::*;
use crate::simulate::tests::PAIR;

/// Attributes with their units and relations of the components that are written, from `rexs_schema_1.5.xml` in the
/// repository `fva-net/rexs-api-java` (Apache-2.0).
const ATTRIBUTES: &str = include_str!("schema_1.5.csv");
const RELATIONS: &str = include_str!("relations_1.5.csv");

/// A helical pair with everything that the format can hold.
fn text() -> String {
    let changes = [
        ("helix_angle_deg = 0.0", "helix_angle_deg = 15.0"),
        ("face_width_mm = 25.0", "face_width_mm = [25.0, 24.0]"),
        ("[load]", "hub_radius_mm = [12.0, 20.0]\n[load]"),
        ("[material]", "[material]\nname = \"16MnCr5\""),
    ];
    let text = changes
        .iter()
        .fold(PAIR.to_owned(), |text, (from, to)| text.replace(from, to));
    text + "[manufacture]\nflank_class = 6\n[corrections]\ntip_relief_um = [6.0, 0.0]\n\
            tip_relief_length_mm = [2.0, 0.0]\ntip_relief_shape = \"parabolic\"\ncrowning_um = 4.0\n\
            helix_slope_um = -3.0\n[material.mate]\nname = \"C45\"\nhardness_hv = 200\n"
}

fn written() -> (PairFile, UnloadedPair, String) {
    let file = PairFile::parse("p.toml", &text()).unwrap();
    let grid = Discretisation::of(file.pair.tooth_model);
    let pair = UnloadedPair::new(&file.to_gear(), &file.corrections(), &grid).unwrap();
    let xml = write("A & B <1>", "1.2.3", &file, &pair);
    (file, pair, xml)
}

fn named<'a, 'input>(node: Node<'a, 'input>, name: &'a str) -> Vec<Node<'a, 'input>> {
    node.descendants()
        .filter(|node| node.has_tag_name(name))
        .collect()
}

/// Every component, attribute, unit and combination in a relation is one of REXS 1.5, and every reference has a
/// component.
#[test]
fn a_written_pair_keeps_the_schema() {
    let (_, _, xml) = written();
    let document = Document::parse(&xml).unwrap();
    let root = document.root_element();
    for required in ["version", "applicationId", "applicationVersion", "date"] {
        assert!(root.attribute(required).is_some(), "{required}");
    }
    let kind = |id: &str| {
        let components = root.children().find(|node| node.has_tag_name("components"));
        let mut components = components.unwrap().children();
        let found = components.find(|node| node.attribute("id") == Some(id));
        found.unwrap().attribute("type").unwrap()
    };
    let mut attributes = 0;
    for component in named(root, "component") {
        let of = component.attribute("type").unwrap();
        assert_eq!(of, kind(component.attribute("id").unwrap()));
        assert!(
            ATTRIBUTES
                .lines()
                .any(|line| line.split(',').next() == Some(of)),
            "{of}"
        );
        for attribute in named(component, "attribute") {
            let [id, unit] = ["id", "unit"].map(|name| attribute.attribute(name).unwrap());
            let line = format!("{of},{id},{unit}");
            let known = ATTRIBUTES.lines().any(|one| one == line);
            assert!(known || id.starts_with("custom_pitchline_"), "{line}");
            attributes += 1;
        }
    }
    assert!(attributes > 75, "{attributes}");
    for relation in named(root, "relation") {
        let members = named(relation, "ref").into_iter().map(|one| {
            let of = kind(one.attribute("id").unwrap());
            assert_eq!(one.attribute("hint"), Some(of));
            format!("{}={of}", one.attribute("role").unwrap())
        });
        let members: Vec<String> = members.collect();
        let line = format!(
            "{},{}",
            relation.attribute("type").unwrap(),
            members.join(" ")
        );
        assert!(RELATIONS.lines().any(|one| one == line), "{line}");
    }
}

#[test]
fn a_written_pair_has_the_file_s_values() {
    let (file, pair, xml) = written();
    let document = Document::parse(&xml).unwrap();
    let root = document.root_element();
    let values = |kind: &str, id: &str| -> Vec<String> {
        let components = named(root, "component").into_iter();
        let components = components.filter(|node| node.attribute("type") == Some(kind));
        let all = components.flat_map(|component| named(component, "attribute"));
        let all = all.filter(|attribute| attribute.attribute("id") == Some(id));
        all.map(|attribute| attribute.text().unwrap().to_owned())
            .collect()
    };
    for (kind, id, expected) in [
        ("cylindrical_gear", "number_of_teeth", &["23", "37"][..]),
        (
            "cylindrical_gear",
            "helix_angle_reference_diameter",
            &["15", "-15"],
        ),
        ("cylindrical_gear", "inner_diameter", &["24", "40"]),
        (
            "cylindrical_gear",
            "tolerance_class_according_to_iso_1328_2013",
            &["6", "6"],
        ),
        (
            "cylindrical_gear_flank",
            "addendum_modification_coefficient",
            &["0.2", "0.2", "0.1", "0.1"],
        ),
        (
            "rack_shaped_tool",
            "addendum_coefficient_reference_profile",
            &["1.25", "1.25"],
        ),
        ("rack_shaped_tool", "tip_radius_factor", &["0.3", "0.3"]),
        ("tip_relief", "tip_relief_depth", &["0.006"]),
        ("tip_relief", "shape_of_relief", &["parabolic"]),
        (
            "helix_crowning",
            "helix_crowning_amount_datum_face",
            &["0.004"],
        ),
        ("cylindrical_stage_gear_data", "torque", &["100"]),
        ("material", "material_designation", &["16MnCr5", "C45"]),
    ] {
        assert_eq!(values(kind, id), expected, "{kind} {id}");
    }
    let a: f64 = values("cylindrical_stage", "center_distance")[0]
        .parse()
        .unwrap();
    assert_eq!(a, pair.geometry().centre_distance);
    assert_eq!(file.load.pinion_torque_nm, 100.0);
    assert!(xml.contains("name=\"A &amp; B &lt;1&gt;\""));
}

/// Everything that REXS holds is read back. It does not hold strength factors, wear, limits, load cases and names of
/// racks.
#[test]
fn a_written_pair_is_imported_as_it_was() {
    let (file, _, xml) = written();
    let imported = import("p.rexs", &xml, None).unwrap();
    let read = PairFile::parse("p.toml", &imported.toml).unwrap();
    assert_eq!(read, file);
    assert!(imported.notes.is_empty(), "{:?}", imported.notes);
    let given = import("p.rexs", &xml, Some(77.0)).unwrap();
    let given = PairFile::parse("p.toml", &given.toml).unwrap();
    assert_eq!(given.load.pinion_torque_nm, 77.0);
}

/// Backlash and turned tips are sizes that do not follow from the others.
#[test]
fn sizes_that_do_not_follow_are_kept() {
    let (_, _, xml) = written();
    let tip = |diameter: f64| format!("id=\"tip_diameter\" unit=\"mm\">{diameter}<");
    let (file, pair, _) = written();
    let g = pair.geometry();
    let (a, [d, other]) = (g.centre_distance, g.r_a.map(|r| 2.0 * r));
    let changed = xml
        .replace(&format!(">{a}<"), &format!(">{}<", a + 0.05))
        .replace(&tip(d), &tip(d - 0.2));
    let read = PairFile::parse("p.toml", &import("p.rexs", &changed, None).unwrap().toml).unwrap();
    assert_eq!(read.pair.centre_distance_mm, Some(a + 0.05));
    assert_eq!(read.pair.tip_diameter_mm, Some([d - 0.2, other]));
    assert_eq!(read.load, file.load);
}

#[test]
fn units_are_converted_and_missing_values_get_stated_defaults() {
    let (file, _, xml) = written();
    let metres = xml
        .replace(
            "id=\"face_width\" unit=\"mm\">25<",
            "id=\"face_width\" unit=\"m\">0.025<",
        )
        .replace(
            "id=\"tip_relief_depth\" unit=\"mm\">0.006<",
            "id=\"tip_relief_depth\" unit=\"um\">6<",
        );
    assert_ne!(metres, xml);
    let read = PairFile::parse("p.toml", &import("p.rexs", &metres, None).unwrap().toml).unwrap();
    assert_eq!(read, file);
    // A tool without its tip radius, a material without Poisson's ratio and a name that is not known.
    let poor = xml
        .replace("tip_radius_factor", "other_factor")
        .replace("\"poisson_ratio\"", "\"other_ratio\"")
        .replace("16MnCr5", "Unobtainium");
    let imported = import("p.rexs", &poor, None).unwrap();
    let read = PairFile::parse("p.toml", &imported.toml).unwrap();
    assert_eq!(read.pair.root_radius_mm, Some([0.76; 2]));
    assert_eq!(read.material.pinion.poisson_ratio, 0.3);
    assert_eq!(imported.notes.len(), 3, "{:?}", imported.notes);
    assert!(
        imported
            .toml
            .starts_with("# cylindrical_gear \"Pinion\" (component")
    );
}

#[test]
fn what_cannot_be_imported_is_refused_by_component_and_attribute() {
    let (_, _, xml) = written();
    let refused = |from: &str, to: &str| {
        let changed = xml.replace(from, to);
        assert_ne!(changed, xml, "{from}");
        format!("{:#}", import("p.rexs", &changed, None).unwrap_err())
    };
    for (from, to, why) in [
        (
            "<model version=\"1.5\"",
            "<model version=\"2.0\"",
            "version \"2.0\"",
        ),
        ("</model>", "", "p.rexs is not XML"),
        (
            "id=\"number_of_teeth\" unit=\"none\">37<",
            "id=\"number_of_teeth\" unit=\"none\">-37<",
            "cylindrical_gear \"Mate\" (component 16) has -37 teeth: internal",
        ),
        (
            "type=\"gear_unit\" name",
            "type=\"planetary_stage\" name",
            "planetary_stage \"A & B <1>\" (component 1) is not an external",
        ),
        (
            "type=\"shaft\" name",
            "type=\"cylindrical_stage\" name",
            "it has 3 cylindrical stages instead of one",
        ),
        (
            "id=\"face_width\" unit=\"mm\"",
            "id=\"face_width\" unit=\"inch\"",
            "face_width is in \"inch\", but must be in mm or um or m",
        ),
        (
            "id=\"face_width\"",
            "id=\"width\"",
            "lacks the attribute face_width",
        ),
        (
            "id=\"torque\"",
            "id=\"power\"",
            "give the torque on the pinion with --torque",
        ),
        (
            "unit=\"deg\">-15<",
            "unit=\"deg\">15<",
            "must have opposite signs",
        ),
        (
            "id=\"normal_pressure_angle\" unit=\"deg\">20<",
            "id=\"normal_pressure_angle\" unit=\"deg\">80<",
            "pair.pressure_angle_deg",
        ),
        (
            "unit=\"mm\">2</attribute>\n<attribute id=\"normal_pressure_angle\"",
            "unit=\"mm\">2.5</attribute>\n<attribute id=\"normal_pressure_angle\"",
            "has normal_module 2.5, but cylindrical_gear",
        ),
    ] {
        let error = refused(from, to);
        assert!(error.contains("p.rexs") && error.contains(why), "{error}");
    }
}
