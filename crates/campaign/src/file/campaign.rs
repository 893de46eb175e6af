//! The campaign file.

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::corrections::{CorrectionsSection, WITHOUT_CROWNING};
use super::pair::size;
use super::sections::{SimulatorKind, SimulatorSection, parse_name};
use super::validate::Source;
use super::{
    Enrichment, FileError, Kriging, Load, Material, Sampling, Wear, WearCoefficients, advice,
};

/// A campaign file, validated: one problem, one DoE, one seed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Campaign {
    /// The version of the file format; [`Campaign::FORMAT`].
    pub format: u32,
    /// Names the default store and report.
    pub name: String,
    /// Every random number of the campaign follows from it.
    pub seed: u64,
    /// `[pair]`
    pub pair: Pair,
    /// `[load]`
    pub load: Load,
    /// `[material]`
    pub material: Material,
    /// `[wear]`
    pub wear: Wear,
    /// `[bounds]`
    pub bounds: Bounds,
    /// `[frozen]`
    pub frozen: FrozenSection,
    /// `[doe]`
    pub doe: Doe,
    /// `[sampling]`
    pub sampling: Sampling,
    /// `[kriging]`
    pub kriging: Kriging,
    /// `[constraints]`
    pub constraints: Constraints,
    /// `[optimise]`
    pub optimise: Optimise,
    /// `[verify]`
    pub verify: Verify,
    /// `[report]`
    pub report: Report,
    /// `[simulator]`; left out of the digest where it says nothing, as in files of before it.
    #[serde(default, skip_serializing_if = "SimulatorSection::is_default")]
    pub simulator: SimulatorSection,
    /// `[enrichment]`; left out of the digest where it is absent, as in files of before it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub enrichment: Option<Enrichment>,
    /// `[corrections]`; left out of the digest where it is absent, as in files of before it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub corrections: Option<CorrectionsSection>,
}

/// `[pair]` of a campaign: what all its designs share.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pair {
    /// Number of teeth of the pinion.
    pub pinion_teeth: u32,
    /// The mate has ⌊pinion teeth / ratio⌋ teeth (the paper's (4)); either this or the number.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gear_ratio: Option<f64>,
    /// Number of teeth of the mate.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gear_teeth: Option<u32>,
    /// Centre distance, mm; either this or the module is given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub centre_distance_mm: Option<f64>,
    /// Normal module, mm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub normal_module_mm: Option<f64>,
    /// Rack pressure angle in the normal section, degrees.
    pub pressure_angle_deg: f64,
    /// Face width, mm.
    pub face_width_mm: f64,
    /// Compliance model; see [`gear::ToothModel`].
    pub tooth_model: String,
    /// What happens to a tip that reaches the mate's root; see [`gear::TipRule`].
    pub tip_rule: String,
}

/// `[bounds]`: `[low, high]` of each kind of variable.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bounds {
    /// Addendum modification coefficient, modules.
    pub profile_shift: [f64; 2],
    /// Tool addendum, modules.
    pub tool_addendum: [f64; 2],
    /// Tool dedendum, modules.
    pub tool_dedendum: [f64; 2],
    /// Tip rounding radius, in modules of the design.
    pub tip_radius_modules: [f64; 2],
    /// Root fillet radius, in modules of the design.
    pub root_radius_modules: [f64; 2],
    /// Helix angle, degrees.
    pub helix_angle_deg: [f64; 2],
}

/// Where the five variables that the problems with wear leave alone come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FrozenFrom {
    /// The values that the campaign file gives.
    Printed,
    /// The campaign's own optimum without wear.
    Deterministic,
}

/// `[frozen]`
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FrozenSection {
    /// Which values are used.
    pub from: FrozenFrom,
    /// Tip rounding radii of pinion and mate, mm.
    pub tip_radius_mm: [f64; 2],
    /// Root fillet radii of pinion and mate, mm.
    pub root_radius_mm: [f64; 2],
    /// Helix angle, degrees.
    pub helix_angle_deg: f64,
}

