//! A pair file from a cylindrical stage in REXS.
//!
//! One stage of two external gears is read. Values that REXS does not hold, or that the file leaves out, get defaults,
//! which notes state. The pair file is made as text and validated as a file is, so that errors name its keys.

use anyhow::{Context as _, bail, ensure};
use gear::Rack;
use problem::PairFile;
use problem::file::{FaceWidth, Grade, micrometres};
use roxmltree::{Document, Node};

use super::pair_text::{Corrections, Pair, SAME_MM, Sizes, line};
use super::xml::{
    ANGLE, Components, LENGTH, NUMBER, PRESSURE, TORQUE, Units, named, number, required, text,
};

/// A pair file from REXS.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PairImport {
    /// The text of the pair file, whose comments are the notes.
    pub toml: String,
    /// Defaults, and parts of the file that are not read, a sentence each.
    pub notes: Vec<String>,
}

/// Default of σ_Hlim, MPa: case-hardened steel by ISO 6336-5, quality MQ.
const CONTACT_LIMIT_MPA: f64 = 1500.0;

/// The pair file of the stage in `text`; `file` names it in errors. `torque_nm` is the torque on the pinion, N·m,
/// instead of the file's.
///
/// # Errors
///
/// The text is not REXS, has another number or kind of stages, lacks a value without a default, or is not a valid pair.
pub fn import(file: &str, text: &str, torque_nm: Option<f64>) -> anyhow::Result<PairImport> {
    let document = Document::parse(text).with_context(|| format!("{file} is not XML"))?;
    let root = document.root_element();
    let version = root.attribute("version").unwrap_or_default();
    ensure!(
        root.tag_name().name() == "model" && version.starts_with("1."),
        "{file} is not a REXS file of version 1: its root is <{}> with version {version:?} instead of <model> with \
         version \"1.5\" or the like",
        root.tag_name().name()
    );
    let model = Components { root };
    let mut notes = Vec::new();
    if version != "1.5" {
        notes.push(format!(
            "The file has version {version}; attributes are read by their names in REXS 1.5."
        ));
    }
    let pair = Stage::of(model)
        .and_then(|stage| stage.pair(torque_nm, &mut notes))
        .with_context(|| format!("{file} cannot be imported"))?;
    let what = format!("the pair of {file}");
    let parsed = PairFile::parse(&what, &pair.text(Sizes::default()))?;
    let sizes = pair.sizes(&parsed);
    let body = pair.text(sizes);
    PairFile::parse(&what, &body)?;
    let comments: String = notes.iter().map(|note| format!("# {note}\n")).collect();
    Ok(PairImport {
        toml: comments + &body,
        notes,
    })
}

/// A cylindrical stage with its two gears, of which the first is the pinion.
struct Stage<'a> {
    model: Components<'a>,
    stage: Node<'a, 'a>,
    gears: [Node<'a, 'a>; 2],
}

impl<'a> Stage<'a> {
    fn of(model: Components<'a>) -> anyhow::Result<Self> {
        let other = model.list("components").find(|one| {
            let kind = one.attribute("type").unwrap_or_default();
            kind == "ring_gear" || kind.ends_with("_stage") && kind != "cylindrical_stage"
        });
        if let Some(other) = other {
            bail!("{} is not an external cylindrical stage", named(other));
        }
        let stages = model.of_kind("cylindrical_stage");
        let [stage] = stages[..] else {
            let names: Vec<String> = stages.iter().map(|one| named(*one)).collect();
            bail!(
                "it has {} cylindrical stages instead of one: {}",
                stages.len(),
                names.join(", ")
            );
        };
        let of_role = |role| model.related("stage", ("stage", stage), role);
        let related = [of_role("gear_1"), of_role("gear_2")].concat();
        let gears = match related.is_empty() {
            true => model.of_kind("cylindrical_gear"),
            false => related,
        };
        let [pinion, mate] = gears[..] else {
            bail!("{} has {} gears instead of two", named(stage), gears.len());
        };
        Ok(Self {
            model,
            stage,
            gears: [pinion, mate],
        })
    }

    /// A number of both gears.
    fn of_gears(&self, id: &str, units: Units) -> anyhow::Result<Option<[f64; 2]>> {
        let [pinion, mate] = self.gears;
        let (pinion, mate) = (number(pinion, id, units)?, number(mate, id, units)?);
        Ok(pinion.zip(mate).map(<[f64; 2]>::from))
    }

