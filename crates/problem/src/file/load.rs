//! `[load]`: the torque, and the cases in which the transmission error counts.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::FileError;
use super::validate::Source;

/// `[load]`: the torque that wears the flanks and that strength and pressure are rated at.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Load {
    /// Torque on the pinion, N·m.
    pub pinion_torque_nm: f64,
    /// `[[load.cases]]`, optional, at most eight: the torques and states of wear in which the transmission error
    /// counts. Each sample is the ΔSTE of one random pair in every case. The weighted mean over the cases is measured
    /// if they have weights, and the greatest ΔSTE otherwise. Without cases it is the ΔSTE of the worn pair under
    /// `pinion_torque_nm`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub cases: Vec<LoadCase>,
}

/// One of `[[load.cases]]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LoadCase {
    /// Name in tables, of letters, digits and underscores; the case's number if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// Torque on the pinion, N·m; that of `[load]` if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pinion_torque_nm: Option<f64>,
    /// Share of the wear's depth: 0 for new flanks, 1, the default, for the depth of `[wear]`.
    #[serde(default = "whole")]
    pub wear: f64,
    /// Weight of the case, given in all cases or in none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub weight: Option<f64>,
    /// Upper limit of the objective's measure of this case's ΔSTE, µm.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub delta_ste_max_um: Option<f64>,
}

const fn whole() -> f64 {
    1.0
}

/// The most cases of a load.
const MOST_CASES: usize = 8;

impl Load {
    /// A load without cases.
    #[must_use]
    pub const fn of(pinion_torque_nm: f64) -> Self {
        Self {
            pinion_torque_nm,
            cases: Vec::new(),
        }
    }

    /// The cases, of which there is at least one: the whole wear under the load's torque.
    #[must_use]
    pub fn all_cases(&self) -> Vec<LoadCase> {
        if !self.cases.is_empty() {
            return self.cases.clone();
        }
        vec![LoadCase {
            name: None,
            pinion_torque_nm: None,
            wear: whole(),
            weight: None,
            delta_ste_max_um: None,
        }]
    }

    /// The torque of a case, N·m.
    #[must_use]
    pub fn torque_of(&self, case: &LoadCase) -> f64 {
        case.pinion_torque_nm.unwrap_or(self.pinion_torque_nm)
    }

    /// The names of the cases.
    #[must_use]
    pub fn case_names(&self) -> Vec<String> {
        let named = (1..).zip(&self.cases);
        let name = |(number, case): (usize, &LoadCase)| {
            let number = || format!("case_{number}");
            case.name.clone().unwrap_or_else(number)
        };
        named.map(name).collect()
    }

    /// The weights of the cases, whose sum is 1; `None` if the greatest ΔSTE counts.
    #[must_use]
    pub fn weights(&self) -> Option<Vec<f64>> {
        let weights: Option<Vec<f64>> = self.cases.iter().map(|case| case.weight).collect();
        let weights = weights.filter(|weights| !weights.is_empty())?;
        let sum: f64 = weights.iter().sum();
        Some(weights.iter().map(|weight| weight / sum).collect())
    }

    /// The ΔSTE that counts of those in all cases.
    #[must_use]
    pub fn combined(&self, values: &[f64]) -> f64 {
        match self.weights() {
            Some(weights) => weights.iter().zip(values).map(|(w, v)| w * v).sum(),
            None => values.iter().copied().reduce(f64::max).unwrap_or(f64::NAN),
        }
    }

    pub(super) fn validate(&self, source: Source<'_>) -> Result<(), FileError> {
        source.between("load.pinion_torque_nm", self.pinion_torque_nm, 0.0, 1e12)?;
        let (cases, count) = ("load.cases", self.cases.len());
        source.require(count <= MOST_CASES, cases, count, "at most eight cases")?;
        let names = self.case_names();
        for (place, (case, name)) in self.cases.iter().zip(&names).enumerate() {
            let key = |key: &str| format!("load.cases[{}].{key}", place + 1);
            let is_plain = |c: char| c.is_ascii_alphanumeric() || c == '_';
            source.require(
                (1..=32).contains(&name.len())
                    && name.chars().all(is_plain)
                    && !names[..place].contains(name),
                &key("name"),
                name,
                "1 to 32 letters, digits or underscores, and another for each case",
            )?;
            if let Some(torque) = case.pinion_torque_nm {
                source.between(&key("pinion_torque_nm"), torque, 0.0, 1e12)?;
            }
            source.within(&key("wear"), case.wear, 0.0, 100.0, "")?;
            match (case.weight, self.cases[0].weight) {
                (Some(weight), _) => source.positive(&key("weight"), weight)?,
                (None, Some(_)) => {
                    return Err(source.missing(&key("weight"), "given in all cases or in none"));
                }
                (None, None) => {}
            }
            if let Some(limit) = case.delta_ste_max_um {
                source.positive(&key("delta_ste_max_um"), limit)?;
            }
        }
        let has_weights = self.cases.iter().filter(|case| case.weight.is_some());
        let expected = "given in all cases or in none";
        if has_weights.count() % count.max(1) != 0 {
            return Err(source.missing("load.cases[1].weight", expected));
        }
        Ok(())
    }
}
