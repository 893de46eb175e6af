//! The pair file: one gear pair for `coordinator simulate`.

use gear::{PairInput, Size};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::corrections::PairCorrections;
use super::file_kind::FileKind;
use super::validate::Source;
use super::{
    Allowances, FaceWidth, FileError, GearLimits, Load, Manufacture, Materials, strength, wear,
};

#[cfg(test)]
mod tests;

/// A validated pair file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PairFile {
    /// `[pair]`
    pub pair: PairSection,
    /// `[load]`
    pub load: Load,
    /// `[material]`
    pub material: Materials,
    /// `[strength]`, optional. Without it every factor of ISO 6336 that does not follow from the geometry is 1.
    #[serde(default, skip_serializing_if = "strength::is_default")]
    pub strength: gear::rating::Factors,
    /// `[wear]`, optional.
    #[serde(default = "wear::default", with = "wear")]
    #[schemars(with = "wear::WearSection")]
    pub wear: gear::Wear,
    /// `[manufacture]`, optional. Without it the flanks are as designed and the shafts parallel.
    pub manufacture: Option<Manufacture>,
    /// `[allowances]`, optional. Without it the data sheet has nominal thicknesses alone.
    pub allowances: Option<Allowances>,
    /// `[corrections]`, optional. Without it the flanks are as cut by the tools.
    pub corrections: Option<PairCorrections>,
    /// `[constraints]`, optional. Without it the contact pressure is limited by the material's σ_Hlim, and
    /// the teeth must not interfere.
    pub constraints: Option<GearLimits>,
}

/// `[pair]` of a pair file. Two-element arrays are pinion, mate.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PairSection {
    /// Numbers of teeth.
    pub teeth: [u32; 2],
    /// Centre distance, mm. If only this or only the module is given, the pair has no backlash.
    pub centre_distance_mm: Option<f64>,
    /// Normal module, mm. With both, the profile shifts are as given and the backlash follows.
    pub normal_module_mm: Option<f64>,
    /// Rack pressure angle in the normal section, degrees.
    pub pressure_angle_deg: f64,
    /// Helix angle at the reference cylinder, degrees.
    pub helix_angle_deg: f64,
    /// Face width, mm; `[b1, b2]` if the gears differ. Teeth touch over the smaller one.
    pub face_width_mm: FaceWidth,
    /// Addendum modification coefficients x, in modules.
    pub profile_shift: [f64; 2],
    /// A standard rack for both gears, instead of tool addendum, tool dedendum and root radius.
    pub rack: Option<gear::Rack>,
    /// Tool addendum haP₀, in modules. It cuts the root.
    pub tool_addendum: Option<[f64; 2]>,
    /// Tool dedendum hfP₀, in modules. It forms the tip.
    pub tool_dedendum: Option<[f64; 2]>,
    /// Tip rounding radius ρa, mm.
    pub tip_radius_mm: [f64; 2],
    /// Root fillet radius ρf, mm.
    pub root_radius_mm: Option<[f64; 2]>,
    /// Tip diameters that override those of the tools, mm.
    pub tip_diameter_mm: Option<[f64; 2]>,
    /// Compliance model.
    #[serde(default)]
    pub tooth_model: gear::ToothModel,
    /// Treatment of a tip that reaches the mate's root.
    #[serde(default)]
    pub tip_rule: gear::TipRule,
    /// Radii at which the bodies of both gears are clamped, mm: their bores, or the hubs of stiff shafts. If
    /// absent, 3.5 modules below the root circle. Only the tooth model `coupled` uses them.
    pub hub_radius_mm: Option<[f64; 2]>,
}

impl PairFile {
    /// Parses and validates `text`; `file` names it in errors.
    ///
    /// # Errors
    ///
    /// The error names the line, the fault and the valid values.
    pub fn parse(file: &str, text: &str) -> Result<Self, FileError> {
        let source = Source { file, text };
        let this: Self = source.parse_kind(FileKind::Pair)?;
        this.validate(source)?;
        Ok(this)
    }

    /// The file as TOML, which parses to the same file.
    ///
    /// # Panics
    ///
    /// Never: a pair file is plain numbers and names, which TOML can hold.
    #[must_use]
    pub fn to_toml(&self) -> String {
        toml::to_string(self).expect("plain numbers and names serialise")
    }

