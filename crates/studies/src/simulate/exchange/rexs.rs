//! A pair in REXS, the exchange format of gear programs (FVA 889, <https://www.rexs.info>), version 1.5.
//!
//! Components, attributes, units and relations are those of `rexs_schema_1.5.xml` and `rexs-file.xsd` in the repository
//! `fva-net/rexs-api-java`. Attributes that REXS does not have begin with `custom_`, as other programs' do. Wear,
//! strength factors and constraints have no place in REXS. Only the load's own torque is written, not its cases.

use std::fmt::{Display, Write as _};

use gear::inspection::Sheet;
use gear::{Member, ReliefShape, UnloadedPair};
use problem::PairFile;
use problem::file::Material;

mod pair_text;
mod read;
mod xml;

pub use read::{PairImport, import};

/// Identifier, unit and value; the value of a quantity that does not exist is not a number.
type Attribute = (&'static str, &'static str, f64);

/// Units of attributes.
const NONE: &str = "none";
const STRESS: &str = "N / mm^2";

/// A component: its type, its name, and its attributes as XML.
struct Component {
    kind: &'static str,
    name: String,
    attributes: String,
}

/// Components, numbered from 1, and relations between them: a type, and components by role.
#[derive(Default)]
struct Model {
    components: Vec<Component>,
    relations: Vec<(&'static str, Vec<(&'static str, usize)>)>,
}

impl Model {
    /// Adds a component and returns its number.
    fn add(&mut self, kind: &'static str, name: &str, attributes: &[Attribute]) -> usize {
        self.components.push(Component {
            kind,
            name: escaped(name),
            attributes: String::new(),
        });
        let number = self.components.len();
        let known = attributes.iter().filter(|(_, _, value)| value.is_finite());
        known.for_each(|(id, unit, value)| self.attribute(number, id, unit, value));
        number
    }

    /// Adds an attribute to a component.
    fn attribute(&mut self, component: usize, id: &str, unit: &str, value: &dyn Display) {
        let value = escaped(&value.to_string());
        self.components[component - 1].attributes +=
            &format!("<attribute id=\"{id}\" unit=\"{unit}\">{value}</attribute>\n");
    }

    fn relate(&mut self, kind: &'static str, members: &[(&'static str, usize)]) {
        self.relations.push((kind, members.to_vec()));
    }

    /// The component as XML with these attributes.
    fn component(&self, number: usize, attributes: &str) -> String {
        let Component { kind, name, .. } = &self.components[number - 1];
        format!(
            "<component id=\"{number}\" type=\"{kind}\" name=\"{name}\">\n{attributes}</component>\n"
        )
    }
}

/// The text without characters that XML reserves.
fn escaped(text: &str) -> String {
    let pairs = [
        ("&", "&amp;"),
        ("<", "&lt;"),
        (">", "&gt;"),
        ("\"", "&quot;"),
    ];
    let escape = |text: String, (from, to): (&str, &str)| text.replace(from, to);
    pairs.into_iter().fold(text.to_owned(), escape)
}

/// The pair of a file as XML, with its torque as a load case. The file has no date, so that equal pairs give equal
/// files.
#[must_use]
pub(super) fn write(
    title: &str,
    program_version: &str,
    file: &PairFile,
    pair: &UnloadedPair,
) -> String {
    let (model, pinion) = model(title, file, pair);
    let mut xml = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<model version=\"1.5\" applicationId=\"Pitchline\" \
         applicationVersion=\"{}\" date=\"\">\n<relations>\n",
        escaped(program_version)
    );
    for (number, (kind, members)) in model.relations.iter().enumerate() {
        // A flank has only one step.
        let order = if *kind == "manufacturing_step" {
            " order=\"1\""
        } else {
            ""
        };
        // Writing to a string does not fail.
        let _ = writeln!(
            xml,
            "<relation id=\"{}\" type=\"{kind}\"{order}>",
            number + 1
        );
        for (role, component) in members {
            let hint = model.components[component - 1].kind;
            let _ = writeln!(
                xml,
                "<ref id=\"{component}\" role=\"{role}\" hint=\"{hint}\"/>"
            );
        }
        xml += "</relation>\n";
    }
    xml += "</relations>\n<components>\n";
    for (number, component) in (1..).zip(&model.components) {
        xml += &model.component(number, &component.attributes);
    }
    let torque = file.load.pinion_torque_nm;
    let torque = format!("<attribute id=\"torque\" unit=\"N m\">{torque}</attribute>\n");
    xml += "</components>\n<load_spectrum id=\"1\">\n<load_case id=\"1\">\n";
    xml += &model.component(pinion, &torque);
    xml + "</load_case>\n</load_spectrum>\n</model>\n"
}

