//! The campaign file as it is written, with one form for each kind of problem.
//!
//! A campaign's digest is that of its JSON, so the order of the fields and the rules for leaving
//! out defaults must not change.

use serde::{Deserialize, Serialize};

use super::settings::Restarts;
use super::{
    Accuracy, Bounds, Campaign, ConstraintSection, CorrectionsSection, Doe, Enrichment,
    ExternalSections, FrozenSection, GearLimits, GearSections, Kind, Kriging, Load, Manufacture,
    Material, Optimise, Pair, Penalty, Report, ResponseSection, Sampling, SimulatorKind,
    SimulatorSection, VariableSection, Verify, Wear,
};

/// The kind of a file.
#[derive(Deserialize)]
pub(super) struct Peek {
    #[serde(default)]
    pub(super) kind: Option<String>,
}

/// `kind` of a gear campaign.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum GearKind {
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
pub(super) struct GearFile {
    /// Not written, because files older than the key have none.
    #[serde(default, skip_serializing, rename = "kind")]
    _kind: Option<GearKind>,
    format: u32,
    name: String,
    seed: u64,
    pair: Pair,
    load: Load,
    material: Material,
    wear: Wear,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    manufacture: Option<Manufacture>,
    bounds: Bounds,
    #[serde(default, skip_serializing_if = "Option::is_none")]
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
    #[serde(default, skip_serializing_if = "SimulatorSection::is_default")]
    simulator: SimulatorSection,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    enrichment: Option<Enrichment>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    corrections: Option<CorrectionsSection>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    accuracy: Option<Accuracy>,
}

/// `[optimise]` of a gear campaign: CMA-ES and the penalised objective.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct PenalisedOptimise {
    population: u32,
    parents: u32,
    step: f64,
    evaluations: u32,
    #[serde(default, skip_serializing_if = "Restarts::is_default")]
    restarts: Restarts,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    restart_at: Option<u32>,
    starts: u32,
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
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
pub(super) struct ExternalFile {
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
    #[serde(default, skip_serializing_if = "Option::is_none")]
    enrichment: Option<Enrichment>,
}

/// `[simulator]` of an external campaign.
#[derive(Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ExternalSimulator {
    #[serde(default, skip_serializing_if = "Option::is_none")]
    probe_designs: Option<u32>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    attempts: Option<u32>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    retry_s: Option<f64>,
}

/// Either form, for serialisation.
#[derive(Serialize)]
#[serde(untagged)]
pub(super) enum Written {
    Gears(Box<GearFile>),
    External(Box<ExternalFile>),
}

impl From<GearFile> for (u32, Campaign) {
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
            accuracy: file.accuracy,
        };
        let campaign = Campaign {
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
        };
        (file.format, campaign)
    }
}

impl From<ExternalFile> for (u32, Campaign) {
    fn from(file: ExternalFile) -> Self {
        let sampling = file.sampling.of_aim(file.response.aim);
        let campaign = Campaign {
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
        };
        (file.format, campaign)
    }
}

impl From<Campaign> for Written {
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
                _kind: None,
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
                accuracy: sections.accuracy,
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
