//! What is said to an external simulator and what it answers: one JSON object per line.

use campaign::Campaign;
use campaign::formulation::{Design, Problem};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value, json};

/// The version of this protocol, which both sides name at the start.
const PROTOCOL: u32 = 1;

/// The longest reason that is kept, bytes.
const MAX_SENTENCE: usize = 2000;

/// The answer to the first request of a process.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Started {
    protocol: u32,
    /// What the program calls itself.
    #[serde(default)]
    pub(super) version: String,
}

/// The answer to `criteria`; see [`campaign::GearCriteria`].
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct CriteriaAnswer {
    pub(super) contact_ratio: f64,
    pub(super) specific_sliding: f64,
    pub(super) root_stress_mpa: f64,
    pub(super) clearance_mm: [f64; 2],
    pub(super) flank_margin_mm: [f64; 2],
}

/// The answer to `unworn` and to `archard`.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct AnalysisAnswer {
    pub(super) delta_ste_um: f64,
    pub(super) hertz_pressure_mpa: f64,
}

/// The answer to `sample`.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SampleAnswer {
    pub(super) delta_ste_um: f64,
}

/// What an answer says.
#[derive(Debug, PartialEq)]
pub(super) enum Answer<T> {
    /// The numbers that were asked for.
    Given(T),
    /// The design cannot be simulated: a short name and a sentence.
    Refused(String),
    /// The program could not answer, and says why.
    Error(String),
}

/// The first request of a process, without its id.
pub(super) fn start(campaign: &Campaign) -> Result<Map<String, Value>, String> {
    let campaign_value: Value = serde_json::from_str(&campaign.to_json())
        .map_err(|error| format!("the campaign cannot be written: {error}"))?;
    Ok(object(json!({
        "request": "start",
        "protocol": PROTOCOL,
        "campaign": campaign_value,
        "teeth": campaign.teeth(),
    })))
}

/// A design as the requests name it.
pub(super) fn design(problem: &Problem, design: &Design, normal_module_mm: f64) -> Value {
    let values = problem.variables().iter().zip(design.values());
    let mut design: Map<String, Value> = values
        .map(|(variable, value)| (variable.name.to_string(), Value::from(*value)))
        .collect();
    design.insert("normal_module_mm".to_owned(), Value::from(normal_module_mm));
    Value::Object(design)
}

/// A question about a design, without its id.
pub(super) fn question(name: &str, design: &Value, seed: Option<[u32; 4]>) -> Map<String, Value> {
    let mut question = object(json!({ "request": name, "design": design }));
    if let Some(seed) = seed {
        question.insert("seed".to_owned(), json!(seed));
    }
    question
}

/// A request as a line, with its newline.
pub(super) fn line(mut request: Map<String, Value>, id: u64) -> String {
    request.insert("id".to_owned(), Value::from(id));
    let mut line = Value::Object(request).to_string();
    line.push('\n');
    line
}

/// Reads the answer to request `id`.
///
/// # Errors
///
/// What is wrong with it.
pub(super) fn read<T: DeserializeOwned>(line: &[u8], id: u64) -> Result<Answer<T>, String> {
    let value: Value = serde_json::from_slice(line).map_err(|error| error.to_string())?;
    let Value::Object(mut answer) = value else {
        return Err("it is no JSON object".to_owned());
    };
    match answer.remove("id").as_ref().and_then(Value::as_u64) {
        Some(theirs) if theirs == id => {}
        Some(theirs) => return Err(format!("it answers request {theirs} instead of {id}")),
        None => return Err("it does not repeat the \"id\" of its request".to_owned()),
    }
    for key in ["refused", "error"] {
        let Some(value) = answer.remove(key) else {
            continue;
        };
        let Value::String(mut sentence) = value else {
            return Err(format!("{key:?} must be text"));
        };
        if let Some((end, _)) = sentence.char_indices().find(|(at, _)| *at >= MAX_SENTENCE) {
            sentence.truncate(end);
        }
        if key == "error" {
            return Ok(Answer::Error(sentence));
        }
        return if is_reason(&sentence) {
            Ok(Answer::Refused(sentence))
        } else {
            Err(
                "\"refused\" must be a short name of small letters, digits and hyphens, a colon \
                 and a sentence, as in \"contact-gap: the teeth lose contact\""
                    .to_owned(),
            )
        };
    }
    serde_json::from_value(Value::Object(answer))
        .map(Answer::Given)
        .map_err(|error| error.to_string())
}

