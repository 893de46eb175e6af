//! A campaign file is refused with its name and a line, or is valid and survives serialisation.

#![no_main]

use problem::Campaign;
use problem::formulation::Problem;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|text: &str| {
    match Campaign::parse("some.toml", text) {
        Err(error) => {
            let sentence = error.to_string();
            assert!(sentence.starts_with("some.toml, line "), "{sentence}");
        }
        Ok(campaign) => {
            let again = Campaign::from_json(&campaign.to_json()).expect("it was just written");
            assert_eq!(again, campaign);
            let _ = campaign.warnings();
            let _ = Problem::new(campaign);
        }
    }
});
