//! The wear along a flank.

use gear::WearProfile;
use problem::Approach;
use stats::streams::{Purpose, stream};

use super::quantity::approach_name;
use crate::snapshot::Snapshot;

/// Number of random wear profiles.
const PROFILES: u64 = 10;

/// Wear depths along one flank (Figure 2).
#[derive(Debug, Clone, PartialEq)]
pub struct WearProfiles {
    /// The flank and the design, for the caption.
    pub subject: String,
    /// Roll angles, rad.
    pub roll_angle_rad: Vec<f64>,
    /// Mean depth at each roll angle, µm, positive where material is missing.
    pub archard_um: Vec<f64>,
    /// Random depths, one list per profile, each as long as the roll angles, µm.
    pub random_um: Vec<Vec<f64>>,
}

/// The wear of the optimum with Archard's wear, otherwise of the one without wear. `None` without either, and
/// for an external simulator.
pub(super) fn profiles(snapshot: &Snapshot) -> Option<WearProfiles> {
    if snapshot.problem.campaign().is_external() {
        return None;
    }
    let (name, design) = [Approach::Baseline, Approach::Nominal]
        .iter()
        .find_map(|approach| {
            let optimum = &snapshot.optima.of(*approach)?.optimum;
            let found = optimum.found.as_ref().ok()?;
            Some((approach_name(&snapshot.problem, *approach), &found.design))
        })?;
    let gears = snapshot.problem.gears()?;
    let pair = gears.pair(design).ok()?;
    let mut sampler = gears.sampler(&pair);
    let seed = snapshot.campaign.seed;
    let profiles: Vec<WearProfile> = (0..PROFILES)
        .map(|index| sampler.draw_profile(&mut stream(seed, Purpose::Test, 2, index)))
        .collect();
    let micrometres = |depths: &[f64]| depths.iter().map(|depth| depth * 1e3).collect::<Vec<_>>();
    let worn = pair.archard(gears.wear());
    // Pinion flank: its roll angle grows with s, so both lists run the same way.
    let roll = profiles.first()?.roll[0].clone();
    let [depth, _] = &worn.depth;
    if depth.len() != roll.len() {
        return None;
    }
    let slopes = match gears.scatter() == gear::Scatter::default() {
        true => "",
        false => ", without its deviations of manufacture",
    };
    let random = profiles.iter();
    Some(WearProfiles {
        subject: format!("Pinion flank of the optimum of the approach “{name}”{slopes}."),
        roll_angle_rad: roll,
        archard_um: micrometres(depth),
        random_um: random
            .map(|profile| micrometres(&profile.depth[0]))
            .collect(),
    })
}