impl Started {
    /// Whether the program speaks this protocol.
    pub(super) fn check(&self) -> Result<(), String> {
        if self.protocol == PROTOCOL {
            Ok(())
        } else {
            let theirs = self.protocol;
            Err(format!(
                "it speaks protocol {theirs}, and this program protocol {PROTOCOL}"
            ))
        }
    }
}

fn is_reason(reason: &str) -> bool {
    reason.split_once(':').is_some_and(|(name, sentence)| {
        let plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
        !name.is_empty()
            && name.len() <= 64
            && name.chars().all(plain)
            && !sentence.trim().is_empty()
    })
}

fn object(value: Value) -> Map<String, Value> {
    match value {
        Value::Object(object) => object,
        _ => Map::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(text: &str) -> Result<Answer<f64>, String> {
        let answer: Answer<SampleAnswer> = read(text.as_bytes(), 7)?;
        Ok(match answer {
            Answer::Given(given) => Answer::Given(given.delta_ste_um),
            Answer::Refused(reason) => Answer::Refused(reason),
            Answer::Error(error) => Answer::Error(error),
        })
    }

    #[test]
    fn answers_are_read_strictly() {
        assert_eq!(
            sample(r#"{"delta_ste_um": 0.1, "id": 7}"#),
            Ok(Answer::Given(0.1))
        );
        assert_eq!(
            sample(r#"{"id": 7, "refused": "contact-gap: the teeth lose contact"}"#),
            Ok(Answer::Refused(
                "contact-gap: the teeth lose contact".to_owned()
            ))
        );
        assert_eq!(
            sample(r#"{"id": 7, "error": "no licence"}"#),
            Ok(Answer::Error("no licence".to_owned()))
        );
        for (nonsense, why) in [
            ("", "EOF"),
            ("hello", "expected value"),
            ("[0.1]", "no JSON object"),
            (r#"{"delta_ste_um": 0.1}"#, "does not repeat"),
            (
                r#"{"delta_ste_um": 0.1, "id": 6}"#,
                "request 6 instead of 7",
            ),
            (r#"{"id": 7}"#, "missing field `delta_ste_um`"),
            (r#"{"delta_ste_um": NaN, "id": 7}"#, "expected value"),
            (r#"{"delta_ste_um": 1e999, "id": 7}"#, "out of range"),
            (r#"{"delta_ste_um": "0.1", "id": 7}"#, "invalid type"),
            (
                r#"{"delta_ste_um": 0.1, "id": 7, "mood": 1}"#,
                "unknown field `mood`",
            ),
            (r#"{"id": 7, "refused": "no"}"#, "a short name"),
            (r#"{"id": 7, "refused": 3}"#, "must be text"),
        ] {
            let error = sample(nonsense).unwrap_err();
            assert!(error.contains(why), "{nonsense}: {error}");
        }
    }

    #[test]
    fn numbers_are_read_to_the_last_bit() {
        for value in [0.1, 1.0 / 3.0, 5e-324, 1.7976931348623157e308] {
            let text = format!("{{\"id\":7,\"delta_ste_um\":{value:e}}}");
            assert_eq!(sample(&text), Ok(Answer::Given(value)));
        }
    }

    #[test]
    fn a_long_sentence_is_cut_between_characters() {
        let text = format!(r#"{{"id": 7, "error": "{}"}}"#, "µ".repeat(5000));
        let Ok(Answer::Error(sentence)) = sample(&text) else {
            panic!("an error")
        };
        assert_eq!(sentence.len(), MAX_SENTENCE);
    }
}
