//! `[corrections]`: flank modifications, as design variables of a campaign or as values of a pair.

use gear::ReliefShape;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::FileError;
use super::bounds::{OfGears, Relation, Setting};
use super::validate::{InvalidValue, Source};

/// Number of variables of a design that are corrections.
pub(crate) const CORRECTIONS: usize = 6;

/// `[corrections]` of a campaign, optional: profile and helix modifications, which are further variables of all its
/// designs. Each is free within `[low, high]` or fixed to a number; one that is absent is zero.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CorrectionsSection {
    /// Amount of tip relief in µm, normal to the flank at the end of contact. Relief at the root of a flank leaves
    /// the same gap as relief at the mate's tip.
    pub tip_relief_um: Option<OfGears>,
    /// Length of the relieved part in mm, along the path of contact.
    pub tip_relief_length_mm: Option<OfGears>,
    /// Shape of the relief; `"linear"` if absent.
    pub tip_relief_shape: Option<ReliefShape>,
    /// Lengthwise crowning of both flanks together in µm, at the ends of the face.
    pub crowning_um: Option<Setting>,
    /// Helix slope of both flanks together in µm over the face: how much more material is missing at the end
    /// of the face that a contact line reaches last.
    pub helix_slope_um: Option<Setting>,
}

impl CorrectionsSection {
    /// The values of each variable, in the order of the design's variables; zero for one without a key.
    pub(crate) fn settings(&self) -> [Setting; CORRECTIONS] {
        let zero = Setting::Fixed(0.0);
        let of_gears = |written: Option<OfGears>| written.map_or([zero; 2], |one| one.settings());
        let [a, b] = of_gears(self.tip_relief_um);
        let [c, d] = of_gears(self.tip_relief_length_mm);
        let [e, f] = [self.crowning_um, self.helix_slope_um].map(|one| one.unwrap_or(zero));
        [a, b, c, d, e, f]
    }

    /// Validates the section of a campaign with this tooth model.
    pub(super) fn validate(
        &self,
        source: Source<'_>,
        tooth_model: gear::ToothModel,
    ) -> Result<(), FileError> {
        let along_face = [
            ("corrections.crowning_um", self.crowning_um, [0.0, MOST_UM]),
            (
                "corrections.helix_slope_um",
                self.helix_slope_um,
                [-MOST_UM, MOST_UM],
            ),
        ];
        if let Some(relief) = self.tip_relief_um {
            relief.validate(source, "corrections.tip_relief_um", [0.0, MOST_UM])?;
        } else if along_face.iter().all(|(_, setting, _)| setting.is_none()) {
            return Err(source.error(InvalidValue::in_words(
                "corrections",
                "empty",
                "a section with tip_relief_um, crowning_um or helix_slope_um",
            )));
        }
        let length = self.tip_relief_length_mm;
        let shape = self.tip_relief_shape;
        relief_keys(source, self.tip_relief_um.is_some(), length, shape)?;
        if let Some(length) = length {
            length.validate(source, "corrections.tip_relief_length_mm", RELIEF_LENGTH_MM)?;
        }
        for (key, setting, limits) in along_face {
            let Some(setting) = setting else { continue };
            setting.validate(source, key, limits)?;
            source.require(tooth_model.knows_the_face(), key, setting, WITHOUT_CROWNING)?;
        }
        let follows = Setting::Relation(Relation::Follows);
        let place = self
            .settings()
            .iter()
            .position(|setting| *setting == follows);
        place.map_or(Ok(()), |place| {
            let keys = ["tip_relief_um", "tip_relief_length_mm"];
            Err(source.refuse(
                &format!("corrections.{}", keys[place / 2]),
                "follows",
                "[low, high], a number or \"tied\": only the profile shift of the mate can follow",
            ))
        })
    }
}

