//! `[material]`: numbers, or the name of a common gear material; of both gears, or of each.

use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::FileError;
use super::validate::Source;

/// `[material]`: of both gears, or of the pinion if `[material.mate]` gives that of the mate.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "MaterialSection")]
pub struct Materials {
    /// The material of the pinion, and of the mate unless `mate` is given.
    #[serde(flatten)]
    pub pinion: Material,
    /// The material of the mate, if the file gives one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mate: Option<Material>,
}

/// The material of a gear: numbers, or a name whose numbers are known. A number beside a name replaces that of the name.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct Material {
    /// The name, if the file gives one.
    pub name: Option<Grade>,
    /// Young's modulus, GPa.
    pub youngs_modulus_gpa: f64,
    /// Poisson's ratio.
    pub poisson_ratio: f64,
    /// Allowable stress number of the flanks σ_Hlim, MPa.
    pub contact_limit_mpa: f64,
    /// Allowable stress number of the roots σ_FE = 2 σ_Flim, MPa, if it is known.
    pub bending_limit_mpa: Option<f64>,
}

/// A common gear material.
///
/// | name | E, GPa | ν | treatment |
/// |---|---|---|---|
/// | 20NC6 | 200 | 0.29 | case-hardened |
/// | 16MnCr5 | 206 | 0.3 | case-hardened |
/// | 18CrNiMo7-6 | 206 | 0.3 | case-hardened |
/// | 31CrMoV9 | 206 | 0.3 | nitrided |
/// | 42CrMo4 | 206 | 0.3 | quenched, or nitrided |
/// | 34CrNiMo6 | 206 | 0.3 | quenched, or nitrided |
/// | C45 | 206 | 0.3 | quenched |
/// | EN-GJS-600-3 | 174 | 0.275 | – |
/// | POM | 2.8 | 0.35 | – |
///
/// - **E and ν** are those of ISO 6336-2 for the steels, of EN 1563 for the cast iron, and typical of POM at room temperature.
/// - **σ_Hlim and σ_FE** are those of ISO 6336-5, quality MQ, for the [`Treatment`]. Those of iron and plastic depend on more
///   than their name, the plastic's on temperature and lubrication above all: a file gives the numbers beside the name.
/// - **20NC6** has the numbers of the 2009 paper, and σ_FE of case-hardened steel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum Grade {
    /// The paper's case-hardened steel.
    #[serde(rename = "20NC6", alias = "20 NC 6")]
    Nc6,
    /// Case-hardening steel 1.7131.
    #[serde(rename = "16MnCr5")]
    MnCr5,
    /// Case-hardening steel 1.6587.
    #[serde(rename = "18CrNiMo7-6")]
    CrNiMo7,
    /// Nitriding steel 1.8519.
    #[serde(rename = "31CrMoV9")]
    CrMoV9,
    /// Steel for quenching and tempering 1.7225.
    #[serde(rename = "42CrMo4")]
    CrMo4,
    /// Steel for quenching and tempering 1.6582.
    #[serde(rename = "34CrNiMo6")]
    CrNiMo6,
    /// Unalloyed steel for quenching and tempering 1.0503.
    C45,
    /// Spheroidal graphite cast iron 5.3201.
    #[serde(rename = "EN-GJS-600-3")]
    Gjs600,
    /// Polyoxymethylene.
    #[serde(rename = "POM")]
    Pom,
}

/// A heat treatment, from which the allowable stress numbers of a steel follow (ISO 6336-5, quality MQ).
///
/// | treatment | σ_Hlim, MPa | σ_FE, MPa |
/// |---|---|---|
/// | case-hardened, 58 to 64 HRC | 1500 | 860 |
/// | nitrided, of a nitriding steel | 1250 | 840 |
/// | nitrided, of a steel for quenching and tempering | 998 | 726 |
/// | quenched and tempered, alloyed, 200 to 360 HV | 1.313 HV + 373 | 2 (0.425 HV + 187) |
/// | quenched and tempered, unalloyed, 135 to 210 HV | 0.925 HV + 360 | 2 (0.240 HV + 163) |
///
/// Case-hardened: the standard has 850, 922 or 1000 MPa by the hardness of the core; 860 is the number of the published
/// reports that this program is compared with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Treatment {
    /// Carburised and hardened.
    CaseHardened,
    /// Gas-nitrided.
    Nitrided,
    /// Quenched and tempered. The stresses follow from `hardness_hv`.
    Quenched,
}

