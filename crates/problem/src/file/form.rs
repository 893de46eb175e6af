//! The campaign file as it is written, with one form for each kind of problem: parsing and writing.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize, Serializer};
use serde_json::Value;

use super::accuracy::AccuracySection;
use super::file_kind::FileKind;
use super::validate::Source;
use super::{
    Allowances, Bounds, Budget, Campaign, ConstraintSection, CorrectionsSection,
    CorrelationSection, Doe, Enrichment, ExternalSections, FileError, FrozenSection, GearLimits,
    GearSections, Kind, Kriging, Load, Manufacture, Materials, Objective, Optimise, Pair, Penalty,
    RandomSection, Report, ResponseSection, Sampling, SimulatorKind, SimulatorSection,
    VariableSection, Verify, strength, wear,
};
use crate::approach::Approach;

/// The kind of a file.
#[derive(Deserialize, JsonSchema)]
struct Peek {
    kind: Option<String>,
}

/// `kind` of a gear campaign.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
enum GearKind {
    /// A gear pair.
    #[default]
    Gear,
}

/// `kind` of an external campaign.
#[derive(Debug, Clone, Copy, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
enum ExternalKind {
    /// A problem that the file states and a program simulates.
    External,
}

/// The file of a campaign that designs a gear pair.
#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct GearFile {
    /// The kind of problem.
    #[serde(default)]
    kind: GearKind,
    /// The version of the file format, 1.
    format: u32,
    /// The name, from which the default store and report are named: letters, digits, hyphens and underscores.
    name: String,
    /// The seed, from which every random number of the campaign follows.
    seed: u64,
    /// The approaches to the optimum that are taken; if absent, all that the other sections allow. The DoE is sampled in
    /// any case.
    #[serde(skip_serializing_if = "Option::is_none")]
    approaches: Option<Vec<Approach>>,
    pair: Pair,
    load: Load,
    material: Materials,
    #[serde(with = "wear")]
    #[schemars(with = "wear::WearSection")]
    wear: gear::Wear,
    #[serde(default, skip_serializing_if = "strength::is_default")]
    strength: gear::rating::Factors,
    manufacture: Option<Manufacture>,
    allowances: Option<Allowances>,
    bounds: Bounds,
    frozen: Option<FrozenSection>,
    #[serde(default)]
    objective: Objective,
    doe: Doe,
    sampling: Sampling,
    kriging: Kriging,
    #[serde(default)]
    constraints: GearLimits,
    #[serde(default)]
    optimise: Optimise,
    #[serde(default)]
    penalty: Penalty,
    #[serde(default)]
    verify: Verify,
    report: Report,
    #[serde(default)]
    simulator: SimulatorSection,
    enrichment: Option<Enrichment>,
    corrections: Option<CorrectionsSection>,
    #[serde(default)]
    accuracy: AccuracySection,
}

/// The file of a campaign with an external problem.
#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct ExternalFile {
    /// The kind of problem.
    kind: ExternalKind,
    /// The version of the file format, 1.
    format: u32,
    /// The name, from which the default store and report are named: letters, digits, hyphens and underscores.
    name: String,
    /// The seed, from which every random number of the campaign follows.
    seed: u64,
    /// The approaches to the optimum that are taken; if absent, all that the other sections allow. The DoE is sampled in
    /// any case.
    #[serde(skip_serializing_if = "Option::is_none")]
    approaches: Option<Vec<Approach>>,
    variables: Vec<VariableSection>,
    #[serde(default)]
    constraints: Vec<ConstraintSection>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    random: Vec<RandomSection>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    correlations: Vec<CorrelationSection>,
    responses: Vec<ResponseSection>,
    #[serde(default)]
    objective: Objective,
    doe: Doe,
    sampling: Sampling,
    #[serde(default)]
    kriging: Kriging,
    #[serde(default)]
    optimise: Optimise,
    #[serde(default)]
    verify: Verify,
    #[serde(default)]
    simulator: SimulatorSection,
    #[serde(default)]
    budget: Budget,
    enrichment: Option<Enrichment>,
}

