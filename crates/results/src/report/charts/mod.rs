//! One function per chart. Each returns a picture, or says why there is nothing to draw.

mod contact;
mod distribution;
mod gears;
mod indices;
mod intervals;
mod map;
mod model;
mod pressure;
mod profile;
mod rounds;
mod runs;
mod scatter;
mod solid;
mod torque;
mod tradeoff;

use crate::report::error::Error;
use crate::report::svg::{Axis, Chart, Mark, Picture, Scale, Series};
use crate::report::wear::WearProfiles;

pub use contact::contact;
pub use distribution::{VerifiedSamples, cumulative, histogram};
pub use gears::gears;
pub use indices::indices;
pub use intervals::{PercentileSeries, front, teeth};
pub use map::{ResponseMap, map};
pub use model::{leave_one_out, residuals, slice};
pub use pressure::pressure;
pub use profile::profile;
pub use rounds::{expected_improvement, prediction};
pub use runs::{convergence, spectrum, ste};
pub use scatter::{Extent, responses};
pub use solid::solid;
pub use torque::torque;
pub use tradeoff::{TradeoffChart, TradeoffSeries, tradeoff};

/// Half a page wide.
pub const HALF: [f64; 2] = [480.0, 360.0];
/// A whole page wide.
pub const FULL: [f64; 2] = [980.0, 340.0];

/// Figure 2: Archard's depth and random depths along a flank. Removed material
/// counts downwards, in µm over the roll angle in rad.
/// `size` is the picture's width and height in pixels.
///
/// # Errors
/// [`Error::NothingToDraw`] without a finite depth, [`Error::LengthMismatch`] if a profile is not as
/// long as the roll angles.
pub fn wear(profiles: &WearProfiles, size: [f64; 2]) -> Result<Picture, Error> {
    let angles = &profiles.roll_angle_rad;
    let removed = |what: &'static str, depths: &[f64]| {
        same_length(what, angles, depths)?;
        Ok::<_, Error>(angles.iter().zip(depths).map(|(&a, &d)| [a, -d]).collect())
    };
    let mut series = Vec::with_capacity(profiles.random_um.len() + 1);
    for (i, depths) in profiles.random_um.iter().enumerate() {
        series.push(Series {
            name: (i == 0).then(|| "random profiles".to_owned()),
            mark: Mark::Thin("5 3"),
            colour: 5,
            points: removed("a random wear profile", depths)?,
        });
    }
    series.push(Series {
        name: Some("Archard’s profile".to_owned()),
        mark: Mark::Curve(""),
        colour: 1,
        points: removed("archard’s wear profile", &profiles.archard_um)?,
    });
    draw(
        Chart {
            title: "Wear of the flank".to_owned(),
            x: Axis::new("roll angle (rad)", Scale::Linear),
            y: Axis::new("profile change (µm)", Scale::Linear),
            series,
            size,
        },
        "wear profiles",
        "no profile has a finite depth",
    )
}

fn draw(chart: Chart, name: &'static str, why: &'static str) -> Result<Picture, Error> {
    chart
        .draw()
        .ok_or(Error::NothingToDraw { chart: name, why })
}

fn same_length(what: &'static str, abscissae: &[f64], values: &[f64]) -> Result<(), Error> {
    if abscissae.len() == values.len() {
        Ok(())
    } else {
        Err(Error::LengthMismatch {
            what,
            expected: abscissae.len(),
            found: values.len(),
        })
    }
}
