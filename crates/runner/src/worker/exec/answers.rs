//! The answers of an external simulator: one JSON object per line, among other text.

use problem::formulation::Problem;
use serde::Deserialize;
use serde_json::{Deserializer, Map, Value};

use super::numbers::{Numbers, number, with_quoted_numbers};
use super::object::Object;
use super::output::Line;
use super::requests::{PROTOCOL, evaluated, sampled};

/// Maximum number of objects in a line that are looked at.
const OBJECTS: usize = 64;

/// Maximum length of a reason, in bytes.
const MAX_SENTENCE: usize = 2000;

/// The answer to the first request of a process.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Description {
    protocol: u32,
    /// The program's version.
    #[serde(default)]
    pub(super) version: String,
    /// The names of the variables that the program knows, if it names them.
    variables: Option<Vec<String>>,
    /// The names of the responses that the program gives for a design, including the sampled one,
    /// if it names them.
    responses: Option<Vec<String>>,
}

/// The content of an answer besides its id.
pub(super) trait Content: Sized {
    /// Reads the content from an answer.
    ///
    /// # Errors
    ///
    /// The error in the answer.
    fn of(answer: Map<String, Value>) -> Result<Self, String>;
}

impl Content for Description {
    fn of(answer: Map<String, Value>) -> Result<Self, String> {
        serde_json::from_value(Value::Object(answer)).map_err(|error| error.to_string())
    }
}

impl Content for Numbers {
    fn of(answer: Map<String, Value>) -> Result<Self, String> {
        let number = |(name, value): (String, Value)| match number(&value) {
            Some(number) => Ok((name, number)),
            None => Err(format!("{name:?} is {value}, which is not a number")),
        };
        answer.into_iter().map(number).collect()
    }
}

#[derive(Debug, PartialEq)]
pub(super) enum Answer<T> {
    /// The requested content.
    Given(T),
    /// The design is not simulable: a short name and a sentence.
    Refused(String),
    /// The program's reason for not answering.
    Error(String),
}

/// Checks that an answer holds all `wanted` numbers, and no others than `others`.
pub(super) fn check(numbers: &Numbers, wanted: &[&str], others: &[&str]) -> Result<(), String> {
    let missing = wanted.iter().find(|name| !numbers.contains_key(**name));
    if let Some(name) = missing {
        return Err(format!("it has no {name:?}, which was asked for"));
    }
    let is_unknown = |name: &&String| !others.contains(&name.as_str());
    if let Some(name) = numbers.keys().find(is_unknown) {
        return Err(match others {
            [] => format!("it has {name:?}, but no number was asked for"),
            _ => format!(
                "it has {name:?}, which was not asked for; allowed: {}",
                others.join(", ")
            ),
        });
    }
    Ok(())
}

/// Reads a line that a program wrote after request `id`.
///
/// The answer may have a byte order mark before it and other text in its line, such as a message
/// without an end of line.
pub(super) fn hear(line: &[u8], id: u64) -> Line<Map<String, Value>> {
    let line = line.strip_prefix(b"\xef\xbb\xbf").unwrap_or(line);
    let line = line.trim_ascii();
    if line.is_empty() {
        return Line::Nothing;
    }
    let text = String::from_utf8_lossy(line);
    let text = with_quoted_numbers(&text);
    let mut error = None;
    let mut from = 0;
    for _ in 0..OBJECTS {
        let Some(start) = text[from..].find('{').map(|start| from + start) else {
            break;
        };
        let mut values = Deserializer::from_str(&text[start..]).into_iter::<Object>();
        match values.next() {
            Some(Ok(read)) => {
                let end = start + values.byte_offset();
                let checked = read.check();
                let mut object = read.map;
                let theirs = object.get("id").and_then(Value::as_f64);
                // A program may print the request for its user.
                let is_answer = !object.contains_key("request");
                if theirs == Some(id as f64) && is_answer {
                    if let Err(doubled) = checked {
                        return Line::Malformed(doubled);
                    }
                    object.remove("id");
                    return Line::Answer(object, start == 0 && end == text.len());
                }
                if let Some(theirs) = theirs
                    && theirs > id as f64
                    && is_answer
                {
                    return Line::Malformed(format!("it answers request {theirs} instead of {id}"));
                }
                from = end;
            }
            Some(Err(why)) => {
                error.get_or_insert(why);
                from = start + 1;
            }
            None => break,
        }
    }
    let is_attempt = text.starts_with('{') && (text.contains("\"id\"") || text.contains("'id'"));
    match error {
        Some(error) if is_attempt => Line::Malformed(format!("it is not JSON: {error}")),
        _ => Line::Foreign,
    }
}

/// Reads an answer, without its id.
///
/// # Errors
///
/// The error in the answer.
pub(super) fn read<T: Content>(mut answer: Map<String, Value>) -> Result<Answer<T>, String> {
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
    T::of(answer).map(Answer::Given)
}

impl Description {
    /// Checks that the program uses this protocol and the names of the campaign.
    pub(super) fn check(&self, problem: &Problem) -> Result<(), String> {
        if self.protocol != PROTOCOL {
            let theirs = self.protocol;
            return Err(format!(
                "it uses protocol {theirs}, this program uses protocol {PROTOCOL}"
            ));
        }
        let variables = problem.variables().iter();
        let variables = variables.map(|variable| &*variable.name).collect();
        let mut responses = evaluated(problem);
        for sampled in sampled(problem) {
            if !responses.contains(&sampled) {
                responses.push(sampled);
            }
        }
        agree("variables", &variables, self.variables.as_deref())?;
        agree("responses", &responses, self.responses.as_deref())
    }
}

