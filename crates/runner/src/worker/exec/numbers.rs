//! Named numbers, and how programs write numbers that JSON does not have.

use std::borrow::Cow;
use std::collections::BTreeMap;

use serde_json::Value;

/// Numbers that JSON does not have, longer ones first.
const NUMBERS: [&str; 8] = [
    "-Infinity",
    "Infinity",
    "-inf",
    "inf",
    "-NaN",
    "NaN",
    "-nan",
    "nan",
];

/// The design or the random inputs of a request; the answer to `evaluate` and to `sample`.
pub(super) type Numbers = BTreeMap<String, f64>;

/// The number that a value stands for. JSON has neither NaN nor infinity, so programs write them in
/// several ways.
pub(super) fn number(value: &Value) -> Option<f64> {
    match value {
        Value::Null => Some(f64::NAN),
        Value::String(text) => text.parse().ok().filter(|number: &f64| !number.is_finite()),
        value => value.as_f64(),
    }
}

/// Puts numbers that JSON does not have, as other programs write them, in quotation marks.
pub(super) fn with_quoted_numbers(text: &str) -> Cow<'_, str> {
    if !NUMBERS.iter().any(|number| text.contains(number)) {
        return Cow::Borrowed(text);
    }
    let mut quoted = String::with_capacity(text.len() + 8);
    let mut rest = text;
    let mut in_text = false;
    while let Some(next) = rest.chars().next() {
        let number = NUMBERS.iter().find(|number| rest.starts_with(**number));
        if let Some(number) = number
            && !in_text
        {
            quoted.extend(["\"", number, "\""]);
            rest = &rest[number.len()..];
            continue;
        }
        // The character after a backslash ends no text.
        let escaped = in_text && next == '\\';
        in_text ^= next == '"';
        let length = rest
            .chars()
            .take(1 + usize::from(escaped))
            .map(char::len_utf8);
        let (head, tail) = rest.split_at(length.sum());
        quoted.push_str(head);
        rest = tail;
    }
    Cow::Owned(quoted)
}