/// `[corrections]` of a pair file. Two-element arrays are pinion, mate.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PairCorrections {
    /// Amounts of tip relief in µm, normal to the flank at the end of contact. Zero means none.
    pub tip_relief_um: Option<[f64; 2]>,
    /// Lengths of the relieved parts in mm, along the path of contact. These or the diameters are given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tip_relief_length_mm: Option<[f64; 2]>,
    /// Diameters d_Ca at which the reliefs start, mm.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tip_relief_diameter_mm: Option<[f64; 2]>,
    /// Shape of the relief on both gears; `"linear"` if absent.
    pub tip_relief_shape: Option<ReliefShape>,
    /// Lengthwise crowning of both flanks together in µm, at the ends of the face.
    pub crowning_um: Option<f64>,
    /// Helix slope of both flanks together in µm over the face: how much more material is missing at the end
    /// of the face that a contact line reaches last. Positive as for a pinion whose helix angle is too large,
    /// f_Hβ > 0 in ISO 1328-1.
    pub helix_slope_um: Option<f64>,
    /// Misalignment of the shafts in µm over the face, in the plane of action, with the sign of the helix
    /// slope.
    pub misalignment_um: Option<f64>,
}

impl PairCorrections {
    pub(super) fn validate(&self, source: Source<'_>) -> Result<(), FileError> {
        let amount = |key: &str, value| source.within(key, value, 0.0, MOST_UM, "µm");
        let is_relieved = self.tip_relief_um.is_some();
        if let Some(diameters) = self.tip_relief_diameter_mm {
            let key = "corrections.tip_relief_diameter_mm";
            let is_alone = is_relieved && self.tip_relief_length_mm.is_none();
            let expected = "absent beside tip_relief_length_mm, and absent without tip_relief_um";
            source.require(is_alone, key, diameters, expected)?;
            let mut diameters = diameters.into_iter();
            diameters.try_for_each(|diameter| source.length(key, diameter))?;
        }
        let extent = self.tip_relief_length_mm.or(self.tip_relief_diameter_mm);
        relief_keys(source, is_relieved, extent, self.tip_relief_shape)?;
        let amounts = self.tip_relief_um.unwrap_or_default();
        let lengths = self.tip_relief_length_mm.unwrap_or_default();
        for (relief, length) in amounts.into_iter().zip(lengths) {
            amount("corrections.tip_relief_um", relief)?;
            // The length is not checked for a gear without relief.
            if relief > 0.0 && self.tip_relief_length_mm.is_some() {
                let [low, high] = RELIEF_LENGTH_MM;
                source.within("corrections.tip_relief_length_mm", length, low, high, "mm")?;
            }
        }
        let slope = |key: &str, value: Option<f64>| {
            value.map_or(Ok(()), |um| source.within(key, um, -MOST_UM, MOST_UM, "µm"))
        };
        slope("corrections.helix_slope_um", self.helix_slope_um)?;
        slope("corrections.misalignment_um", self.misalignment_um)?;
        self.crowning_um
            .map_or(Ok(()), |um| amount("corrections.crowning_um", um))
    }

    /// The corrections that change along the face, by key and amount, µm; zeros are left out.
    pub(super) fn along_face(&self) -> impl Iterator<Item = (&'static str, f64)> {
        [
            ("corrections.crowning_um", self.crowning_um),
            ("corrections.helix_slope_um", self.helix_slope_um),
            ("corrections.misalignment_um", self.misalignment_um),
        ]
        .into_iter()
        .filter_map(|(key, um)| um.filter(|um| *um != 0.0).map(|um| (key, um)))
    }

    /// The section of a pair with these corrections; `None` without any.
    #[must_use]
    pub fn of_gear(corrections: &gear::Corrections) -> Option<Self> {
        if *corrections == gear::Corrections::default() {
            return None;
        }
        let relief = corrections.tip_relief;
        let given = relief.iter().flatten().next();
        let of = |value: fn(gear::TipRelief) -> f64| {
            given.map(|_| relief.map(|relief| relief.map_or(0.0, value)))
        };
        let um = |mm: f64| Some(micrometres(mm)).filter(|um| *um != 0.0);
        Some(Self {
            tip_relief_um: of(|relief| micrometres(relief.amount)),
            tip_relief_length_mm: of(|relief| relief.length),
            tip_relief_diameter_mm: None,
            tip_relief_shape: given.map(|relief| relief.shape),
            crowning_um: um(corrections.crowning),
            helix_slope_um: um(corrections.helix_slope),
            misalignment_um: um(corrections.misalignment),
        })
    }