impl Grade {
    /// All materials, in the order of the table.
    pub const ALL: [Self; 9] = [
        Self::Nc6,
        Self::MnCr5,
        Self::CrNiMo7,
        Self::CrMoV9,
        Self::CrMo4,
        Self::CrNiMo6,
        Self::C45,
        Self::Gjs600,
        Self::Pom,
    ];

    /// Young's modulus in GPa and Poisson's ratio.
    const fn elasticity(self) -> (f64, f64) {
        match self {
            Self::Nc6 => (200.0, 0.29),
            Self::Gjs600 => (174.0, 0.275),
            Self::Pom => (2.8, 0.35),
            _ => (206.0, 0.3),
        }
    }

    /// The treatments in the table, the usual one first.
    const fn treatments(self) -> &'static [Treatment] {
        match self {
            Self::Nc6 | Self::MnCr5 | Self::CrNiMo7 => &[Treatment::CaseHardened],
            Self::CrMoV9 => &[Treatment::Nitrided],
            Self::CrMo4 | Self::CrNiMo6 => &[Treatment::Quenched, Treatment::Nitrided],
            Self::C45 => &[Treatment::Quenched],
            Self::Gjs600 | Self::Pom => &[],
        }
    }

    /// σ_Hlim and σ_Flim in MPa after a treatment of the table; `None` where they follow from a hardness that is not
    /// given or not in the standard's range.
    fn limits(self, treatment: Treatment, hardness_hv: Option<f64>) -> Option<[f64; 2]> {
        let within = |range: [f64; 2]| hardness_hv.filter(|hv| (range[0]..=range[1]).contains(hv));
        match (treatment, self) {
            (Treatment::CaseHardened, Self::Nc6) => Some([1550.0, 430.0]),
            (Treatment::CaseHardened, _) => Some([1500.0, 430.0]),
            (Treatment::Nitrided, Self::CrMoV9) => Some([1250.0, 420.0]),
            (Treatment::Nitrided, _) => Some([998.0, 363.0]),
            (Treatment::Quenched, _) => {
                let (contact, bending) = match self {
                    Self::C45 => ([0.925, 360.0], [0.240, 163.0]),
                    _ => ([1.313, 373.0], [0.425, 187.0]),
                };
                let hv = within(self.hardness_range())?;
                Some([contact, bending].map(|[slope, constant]| slope * hv + constant))
            }
        }
    }

    /// The hardnesses for which the standard has the stresses of the quenched steel, HV.
    const fn hardness_range(self) -> [f64; 2] {
        match self {
            Self::C45 => [135.0, 210.0],
            _ => [200.0, 360.0],
        }
    }
}

/// The name used in files.
impl fmt::Display for Grade {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.serialize(f)
    }
}

/// The name used in files.
impl fmt::Display for Treatment {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.serialize(f)
    }
}

/// `[material]`, of both gears or of the pinion: numbers, or a name whose numbers are known. A number beside a name
/// replaces that of the name.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct MaterialSection {
    /// The name of a common gear material.
    name: Option<Grade>,
    /// Heat treatment of a named steel. The usual one if absent.
    treatment: Option<Treatment>,
    /// Hardness of a quenched and tempered steel, HV, from which its allowable stresses follow.
    hardness_hv: Option<f64>,
    /// Young's modulus, GPa.
    youngs_modulus_gpa: Option<f64>,
    /// Poisson's ratio.
    poisson_ratio: Option<f64>,
    /// Allowable stress number of the flanks σ_Hlim of ISO 6336-5, MPa: the limit of the contact pressure unless
    /// `[constraints]` has another.
    contact_limit_mpa: Option<f64>,
    /// Allowable stress number of the roots σ_FE = 2 σ_Flim of ISO 6336-5, MPa.
    bending_limit_mpa: Option<f64>,
    /// Material of the mate, if it is not the pinion's, with the same keys.
    mate: Option<Box<MaterialSection>>,
}

impl TryFrom<MaterialSection> for Materials {
    type Error = String;

