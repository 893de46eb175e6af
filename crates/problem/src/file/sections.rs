//! Sections common to the campaign file and the pair file.

use std::time::Duration;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::FileError;
use super::validate::{Invalid, Source};

/// `[load]`
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Load {
    /// Torque on the pinion, N·m.
    pub pinion_torque_nm: f64,
}

/// `[manufacture]`, optional. Without it flanks are as designed and shafts parallel.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Manufacture {
    /// Flank tolerance class of both gears by ISO 1328-1, from 1, the finest, to 11.
    pub flank_class: Option<gear::FlankClass>,
    /// Tolerance ± of the misalignment of the shafts over the face width, µm in the plane of action; three
    /// standard deviations. The tooth model `whole-face-beam` does not know of it.
    pub misalignment_um: Option<f64>,
}

impl Load {
    pub(super) fn validate(&self, source: Source<'_>) -> Result<(), FileError> {
        source.between("load.pinion_torque_nm", self.pinion_torque_nm, 0.0, 1e12)
    }
}

impl Manufacture {
    /// The random effects besides the wear, and the neglected ones, in words.
    #[must_use]
    pub fn describe(&self) -> String {
        let class = self.flank_class.map(|class| {
            format!(
                "flank class {} of ISO 1328-1: profile slopes, and with all tooth models but \
                 whole-face-beam helix slopes, deviate at random, alike on all teeth of a gear",
                class.number()
            )
        });
        let misalignment = self
            .misalignment_um
            .map(|um| format!("shafts out of line by up to {um} µm over the face"));
        let known: Vec<String> = class.into_iter().chain(misalignment).collect();
        format!(
            "{}; no pitch or form deviations, no dynamics",
            known.join("; ")
        )
    }

    /// The scatter as the simulator's input.
    #[must_use]
    pub fn to_gear(&self) -> gear::Scatter {
        gear::Scatter {
            flank_class: self.flank_class,
            misalignment: 1e-3 * self.misalignment_um.unwrap_or_default(),
        }
    }

    pub(super) fn validate(
        &self,
        source: Source<'_>,
        model: gear::ToothModel,
    ) -> Result<(), FileError> {
        if self.flank_class.is_none() && self.misalignment_um.is_none() {
            return Err(source.error(Invalid::in_words(
                "manufacture",
                "empty",
                "a section with flank_class, misalignment_um or both",
            )));
        }
        self.misalignment_um.map_or(Ok(()), |um| {
            let key = "manufacture.misalignment_um";
            source.require(
                model.knows_the_face(),
                key,
                um,
                "absent when pair.tooth_model is \"whole-face-beam\"",
            )?;
            source.within(key, um, 0.0, 1000.0, "µm")
        })
    }
}

/// The kind of simulator.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum SimulatorKind {
    /// The gear model of this program.
    #[default]
    BuiltIn,
    /// A program that every worker starts.
    External,
}

/// `[simulator]`, optional.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SimulatorSection {
    /// The simulator; the built-in model if the section is absent.
    pub kind: SimulatorKind,
    /// Number of designs that an external program simulates when a worker starts, to verify that
    /// all workers run the same program; 3 if absent. With 0 only the version that the program reports counts,
    /// which is meant for simulations that take very long.
    pub probe_designs: Option<u32>,
    /// Number of times that a failing request is tried before its failure is final; 3 if absent. An
    /// attempt counts only if the program answers something else in between.
    pub attempts: Option<u32>,
    /// How long, in seconds, everything may fail before the campaign goes on without what fails; 60
    /// if absent. A shorter outage, such as of a licence server, costs nothing but time.
    pub retry_s: Option<f64>,
}

impl SimulatorSection {
    /// The most designs behind a model digest.
    pub const MAX_PROBE_DESIGNS: u32 = 12;
    /// Default number of designs behind the model digest.
    const PROBE_DESIGNS: u32 = 3;
    /// Default of [`SimulatorSection::attempts`].
    const ATTEMPTS: u32 = 3;
    /// Default of [`SimulatorSection::retry_s`].
    const RETRY_S: f64 = 60.0;

    /// Number of designs behind the model digest of an external program.
    #[must_use]
    pub fn probe_designs(&self) -> u32 {
        self.probe_designs.unwrap_or(Self::PROBE_DESIGNS)
    }

    /// Number of times that a failing request is tried.
    #[must_use]
    pub fn attempts(&self) -> u32 {
        self.attempts.unwrap_or(Self::ATTEMPTS)
    }

    /// How long everything may fail.
    #[must_use]
    pub fn retry_for(&self) -> Duration {
        Duration::from_secs_f64(self.retry_s.unwrap_or(Self::RETRY_S))
    }

    /// The section without the keys that no result depends on.
    pub(super) const fn without_retries(mut self) -> Self {
        self.attempts = None;
        self.retry_s = None;
        self
    }

    pub(super) fn validate(&self, source: Source<'_>) -> Result<(), FileError> {
        if let Some(attempts) = self.attempts {
            source.count("simulator.attempts", attempts, 1, 1000)?;
        }
        if let Some(seconds) = self.retry_s {
            source.within("simulator.retry_s", seconds, 0.0, 1e6, "s")?;
        }
        let keys = [
            ("probe_designs", self.probe_designs.map(f64::from)),
            ("attempts", self.attempts.map(f64::from)),
            ("retry_s", self.retry_s),
        ];
        let mut given = keys.into_iter();
        if self.kind == SimulatorKind::BuiltIn
            && let Some((key, Some(found))) = given.find(|(_, value)| value.is_some())
        {
            let key = format!("simulator.{key}");
            return Err(source.refuse(&key, found, "absent: it is for kind = \"external\""));
        }
        let most = Self::MAX_PROBE_DESIGNS;
        self.probe_designs.map_or(Ok(()), |found| {
            source.require(
                found <= most,
                "simulator.probe_designs",
                found,
                &format!("a whole number from 0 to {most}"),
            )
        })
    }
}
