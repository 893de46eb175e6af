//! The result file of a program: lines of `name = value`, a JSON object, or lines that the campaign describes.

use std::collections::BTreeMap;

use problem::file::ResultLine;
use serde_json::{Map, Value, json};

use super::numbers::{Numbers, number};
use super::object::Object;

/// The name of the reason for which a design is not simulable.
const REFUSED: &str = "refused";

/// The content of a result file.
#[derive(Debug, PartialEq)]
pub(super) enum Results {
    Numbers(Numbers),
    /// The design is not simulable: a short name and a sentence.
    Refused(String),
}

impl Results {
    /// Reads the text of a result file. If lines are described in `read`, the `wanted` numbers are read from them.
    ///
    /// # Errors
    ///
    /// The part of a sentence after the file's name: the line and the error.
    pub(super) fn read(
        text: &str,
        read: &BTreeMap<String, ResultLine>,
        wanted: &[String],
    ) -> Result<Self, String> {
        if read.is_empty() {
            return named(text);
        }
        if let Some(Ok(reason)) = read.get(REFUSED).map(|place| place.find(text)) {
            return Ok(Self::Refused(reason.trim().to_owned()));
        }
        let value = |name: &String| {
            let place = read.get(name);
            let place =
                place.ok_or_else(|| format!(": simulator.read does not say where {name} is"))?;
            let found = place.find(text)?;
            let value = plain(found)
                .ok_or_else(|| format!(": {name} is {found:?}, which is not a number"))?;
            Ok((name.clone(), value))
        };
        let numbers = wanted.iter().map(value);
        numbers.collect::<Result<_, _>>().map(Self::Numbers)
    }

    /// The answer with the `wanted` numbers, or with the reason for a refusal.
    ///
    /// # Errors
    ///
    /// The part of a sentence after the file's name: the number that is missing.
    pub(super) fn answer(self, wanted: &[String]) -> Result<Map<String, Value>, String> {
        let numbers = match self {
            Self::Refused(reason) => {
                return Ok(Map::from_iter([(REFUSED.to_owned(), reason.into())]));
            }
            Self::Numbers(numbers) => numbers,
        };
        let number = |name: &String| match numbers.get(name) {
            Some(number) if number.is_finite() => Ok((name.clone(), json!(number))),
            // JSON has no such number.
            Some(number) => Ok((name.clone(), json!(number.to_string()))),
            None => {
                let names: Vec<&str> = numbers.keys().map(String::as_str).collect();
                Err(format!(" has no {name:?}; it has: {}", names.join(", ")))
            }
        };
        wanted.iter().map(number).collect()
    }
}

/// A number as programs print it. Fortran writes 1.0D-3, and 1.0-103 where the exponent has three digits.
fn plain(text: &str) -> Option<f64> {
    let text = text.replace(['D', 'd'], "e");
    text.parse().ok().or_else(|| {
        let sign = text.rfind(['+', '-']).filter(|place| *place > 0)?;
        let (digits, exponent) = text.split_at(sign);
        let is_number = digits.ends_with(|c: char| c.is_ascii_digit() || c == '.');
        is_number.then(|| format!("{digits}e{exponent}").parse().ok())?
    })
}

