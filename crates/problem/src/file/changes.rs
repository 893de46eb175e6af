//! The differences between two campaigns, by key.

use serde_json::Value;

use super::Campaign;

/// Number of characters after which a value is cut in messages.
const SHOWN: usize = 60;

impl Campaign {
    /// The keys in which this campaign differs from `held`, in alphabetical order and with both
    /// values: `sampling.level: 0.9 there, 0.95 here`.
    #[must_use]
    pub fn changes_from(&self, held: &Self) -> Vec<String> {
        let mut changes = Vec::new();
        let (held, ours) = (held.to_value(), self.to_value());
        compare("", Some(&held), Some(&ours), &mut changes);
        changes
    }
}

/// Compares two JSON trees. A key in only one of them is reported as a whole.
fn compare(key: &str, held: Option<&Value>, ours: Option<&Value>, changes: &mut Vec<String>) {
    match (held, ours) {
        (Some(Value::Object(held)), Some(Value::Object(ours))) => {
            let mut names: Vec<&String> = held.keys().chain(ours.keys()).collect();
            names.sort();
            names.dedup();
            for name in names {
                let dot = if key.is_empty() { "" } else { "." };
                let key = format!("{key}{dot}{name}");
                compare(&key, held.get(name), ours.get(name), changes);
            }
        }
        (Some(Value::Array(held)), Some(Value::Array(ours))) if held.len() == ours.len() => {
            for (i, (held, ours)) in held.iter().zip(ours).enumerate() {
                compare(&format!("{key}[{i}]"), Some(held), Some(ours), changes);
            }
        }
        _ if held == ours => {}
        _ => changes.push(format!(
            "{key}: {} there, {} here",
            shown(held),
            shown(ours)
        )),
    }
}

fn shown(value: Option<&Value>) -> String {
    let Some(value) = value else {
        return "not given".to_owned();
    };
    let text = value.to_string();
    if text.chars().count() <= SHOWN {
        return text;
    }
    text.chars().take(SHOWN).chain(['…']).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(changes: &[(&str, &str)]) -> Campaign {
        let mut text = Campaign::PAPER.to_owned();
        for (from, to) in changes {
            assert!(text.contains(from), "no {from}");
            text = text.replacen(from, to, 1);
        }
        Campaign::parse("paper.toml", &text).unwrap()
    }

    #[test]
    fn every_key_that_changed_is_named_with_both_values() {
        let held = parse(&[]);
        assert_eq!(held.changes_from(&held), Vec::<String>::new());
        let ours = parse(&[
            ("seed = 2009", "seed = 7"),
            ("pinion_torque_nm = 200.0", "pinion_torque_nm = 210.0"),
            ("[sampling]\n", "[sampling]\nprecision = 0.05\n"),
        ]);
        assert_eq!(
            ours.changes_from(&held),
            [
                "load.pinion_torque_nm: 200.0 there, 210.0 here",
                "sampling.precision: not given there, 0.05 here",
                "seed: 2009 there, 7 here",
            ]
        );
    }

    #[test]
    fn a_bound_of_one_variable_is_found_in_its_list() {
        let text = include_str!("../../../../campaigns/ishigami/campaign.toml");
        let held = Campaign::parse("i.toml", text).unwrap();
        let mut ours = text.to_owned();
        let place = ours.rfind("low = ").unwrap();
        ours.insert_str(place + "low = ".len(), "-1.0 # ");
        let ours = Campaign::parse("i.toml", &ours).unwrap();
        let changes = ours.changes_from(&held);
        assert_eq!(changes.len(), 1, "{changes:?}");
        assert!(changes[0].starts_with("variables[2].low: "), "{changes:?}");
    }
}