    /// A number of both gears that must be the same.
    fn common(&self, id: &str, units: Units) -> anyhow::Result<f64> {
        let [pinion, mate] = self.gears;
        let (a, b) = (required(pinion, id, units)?, required(mate, id, units)?);
        ensure!(
            (a - b).abs() < SAME_MM,
            "{id} is {a} at {} and {b} at {}, but must be the same",
            named(pinion),
            named(mate)
        );
        Ok(a)
    }

    fn teeth(&self, gear: Node<'_, '_>) -> anyhow::Result<u32> {
        let teeth = required(gear, "number_of_teeth", NUMBER)?;
        ensure!(
            teeth > 0.0,
            "{} has {teeth} teeth: internal gears are not simulated",
            named(gear)
        );
        ensure!(
            teeth.fract() == 0.0 && teeth < 1e6,
            "{} has {teeth} teeth, but must have a whole number",
            named(gear)
        );
        Ok(teeth as u32)
    }

    /// The torque on the pinion in the first load case, N·m.
    fn torque(&self, teeth: [u32; 2], notes: &mut Vec<String>) -> anyhow::Result<f64> {
        let spectra = self.model.list("load_spectrum");
        let cases: Vec<Node<'_, '_>> = spectra
            .filter(|one| one.has_tag_name("load_case"))
            .collect();
        for (place, case) in cases.iter().enumerate() {
            for (i, gear) in self.gears.into_iter().enumerate() {
                let role = ("gear", gear);
                for data in self
                    .model
                    .related("stage_gear_data", role, "stage_gear_data")
                {
                    let mut loaded = case.children();
                    let of_data = |one: &Node<'_, '_>| one.attribute("id") == data.attribute("id");
                    let Some(loaded) = loaded.find(|one| one.is_element() && of_data(one)) else {
                        continue;
                    };
                    let Some(torque) = number(loaded, "torque", TORQUE)? else {
                        continue;
                    };
                    if cases.len() > 1 {
                        notes.push(format!(
                            "The torque is that of load case {} of {}.",
                            place + 1,
                            cases.len()
                        ));
                    }
                    let ratio = f64::from(teeth[0]) / f64::from(teeth[i]);
                    return Ok(torque.abs() * ratio);
                }
            }
        }
        bail!(
            "no load case has the attribute torque of the pinion's or the mate's cylindrical_stage_gear_data: give the \
             torque on the pinion with --torque"
        )
    }

    fn pair(&self, torque_nm: Option<f64>, notes: &mut Vec<String>) -> anyhow::Result<Pair> {
        let [pinion, mate] = self.gears;
        let teeth = [self.teeth(pinion)?, self.teeth(mate)?];
        let module = self.common("normal_module", LENGTH)?;
        let flanks = [self.flank(pinion)?, self.flank(mate)?];
        let angles = flanks.map(|flank| required(flank, "normal_pressure_angle", ANGLE));
        let [angle, other] = angles;
        let (angle, other) = (angle?, other?);
        ensure!(
            (angle - other).abs() < SAME_MM,
            "the gears have normal_pressure_angle {angle} and {other} degrees, but must have the same"
        );
        let shifts =
            flanks.map(|flank| required(flank, "addendum_modification_coefficient", NUMBER));
        let [shift, other] = shifts;
        let shift = [shift?, other?];
        let torque_nm = match torque_nm {
            Some(given) => given,
            None => self.torque(teeth, notes)?,
        };
        let class = "tolerance_class_according_to_iso_1328_2013";
        let [fine, coarse] = [number(pinion, class, NUMBER)?, number(mate, class, NUMBER)?];
        if fine != coarse {
            notes
                .push("The flank tolerance class of both gears is that of the coarser one.".into());
        }
        let rounding = |gear| -> anyhow::Result<f64> {
            Ok(number(gear, "custom_pitchline_tip_rounding", LENGTH)?.unwrap_or(0.0))
        };
        let tip_radius = [rounding(pinion)?, rounding(mate)?];
        Ok(Pair {
            module,
            distance: number(self.stage, "center_distance", LENGTH)?.map(f64::abs),
            pressure_angle: angle,
            helix_angle: self.helix_angle(notes)?,
            face_width: self.face_width()?,
            tools: self.tools(flanks, [module, angle], shift, notes)?,
            tip_diameter: self.of_gears("tip_diameter", LENGTH)?,
            hub_diameter: self.of_gears("inner_diameter", LENGTH)?,
            tooth_model: text(self.stage, "custom_pitchline_tooth_model").map(str::to_owned),
            corrections: self.corrections(flanks, notes)?,
            materials: self.materials(notes)?,
            class: fine.into_iter().chain(coarse).reduce(f64::max),
            teeth,
            shift,
            tip_radius,
            torque_nm,
        })
    }