/// `[doe]`
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Doe {
    /// The number of designs, n.
    pub designs: u32,
    /// The kind of design; see [`doe::Method`]. Maximin if absent, and then left out of the digest, as
    /// in files of before it.
    #[serde(
        default,
        with = "doe_method",
        skip_serializing_if = "doe_method::is_default"
    )]
    pub method: doe::Method,
}

/// A kind of design as its name.
mod doe_method {
    use doe::Method;
    use serde::{Deserialize as _, Deserializer, Serializer, de::Error as _};

    pub(super) fn serialize<S: Serializer>(method: &Method, to: S) -> Result<S::Ok, S::Error> {
        to.collect_str(method)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Method, D::Error> {
        String::deserialize(from)?.parse().map_err(D::Error::custom)
    }

    pub(super) fn is_default(method: &Method) -> bool {
        *method == Method::default()
    }
}

/// `[constraints]`; the limits of the stresses are the material's.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Constraints {
    /// The contact ratio r_c must be above this.
    pub contact_ratio_min: f64,
    /// The specific sliding g_s must be below this.
    pub specific_sliding_max: f64,
}

/// `[optimise]`: the settings of CMA-ES and of the penalised objective (5).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Optimise {
    /// Candidates per generation, λ.
    pub population: u32,
    /// Candidates that survive, µ.
    pub parents: u32,
    /// Initial step, in parts of each variable's range.
    pub step: f64,
    /// Evaluations per start.
    pub evaluations: u32,
    /// How a search that has stopped starts again. From its best point if absent, and then left out
    /// of the digest, as in files of before it.
    #[serde(default, skip_serializing_if = "Restarts::is_default")]
    pub restarts: Restarts,
    /// After how many evaluations the search restarts from its best point whatever its state; given
    /// with [`Restarts::FromBest`] only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub restart_at: Option<u32>,
    /// Independent runs.
    pub starts: u32,
    /// Weight p of a constraint's relative violation.
    pub penalty: f64,
    /// Δ_ref, µm.
    pub reference_um: f64,
    /// Value of a design that cannot be simulated.
    pub failure_value: f64,
}

/// How the optimiser starts again when a search has stopped; see [`cmaes::Restarts`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Restarts {
    /// From the best point so far, with the same population, as in the paper.
    #[default]
    FromBest,
    /// From a random point with twice the population.
    Ipop,
    /// In turns with twice the population, and with a small population and a short step.
    Bipop,
}

impl Restarts {
    fn is_default(&self) -> bool {
        *self == Self::default()
    }
}

impl Optimise {
    /// The settings of a run of CMA-ES within `bounds`.
    #[must_use]
    pub fn run(&self, bounds: cmaes::Bounds) -> cmaes::RunOptions {
        cmaes::RunOptions {
            search: cmaes::Options {
                population: self.population as usize,
                parents: self.parents as usize,
                step: self.step,
                ..cmaes::Options::new(bounds)
            },
            evaluations: self.evaluations as usize,
            restarts: match self.restarts {
                Restarts::FromBest => cmaes::Restarts::FromBest {
                    planned: self.restart_at.unwrap_or(0) as usize,
                },
                Restarts::Ipop => cmaes::Restarts::Ipop,
                Restarts::Bipop => cmaes::Restarts::Bipop,
            },
        }
    }
}

/// `[verify]`
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Verify {
    /// Fresh samples at each optimum.
    pub samples: u32,
}

/// `[report]`
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Report {
    /// Whether the paper's figures stand beside the campaign's.
    pub compare_with_paper: bool,
}

impl Campaign {
    /// The version of the file format that this program reads.
    pub const FORMAT: u32 = 1;

    /// The file of a campaign to start from, as shipped: the paper's with Archard's law of wear.
    pub const WEAR: &'static str = include_str!("../../../../campaigns/wear.toml");