/// The file in either form.
#[derive(Serialize, JsonSchema)]
#[serde(untagged)]
pub(crate) enum Form {
    Gears(Box<GearFile>),
    External(Box<ExternalFile>),
}

impl Form {
    /// The content of a file, not validated.
    pub(crate) fn parse(source: Source<'_>) -> Result<Self, FileError> {
        // If the text is not TOML, parsing the whole form reports the error.
        let kind = toml::from_str(source.text).map_or(None, |Peek { kind }| kind);
        let this = match kind.as_deref() {
            None | Some("gear") => Self::Gears(Box::new(source.parse_kind(FileKind::Campaign)?)),
            Some("external") => Self::External(Box::new(source.parse()?)),
            Some(other) => {
                return Err(source.refuse("kind", other, "\"gear\" or \"external\""));
            }
        };
        let format = match &this {
            Self::Gears(file) => file.format,
            Self::External(file) => file.format,
        };
        let known = Campaign::FORMAT;
        source.require(
            format == known,
            "format",
            format,
            &format!("{known}, the version this program reads"),
        )?;
        Ok(this)
    }

    /// The content of a file as JSON, not validated.
    pub(super) fn from_json(json: &str) -> Result<Self, serde_json::Error> {
        let Peek { kind } = serde_json::from_str(json)?;
        Ok(match kind.as_deref() {
            Some("external") => Self::External(serde_json::from_str(json)?),
            _ => Self::Gears(serde_json::from_str(json)?),
        })
    }

    /// `accuracy.tolerance_um`
    pub(crate) const fn tolerance_um(&self) -> Option<f64> {
        match self {
            Self::Gears(file) => file.accuracy.tolerance_um,
            Self::External(_) => None,
        }
    }
}

impl From<Form> for Campaign {
    fn from(written: Form) -> Self {
        match written {
            Form::Gears(file) => (*file).into(),
            Form::External(file) => (*file).into(),
        }
    }
}

impl From<GearFile> for Campaign {
    fn from(file: GearFile) -> Self {
        let grid = file.accuracy.grid(file.pair.tooth_model);
        let corrections = file.corrections.as_ref();
        let sections = GearSections {
            pair: file.pair,
            load: file.load,
            material: file.material,
            wear: file.wear,
            strength: file.strength,
            manufacture: file.manufacture,
            allowances: file.allowances,
            bounds: file.bounds,
            frozen: file.frozen,
            constraints: file
                .constraints
                .of_relieved(corrections.is_some_and(|one| one.tip_relief_um.is_some())),
            penalty: file.penalty,
            report: file.report,
            corrections: file.corrections,
            grid,
        };
        Self {
            name: file.name,
            seed: file.seed,
            approaches: file.approaches,
            kind: Kind::Gears(Box::new(sections)),
            doe: file.doe,
            sampling: file.sampling.of(file.objective),
            kriging: file.kriging,
            optimise: file.optimise,
            verify: file
                .verify
                .resolved(file.simulator.kind == SimulatorKind::External),
            simulator: file.simulator,
            budget: Budget::default(),
            enrichment: file.enrichment,
        }
    }
}

impl From<ExternalFile> for Campaign {
    fn from(file: ExternalFile) -> Self {
        let sampling = file.sampling.of(file.objective);
        Self {
            name: file.name,
            seed: file.seed,
            approaches: file.approaches,
            kind: Kind::External(ExternalSections {
                variables: file.variables,
                constraints: file.constraints,
                random: file.random,
                correlations: file.correlations,
                responses: file.responses,
            }),
            doe: file.doe,
            sampling,
            kriging: file.kriging,
            optimise: file.optimise,
            verify: file.verify.resolved(true),
            simulator: SimulatorSection {
                kind: SimulatorKind::External,
                ..file.simulator
            },
            budget: file.budget,
            enrichment: file.enrichment,
        }
    }
}