    /// The corrections of a pair with this geometry as the simulator's input, in mm.
    #[must_use]
    pub fn to_gear(&self, geometry: Option<&gear::Geometry>) -> gear::Corrections {
        let amounts = self.tip_relief_um.unwrap_or_default();
        let lengths = self.lengths(geometry);
        let shape = self.tip_relief_shape.unwrap_or_default();
        let mm = |um: Option<f64>| um.unwrap_or_default() * 1e-3;
        let none = gear::Corrections::default()
            .with_crowning(mm(self.crowning_um))
            .with_helix_slope(mm(self.helix_slope_um))
            .with_misalignment(mm(self.misalignment_um));
        gear::Member::BOTH.into_iter().fold(none, |all, member| {
            let index = member.index();
            let relief = gear::TipRelief {
                amount: amounts[index] * 1e-3,
                length: lengths[index],
                shape,
            };
            if relief.amount > 0.0 {
                all.with_tip_relief(member, relief)
            } else {
                all
            }
        })
    }

    /// Lengths of the relieved parts along the path of contact, mm, of a pair with this geometry.
    fn lengths(&self, geometry: Option<&gear::Geometry>) -> [f64; 2] {
        let given = self.tip_relief_length_mm;
        let from_diameters =
            geometry
                .zip(self.tip_relief_diameter_mm)
                .map(|(geometry, diameters)| {
                    gear::Member::BOTH.map(|member| {
                        let diameter = diameters[member.index()];
                        gear::inspection::relief_length(geometry, member, diameter)
                    })
                });
        given.or(from_diameters).unwrap_or([RELIEF_LENGTH_MM[0]; 2])
    }

    /// Refuses diameters from which no relief can start on a pair with this geometry.
    pub(super) fn fit(
        &self,
        geometry: &gear::Geometry,
        source: Source<'_>,
    ) -> Result<(), FileError> {
        let Some(diameters) = self.tip_relief_diameter_mm else {
            return Ok(());
        };
        let (amounts, lengths) = (
            self.tip_relief_um.unwrap_or_default(),
            self.lengths(Some(geometry)),
        );
        for (i, gear) in ["pinion", "mate"].into_iter().enumerate() {
            let [low, high] = [2.0 * geometry.r_b[i], 2.0 * geometry.r_na[i]];
            let expected = format!(
                "from {low:.4} to below {high:.4} mm for the {gear}, its base and tip form diameters"
            );
            let fits = diameters[i] >= low && lengths[i] >= RELIEF_LENGTH_MM[0];
            let key = "corrections.tip_relief_diameter_mm";
            source.require(amounts[i] == 0.0 || fits, key, diameters[i], &expected)?;
        }
        Ok(())
    }
}

/// A length in µm, without the last digits that the conversion to mm and back leaves.
#[must_use]
pub fn micrometres(mm: f64) -> f64 {
    (1e12 * mm).round() / 1e9
}

/// Largest amount of a correction, in µm.
const MOST_UM: f64 = 1000.0;
/// Shortest and longest relieved part, in mm along the path of contact.
const RELIEF_LENGTH_MM: [f64; 2] = [1e-3, 1000.0];

/// The valid value of corrections along the face, in errors for a tooth model that has one gap for the whole face.
pub(super) const WITHOUT_CROWNING: &str = "absent when pair.tooth_model is \"whole-face-beam\", which \
                                           has one gap for the whole face";

/// Requires a length beside amounts of tip relief, and no length or shape without them.
fn relief_keys(
    source: Source<'_>,
    relieved: bool,
    length: Option<impl Serialize>,
    shape: Option<ReliefShape>,
) -> Result<(), FileError> {
    let key = "corrections.tip_relief_length_mm";
    match (relieved, length) {
        (true, None) => {
            return Err(source.missing(key, "given when tip_relief_um is"));
        }
        (false, Some(length)) => {
            return Err(source.refuse(key, length, "absent without tip_relief_um"));
        }
        _ => {}
    }
    let Some(shape) = shape else { return Ok(()) };
    let key = "corrections.tip_relief_shape";
    source.require(relieved, key, shape, "absent without tip_relief_um")
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
            ("", "corrections is empty"),
            ("crowning_um = [5.0, 0.0]", "corrections.crowning_um"),
            ("crowning_um = [-1.0, 5.0]", "corrections.crowning_um"),
            (
                "tip_relief_um = [0.0, 9.0]",
                "tip_relief_length_mm is missing",
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
                "corrections.tip_relief_shape is \"round\", but must be \"linear\" or \"parabolic\"",
            ),
            ("crowning = [0.0, 5.0]", "unknown field"),
        ] {
            let error = with(section).unwrap_err();
            assert!(error.contains(why), "{section}: {error}");
        }
    }
}