    fn validate(&self, source: Source<'_>) -> Result<(), FileError> {
        let pair = &self.pair;
        for teeth in pair.teeth {
            source.teeth("pair.teeth", teeth)?;
        }
        sizes(source, pair.centre_distance_mm, pair.normal_module_mm)?;
        source.pressure_angle("pair.pressure_angle_deg", pair.pressure_angle_deg)?;
        source.helix_angle("pair.helix_angle_deg", pair.helix_angle_deg)?;
        pair.face_width_mm.validate(source)?;
        let modules = |key, value, low| source.within(key, value, low, 10.0, "modules");
        for gear in 0..2 {
            modules("pair.profile_shift", pair.profile_shift[gear], -10.0)?;
            source.tip_radius("pair.tip_radius_mm", pair.tip_radius_mm[gear])?;
            if let Some(diameters) = pair.tip_diameter_mm {
                source.length("pair.tip_diameter_mm", diameters[gear])?;
            }
            if let Some(radii) = pair.hub_radius_mm {
                source.length("pair.hub_radius_mm", radii[gear])?;
            }
        }
        let of_rack = [pair.tool_addendum, pair.tool_dedendum, pair.root_radius_mm];
        for (key, values) in RACK_KEYS.into_iter().zip(of_rack) {
            let Some(values) = pair.given(key, values, source)? else {
                continue;
            };
            for value in values {
                match key {
                    "pair.root_radius_mm" => source.root_radius(key, value)?,
                    _ => modules(key, value, 0.0)?,
                }
            }
        }
        self.load.validate(source)?;
        self.material.validate(source)?;
        strength::validate(&self.strength, source)?;
        wear::validate(&self.wear, source)?;
        if let Some(constraints) = &self.constraints {
            constraints.needs_of(&self.material, source)?;
            constraints.validate(source)?;
        }
        if let Some(manufacture) = &self.manufacture {
            manufacture.validate(source, pair.tooth_model)?;
        }
        if let Some(allowances) = &self.allowances {
            allowances.validate(source)?;
        }
        if let Some(corrections) = &self.corrections {
            corrections.validate(source)?;
        }
        self.of_geometry(source)
    }

    /// Refuses values that only the geometry shows to be impossible.
    fn of_geometry(&self, source: Source<'_>) -> Result<(), FileError> {
        let input = self.to_gear();
        if let (Some(corrections), Ok(geometry)) = (&self.corrections, gear::Geometry::new(&input))
        {
            corrections.fit(&geometry, source)?;
        }
        let corrections = self.corrections();
        let grid = gear::Discretisation::of(input.tooth_model);
        let pair = gear::UnloadedPair::new(&input, &corrections, &grid);
        let error = match pair {
            Ok(pair) => return of_relief(&pair, self.corrections.as_ref(), source),
            Err(gear::Error::Input(error)) => error,
            Err(_) => return Ok(()),
        };
        let place = match error.field {
            "face_width" => Some(("pair.face_width_mm", error.value)),
            "hub_radius[0]" | "hub_radius[1]" => Some(("pair.hub_radius_mm", error.value)),
            field => self
                .corrections
                .iter()
                .flat_map(PairCorrections::along_face)
                .find(|(key, _)| key.contains(field)),
        };
        place.map_or(Ok(()), |(key, value)| {
            source.require(false, key, value, error.expected)
        })
    }

    /// The simulator's corrections, in mm; without effect if there is no
    /// `[corrections]`.
    #[must_use]
    pub fn corrections(&self) -> gear::Corrections {
        let geometry = gear::Geometry::new(&self.to_gear()).ok();
        let corrections = self.corrections.as_ref();
        corrections.map_or_else(gear::Corrections::default, |one| {
            one.to_gear(geometry.as_ref())
        })
    }

    /// The scatter of manufacture; none without `[manufacture]`.
    #[must_use]
    pub fn scatter(&self) -> gear::Scatter {
        self.manufacture.unwrap_or_default().to_gear()
    }

    /// A sampler of random flanks of the file's pair, with its wear and its scatter of manufacture.
    #[must_use]
    pub fn sampler(&self, pair: &gear::Pair) -> gear::Sampler {
        pair.sampler_with(&self.wear, self.scatter())
    }

    /// The limits that the file gives, all absent without `[constraints]`.
    #[must_use]
    pub fn limits(&self) -> GearLimits {
        let corrections = self.corrections.as_ref();
        let is_relieved = corrections.is_some_and(|one| one.tip_relief_um.is_some());
        self.constraints
            .unwrap_or_default()
            .of_relieved(is_relieved)
    }

    /// The JSON Schema of the file.
    #[must_use]
    pub fn schema() -> serde_json::Value {
        schemars::schema_for!(PairFile).to_value()
    }

    /// The normal module in mm; 1 where the involute equation has no solution, which the simulator reports.
    fn module(&self, size: Size) -> f64 {
        let pair = &self.pair;
        let [alpha, beta] = [pair.pressure_angle_deg, pair.helix_angle_deg].map(f64::to_radians);
        let shift = pair.profile_shift[0] + pair.profile_shift[1];
        gear::normal_module(pair.teeth, size, alpha, beta, shift).unwrap_or(1.0)
    }