/// The components and relations of a pair, and the number of the pinion's data in the stage, to which the torque
/// belongs.
fn model(title: &str, file: &PairFile, pair: &UnloadedPair) -> (Model, usize) {
    let (g, sheet) = (pair.geometry(), Sheet::new(pair));
    let mut model = Model::default();
    let unit = model.add("gear_unit", title, &[]);
    let stage = model.add(
        "cylindrical_stage",
        "Stage",
        &[
            ("center_distance", "mm", g.centre_distance),
            ("overlap_contact_ratio", NONE, g.eps_beta),
            ("total_contact_ratio", NONE, g.eps_alpha_left() + g.eps_beta),
            (
                "custom_pitchline_misalignment",
                "mm",
                pair.corrections().misalignment,
            ),
        ],
    );
    let tooth_model = &file.pair.tooth_model;
    model.attribute(stage, "custom_pitchline_tooth_model", NONE, tooth_model);
    model.relate("assembly", &[("assembly", unit), ("part", stage)]);
    let materials = match &file.material.mate {
        None => [material(&mut model, "both gears", &file.material.pinion); 2],
        Some(mate) => [("the pinion", &file.material.pinion), ("the mate", mate)]
            .map(|(whose, one)| material(&mut model, whose, one)),
    };
    let [pinion, mate] = Member::BOTH.map(|member| {
        let i = member.index();
        let name = ["Pinion", "Mate"][i];
        let shaft = model.add("shaft", &format!("{name} shaft"), &[]);
        model.relate("assembly", &[("assembly", unit), ("part", shaft)]);
        let gear = gear(&mut model, name, file, pair, &sheet, i);
        model.relate("assembly", &[("assembly", shaft), ("part", gear)]);
        model.relate(
            "reference",
            &[("origin", gear), ("referenced", materials[i])],
        );
        let data = model.add(
            "cylindrical_stage_gear_data",
            &format!("{name} in the stage"),
            &[
                (
                    "usable_addendum_circle_diameter",
                    "mm",
                    sheet.active_tip_diameter[i],
                ),
                (
                    "usable_root_circle_diameter",
                    "mm",
                    sheet.active_root_diameter[i],
                ),
                ("tip_clearance", "mm", g.clearance[i]),
            ],
        );
        model.attribute(data, "is_driving_gear", NONE, &(i == 0));
        let members = [("stage", stage), ("gear", gear), ("stage_gear_data", data)];
        model.relate("stage_gear_data", &members);
        flanks(&mut model, name, file, pair, &sheet, gear, i);
        (gear, data)
    });
    let members = [("stage", stage), ("gear_1", pinion.0), ("gear_2", mate.0)];
    model.relate("stage", &members);
    (model, pinion.1)
}

fn material(model: &mut Model, whose: &str, material: &Material) -> usize {
    let bending = material.bending_limit_mpa.unwrap_or(f64::NAN);
    let number = model.add(
        "material",
        &format!("Material of {whose}"),
        &[
            ("elastic_modulus", STRESS, 1e3 * material.youngs_modulus_gpa),
            ("poisson_ratio", NONE, material.poisson_ratio),
            ("endurance_limit_flank", STRESS, material.contact_limit_mpa),
            ("basic_strength_root", STRESS, bending),
        ],
    );
    if let Some(name) = &material.name {
        model.attribute(number, "material_designation", NONE, name);
    }
    number
}

/// Adds a gear; `i` is 0 for the pinion.
fn gear(
    model: &mut Model,
    name: &str,
    file: &PairFile,
    pair: &UnloadedPair,
    sheet: &Sheet,
    i: usize,
) -> usize {
    let (g, input) = (pair.geometry(), pair.input());
    let hub = input.hub_radius[i].unwrap_or(f64::NAN);
    let balls = sheet.over_balls[i].map_or([f64::NAN; 2], |balls| [balls.ball, balls.dimension]);
    let span = sheet.span[i].map_or(f64::NAN, |span| span.length);
    // Helices of opposite hands.
    let helix = [1.0, -1.0][i] * file.pair.helix_angle_deg;
    let gear = model.add(
        "cylindrical_gear",
        name,
        &[
            ("normal_module", "mm", g.normal_module),
            ("helix_angle_reference_diameter", "deg", helix),
            ("face_width", "mm", input.face_width[i]),
            ("reference_circle_diameter", "mm", 2.0 * g.r[i]),
            ("base_circle_diameter", "mm", 2.0 * g.r_b[i]),
            ("tip_diameter", "mm", 2.0 * g.r_a[i]),
            ("root_diameter", "mm", 2.0 * g.r_f[i]),
            ("tip_form_diameter", "mm", sheet.tip_form_diameter[i]),
            ("root_form_diameter", "mm", sheet.root_form_diameter[i]),
            ("inner_diameter", "mm", 2.0 * hub),
            (
                "normal_tooth_thickness_at_reference_diameter",
                "mm",
                sheet.tooth_thickness[i],
            ),
            (
                "normal_tooth_thickness_at_tip_diameter",
                "mm",
                sheet.tip_land[i],
            ),
            ("span_measurement", "mm", span),
            ("diameter_of_measuring_ball_or_pin", "mm", balls[0]),
            ("size_over_balls", "mm", balls[1]),
            ("custom_pitchline_tip_rounding", "mm", input.tip_radius[i]),
        ],
    );
    model.attribute(gear, "number_of_teeth", NONE, &g.teeth[i]);
    if let Some(span) = sheet.span[i] {
        model.attribute(
            gear,
            "number_of_teeth_for_span_measurement",
            NONE,
            &span.teeth,
        );
    }
    if let Some(class) = file.scatter().flank_class {
        let id = "tolerance_class_according_to_iso_1328_2013";
        model.attribute(gear, id, NONE, &class.number());
    }
    gear
}

