//! The campaign file as it is written, with one form for each kind of problem.

use cmaes::Restarts;
use serde::{Deserialize, Serialize};

use super::accuracy::AccuracySection;
use super::validate::Source;
use super::{
    Bounds, Campaign, ConstraintSection, CorrectionsSection, Doe, Enrichment, ExternalSections,
    FileError, FrozenSection, GearLimits, GearSections, Kind, Kriging, Load, Manufacture, Material,
    Optimise, Pair, Penalty, Report, ResponseSection, Sampling, SimulatorKind, SimulatorSection,
    VariableSection, Verify, wear,
};

/// The kind of a file.
#[derive(Deserialize)]
struct Peek {
    kind: Option<String>,
}

/// `kind` of a gear campaign.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum GearKind {
    #[default]
    Gear,
}

/// `kind` of an external campaign.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum ExternalKind {
    External,
}

/// The file of a campaign that designs a gear pair.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct GearFile {
    #[serde(default)]
    kind: GearKind,
    format: u32,
    name: String,
    seed: u64,
    pair: Pair,
    load: Load,
    material: Material,
    #[serde(with = "wear")]
    wear: gear::Wear,
    manufacture: Option<Manufacture>,
    bounds: Bounds,
    frozen: Option<FrozenSection>,
    doe: Doe,
    sampling: Sampling,
    kriging: Kriging,
    #[serde(default)]
    constraints: GearLimits,
    optimise: PenalisedOptimise,
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

/// `[optimise]` of a gear campaign: CMA-ES and the penalised objective.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct PenalisedOptimise {
    population: u32,
    parents: u32,
    step: f64,
    evaluations: u32,
    #[serde(default)]
    restarts: Restarts,
    restart_at: Option<u32>,
    starts: u32,
    #[serde(default)]
    direct: bool,
    /// Weight p of a constraint's relative violation in the penalised objective.
    penalty: f64,
    /// Divisor of the criterion in the penalised objective, µm.
    reference_um: f64,
    /// Objective of a design that cannot be simulated.
    failure_value: f64,
}

/// The file of a campaign with an external problem.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ExternalFile {
    kind: ExternalKind,
    format: u32,
    name: String,
    seed: u64,
    variables: Vec<VariableSection>,
    #[serde(default)]
    constraints: Vec<ConstraintSection>,
    response: ResponseSection,
    doe: Doe,
    sampling: Sampling,
    #[serde(default)]
    kriging: Kriging,
    #[serde(default)]
    optimise: Optimise,
    #[serde(default)]
    verify: Verify,
    #[serde(default)]
    simulator: ExternalSimulator,
    enrichment: Option<Enrichment>,
}

/// `[simulator]` of an external campaign.
#[derive(Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ExternalSimulator {
    probe_designs: Option<u32>,
    attempts: Option<u32>,
    retry_s: Option<f64>,
}

/// The file in either form.
#[derive(Serialize)]
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
            None | Some("gear") => Self::Gears(Box::new(source.parse()?)),
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
        let PenalisedOptimise {
            population,
            parents,
            step,
            evaluations,
            restarts,
            restart_at,
            starts,
            direct,
            penalty,
            reference_um,
            failure_value,
        } = file.optimise;
        let sections = GearSections {
            pair: file.pair,
            load: file.load,
            material: file.material,
            wear: file.wear,
            manufacture: file.manufacture,
            bounds: file.bounds,
            frozen: file.frozen,
            constraints: file.constraints,
            penalty: Penalty {
                weight: penalty,
                reference_um,
                failure_value,
            },
            report: file.report,
            corrections: file.corrections,
            grid: file.accuracy.into(),
        };
        Self {
            name: file.name,
            seed: file.seed,
            kind: Kind::Gears(Box::new(sections)),
            doe: file.doe,
            sampling: file.sampling,
            kriging: file.kriging,
            optimise: Optimise {
                population,
                parents,
                step,
                evaluations,
                restarts,
                restart_at,
                starts,
                direct,
            },
            verify: file
                .verify
                .resolved(file.simulator.kind == SimulatorKind::External),
            simulator: file.simulator,
            enrichment: file.enrichment,
        }
    }
}

impl From<ExternalFile> for Campaign {
    fn from(file: ExternalFile) -> Self {
        let sampling = file.sampling.of_aim(file.response.aim);
        Self {
            name: file.name,
            seed: file.seed,
            kind: Kind::External(ExternalSections {
                variables: file.variables,
                constraints: file.constraints,
                response: file.response,
            }),
            doe: file.doe,
            sampling,
            kriging: file.kriging,
            optimise: file.optimise,
            verify: file.verify.resolved(true),
            simulator: SimulatorSection {
                kind: SimulatorKind::External,
                probe_designs: file.simulator.probe_designs,
                attempts: file.simulator.attempts,
                retry_s: file.simulator.retry_s,
            },
            enrichment: file.enrichment,
        }
    }
}

impl From<Campaign> for Form {
    fn from(campaign: Campaign) -> Self {
        let Campaign {
            name,
            seed,
            kind,
            doe,
            sampling,
            kriging,
            optimise,
            verify,
            simulator,
            enrichment,
        } = campaign;
        let format = Campaign::FORMAT;
        match kind {
            Kind::Gears(sections) => Self::Gears(Box::new(GearFile {
                kind: GearKind::Gear,
                format,
                name,
                seed,
                pair: sections.pair,
                load: sections.load,
                material: sections.material,
                wear: sections.wear,
                manufacture: sections.manufacture,
                bounds: sections.bounds,
                frozen: sections.frozen,
                doe,
                sampling,
                kriging,
                constraints: sections.constraints,
                optimise: PenalisedOptimise {
                    population: optimise.population,
                    parents: optimise.parents,
                    step: optimise.step,
                    evaluations: optimise.evaluations,
                    restarts: optimise.restarts,
                    restart_at: optimise.restart_at,
                    starts: optimise.starts,
                    direct: optimise.direct,
                    penalty: sections.penalty.weight,
                    reference_um: sections.penalty.reference_um,
                    failure_value: sections.penalty.failure_value,
                },
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
                variables: sections.variables,
                constraints: sections.constraints,
                response: sections.response,
                doe,
                sampling,
                kriging,
                optimise,
                verify,
                simulator: ExternalSimulator {
                    probe_designs: simulator.probe_designs,
                    attempts: simulator.attempts,
                    retry_s: simulator.retry_s,
                },
                enrichment,
            })),
        }
    }
}
