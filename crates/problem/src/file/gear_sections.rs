//! The sections of a campaign that designs a gear pair.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::bounds::Setting;
use super::corrections::CorrectionsSection;
use super::pair::sizes;
use super::validate::{InvalidValue, Source, TEETH};
use super::{
    Allowances, Bounds, FaceWidth, FileError, FrozenSection, GearLimits, Load, Manufacture,
    Materials, accuracy, strength, wear,
};

/// The sections that only gear campaigns have.
#[derive(Debug, Clone, PartialEq)]
pub struct GearSections {
    /// `[pair]`
    pub pair: Pair,
    /// `[load]`
    pub load: Load,
    /// `[material]`
    pub material: Materials,
    /// `[wear]`
    pub wear: gear::Wear,
    /// `[strength]`
    pub strength: gear::rating::Factors,
    /// `[manufacture]`
    pub manufacture: Option<Manufacture>,
    /// `[allowances]`
    pub allowances: Option<Allowances>,
    /// `[bounds]`
    pub bounds: Bounds,
    /// `[frozen]`, optional.
    pub frozen: Option<FrozenSection>,
    /// `[constraints]`
    pub constraints: GearLimits,
    /// `[penalty]`
    pub penalty: Penalty,
    /// `[report]`
    pub report: Report,
    /// `[corrections]`
    pub corrections: Option<CorrectionsSection>,
    /// `[accuracy]`: the simulator's grid.
    pub grid: gear::Discretisation,
}

/// `[penalty]`: the penalised objective (5) of the paper.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Penalty {
    /// Weight p of a constraint's relative violation.
    pub weight: f64,
    /// Divisor Δ_ref of the criterion, µm.
    pub reference_um: f64,
    /// Objective of a design that is not simulable.
    pub failure_value: f64,
}

impl Default for Penalty {
    fn default() -> Self {
        Self {
            weight: 10.0,
            reference_um: 0.5,
            failure_value: 100.0,
        }
    }
}

/// `[pair]` of a campaign: the values common to all its designs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Pair {
    /// Number of teeth of the pinion.
    pub pinion_teeth: u32,
    /// Gear ratio u = z2/z1 of ISO 21771, at least 1: the mate has the nearest whole number of teeth to
    /// u · `pinion_teeth`. Either this or `gear_teeth` is given.
    pub gear_ratio: Option<f64>,
    /// Number of teeth of the mate.
    pub gear_teeth: Option<u32>,
    /// Centre distance, mm. This or the module is given, or both.
    pub centre_distance_mm: Option<f64>,
    /// Normal module, mm.
    pub normal_module_mm: Option<f64>,
    /// Rack pressure angle in the normal section, degrees.
    pub pressure_angle_deg: f64,
    /// Face width, mm; `[b1, b2]` if the gears differ. Teeth touch over the smaller one.
    pub face_width_mm: FaceWidth,
    /// Compliance model.
    pub tooth_model: gear::ToothModel,
    /// Treatment of a tip that reaches the mate's root.
    pub tip_rule: gear::TipRule,
    /// Radii at which the bodies of both gears are clamped, mm: their bores, or the hubs of stiff shafts. If
    /// absent, 3.5 modules below the root circle. Only the tooth model `coupled` uses them.
    pub hub_radius_mm: Option<[f64; 2]>,
}

/// `[report]`
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Report {
    /// Whether the report shows the paper's figures beside the campaign's.
    pub compare_with_paper: bool,
}

impl Penalty {
    /// The objective of a design with this criterion, in µm, and this constraint violation.
    #[must_use]
    pub fn objective(&self, criterion: f64, violation: f64) -> f64 {
        criterion / self.reference_um + self.weight * violation
    }
}

impl GearSections {
    /// Whether the criteria have [details](crate::formulation::gears::GearDetails): if a limit needs them, and in
    /// campaigns that limit a case's ΔSTE, because the bounds of limited measures may only follow the details.
    pub(crate) fn need_details(&self) -> bool {
        let mut cases = self.load.cases.iter();
        self.constraints.need_details() || cases.any(|case| case.delta_ste_max_um.is_some())
    }

