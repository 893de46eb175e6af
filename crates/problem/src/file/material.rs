//! `[material]`: four numbers, or the name of a common gear material.

use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::FileError;
use super::validate::Source;

/// `[material]`, the same for both gears: four numbers, or a name whose numbers are known. A number beside a name
/// replaces that of the name.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "MaterialSection")]
pub struct Material {
    /// The name, if the file gives one.
    pub name: Option<Grade>,
    /// Young's modulus, GPa.
    pub youngs_modulus_gpa: f64,
    /// Poisson's ratio.
    pub poisson_ratio: f64,
    /// Yield stress, MPa: the limit of the root stress.
    pub yield_mpa: f64,
    /// Permissible contact pressure, MPa.
    pub hertz_limit_mpa: f64,
}

/// A common gear material.
///
/// | name | E, GPa | ν | yield stress, MPa | permissible pressure, MPa |
/// |---|---|---|---|---|
/// | 20NC6 | 200 | 0.29 | 980 | 1550 |
/// | 16MnCr5 | 206 | 0.3 | 490 | 1500 |
/// | 42CrMo4 | 206 | 0.3 | 650 | – |
/// | 34CrNiMo6 | 206 | 0.3 | 1000 | – |
/// | C45 | 206 | 0.3 | 370 | – |
/// | EN-GJS-600-3 | 174 | 0.275 | 370 | – |
///
/// - **E and ν** are those of ISO 6336-2 for the steels and of EN 1563 for the cast iron.
/// - **Yield stress** is the minimum R_p0.2 (or R_e) of the core. 16MnCr5: a 30 mm test bar after
///   core hardening (UNI 7846). 42CrMo4 and C45: quenched and tempered bars of 40 to 100 mm,
///   34CrNiMo6: up to 16 mm (EN 10083-2 and -3). EN-GJS-600-3: separately cast samples (EN 1563).
///   Larger sections have lower values.
/// - **Permissible pressure** of the case-hardened 16MnCr5 is σ_Hlim of ISO 6336-5, quality MQ, 58
///   to 64 HRC: the endurance limit of the nominal contact stress at the pitch point. The
///   simulator's pressure is the largest one along the path, so the comparison is conservative. The
///   other materials have no value here, because their σ_Hlim depends on the hardness: a file gives
///   `hertz_limit_mpa` beside the name.
/// - **20NC6** has the four numbers of the 2009 paper, case-hardened.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum Grade {
    /// The paper's case-hardened steel.
    #[serde(rename = "20NC6", alias = "20 NC 6")]
    Nc6,
    /// Case-hardening steel 1.7131.
    #[serde(rename = "16MnCr5")]
    MnCr5,
    /// Steel for quenching and tempering 1.7225.
    #[serde(rename = "42CrMo4")]
    CrMo4,
    /// Steel for quenching and tempering 1.6582.
    #[serde(rename = "34CrNiMo6")]
    CrNiMo6,
    /// Steel for quenching and tempering 1.0503.
    C45,
    /// Spheroidal graphite cast iron 5.3201.
    #[serde(rename = "EN-GJS-600-3")]
    Gjs600,
}

impl Grade {
    /// All materials, in the order of the table.
    pub const ALL: [Self; 6] = [
        Self::Nc6,
        Self::MnCr5,
        Self::CrMo4,
        Self::CrNiMo6,
        Self::C45,
        Self::Gjs600,
    ];

    /// Young's modulus in GPa, Poisson's ratio, yield stress in MPa and permissible pressure in MPa.
    const fn numbers(self) -> (f64, f64, f64, Option<f64>) {
        match self {
            Self::Nc6 => (200.0, 0.29, 980.0, Some(1550.0)),
            Self::MnCr5 => (206.0, 0.3, 490.0, Some(1500.0)),
            Self::CrMo4 => (206.0, 0.3, 650.0, None),
            Self::CrNiMo6 => (206.0, 0.3, 1000.0, None),
            Self::C45 => (206.0, 0.3, 370.0, None),
            Self::Gjs600 => (174.0, 0.275, 370.0, None),
        }
    }
}

/// The name used in files.
impl fmt::Display for Grade {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.serialize(f)
    }
}