    fn try_from(section: MaterialSection) -> Result<Self, String> {
        let mate = section.mate.as_deref();
        if mate.is_some_and(|mate| mate.mate.is_some()) {
            return Err(
                "`mate` of [material.mate] must be absent: a pair has two gears".to_owned(),
            );
        }
        Ok(Self {
            pinion: section.material("material")?,
            mate: mate
                .map(|mate| mate.material("material.mate"))
                .transpose()?,
        })
    }
}

impl MaterialSection {
    /// The material that the table `[place]` gives.
    fn material(&self, place: &str) -> Result<Material, String> {
        let elasticity = self.name.map(Grade::elasticity);
        let limits = self.limits(place)?;
        let number = |key: &str, given: Option<f64>, known: Option<f64>| {
            given.or(known).ok_or_else(|| {
                let why = self.reason();
                format!("missing field `{key}` of [{place}]{why}")
            })
        };
        Ok(Material {
            name: self.name,
            youngs_modulus_gpa: number(
                "youngs_modulus_gpa",
                self.youngs_modulus_gpa,
                elasticity.map(|of| of.0),
            )?,
            poisson_ratio: number(
                "poisson_ratio",
                self.poisson_ratio,
                elasticity.map(|of| of.1),
            )?,
            contact_limit_mpa: number(
                "contact_limit_mpa",
                self.contact_limit_mpa,
                limits.map(|[contact, _]| contact),
            )?,
            bending_limit_mpa: self
                .bending_limit_mpa
                .or(limits.map(|[_, bending]| 2.0 * bending)),
        })
    }

    /// σ_Hlim and σ_Flim in MPa, if name, treatment and hardness determine them.
    fn limits(&self, place: &str) -> Result<Option<[f64; 2]>, String> {
        let Some(name) = self.name else {
            let stray = self.treatment.map(|_| "treatment");
            let stray = stray.or(self.hardness_hv.map(|_| "hardness_hv"));
            return stray.map_or(Ok(None), |key| {
                Err(format!(
                    "`{key}` of [{place}] must be absent without a name"
                ))
            });
        };
        let treatments = name.treatments();
        let treatment = match self.treatment {
            Some(treatment) if !treatments.contains(&treatment) => {
                let known: Vec<String> =
                    treatments.iter().map(|one| format!("\"{one}\"")).collect();
                let known = match &known[..] {
                    [] => "absent".to_owned(),
                    known => known.join(" or "),
                };
                return Err(format!(
                    "`treatment` of [{place}] is \"{treatment}\", but must be {known} for {name}"
                ));
            }
            Some(treatment) => Some(treatment),
            None => treatments.first().copied(),
        };
        let is_quenched = treatment == Some(Treatment::Quenched);
        let [low, high] = name.hardness_range();
        match self.hardness_hv {
            Some(_) if !is_quenched => Err(format!(
                "`hardness_hv` of [{place}] must be absent: only the stresses of quenched steels follow from it"
            )),
            Some(hv) if !(low..=high).contains(&hv) => Err(format!(
                "`hardness_hv` of [{place}] is {hv}, but must be from {low} to {high} HV, for which ISO 6336-5 has the \
                 stresses of {name}, quenched and tempered"
            )),
            hv => Ok(treatment.and_then(|treatment| name.limits(treatment, hv))),
        }
    }

    /// Why a number is missing, for the end of a sentence.
    fn reason(&self) -> String {
        match self.name {
            Some(name) if name.treatments().contains(&Treatment::Quenched) => {
                let [low, high] = name.hardness_range();
                format!(
                    ": of quenched {name} it follows from `hardness_hv`, from {low} to {high} HV; give that or the number"
                )
            }
            Some(name) => format!(
                ": that of {name} depends on more than its name, so it is given beside the name"
            ),
            None => format!(
                ", which needs numbers or a name: {}",
                Grade::ALL.map(|grade| grade.to_string()).join(", ")
            ),
        }
    }
}

impl Materials {
    /// The materials of pinion and mate.
    #[must_use]
    pub fn each(&self) -> [Material; 2] {
        [self.pinion, self.mate.unwrap_or(self.pinion)]
    }

    /// The tables that the file has, with their materials.
    pub(super) fn tables(&self) -> impl Iterator<Item = (&'static str, Material)> {
        let mate = self.mate.map(|mate| ("material.mate", mate));
        std::iter::once(("material", self.pinion)).chain(mate)
    }

    pub(super) fn validate(&self, source: Source<'_>) -> Result<(), FileError> {
        self.tables()
            .try_for_each(|(place, material)| material.validate(place, source))
    }