/// Reads lines of `name = value`, or a JSON object.
fn named(text: &str) -> Result<Results, String> {
    if text.trim_start().starts_with('{') {
        let read: Object = serde_json::from_str(text)
            .map_err(|error| format!(" is not a JSON object: {error}"))?;
        read.check().map_err(|doubled| format!(": {doubled}"))?;
        let mut object = read.map;
        if let Some(Value::String(reason)) = object.remove(REFUSED) {
            return Ok(Results::Refused(reason));
        }
        let number = |(name, value): (String, Value)| match number(&value) {
            Some(number) => Ok((name, number)),
            None => Err(format!(": {name} is {value}, which is not a number")),
        };
        return object
            .into_iter()
            .map(number)
            .collect::<Result<_, _>>()
            .map(Results::Numbers);
    }
    let mut numbers = BTreeMap::new();
    for (number, line) in text.lines().enumerate() {
        let line = line.trim();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let parsed = line.split_once('=').and_then(|(name, value)| {
            let (name, value) = (name.trim(), value.trim());
            if name == REFUSED {
                return Some(Err(value.to_owned()));
            }
            Some(Ok((name.to_owned(), plain(value)?)))
        });
        match parsed {
            Some(Ok((name, value))) => {
                let line_number = number + 1;
                if numbers.contains_key(&name) {
                    return Err(format!(", line {line_number}: {name} has a value already"));
                }
                numbers.insert(name, value);
            }
            Some(Err(reason)) => return Ok(Results::Refused(reason)),
            None => {
                let line_number = number + 1;
                return Err(format!(
                    ", line {line_number}: {line:?} is not of the form name = number"
                ));
            }
        }
    }
    Ok(Results::Numbers(numbers))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_are_lines_or_an_object() {
        let numbers = |pairs: &[(&str, f64)]| {
            let pairs = pairs
                .iter()
                .map(|(name, value)| ((*name).to_owned(), *value));
            Ok(Results::Numbers(pairs.collect()))
        };
        let refused = Ok(Results::Refused("no-mesh: it tears".to_owned()));
        assert_eq!(
            named("# a comment\n\n y = 1.5\nz=-2.0D-3\n"),
            numbers(&[("y", 1.5), ("z", -2e-3)])
        );
        assert_eq!(named(" {\"y\": 3}"), numbers(&[("y", 3.0)]));
        assert_eq!(named("refused = no-mesh: it tears"), refused);
        assert_eq!(named("{\"refused\": \"no-mesh: it tears\"}"), refused);
        for (text, why) in [
            ("y = 1\nz 2", ", line 2: \"z 2\" is not of the form"),
            ("y = one", ", line 1: "),
            ("y = 1\n\ny = 2", ", line 3: y has a value already"),
            ("{\"y\": \"one\"}", ": y is \"one\", which is not a number"),
            ("{\"y\": ", " is not a JSON object: EOF"),
            ("{\"y\": 1, \"y\": 2}", ": it has \"y\" more than once"),
        ] {
            let error = named(text).unwrap_err();
            assert!(error.starts_with(why), "{text}: {error}");
        }
    }

    #[test]
    fn numbers_are_read_as_programs_print_them() {
        for (text, expected) in [
            ("1.5", Some(1.5)),
            ("-2.0D-3", Some(-2e-3)),
            ("1.25d+02", Some(125.0)),
            ("-1.5-103", Some(-1.5e-103)),
            ("1.+100", Some(1e100)),
            ("NaN", Some(f64::NAN)),
            ("1-", None),
            ("-", None),
            ("one-2", None),
            ("****", None),
        ] {
            let (found, expected) = (plain(text).map(f64::to_bits), expected.map(f64::to_bits));
            assert_eq!(found, expected, "{text}");
        }
    }

    #[test]
    fn described_lines_tell_the_wanted_numbers() {
        let read: BTreeMap<String, ResultLine> = toml::from_str(
            "y = { line = 'y = (.*) mm' }\nz = { line = '^sum', column = 2 }\nrefused = { line = 'DIVERGED: (.*)' }",
        )
        .unwrap();
        let text = "Gr\u{fffd}\u{fffd}e: y = 1.0 mm\ny = 2.5D0 mm\nsum 7 8\n";
        let of = |names: &[&str]| {
            let names: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
            Results::read(text, &read, &names)
        };
        let both = Numbers::from_iter([("y".to_owned(), 2.5), ("z".to_owned(), 7.0)]);
        assert_eq!(of(&["y", "z"]), Ok(Results::Numbers(both)));
        let refused = Results::read("DIVERGED: too thin\n", &read, &[]);
        assert_eq!(refused, Ok(Results::Refused("too thin".to_owned())));
        let error = of(&["w"]).unwrap_err();
        assert!(error.contains("does not say where w is"), "{error}");
        let error = Results::read("y = 3,5 mm", &read, &["y".to_owned()]).unwrap_err();
        assert_eq!(error, ": y is \"3,5\", which is not a number");
    }
}