    /// The file of the paper's campaign, as shipped.
    pub const PAPER: &'static str = include_str!("../../../../campaigns/paper.toml");

    /// Whether an external program simulates.
    #[must_use]
    pub fn is_external(&self) -> bool {
        self.simulator.kind == SimulatorKind::External
    }

    /// Parses and validates `text`; `file` names it in errors.
    ///
    /// # Errors
    ///
    /// What is wrong, on which line, and what would be right.
    pub fn parse(file: &str, text: &str) -> Result<Self, FileError> {
        let source = Source { file, text };
        let this: Self = source.parse()?;
        this.validate(source)?;
        Ok(this)
    }

    /// The number of teeth of pinion and mate.
    #[must_use]
    pub fn teeth(&self) -> [u32; 2] {
        let pinion = self.pair.pinion_teeth;
        let mate = match (self.pair.gear_teeth, self.pair.gear_ratio) {
            (Some(teeth), _) => teeth,
            // The ratio is a decimal such as 0.9, which binary numbers miss by an ulp: 18/0.9 must
            // give 20, so a quotient that close to a whole number is taken as it.
            (None, Some(ratio)) => (f64::from(pinion) / ratio + 1e-9).floor() as u32,
            (None, None) => 0,
        };
        [pinion, mate]
    }

    /// SHA-256 of the campaign's content as hex: comments, layout and key order do not matter.
    #[must_use]
    pub fn digest(&self) -> String {
        Sha256::digest(self.to_json().as_bytes())
            .iter()
            .map(|byte| format!("{byte:02x}"))
            .collect()
    }

    /// SHA-256 of everything that the values of a design's samples may depend on: the same for a
    /// campaign and one that [extends](Self::extends) it.
    #[must_use]
    pub fn values_digest(&self) -> [u8; 32] {
        let mut values = self.clone();
        values.doe.designs = 0;
        values.sampling.samples_per_design = 0;
        values.verify.samples = 0;
        values.enrichment = None;
        values.kriging = self.kriging.without_choices();
        Sha256::digest(values.to_json().as_bytes()).into()
    }

    /// Whether this is `held` made larger: more designs, more samples per design or more fresh
    /// samples, an enrichment or a larger budget for it, another model of the same kernel, and everything
    /// else the same. What was
    /// sampled for `held` is then part of it.
    #[must_use]
    pub fn extends(&self, held: &Self) -> bool {
        let sizes = |campaign: &Self| {
            [
                campaign.doe.designs,
                campaign.sampling.samples_per_design,
                campaign.verify.samples,
            ]
        };
        let grows = sizes(self).iter().zip(sizes(held)).all(|(a, b)| *a >= b);
        let enriches = match (&self.enrichment, &held.enrichment) {
            (Some(section), Some(held)) => section.extends(held),
            (section, held) => held.is_none() || section == held,
        };
        let mut same = self.clone();
        same.doe.designs = held.doe.designs;
        same.sampling.samples_per_design = held.sampling.samples_per_design;
        same.verify.samples = held.verify.samples;
        same.enrichment = held.enrichment;
        if self.kriging.kernel == held.kriging.kernel {
            same.kriging = held.kriging.clone();
        }
        grows && enriches && same == *held
    }

    /// The campaign as JSON, for the wire.
    ///
    /// # Panics
    ///
    /// Never: every field is a number, a name or a list of them.
    #[must_use]
    pub fn to_json(&self) -> String {
        serde_json::to_string(self).expect("plain numbers and names serialise")
    }

    /// Reads what [`Campaign::to_json`] wrote.
    ///
    /// # Errors
    ///
    /// The text is no campaign of this version.
    pub fn from_json(json: &str) -> Result<Self, serde_json::Error> {
        serde_json::from_str(json)
    }