    /// The smaller σ_Hlim, MPa: both flanks bear the same pressure.
    #[must_use]
    pub fn contact_limit_mpa(&self) -> f64 {
        let [pinion, mate] = self.each();
        pinion.contact_limit_mpa.min(mate.contact_limit_mpa)
    }

    /// The strength of the materials with these factors.
    #[must_use]
    pub fn strength(&self, factors: gear::rating::Factors) -> gear::rating::Strength {
        let each = self.each();
        gear::rating::Strength {
            factors,
            bending_limit_mpa: each.map(|one| one.bending_limit_mpa),
            contact_limit_mpa: each.map(|one| one.contact_limit_mpa),
        }
    }

    /// The simulator's materials, in MPa.
    #[must_use]
    pub fn to_gear(&self) -> [gear::Material; 2] {
        self.each().map(|one| gear::Material {
            youngs_modulus_mpa: one.youngs_modulus_gpa * 1e3,
            poisson_ratio: one.poisson_ratio,
        })
    }
}

impl Material {
    fn validate(&self, place: &str, source: Source<'_>) -> Result<(), FileError> {
        let within = |key, value, low, high, unit| {
            source.within(&format!("{place}.{key}"), value, low, high, unit)
        };
        let modulus = self.youngs_modulus_gpa;
        within("youngs_modulus_gpa", modulus, 1e-5, 1e6, "GPa")?;
        within("poisson_ratio", self.poisson_ratio, 0.0, 0.499, "")?;
        let limit = self.contact_limit_mpa;
        within("contact_limit_mpa", limit, 1e-3, 1e9, "MPa")?;
        let limit = self.bending_limit_mpa.unwrap_or(1.0);
        within("bending_limit_mpa", limit, 1e-3, 1e9, "MPa")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Campaign;

    /// The shipped campaign with another `[material]`.
    fn with(section: &str) -> Result<Campaign, String> {
        let (before, rest) = Campaign::WEAR.split_once("[material]").unwrap();
        let (_, after) = rest.split_once("[wear]").unwrap();
        let text = format!("{before}[material]\n{section}\n[wear]{after}");
        Campaign::parse("c.toml", &text).map_err(|error| error.to_string())
    }

    #[test]
    fn the_papers_steel_by_name_is_the_shipped_material() {
        let plain = Campaign::parse("c.toml", Campaign::WEAR).unwrap();
        let named = with("name = \"20NC6\"").unwrap();
        let [plain, steel] = [&plain, &named].map(|one| one.gears().unwrap().material);
        assert_eq!(steel.to_gear(), plain.to_gear());
        assert_eq!(steel.contact_limit_mpa(), plain.contact_limit_mpa());
        assert_eq!(with("name = \"20 NC 6\"").unwrap(), named);
        assert_eq!(Campaign::from_json(&named.to_json()).unwrap(), named);
    }

    #[test]
    fn numbers_beside_a_name_override_the_table_and_change_the_digest() {
        let table = with("name = \"16MnCr5\"").unwrap();
        assert_eq!(
            table.gears().unwrap().material.pinion.bending_limit_mpa,
            Some(860.0)
        );
        let other = with("name = \"16MnCr5\"\nbending_limit_mpa = 922.0").unwrap();
        let material = other.gears().unwrap().material.pinion;
        assert_eq!(material.bending_limit_mpa, Some(922.0));
        assert_eq!(material.contact_limit_mpa, 1500.0);
        assert_ne!(other.digest(), table.digest());
    }

    #[test]
    fn every_name_of_the_table_is_read_with_its_limit_beside_it() {
        for grade in Grade::ALL {
            let section = format!("name = \"{grade}\"\ncontact_limit_mpa = 800.0");
            let material = with(&section).unwrap().gears().unwrap().material.pinion;
            assert_eq!(material.name, Some(grade));
            assert_eq!(material.contact_limit_mpa, 800.0);
        }
    }

    /// A steel pinion and a plastic wheel: each has its own limits, and the weaker flank limits the pressure.
    #[test]
    fn the_mate_has_a_material_of_its_own() {
        let section =
            "name = \"16MnCr5\"\n[material.mate]\nname = \"POM\"\ncontact_limit_mpa = 60.0";
        let campaign = with(section).unwrap();
        let materials = campaign.gears().unwrap().material;
        let [pinion, mate] = materials.each();
        assert_eq!(
            [pinion.youngs_modulus_gpa, mate.youngs_modulus_gpa],
            [206.0, 2.8]
        );
        assert_eq!(materials.contact_limit_mpa(), 60.0);
        let strength = materials.strength(gear::rating::Factors::default());
        assert_eq!(strength.bending_limit_mpa, [Some(860.0), None]);
        assert_eq!(Campaign::from_json(&campaign.to_json()).unwrap(), campaign);
        let other = with("name = \"16MnCr5\"").unwrap();
        assert_ne!(other.digest(), campaign.digest());
    }

    #[test]
    fn a_number_of_the_mate_is_refused_by_its_own_line() {
        let section =
            "name = \"16MnCr5\"\n[material.mate]\nname = \"POM\"\ncontact_limit_mpa = -60.0";
        let error = with(section).unwrap_err();
        assert!(
            error.contains("material.mate.contact_limit_mpa is -60"),
            "{error}"
        );
        let line = |text: &str| text.lines().count();
        let (before, _) = Campaign::WEAR.split_once("[material]").unwrap();
        assert!(
            error.contains(&format!("line {}:", line(before) + 5)),
            "{error}"
        );
    }

    /// A case-hardened tooth bears more than a quenched one, whatever the strength of its core.
    #[test]
    fn the_limits_follow_from_treatment_and_hardness() {
        let limits = |section: &str| {
            let material = with(section).unwrap().gears().unwrap().material.pinion;
            (
                material.contact_limit_mpa,
                material.bending_limit_mpa.unwrap(),
            )
        };
        let case_hardened = limits("name = \"18CrNiMo7-6\"");
        assert_eq!(case_hardened, (1500.0, 860.0));
        let (contact, bending) = limits("name = \"34CrNiMo6\"\nhardness_hv = 300");
        assert!((contact - 766.9).abs() < 1e-9 && (bending - 629.0).abs() < 1e-9);
        assert!(bending < case_hardened.1);
        assert_eq!(
            limits("name = \"42CrMo4\"\ntreatment = \"nitrided\""),
            (998.0, 726.0)
        );
        assert_eq!(limits("name = \"31CrMoV9\""), (1250.0, 840.0));
    }

    #[test]
    fn bad_sections_are_refused_by_line_and_key() {
        let line = |needle: &str| {
            let (before, _) = Campaign::WEAR.split_once(needle).unwrap();
            before.lines().count() + 1
        };
        for (section, what) in [
            ("name = \"unobtainium\"", "\"16MnCr5\""),
            (
                "name = \"42CrMo4\"",
                "missing field `contact_limit_mpa` of [material]: of quenched 42CrMo4 it follows from `hardness_hv`",
            ),
            (
                "name = \"C45\"\nhardness_hv = 300",
                "`hardness_hv` of [material] is 300, but must be from 135 to 210 HV",
            ),
            (
                "name = \"16MnCr5\"\ntreatment = \"quenched\"",
                "is \"quenched\", but must be \"case-hardened\" for 16MnCr5",
            ),
            (
                "name = \"16MnCr5\"\nhardness_hv = 300",
                "`hardness_hv` of [material] must be absent",
            ),
            (
                "name = \"POM\"",
                "that of POM depends on more than its name",
            ),
            (
                "youngs_modulus_gpa = 206.0",
                "missing field `poisson_ratio` of [material], which needs numbers or a name: 20NC6",
            ),
            ("name = \"C45\"\nyield = 3.0", "unknown field `yield`"),
            (
                "name = \"16MnCr5\"\nmate = { name = \"C45\" }",
                "missing field `contact_limit_mpa` of [material.mate]: of quenched C45 it follows from `hardness_hv`",
            ),
            (
                "name = \"16MnCr5\"\nmate = { name = \"16MnCr5\", mate = { name = \"16MnCr5\" } }",
                "`mate` of [material.mate] must be absent",
            ),
        ] {
            let error = with(section).unwrap_err();
            assert!(error.contains(what), "{section}: {error}");
            let at: usize = error["c.toml, line ".len()..]
                .split_once(':')
                .unwrap()
                .0
                .parse()
                .unwrap();
            let first = line("[material]");
            assert!((first..first + 3).contains(&at), "{section}: {error}");
        }
    }
}
