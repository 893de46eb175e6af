//! The profile of a gear: the K-diagram.

use super::{HALF, draw, same_length};
use crate::number::fixed;
use crate::report::drawing::FlankProfile;
use crate::report::error::Error;
use crate::report::svg::{Axis, Chart, Mark, Picture, Scale, Series};

/// The depth of material missing from a gear's profile over the roll angle, in µm: by the modification, and with the
/// mean wear. Removed material counts downwards.
///
/// # Errors
/// [`Error::NothingToDraw`] without a finite value, [`Error::LengthMismatch`] if a curve that is not empty is not as
/// long as the roll angles.
pub fn profile(profile: &FlankProfile) -> Result<Picture, Error> {
    let angles = &profile.roll_angle_deg;
    same_length("the profile modification", angles, &profile.modification_um)?;
    let curve = |name: &str, mark, colour, depths: Vec<f64>| Series {
        name: Some(name.to_owned()),
        mark,
        colour,
        points: angles.iter().zip(depths).map(|(&a, d)| [a, -d]).collect(),
    };
    let modified = profile.modification_um.clone();
    let mut series = vec![curve("as designed", Mark::Curve(""), 0, modified)];
    if !profile.wear_um.is_empty() {
        same_length("the mean wear", angles, &profile.wear_um)?;
        let both = profile.modification_um.iter().zip(&profile.wear_um);
        let worn = both.map(|(a, b)| a + b).collect();
        series.push(curve("with the mean wear", Mark::Curve("8 3"), 1, worn));
    }
    let [root, tip] = profile.diameters_mm.map(|diameter| fixed(diameter, 2));
    let chart = Chart {
        title: format!("Profile of the {} (K-diagram)", profile.gear),
        x: Axis::new(
            format!("roll angle (°), between the diameters {root} and {tip} mm"),
            Scale::Linear,
        ),
        y: Axis::new("profile change (µm)", Scale::Linear),
        series,
        size: HALF,
    };
    draw(chart, "profile", "no depth is finite")
}