    /// Advice about settings that are legal but doubtful.
    #[must_use]
    pub fn warnings(&self) -> Vec<String> {
        let mut warnings = Vec::new();
        let samples = self.sampling.samples_per_design;
        if samples < 25 {
            warnings.push(format!(
                "sampling.samples_per_design is {samples}: below 25 samples the normality of \
                 ΔSTE, on which the percentile rests, cannot be trusted"
            ));
        }
        if let Some(enrichment) = &self.enrichment {
            let first = u64::from(self.doe.designs) * u64::from(samples);
            let budget = u64::from(enrichment.samples);
            if budget < first {
                warnings.push(format!(
                    "enrichment.samples is {budget}: the DoE alone can take {first}, which leaves \
                     little or nothing for infill"
                ));
            }
        }
        warnings.extend(advice::of_sections(
            &self.material,
            &self.wear,
            self.pair.face_width_mm,
        ));
        warnings.extend(advice::of_frozen(self));
        warnings
    }

    fn validate(&self, source: Source<'_>) -> Result<(), FileError> {
        let format = Self::FORMAT;
        source.require(
            self.format == format,
            "format",
            self.format,
            &format!("{format}, the version this program reads"),
        )?;
        let plain = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
        source.require(
            !self.name.is_empty() && self.name.len() <= 64 && self.name.chars().all(plain),
            "name",
            &self.name,
            "1 to 64 letters, digits, hyphens or underscores",
        )?;
        // TOML's integers are signed: a larger seed could not be written down.
        source.require(
            i64::try_from(self.seed).is_ok(),
            "seed",
            self.seed,
            "a whole number below 2^63",
        )?;
        self.pair.validate(source, self.teeth())?;
        self.load.validate(source)?;
        self.material.validate(source)?;
        self.wear.validate(source)?;
        self.bounds.validate(source)?;
        self.frozen.validate(source)?;
        self.simulator.validate(source)?;
        if let Some(corrections) = &self.corrections {
            corrections.validate(source)?;
            let whole_face = self.pair.tooth_model == gear::ToothModel::WholeFaceBeam.name();
            source.require(
                !whole_face || corrections.crowning_um.is_none(),
                "corrections.crowning_um",
                corrections.crowning_um.unwrap_or_default(),
                WITHOUT_CROWNING,
            )?;
        }
        source.require(
            !(self.is_external() && self.report.compare_with_paper),
            "report.compare_with_paper",
            self.report.compare_with_paper,
            "false when simulator.kind is \"external\": the paper's figures are compared with the \
             built-in model's",
        )?;
        if let Some(enrichment) = &self.enrichment {
            enrichment.validate(source)?;
            source.require(
                !self.is_external(),
                "enrichment",
                "present",
                "absent when simulator.kind is \"external\": the coordinator evaluates the \
                 constraints of thousands of candidates itself, with the built-in model",
            )?;
            source.require(
                self.sampling.coefficients == WearCoefficients::Independent,
                "sampling.coefficients",
                self.sampling.coefficients,
                "\"independent\" beside [enrichment], whose designs get more samples a few at a time",
            )?;
        }
        let count = |key, value, low, high| source.count(key, value, low, high);
        let most = match self.doe.method {
            doe::Method::Sobol => doe::SOBOL_POINTS as u32,
            _ => 100_000,
        };
        count("doe.designs", self.doe.designs, 2, most)?;
        self.sampling.validate(source, self.is_external())?;
        count("verify.samples", self.verify.samples, 4, 1_000_000)?;
        self.kriging
            .validate(source, self.doe.designs, &self.sampling)?;
        source.positive(
            "constraints.contact_ratio_min",
            self.constraints.contact_ratio_min,
        )?;
        source.positive(
            "constraints.specific_sliding_max",
            self.constraints.specific_sliding_max,
        )?;
        let optimise = &self.optimise;
        count("optimise.population", optimise.population, 4, 10_000)?;
        count("optimise.parents", optimise.parents, 1, optimise.population)?;
        source.between("optimise.step", optimise.step, 0.0, 10.0)?;
        count(
            "optimise.evaluations",
            optimise.evaluations,
            optimise.population,
            100_000_000,
        )?;
        let key = "optimise.restart_at";
        match (optimise.restarts, optimise.restart_at) {
            (Restarts::FromBest, Some(at)) => count(key, at, 1, optimise.evaluations)?,
            (Restarts::FromBest, None) => {
                return Err(source.refuse(
                    key,
                    "missing",
                    "given, unless restarts is \"ipop\" or \"bipop\"",
                ));
            }
            (_, Some(at)) => {
                return Err(source.refuse(
                    key,
                    at,
                    "absent when restarts is \"ipop\" or \"bipop\", which restart when a search \
                     has stopped",
                ));
            }
            (_, None) => {}
        }
        count("optimise.starts", optimise.starts, 1, 1000)?;
        source.positive("optimise.penalty", optimise.penalty)?;
        source.positive("optimise.reference_um", optimise.reference_um)?;
        source.positive("optimise.failure_value", optimise.failure_value)
    }
}

