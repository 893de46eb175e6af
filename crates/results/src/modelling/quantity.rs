use serde::{Deserialize, Serialize};

/// Units that a column's name can end with, after an underscore, and how they are written.
const SUFFIXES: [(&str, &str); 12] = [
    ("um", "µm"),
    ("um2", "µm²"),
    ("mm", "mm"),
    ("mm2", "mm²"),
    ("deg", "°"),
    ("rad", "rad"),
    ("mpa", "MPa"),
    ("gpa", "GPa"),
    ("nm", "N m"),
    ("kn", "kN"),
    ("kg", "kg"),
    ("hz", "Hz"),
];

/// A column: its name, and its unit if the name says it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Quantity {
    /// The name in the header, unit included.
    pub name: String,
    /// The unit: in brackets at the name's end, as in `load [N]`, or a suffix such as `_mm`.
    pub unit: Option<String>,
}

impl Quantity {
    /// A column of this name.
    #[must_use]
    pub fn new(name: &str) -> Self {
        Self {
            name: name.to_owned(),
            unit: unit(name),
        }
    }

    /// A quantity of a problem. For gears, the names of the variables end in their unit, and `unit` is empty.
    #[must_use]
    pub fn of_problem(name: &str, unit: &str) -> Self {
        match unit {
            "" => Self::new(name),
            unit => Self {
                name: name.to_owned(),
                unit: Some(unit.to_owned()),
            },
        }
    }

    /// The unit with a space before it; empty if there is none.
    #[must_use]
    pub fn spaced_unit(&self) -> String {
        let unit = self.unit.iter();
        unit.map(|unit| format!(" {unit}")).collect()
    }
}

fn unit(name: &str) -> Option<String> {
    let bracketed = |open, close| Some(name.strip_suffix(close)?.rsplit_once(open)?.1);
    if let Some(unit) = bracketed('[', ']').or_else(|| bracketed('(', ')')) {
        return (!unit.is_empty()).then(|| unit.to_owned());
    }
    let suffix = name.rsplit_once('_')?.1;
    let known = SUFFIXES.iter().find(|(end, _)| *end == suffix)?;
    Some(known.1.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_read_from_names() {
        for (name, expected) in [
            ("load [N]", Some("N")),
            ("depth (µm)", Some("µm")),
            ("width_mm", Some("mm")),
            ("variance_um2", Some("µm²")),
            ("x_p", None),
            ("mm", None),
            ("odd []", None),
        ] {
            assert_eq!(Quantity::new(name).unit.as_deref(), expected, "{name}");
        }
    }
}