/// Checks that the names of the program, if it gives any, are those of the campaign.
fn agree(what: &str, ours: &Vec<&str>, theirs: Option<&[String]>) -> Result<(), String> {
    let Some(theirs) = theirs else {
        return Ok(());
    };
    let lacks = ours.iter().find(|name| !theirs.iter().any(|t| t == *name));
    let knows = theirs.iter().find(|name| !ours.contains(&name.as_str()));
    let difference = match (lacks, knows) {
        (Some(name), _) => format!("does not know {name:?} of the campaign"),
        (None, Some(name)) => format!("knows {name:?}, which the campaign does not have"),
        (None, None) => return Ok(()),
    };
    Err(format!(
        "its {what} differ from those of the campaign ({}): it {difference}",
        ours.join(", ")
    ))
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

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(text: &str) -> Result<Answer<f64>, String> {
        let answer = match hear(text.as_bytes(), 7) {
            Line::Answer(answer, _) => answer,
            Line::Malformed(reason) => return Err(reason),
            Line::Foreign | Line::Nothing => return Err("skipped".to_owned()),
        };
        let answer: Answer<Numbers> = read(answer)?;
        Ok(match answer {
            Answer::Given(given) => {
                check(&given, &["delta_ste_um"], &["delta_ste_um"])?;
                Answer::Given(given["delta_ste_um"])
            }
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
            (
                r#"{"delta_ste_um": 0.1, "id": 8}"#,
                "request 8 instead of 7",
            ),
            (r#"{"delta_ste_um": 0,1, "id": 7}"#, "not JSON"),
            ("{'delta_ste_um': 0.1, 'id': 7}", "not JSON"),
            (r#"{"id": 7}"#, "no \"delta_ste_um\", which was asked for"),
            (r#"{"delta_ste_um": 1e999, "id": 7}"#, "out of range"),
            (
                r#"{"delta_ste_um": "0.1", "id": 7}"#,
                "\"delta_ste_um\" is \"0.1\", which is not a number",
            ),
            (
                r#"{"delta_ste_um": 0.1, "id": 7, "mood": 1}"#,
                "\"mood\", which was not asked for; allowed: delta_ste_um",
            ),
            (
                r#"{"delta_ste_um": 0.1, "delta_ste_um": 0.2, "id": 7}"#,
                "\"delta_ste_um\" more than once",
            ),
            (
                r#"{"id": 7, "delta_ste_um": 0.1, "id": 7}"#,
                "\"id\" more than once",
            ),
            (r#"{"id": 7, "refused": "no"}"#, "a short name"),
            (r#"{"id": 7, "refused": 3}"#, "must be text"),
        ] {
            let error = sample(nonsense).unwrap_err();
            assert!(error.contains(why), "{nonsense}: {error}");
        }
        let unasked = Numbers::from([("area".to_owned(), 1.0)]);
        let error = check(&unasked, &[], &[]).unwrap_err();
        assert_eq!(error, "it has \"area\", but no number was asked for");
    }

    #[test]
    fn an_answer_is_found_among_other_text() {
        let answer = r#"{"delta_ste_um": 0.1, "id": 7}"#;
        for line in [
            format!("\u{feff}{answer}\r"),
            format!(" \t{answer}  "),
            format!("Loading licence ... {answer}"),
            format!("10 %\r20 %\r{answer} done {{}}"),
            format!("{{x{answer}"),
            format!(r#"{{"id":6,"delta_ste_um":9}}{answer}"#),
            r#"{"id":7.0,"delta_ste_um":0.1}"#.to_owned(),
        ] {
            assert_eq!(sample(&line), Ok(Answer::Given(0.1)), "{line}");
        }
        for line in [
            "",
            "\r",
            "hello",
            "[0.1]",
            "{}",
            "iteration {1} residual 1e-3",
            r#"{"delta_ste_um": 0.1}"#,
            r#"{"delta_ste_um": 0.1, "id": 6}"#,
            r#"{"level": "info", "id": "solver", "of": {"id": 7, "delta_ste_um": 0.1}}"#,
            r#"{"id": 7, "request": "sample", "design": {"x": 1}, "seed": [1, 2, 3, 4]}"#,
        ] {
            assert_eq!(sample(line), Err("skipped".to_owned()), "{line}");
        }
        assert_eq!(
            sample(r#"{"id": 7, "error": "NaN, \"NaN\" and -Infinity"}"#),
            Ok(Answer::Error("NaN, \"NaN\" and -Infinity".to_owned()))
        );
    }

    #[test]
    fn what_is_no_number_in_json_is_read_as_programs_write_it() {
        for (text, value) in [
            ("NaN", f64::NAN),
            ("-nan", f64::NAN),
            ("null", f64::NAN),
            ("\"NaN\"", f64::NAN),
            ("Infinity", f64::INFINITY),
            ("-inf", f64::NEG_INFINITY),
        ] {
            let line = format!("{{\"delta_ste_um\": {text}, \"id\": 7}}");
            let Ok(Answer::Given(read)) = sample(&line) else {
                panic!("{line}");
            };
            assert!(
                read == value || read.is_nan() && value.is_nan(),
                "{line}: {read}"
            );
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