/// `[material]`, the same for both gears: four numbers, or a name whose numbers are known. A number beside a name
/// replaces that of the name.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct MaterialSection {
    /// The name of a common gear material.
    name: Option<Grade>,
    /// Young's modulus, GPa.
    youngs_modulus_gpa: Option<f64>,
    /// Poisson's ratio.
    poisson_ratio: Option<f64>,
    /// Yield stress, MPa: the limit of the root stress.
    yield_mpa: Option<f64>,
    /// Permissible contact pressure, MPa. It depends on the hardness, so most names have none.
    hertz_limit_mpa: Option<f64>,
}

impl TryFrom<MaterialSection> for Material {
    type Error = String;

    fn try_from(section: MaterialSection) -> Result<Self, String> {
        let name = section.name;
        let table = name.map(Grade::numbers);
        let number = |key: &str, given: Option<f64>, known: Option<f64>| {
            given.or(known).ok_or_else(|| match name {
                Some(name) => format!(
                    "missing field `{key}` of [material]: the permissible pressure of {name} depends \
                     on its hardness, so it is given beside the name"
                ),
                None => format!(
                    "missing field `{key}` of [material], which needs four numbers or a name: {}",
                    Grade::ALL.map(|grade| grade.to_string()).join(", ")
                ),
            })
        };
        Ok(Self {
            name,
            youngs_modulus_gpa: number(
                "youngs_modulus_gpa",
                section.youngs_modulus_gpa,
                table.map(|table| table.0),
            )?,
            poisson_ratio: number(
                "poisson_ratio",
                section.poisson_ratio,
                table.map(|table| table.1),
            )?,
            yield_mpa: number("yield_mpa", section.yield_mpa, table.map(|table| table.2))?,
            hertz_limit_mpa: number(
                "hertz_limit_mpa",
                section.hertz_limit_mpa,
                table.and_then(|table| table.3),
            )?,
        })
    }
}

impl Material {
    pub(super) fn validate(&self, source: Source<'_>) -> Result<(), FileError> {
        let within = |key, value, low, high, unit| source.within(key, value, low, high, unit);
        let modulus = self.youngs_modulus_gpa;
        within("material.youngs_modulus_gpa", modulus, 1e-5, 1e6, "GPa")?;
        within("material.poisson_ratio", self.poisson_ratio, 0.0, 0.499, "")?;
        within("material.yield_mpa", self.yield_mpa, 1e-3, 1e9, "MPa")?;
        let limit = self.hertz_limit_mpa;
        within("material.hertz_limit_mpa", limit, 1e-3, 1e9, "MPa")
    }

    /// The simulator's material, in MPa.
    #[must_use]
    pub fn to_gear(&self) -> gear::Material {
        gear::Material {
            youngs_modulus_mpa: self.youngs_modulus_gpa * 1e3,
            poisson_ratio: self.poisson_ratio,
            yield_mpa: self.yield_mpa,
            hertz_limit_mpa: self.hertz_limit_mpa,
        }
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
        assert_eq!(
            named.gears().unwrap().material.to_gear(),
            plain.gears().unwrap().material.to_gear()
        );
        assert_eq!(with("name = \"20 NC 6\"").unwrap(), named);
        assert_eq!(Campaign::from_json(&named.to_json()).unwrap(), named);
    }

    #[test]
    fn numbers_beside_a_name_override_the_table_and_change_the_digest() {
        let table = with("name = \"16MnCr5\"").unwrap();
        assert_eq!(table.gears().unwrap().material.yield_mpa, 490.0);
        let other = with("name = \"16MnCr5\"\nyield_mpa = 590.0").unwrap();
        assert_eq!(other.gears().unwrap().material.yield_mpa, 590.0);
        assert_eq!(other.gears().unwrap().material.hertz_limit_mpa, 1500.0);
        assert_ne!(other.digest(), table.digest());
    }

    #[test]
    fn every_name_of_the_table_is_read_with_a_pressure_beside_it() {
        for grade in Grade::ALL {
            let section = format!("name = \"{grade}\"\nhertz_limit_mpa = 800.0");
            let material = with(&section).unwrap().gears().unwrap().material;
            assert_eq!(material.name, Some(grade));
            assert_eq!(material.hertz_limit_mpa, 800.0);
        }
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
                "missing field `hertz_limit_mpa` of [material]: the permissible pressure of 42CrMo4",
            ),
            (
                "youngs_modulus_gpa = 206.0",
                "missing field `poisson_ratio` of [material], which needs four numbers or a name: 20NC6",
            ),
            ("name = \"C45\"\nyield = 3.0", "unknown field `yield`"),
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
