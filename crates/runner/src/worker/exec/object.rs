//! JSON objects that programs write.

use std::fmt;

use serde::de::{Deserialize, Deserializer, MapAccess, Visitor};
use serde_json::map::Entry;
use serde_json::{Map, Value};

/// A JSON object of a program.
#[derive(Debug, Default)]
pub(super) struct Object {
    pub(super) map: Map<String, Value>,
    /// A key that it has more than once. Its value is ambiguous.
    doubled: Option<String>,
}

impl Object {
    /// Refuses an object that has a key more than once.
    pub(super) fn check(&self) -> Result<(), String> {
        match &self.doubled {
            Some(key) => Err(format!("it has {key:?} more than once")),
            None => Ok(()),
        }
    }
}

impl<'de> Deserialize<'de> for Object {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(ObjectVisitor)
    }
}

struct ObjectVisitor;

impl<'de> Visitor<'de> for ObjectVisitor {
    type Value = Object;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a JSON object")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut entries: A) -> Result<Object, A::Error> {
        let mut object = Object::default();
        while let Some((key, value)) = entries.next_entry::<String, Value>()? {
            match object.map.entry(key) {
                Entry::Vacant(free) => {
                    free.insert(value);
                }
                Entry::Occupied(held) => object.doubled = Some(held.key().clone()),
            }
        }
        Ok(object)
    }
}