/// Adds both flanks of a gear, which are alike, with their tool and their modifications.
fn flanks(
    model: &mut Model,
    name: &str,
    file: &PairFile,
    pair: &UnloadedPair,
    sheet: &Sheet,
    gear: usize,
    i: usize,
) {
    let (input, module) = (pair.input(), pair.geometry().normal_module);
    let angle = ("normal_pressure_angle", "deg", file.pair.pressure_angle_deg);
    let shift = input.profile_shift[i];
    let tool = model.add(
        "rack_shaped_tool",
        &format!("{name} tool"),
        &[
            ("normal_module", "mm", module),
            angle,
            (
                "addendum_coefficient_reference_profile",
                NONE,
                input.tool_addendum[i],
            ),
            (
                "dedendum_coefficient_reference_profile",
                NONE,
                input.tool_dedendum[i],
            ),
            ("tip_radius_factor", NONE, sheet.root_radius_factor[i]),
        ],
    );
    let settings = model.add(
        "cylindrical_gear_manufacturing_settings",
        &format!("{name} cutting"),
        &[("generated_addendum_modification_coefficient", NONE, shift)],
    );
    let modifications = modifications(model, name, pair, sheet, i);
    let [left, right] = ["left", "right"].map(|side| {
        let attributes = [angle, ("addendum_modification_coefficient", NONE, shift)];
        let flank = model.add(
            "cylindrical_gear_flank",
            &format!("{name}, {side} flank"),
            &attributes,
        );
        let step = [
            ("workpiece", flank),
            ("tool", tool),
            ("manufacturing_settings", settings),
        ];
        model.relate("manufacturing_step", &step);
        for &modification in &modifications {
            model.relate(
                "reference",
                &[("origin", flank), ("referenced", modification)],
            );
        }
        flank
    });
    model.relate("flank", &[("gear", gear), ("left", left), ("right", right)]);
}

/// Adds the modifications of a gear's flanks and returns their numbers. Modifications that the simulator has for both
/// gears together are the pinion's.
fn modifications(
    model: &mut Model,
    name: &str,
    pair: &UnloadedPair,
    sheet: &Sheet,
    i: usize,
) -> Vec<usize> {
    let corrections = pair.corrections();
    let mut all = Vec::new();
    if let (Some(relief), Some(start)) = (corrections.tip_relief[i], sheet.relief_diameter[i]) {
        let attributes = [
            ("tip_relief_depth", "mm", relief.amount),
            ("tip_relief_datum_length", "mm", relief.length),
            ("tip_relief_datum_diameter", "mm", start),
        ];
        let number = model.add("tip_relief", &format!("{name}, tip relief"), &attributes);
        let shape = match relief.shape {
            ReliefShape::Linear => "linear",
            ReliefShape::Parabolic => "parabolic",
        };
        model.attribute(number, "shape_of_relief", NONE, &shape);
        all.push(number);
    }
    let crowning = corrections.crowning;
    if i == 0 && crowning != 0.0 {
        let attributes = [
            ("helix_crowning_amount_datum_face", "mm", crowning),
            ("helix_crowning_amount_non_datum_face", "mm", crowning),
        ];
        let number = model.add(
            "helix_crowning",
            "Crowning of both gears together",
            &attributes,
        );
        model.attribute(number, "shape_of_helix_crowning", NONE, &"parabolic");
        all.push(number);
    }
    if i == 0 && corrections.helix_slope != 0.0 {
        let attributes = [("helix_slope", "mm", corrections.helix_slope)];
        let number = model.add(
            "helix_slope",
            "Helix slope of both gears together",
            &attributes,
        );
        model.attribute(number, "helix_evaluation_reference", NONE, &"facewidth");
        all.push(number);
    }
    all
}

#[cfg(test)]
mod tests;