impl From<Campaign> for Form {
    fn from(campaign: Campaign) -> Self {
        let Campaign {
            name,
            seed,
            approaches,
            kind,
            doe,
            sampling,
            kriging,
            optimise,
            verify,
            simulator,
            budget,
            enrichment,
        } = campaign;
        let format = Campaign::FORMAT;
        match kind {
            Kind::Gears(sections) => Self::Gears(Box::new(GearFile {
                kind: GearKind::Gear,
                format,
                name,
                seed,
                approaches,
                pair: sections.pair,
                load: sections.load,
                material: sections.material,
                wear: sections.wear,
                strength: sections.strength,
                manufacture: sections.manufacture,
                allowances: sections.allowances,
                bounds: sections.bounds,
                frozen: sections.frozen,
                objective: sampling.objective.clone(),
                doe,
                sampling,
                kriging,
                constraints: sections.constraints,
                optimise,
                penalty: sections.penalty,
                verify,
                report: sections.report,
                simulator,
                enrichment,
                corrections: sections.corrections,
                accuracy: sections.grid.into(),
            })),
            Kind::External(sections) => Self::External(Box::new(ExternalFile {
                kind: ExternalKind::External,
                format,
                name,
                seed,
                approaches,
                variables: sections.variables,
                constraints: sections.constraints,
                random: sections.random,
                correlations: sections.correlations,
                responses: sections.responses,
                objective: sampling.objective.clone(),
                doe,
                sampling,
                kriging,
                optimise,
                verify,
                simulator,
                budget,
                enrichment,
            })),
        }
    }
}

impl Serialize for Campaign {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        Form::from(self.clone()).serialize(to)
    }
}

impl Campaign {
    /// Parses and validates `text`; `file` names it in errors.
    ///
    /// A file with a tolerance has no settings yet: [`CampaignFile`](crate::accuracy::CampaignFile) chooses them.
    ///
    /// # Errors
    ///
    /// The error names the line, the fault and the valid values.
    pub fn parse(file: &str, text: &str) -> Result<Self, FileError> {
        let source = Source { file, text };
        let form = Form::parse(source)?;
        if let Some(tolerance_um) = form.tolerance_um() {
            let expected = "absent from a file whose settings are chosen";
            return Err(source.refuse("accuracy.tolerance_um", tolerance_um, expected));
        }
        let this = Self::from(form);
        this.validate(source)?;
        Ok(this)
    }

    /// Parses the text of a campaign file that a store holds.
    ///
    /// # Errors
    ///
    /// The text has the format of another version of the program.
    pub fn stored(text: &str) -> Result<Self, FileError> {
        Self::parse("the store's campaign file", text)
    }

    /// The keys of the file with their values; those without a value are left out.
    ///
    /// # Panics
    ///
    /// Never: every field is a number, a name or a list of these.
    pub(super) fn to_value(&self) -> Value {
        fn without_nulls(value: &mut Value) {
            match value {
                Value::Object(keys) => {
                    keys.retain(|_, value| !value.is_null());
                    keys.values_mut().for_each(without_nulls);
                }
                Value::Array(values) => values.iter_mut().for_each(without_nulls),
                _ => {}
            }
        }
        let mut value = serde_json::to_value(self).expect("plain numbers and names serialise");
        without_nulls(&mut value);
        value
    }

    /// The campaign as JSON, for the protocol and for external programs.
    #[must_use]
    pub fn to_json(&self) -> String {
        self.to_value().to_string()
    }

    /// Reads the JSON written by [`Campaign::to_json`].
    ///
    /// # Errors
    ///
    /// The text is not a campaign of this version.
    pub fn from_json(json: &str) -> Result<Self, serde_json::Error> {
        Form::from_json(json).map(Self::from)
    }

    /// The JSON Schema of the file: `anyOf` the forms for gears and for an external problem.
    #[must_use]
    pub fn schema() -> Value {
        schemars::schema_for!(Form).to_value()
    }
}
