//! `[corrections]` of a campaign: profile corrections as design variables.

use serde::{Deserialize, Serialize};

use super::FileError;
use super::sections::parse_name;
use super::validate::Source;

/// `[corrections]`, optional: `[low, high]` of each kind of profile correction. The campaign itself
/// leaves flanks as they are; `coordinator corrections` designs with and without them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CorrectionsSection {
    /// Amount of tip relief, µm normal to the flank at the end of contact; for both gears.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tip_relief_um: Option<[f64; 2]>,
    /// Length of the relieved part, mm along the path of contact; for both gears.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tip_relief_length_mm: Option<[f64; 2]>,
    /// How the relief grows; see [`gear::ReliefShape`]. Linear if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tip_relief_shape: Option<String>,
    /// Lengthwise crowning of both flanks together, µm at the ends of the face.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub crowning_um: Option<[f64; 2]>,
}

impl CorrectionsSection {
    /// Amounts beyond this are no corrections any more, µm.
    const MOST_UM: f64 = 1000.0;

    pub(super) fn validate(&self, source: Source<'_>) -> Result<(), FileError> {
        let amount = |key: &str, range: Option<[f64; 2]>| {
            range.map_or(Ok(()), |range| {
                source.ordered(key, range, 0.0, Self::MOST_UM)
            })
        };
        amount("corrections.tip_relief_um", self.tip_relief_um)?;
        amount("corrections.crowning_um", self.crowning_um)?;
        source.require(
            self.tip_relief_um.is_some() || self.crowning_um.is_some(),
            "corrections",
            "empty",
            "a section with tip_relief_um, crowning_um or both",
        )?;
        match (self.tip_relief_um, self.tip_relief_length_mm) {
            (Some(_), Some(length)) => {
                source.ordered("corrections.tip_relief_length_mm", length, 1e-3, 1000.0)?;
            }
            (Some(_), None) => {
                return Err(source.refuse(
                    "corrections.tip_relief_length_mm",
                    "missing",
                    "given when tip_relief_um is",
                ));
            }
            (None, Some(length)) => {
                return Err(source.refuse(
                    "corrections.tip_relief_length_mm",
                    length,
                    "absent without tip_relief_um",
                ));
            }
            (None, None) => {}
        }
        if let Some(shape) = &self.tip_relief_shape {
            source.require(
                self.tip_relief_um.is_some(),
                "corrections.tip_relief_shape",
                shape,
                "absent without tip_relief_um",
            )?;
            parse_name::<gear::ReliefShape>(source, "corrections.tip_relief_shape", shape)?;
        }
        Ok(())
    }

    /// The shape of the relief.
    ///
    /// # Panics
    ///
    /// Never for a validated section: the name was parsed before.
    #[must_use]
    pub fn shape(&self) -> gear::ReliefShape {
        self.tip_relief_shape
            .as_ref()
            .map_or(gear::ReliefShape::Linear, |name| {
                name.parse().expect("validation has parsed this name")
            })
    }
}

#[cfg(test)]
mod tests {
    use crate::Campaign;

    fn with(section: &str) -> Result<Campaign, String> {
        let text = format!("{}\n[corrections]\n{section}", Campaign::WEAR);
        Campaign::parse("c.toml", &text).map_err(|error| error.to_string())
    }

    #[test]
    fn absent_corrections_change_no_digest_and_given_ones_do() {
        let plain = Campaign::parse("c.toml", Campaign::WEAR).unwrap();
        assert!(!plain.to_json().contains("corrections"));
        let crowned = with("crowning_um = [0.0, 10.0]").unwrap();
        assert_ne!(plain.digest(), crowned.digest());
        assert_eq!(Campaign::from_json(&crowned.to_json()).unwrap(), crowned);
    }

    #[test]
    fn sections_that_make_no_sense_are_refused_by_key() {
        for (section, why) in [
            ("", "corrections is \"empty\""),
            ("crowning_um = [5.0, 0.0]", "corrections.crowning_um"),
            ("crowning_um = [-1.0, 5.0]", "corrections.crowning_um"),
            (
                "tip_relief_um = [0.0, 9.0]",
                "tip_relief_length_mm is \"missing\"",
            ),
            (
                "tip_relief_um = [0.0, 9.0]\ntip_relief_length_mm = [0.0, 2.0]",
                "corrections.tip_relief_length_mm",
            ),
            (
                "crowning_um = [0.0, 5.0]\ntip_relief_shape = \"linear\"",
                "absent without tip_relief_um",
            ),
            (
                "tip_relief_um = [0.0, 9.0]\ntip_relief_length_mm = [0.1, 2.0]\n\
                 tip_relief_shape = \"round\"",
                "linear, parabolic",
            ),
            ("crowning = [0.0, 5.0]", "unknown field"),
        ] {
            let error = with(section).unwrap_err();
            assert!(error.contains(why), "{section}: {error}");
        }
    }
}