    /// The values of each variable of a design, in the order of the variables: those of the pair, and then the
    /// corrections of a campaign that has them.
    #[must_use]
    pub fn settings(&self) -> Vec<Setting> {
        let corrections = self.corrections.iter();
        let corrections = corrections.flat_map(CorrectionsSection::settings);
        self.bounds
            .settings()
            .into_iter()
            .chain(corrections)
            .collect()
    }

    pub(super) fn validate(&self, source: Source<'_>, is_external: bool) -> Result<(), FileError> {
        self.pair.validate(source)?;
        self.load.validate(source)?;
        self.material.validate(source)?;
        strength::validate(&self.strength, source)?;
        self.constraints.needs_of(&self.material, source)?;
        wear::validate(&self.wear, source)?;
        if let Some(manufacture) = &self.manufacture {
            manufacture.validate(source, self.pair.tooth_model)?;
        }
        if let Some(allowances) = &self.allowances {
            allowances.validate(source)?;
        }
        for radius in self.pair.hub_radius_mm.into_iter().flatten() {
            source.length("pair.hub_radius_mm", radius)?;
        }
        self.constraints.validate(source)?;
        self.bounds.validate(source, &self.pair)?;
        if let Some(frozen) = &self.frozen {
            frozen.validate(source, &self.bounds)?;
        }
        accuracy::validate(&self.grid, source)?;
        if is_external && self.grid != gear::Discretisation::of(self.pair.tooth_model) {
            return Err(source.error(InvalidValue::in_words(
                "accuracy",
                "present",
                "absent where a program simulates: it is the grid of the built-in model",
            )));
        }
        if let Some(corrections) = &self.corrections {
            corrections.validate(source, self.pair.tooth_model)?;
        }
        let is_free = |setting: &Setting| setting.range().is_some();
        if !self.settings().iter().any(is_free) {
            return Err(source.error(InvalidValue::in_words(
                "bounds",
                "without a free variable",
                "a section with at least one variable with [low, high], unless [corrections] has one",
            )));
        }
        source.require(
            !(is_external && self.report.compare_with_paper),
            "report.compare_with_paper",
            self.report.compare_with_paper,
            "false when simulator.kind is \"external\": the paper's figures are compared with the \
             built-in model's",
        )?;
        source.positive("penalty.weight", self.penalty.weight)?;
        source.positive("penalty.reference_um", self.penalty.reference_um)?;
        source.positive("penalty.failure_value", self.penalty.failure_value)
    }
}

impl Pair {
    /// The numbers of teeth of pinion and mate.
    #[must_use]
    pub fn teeth(&self) -> [u32; 2] {
        let pinion = self.pinion_teeth;
        let mate = match (self.gear_teeth, self.gear_ratio) {
            (Some(teeth), _) => teeth,
            (None, Some(ratio)) => (f64::from(pinion) * ratio).round() as u32,
            (None, None) => 0,
        };
        [pinion, mate]
    }

    fn validate(&self, source: Source<'_>) -> Result<(), FileError> {
        source.teeth("pair.pinion_teeth", self.pinion_teeth)?;
        match (self.gear_ratio, self.gear_teeth) {
            (Some(ratio), None) => source.require(
                ratio >= 1.0 && TEETH.contains(&self.teeth()[1]),
                "pair.gear_ratio",
                ratio,
                "u = z2/z1, the mate's number of teeth over the pinion's: at least 1, and such that the mate has \
                 at most 2000 teeth; a pair that speeds up is given by gear_teeth",
            )?,
            (None, Some(gear_teeth)) => source.teeth("pair.gear_teeth", gear_teeth)?,
            (Some(_), Some(gear_teeth)) => {
                return Err(source.refuse(
                    "pair.gear_teeth",
                    gear_teeth,
                    "absent when gear_ratio is given: the number follows from it",
                ));
            }
            (None, None) => {
                return Err(source.missing("pair.gear_ratio", "given, unless gear_teeth is"));
            }
        }
        sizes(source, self.centre_distance_mm, self.normal_module_mm)?;
        source.pressure_angle("pair.pressure_angle_deg", self.pressure_angle_deg)?;
        self.face_width_mm.validate(source)
    }
}