impl Pair {
    fn validate(&self, source: Source<'_>, teeth: [u32; 2]) -> Result<(), FileError> {
        let sensible = 4..=2000;
        source.require(
            sensible.contains(&self.pinion_teeth),
            "pair.pinion_teeth",
            self.pinion_teeth,
            "a number of teeth from 4 to 2000",
        )?;
        match (self.gear_ratio, self.gear_teeth) {
            (Some(ratio), None) => {
                source.positive("pair.gear_ratio", ratio)?;
                source.require(
                    sensible.contains(&teeth[1]),
                    "pair.gear_ratio",
                    ratio,
                    "such that pinion_teeth / gear_ratio lies between 4 and 2000",
                )?;
            }
            (None, Some(gear_teeth)) => source.require(
                sensible.contains(&gear_teeth),
                "pair.gear_teeth",
                gear_teeth,
                "a number of teeth from 4 to 2000",
            )?,
            (Some(_), Some(gear_teeth)) => {
                return Err(source.refuse(
                    "pair.gear_teeth",
                    gear_teeth,
                    "absent when gear_ratio is given: the number follows from it",
                ));
            }
            (None, None) => {
                return Err(source.refuse(
                    "pair.gear_ratio",
                    "missing",
                    "given, unless gear_teeth is",
                ));
            }
        }
        size(source, self.centre_distance_mm, self.normal_module_mm)?;
        source.pressure_angle("pair.pressure_angle_deg", self.pressure_angle_deg)?;
        source.length("pair.face_width_mm", self.face_width_mm)?;
        parse_name::<gear::ToothModel>(source, "pair.tooth_model", &self.tooth_model)?;
        parse_name::<gear::TipRule>(source, "pair.tip_rule", &self.tip_rule)?;
        Ok(())
    }
}

impl Bounds {
    fn validate(&self, source: Source<'_>) -> Result<(), FileError> {
        source.ordered("bounds.profile_shift", self.profile_shift, -10.0, 10.0)?;
        source.ordered("bounds.tool_addendum", self.tool_addendum, 0.0, 10.0)?;
        source.ordered("bounds.tool_dedendum", self.tool_dedendum, 0.0, 10.0)?;
        source.ordered(
            "bounds.tip_radius_modules",
            self.tip_radius_modules,
            0.0,
            10.0,
        )?;
        source.ordered(
            "bounds.root_radius_modules",
            self.root_radius_modules,
            1e-6,
            10.0,
        )?;
        source.ordered("bounds.helix_angle_deg", self.helix_angle_deg, -60.0, 60.0)
    }
}

impl FrozenSection {
    fn validate(&self, source: Source<'_>) -> Result<(), FileError> {
        for gear in 0..2 {
            source.tip_radius("frozen.tip_radius_mm", self.tip_radius_mm[gear])?;
            source.root_radius("frozen.root_radius_mm", self.root_radius_mm[gear])?;
        }
        source.helix_angle("frozen.helix_angle_deg", self.helix_angle_deg)
    }
}

#[cfg(test)]
mod tests;