    /// The simulator's input.
    ///
    /// # Panics
    ///
    /// Never for a validated file, which gives a size, and a rack or its keys.
    #[must_use]
    pub fn to_gear(&self) -> PairInput {
        let pair = &self.pair;
        let size = match (pair.centre_distance_mm, pair.normal_module_mm) {
            (Some(centre_distance), Some(normal_module)) => Size::Both {
                normal_module,
                centre_distance,
            },
            (centre_distance, normal_module) => gear_size(centre_distance, normal_module),
        };
        let of_rack = |written: Option<[f64; 2]>, of: fn(&gear::Rack) -> f64, scale: f64| {
            let rack = || pair.rack.expect("validation asks for a rack or its keys");
            written.unwrap_or_else(|| [scale * of(&rack()); 2])
        };
        PairInput {
            teeth: pair.teeth,
            size,
            pressure_angle: pair.pressure_angle_deg.to_radians(),
            helix_angle: pair.helix_angle_deg.to_radians(),
            face_width: pair.face_width_mm.each(),
            profile_shift: pair.profile_shift,
            tool_addendum: of_rack(pair.tool_addendum, gear::Rack::addendum, 1.0),
            tool_dedendum: of_rack(pair.tool_dedendum, gear::Rack::dedendum, 1.0),
            tip_radius: pair.tip_radius_mm,
            root_radius: of_rack(
                pair.root_radius_mm,
                gear::Rack::root_radius,
                self.module(size),
            ),
            tip_diameter: pair
                .tip_diameter_mm
                .map_or([None; 2], |diameters| diameters.map(Some)),
            hub_radius: pair
                .hub_radius_mm
                .map_or([None; 2], |radii| radii.map(Some)),
            tooth_model: pair.tooth_model,
            tip_rule: pair.tip_rule,
            pinion_torque: self.load.pinion_torque_nm * 1e3,
            material: self.material.to_gear(),
        }
    }
}

/// The keys of `[pair]` that a rack gives.
const RACK_KEYS: [&str; 3] = [
    "pair.tool_addendum",
    "pair.tool_dedendum",
    "pair.root_radius_mm",
];

impl PairSection {
    /// The values of one of [`RACK_KEYS`]; `None` if the rack gives them.
    fn given(
        &self,
        key: &str,
        values: Option<[f64; 2]>,
        source: Source<'_>,
    ) -> Result<Option<[f64; 2]>, FileError> {
        match (values, self.rack) {
            (Some(values), Some(rack)) => Err(source.refuse(
                key,
                values,
                format!("absent beside pair.rack: \"{rack}\" gives it"),
            )),
            (None, None) => Err(source.missing(key, "given, unless pair.rack is")),
            (values, _) => Ok(values),
        }
    }
}

/// Requires that the tip relief leaves some of the path of contact.
fn of_relief(
    pair: &gear::UnloadedPair,
    section: Option<&PairCorrections>,
    source: Source<'_>,
) -> Result<(), FileError> {
    let [start, end] = pair.geometry().path_left();
    let path = end - start;
    let diameters = section.and_then(|section| section.tip_relief_diameter_mm);
    let reliefs = pair.corrections().tip_relief.into_iter().enumerate();
    for (i, relief) in reliefs.filter_map(|(i, relief)| Some((i, relief?))) {
        let length = relief.length;
        let (key, value, expected) = match diameters {
            Some(diameters) => (
                "corrections.tip_relief_diameter_mm",
                diameters[i],
                format!(
                    "greater: it makes the relief {length:.3} mm long, longer than the path of contact of {path:.3} mm"
                ),
            ),
            None => (
                "corrections.tip_relief_length_mm",
                length,
                format!("at most {path:.3} mm, the length of the path of contact"),
            ),
        };
        source.require(length <= path, key, value, &expected)?;
    }
    Ok(())
}

/// Requires at least one of the two ways to give a pair's size.
pub(super) fn sizes(
    source: Source<'_>,
    centre_distance_mm: Option<f64>,
    normal_module_mm: Option<f64>,
) -> Result<(), FileError> {
    for (key, length) in [
        ("pair.centre_distance_mm", centre_distance_mm),
        ("pair.normal_module_mm", normal_module_mm),
    ] {
        length.map_or(Ok(()), |length| source.length(key, length))?;
    }
    if centre_distance_mm.or(normal_module_mm).is_some() {
        return Ok(());
    }
    Err(source.missing(
        "pair.centre_distance_mm",
        "given, unless normal_module_mm is",
    ))
}

/// The simulator's size of a campaign's pair: the module, if both are given, since the profile shifts then follow
/// from the distance.
pub(crate) fn gear_size(centre_distance_mm: Option<f64>, normal_module_mm: Option<f64>) -> Size {
    match (centre_distance_mm, normal_module_mm) {
        (_, Some(module)) => Size::NormalModule(module),
        (distance, None) => {
            Size::CentreDistance(distance.expect("validation asks for one of the two"))
        }
    }
}
