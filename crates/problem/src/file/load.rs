//! `[load]`: the torque, and the cases in which the transmission error counts.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::validate::Source;
use super::{FileError, Several};

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
#[serde(deny_unknown_fields, default)]
pub struct LoadCase {
    /// Name in tables, of letters, digits and underscores; `case_1`, `case_2`, … if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// Torque on the pinion, N·m; that of `[load]` if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pinion_torque_nm: Option<f64>,
    /// Share of the wear's depth: 0 for new flanks, 1, the default, for the depth of `[wear]`.
    pub wear: f64,
    /// Weight of the case, given in all cases or in none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub weight: Option<f64>,
    /// Upper limit of the objective's measure of this case's ΔSTE, µm.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub delta_ste_max_um: Option<f64>,
}

/// The case of a load without `[[load.cases]]`: the whole wear under the load's torque.
impl Default for LoadCase {
    fn default() -> Self {
        Self {
            name: None,
            pinion_torque_nm: None,
            wear: 1.0,
            weight: None,
            delta_ste_max_um: None,
        }
    }
}

/// The most cases of a load.
const MOST_CASES: usize = 8;

impl Load {
    /// The cases of `[[load.cases]]`, or the [default](LoadCase::default) case without that section.
    #[must_use]
    pub fn all_cases(&self) -> Vec<LoadCase> {
        match self.cases.is_empty() {
            true => vec![LoadCase::default()],
            false => self.cases.clone(),
        }
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

    /// The combination of the cases' ΔSTE that is measured, and the index of the case for each of its terms; `None`
    /// without cases.
    pub(crate) fn combination(&self) -> Option<(Several, Vec<usize>)> {
        let names = self.case_names();
        let Some(weights) = self.weights() else {
            let places = (0..names.len()).collect();
            return (!names.is_empty()).then_some((Several::Greatest(names), places));
        };
        let sum: BTreeMap<String, f64> = names.iter().cloned().zip(weights).collect();
        // In the order of the sum's weights.
        let place = |name: &String| names.iter().position(|one| one == name);
        let places = sum.keys().filter_map(place).collect();
        Some((Several::Sum(sum), places))
    }

    /// The measured ΔSTE, combined from the `values` in all cases.
    #[must_use]
    pub fn combined(&self, values: &[f64]) -> f64 {
        match self.combination() {
            None => values[0],
            Some((several, places)) => several.of(places.into_iter().map(|place| values[place])),
        }
    }

    pub(super) fn validate(&self, source: Source<'_>) -> Result<(), FileError> {
        source.between("load.pinion_torque_nm", self.pinion_torque_nm, 0.0, 1e12)?;
        let (cases, count) = ("load.cases", self.cases.len());
        source.require(count <= MOST_CASES, cases, count, "at most eight cases")?;
        let names = self.case_names();
        let is_weighted = self.cases.iter().any(|case| case.weight.is_some());
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
            match case.weight {
                Some(weight) => source.positive(&key("weight"), weight)?,
                None if is_weighted => {
                    return Err(source.missing(&key("weight"), "given in all cases or in none"));
                }
                None => {}
            }
            if let Some(limit) = case.delta_ste_max_um {
                source.positive(&key("delta_ste_max_um"), limit)?;
            }
        }
        Ok(())
    }
}
