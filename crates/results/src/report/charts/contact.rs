//! The contact pattern: pressure over the flank.

use super::{HALF, draw};
use crate::number::{fixed, significant};
use crate::report::drawing::ContactPattern;
use crate::report::error::Error;
use crate::report::svg::{Axis, Chart, Mark, PALETTE, Picture, Scale, Series};

/// Contact pressure in MPa over the flank.
///
/// # Errors
/// [`Error::NothingToDraw`] if no place carries load, [`Error::LengthMismatch`] if the rows are not as many
/// as the places on the path, or not as long as those across the face.
pub fn contact(pattern: &ContactPattern) -> Result<Picture, Error> {
    let (along, across) = (&pattern.place_mm, &pattern.across_mm);
    let same_length = |expected, found| match expected == found {
        true => Ok(()),
        false => Err(Error::LengthMismatch {
            what: "the contact pattern",
            expected,
            found,
        }),
    };
    same_length(along.len(), pattern.pressure_mpa.len())?;
    for row in &pattern.pressure_mpa {
        same_length(across.len(), row.len())?;
    }
    let rows = along.iter().zip(&pattern.pressure_mpa);
    let cells: Vec<[f64; 3]> = rows
        .flat_map(|(&s, row)| across.iter().zip(row).map(move |(&z, &p)| [z, s, p]))
        .filter(|cell| cell[2].is_finite() && cell[2] > 0.0)
        .collect();
    let most = cells.iter().map(|cell| cell[2]).fold(0.0, f64::max);
    let step = most / PALETTE as f64;
    let class = |pressure: f64| ((pressure / step).ceil() as usize).clamp(1, PALETTE) - 1;
    let size = [spacing(across), spacing(along)];
    let mut series: Vec<Series> = (0..PALETTE)
        .map(|colour| {
            let ends = [colour, colour + 1].map(|k| significant(k as f64 * step, 3));
            let of_class = cells.iter().filter(|cell| class(cell[2]) == colour);
            Series {
                name: Some(format!("{} to {} MPa", ends[0], ends[1])),
                mark: Mark::Cells(size),
                colour,
                points: of_class.map(|cell| [cell[0], cell[1]]).collect(),
            }
        })
        .collect();
    let name = || "lines of contact at one moment".to_owned();
    series.extend(pattern.lines.iter().enumerate().map(|(i, ends)| Series {
        name: (i == 0).then(name),
        mark: Mark::Guide,
        colour: 0,
        points: ends.to_vec(),
    }));
    let axis = |label: &str, places: &[f64], size: f64| Axis {
        label: label.to_owned(),
        scale: Scale::Linear,
        range: places
            .first()
            .zip(places.last())
            .map(|(low, high)| (low - 0.5 * size, high + 0.5 * size)),
    };
    let share = cells.len() as f64 / (along.len() * across.len()).max(1) as f64;
    let chart = Chart {
        title: format!(
            "Contact pattern, {}: {} % of the flank carries load",
            if pattern.is_worn { "worn" } else { "unworn" },
            fixed(100.0 * share, 0)
        ),
        x: axis("place across the face (mm)", across, size[0]),
        y: axis("distance from the pitch point (mm)", along, size[1]),
        series,
        size: [HALF[0], HALF[1] + 40.0],
    };
    draw(
        chart,
        "contact pattern",
        "no place of the flank carries load",
    )
}

/// The distance of evenly spaced places.
fn spacing(places: &[f64]) -> f64 {
    match places {
        [first, .., last] => (last - first) / (places.len() - 1) as f64,
        _ => 1.0,
    }
}
