//! Numbers in a stored state: finite ones as numbers, the others by name, which JSON has none for.

use std::fmt;

use serde::de::{Error, Visitor};
use serde::{Deserializer, Serializer};

const NAMES: [(&str, f64); 3] = [
    ("nan", f64::NAN),
    ("infinity", f64::INFINITY),
    ("-infinity", f64::NEG_INFINITY),
];

pub(crate) fn serialize<S: Serializer>(value: &f64, serializer: S) -> Result<S::Ok, S::Error> {
    if value.is_finite() {
        return serializer.serialize_f64(*value);
    }
    let same = |n: &f64| n.is_nan() == value.is_nan() && (n.is_nan() || n == value);
    let name = NAMES.iter().find(|(_, number)| same(number));
    serializer.serialize_str(name.map_or("nan", |(name, _)| name))
}

pub(crate) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    deserializer.deserialize_any(Number)
}

struct Number;

impl Visitor<'_> for Number {
    type Value = f64;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a number, \"nan\", \"infinity\" or \"-infinity\"")
    }

    fn visit_f64<E: Error>(self, value: f64) -> Result<f64, E> {
        Ok(value)
    }

    fn visit_u64<E: Error>(self, value: u64) -> Result<f64, E> {
        Ok(value as f64)
    }

    fn visit_i64<E: Error>(self, value: i64) -> Result<f64, E> {
        Ok(value as f64)
    }

    fn visit_str<E: Error>(self, value: &str) -> Result<f64, E> {
        NAMES
            .iter()
            .find(|(name, _)| *name == value)
            .map(|(_, number)| *number)
            .ok_or_else(|| E::custom(format!("{value} is no number")))
    }
}