    /// The flank of a gear, whose two flanks must be alike.
    fn flank(&self, gear: Node<'a, 'a>) -> anyhow::Result<Node<'a, 'a>> {
        let of_side = |side| self.model.related("flank", ("gear", gear), side);
        let sides = [of_side("left"), of_side("right")].concat();
        let first = *sides
            .first()
            .with_context(|| format!("{} has no cylindrical_gear_flank", named(gear)))?;
        for (id, units) in [
            ("normal_pressure_angle", ANGLE),
            ("addendum_modification_coefficient", NUMBER),
        ] {
            let value = number(first, id, units)?;
            for other in &sides[1..] {
                ensure!(
                    number(*other, id, units)? == value,
                    "{} and {} differ in {id}: asymmetric teeth are not simulated",
                    named(first),
                    named(*other)
                );
            }
        }
        Ok(first)
    }

    /// The helix angle of the pinion, degrees; the mate has the other hand.
    fn helix_angle(&self, notes: &mut Vec<String>) -> anyhow::Result<f64> {
        let id = "helix_angle_reference_diameter";
        let Some([a, b]) = self.of_gears(id, ANGLE)? else {
            notes.push(format!("{id} is missing: the teeth are straight."));
            return Ok(0.0);
        };
        ensure!(
            (a + b).abs() < SAME_MM,
            "{id} is {a} and {b} degrees, but must have opposite signs: the axes would cross"
        );
        Ok(a)
    }

    fn face_width(&self) -> anyhow::Result<FaceWidth> {
        let [pinion, mate] = self.gears;
        let widths = [
            required(pinion, "face_width", LENGTH)?,
            required(mate, "face_width", LENGTH)?,
        ];
        Ok(match widths[0] == widths[1] {
            true => FaceWidth::Both(widths[0]),
            false => FaceWidth::Each(widths),
        })
    }

    /// Addendum and dedendum of the tools and radius of their tips, modules, of both gears. A tool must have the normal
    /// module and the pressure angle `of_gears`.
    fn tools(
        &self,
        flanks: [Node<'a, 'a>; 2],
        of_gears: [f64; 2],
        shift: [f64; 2],
        notes: &mut Vec<String>,
    ) -> anyhow::Result<[[f64; 3]; 2]> {
        let mut tools = [[0.0; 3]; 2];
        for (i, gear) in self.gears.into_iter().enumerate() {
            let of_flank = ("workpiece", flanks[i]);
            let tool = self.model.related("manufacturing_step", of_flank, "tool");
            let read = |id: &str| match tool.first() {
                Some(tool) => number(*tool, id, NUMBER),
                None => Ok(None),
            };
            for (id, units, of_gears) in [
                ("normal_module", LENGTH, of_gears[0]),
                ("normal_pressure_angle", ANGLE, of_gears[1]),
            ] {
                for tool in &tool {
                    let given = number(*tool, id, units)?;
                    ensure!(
                        given.is_none_or(|given| (given - of_gears).abs() < SAME_MM),
                        "{} has {id} {}, but {} has {of_gears}: a tool that differs from its gear is not read",
                        named(*tool),
                        given.unwrap_or_default(),
                        named(gear)
                    );
                }
            }
            // Without the tool's heights, the gear's diameters give them.
            let diameter = number(gear, "reference_circle_diameter", LENGTH)?;
            let height = |id: &str, sign: f64| -> anyhow::Result<Option<f64>> {
                let circle = number(gear, id, LENGTH)?.zip(diameter);
                Ok(circle.map(|(circle, d)| sign * (0.5 * (circle - d) / of_gears[0] - shift[i])))
            };
            let values = [
                read("addendum_coefficient_reference_profile")?
                    .map_or_else(|| height("root_diameter", -1.0), |one| Ok(Some(one)))?,
                read("dedendum_coefficient_reference_profile")?
                    .map_or_else(|| height("tip_diameter", 1.0), |one| Ok(Some(one)))?,
                read("tip_radius_factor")?,
            ];
            let rack = Rack::A;
            let defaults = [rack.addendum(), rack.dedendum(), rack.root_radius()];
            let names = ["addendum", "dedendum", "tip radius"];
            for (place, (value, default)) in values.into_iter().zip(defaults).enumerate() {
                if value.is_none() {
                    notes.push(format!(
                        "{} lacks the {} of its tool: {default} modules, that of ISO 53 A.",
                        named(gear),
                        names[place]
                    ));
                }
                tools[i][place] = value.unwrap_or(default);
            }
        }
        Ok(tools)
    }

