//! The campaign that the command line asks for.

use kriging::Noise;
use problem::Campaign;

/// The tooth model with this name.
fn named(name: &str) -> gear::ToothModel {
    let mut models = gear::ToothModel::ALL.iter();
    let named = models.find(|model| model.to_string() == name);
    *named.expect("--tooth-model takes a name")
}

/// The campaign of the command line: that of a file, with other teeth, torque and tooth model if
/// requested.
pub(super) fn campaign_of(file: &str, value: impl Fn(&str) -> Option<String>) -> Campaign {
    let text = std::fs::read_to_string(file).expect("--campaign takes a campaign file");
    let mut campaign = Campaign::parse(file, &text).expect("a campaign file");
    let mut pinion = campaign.gears().expect("a gear campaign").pair.pinion_teeth;
    if let Some(teeth) = value("--teeth") {
        let both = teeth.split_once(',').expect("--teeth takes PINION,MATE");
        let number = |text: &str| text.parse::<u32>().expect("--teeth takes two numbers");
        pinion = number(both.0);
        campaign
            .gears_mut()
            .expect("a gear campaign")
            .pair
            .gear_teeth = Some(number(both.1));
        campaign
            .gears_mut()
            .expect("a gear campaign")
            .pair
            .gear_ratio = None;
    }
    if let Some(torque) = value("--torque") {
        campaign
            .gears_mut()
            .expect("a gear campaign")
            .load
            .pinion_torque_nm = torque.parse().expect("--torque takes a number");
    }
    if let Some(model) = value("--tooth-model") {
        campaign
            .gears_mut()
            .expect("a gear campaign")
            .pair
            .tooth_model = named(&model);
    }
    match value("--noise").as_deref() {
        None => {}
        Some("own") => campaign.kriging.noise = Some(Noise::Own),
        Some("smoothed") => campaign.kriging.noise = Some(Noise::Smoothed),
        Some(_) => panic!("--noise takes own or smoothed"),
    }
    // This validates the other values, too.
    let checked = campaign.with_pinion_teeth(file, pinion);
    checked.expect("a proper campaign").0
}