    /// The modifications of both gears.
    fn corrections(
        &self,
        flanks: [Node<'a, 'a>; 2],
        notes: &mut Vec<String>,
    ) -> anyhow::Result<Corrections> {
        let mut all = Corrections {
            misalignment_um: micrometres(
                number(self.stage, "custom_pitchline_misalignment", LENGTH)?.unwrap_or(0.0),
            ),
            ..Corrections::default()
        };
        for (i, flank) in flanks.into_iter().enumerate() {
            for one in self
                .model
                .related("reference", ("origin", flank), "referenced")
            {
                let amount =
                    |id: &str| Ok::<_, anyhow::Error>(micrometres(required(one, id, LENGTH)?));
                match one.attribute("type").unwrap_or_default() {
                    "tip_relief" => {
                        all.relief_um[i] = amount("tip_relief_depth")?;
                        all.relief_length_mm[i] = required(one, "tip_relief_datum_length", LENGTH)?;
                        let shape = text(one, "shape_of_relief").unwrap_or("linear");
                        ensure!(
                            ["linear", "parabolic"].contains(&shape),
                            "{} is {shape}, but must be linear or parabolic",
                            named(one)
                        );
                        all.relief_shapes.push(shape.to_owned());
                    }
                    "helix_crowning" => {
                        all.crowning_um += amount("helix_crowning_amount_datum_face")?;
                    }
                    // The gap grows by the difference.
                    "helix_slope" => all.slope_um += [1.0, -1.0][i] * amount("helix_slope")?,
                    _ => notes.push(format!("{} is not read.", named(one))),
                }
            }
        }
        all.relief_shapes.dedup();
        ensure!(
            all.relief_shapes.len() < 2,
            "the tip reliefs of the gears are of shapes {}, but must be of one",
            all.relief_shapes.join(" and ")
        );
        Ok(all)
    }

    /// The section `[material]`, with that of the mate if it is another one.
    fn materials(&self, notes: &mut Vec<String>) -> anyhow::Result<String> {
        let of = |gear| {
            self.model
                .related("reference", ("origin", gear), "referenced")
        };
        let [pinion, mate] = self.gears.map(|gear| {
            let mut all = of(gear).into_iter();
            all.find(|one| one.attribute("type") == Some("material"))
        });
        let mut section = "[material]\n".to_owned() + &self.material(pinion, notes)?;
        if mate != pinion {
            section = section + "[material.mate]\n" + &self.material(mate, notes)?;
        }
        Ok(section)
    }

    /// The keys of a material.
    fn material(
        &self,
        material: Option<Node<'a, 'a>>,
        notes: &mut Vec<String>,
    ) -> anyhow::Result<String> {
        let mut section = String::new();
        let read = |id: &str, units| match material {
            Some(material) => number(material, id, units),
            None => Ok(None),
        };
        let grade = material
            .and_then(|material| text(material, "material_designation"))
            .filter(|name| serde_json::from_value::<Grade>((*name).into()).is_ok());
        if let Some(name) = grade {
            line(&mut section, "name", &name);
        }
        let gpa = read("elastic_modulus", PRESSURE)?.map(|mpa| 1e-3 * mpa);
        let values = [
            ("youngs_modulus_gpa", gpa, 206.0, "GPa, that of steel"),
            (
                "poisson_ratio",
                read("poisson_ratio", NUMBER)?,
                0.3,
                "that of steel",
            ),
            (
                "contact_limit_mpa",
                read("endurance_limit_flank", PRESSURE)?,
                CONTACT_LIMIT_MPA,
                "MPa, σ_Hlim of case-hardened steel",
            ),
        ];
        for (key, value, default, what) in values {
            match (value, grade) {
                (Some(value), _) => line(&mut section, key, &value),
                // The name of the material's grade gives the value.
                (None, Some(_)) => {}
                (None, None) => {
                    notes.push(format!("The material lacks {key}: {default} {what}."));
                    line(&mut section, key, &default);
                }
            }
        }
        if let Some(mpa) = read("basic_strength_root", PRESSURE)? {
            line(&mut section, "bending_limit_mpa", &mpa);
        }
        Ok(section)
    }
}
