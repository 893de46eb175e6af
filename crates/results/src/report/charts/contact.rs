//! The contact pattern: pressure over the flank.

use super::{HALF, draw};
use crate::number::{fixed, significant};
use crate::report::drawing::ContactPattern;
use crate::report::error::Error;
use crate::report::svg::{Axis, Chart, Mark, Picture, SHADES, Scale, Series, Table};

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
    let loaded = |pressure: &f64| pressure.is_finite() && *pressure > 0.0;
    let all = || pattern.pressure_mpa.iter().flatten().copied();
    let least = all().filter(loaded).fold(pattern.peak_mpa, f64::min);
    let most = all().filter(loaded).fold(pattern.peak_mpa, f64::max);
    let shade = |pressure: f64| {
        let share = (pressure - least) / (most - least).max(f64::MIN_POSITIVE);
        ((share * SHADES as f64) as usize).min(SHADES - 1)
    };
    let size = [spacing(across), spacing(along)];
    let half = size.map(|size| 0.5 * size);
    let mut series: Vec<Series> = (0..SHADES)
        .map(|colour| Series {
            name: None,
            mark: Mark::Cells,
            colour,
            points: Vec::new(),
        })
        .collect();
    // Neighbours of the same shade in a row are drawn as one rectangle.
    for (s, row) in along.iter().zip(&pattern.pressure_mpa) {
        let shades = row.iter().map(|p| loaded(p).then(|| shade(*p)));
        let shades: Vec<(usize, Option<usize>)> = shades.enumerate().collect();
        for run in shades.chunk_by(|a, b| a.1 == b.1) {
            let (Some((first, Some(shade))), Some((last, _))) = (run.first(), run.last()) else {
                continue;
            };
            series[*shade].points.extend([
                [across[*first] - half[0], s - half[1]],
                [across[*last] + half[0], s + half[1]],
            ]);
        }
    }
    series.retain(|one| !one.points.is_empty());
    let ends = [least, most].map(|end| format!("{} MPa", significant(end, 3)));
    for (end, name) in [0, series.len().saturating_sub(1)].into_iter().zip(ends) {
        if let Some(one) = series.get_mut(end) {
            one.name = Some(name);
        }
    }
    let name = || "lines of contact at one moment".to_owned();
    series.extend(pattern.lines.iter().enumerate().map(|(i, ends)| Series {
        name: (i == 0).then(name),
        mark: Mark::Guide,
        colour: 0,
        points: ends.to_vec(),
    }));
    let axis = |label: &str, places: &[f64], half: f64| Axis {
        range: places
            .first()
            .zip(places.last())
            .map(|(low, high)| (low - half, high + half)),
        ..Axis::new(label, Scale::Linear)
    };
    let count = all().filter(loaded).count();
    let share = count as f64 / (along.len() * across.len()).max(1) as f64;
    let chart = Chart {
        title: format!(
            "Contact pattern, {}: {} % of the flank carries load",
            if pattern.is_worn { "worn" } else { "unworn" },
            fixed(100.0 * share, 0)
        ),
        x: axis("place across the face (mm)", across, half[0]),
        y: axis("distance from the pitch point (mm)", along, half[1]),
        series,
        size: [HALF[0], HALF[1] + 40.0],
    };
    let columns = across.iter().enumerate().map(|(k, z)| {
        let rows = along.iter().zip(&pattern.pressure_mpa);
        let points = rows.map(|(&s, row)| [s, row[k]]).collect();
        (format!("{} mm across the face", fixed(*z, 2)), points)
    });
    let data = Table {
        axes: [
            "distance from the pitch point (mm)".to_owned(),
            "pressure (MPa)".to_owned(),
        ],
        series: columns.collect(),
    };
    let why = "no place of the flank carries load";
    Ok(draw(chart, "contact pattern", why)?.with_data(data))
}

/// The distance of evenly spaced places.
fn spacing(places: &[f64]) -> f64 {
    match places {
        [first, .., last] => (last - first) / (places.len() - 1) as f64,
        _ => 1.0,
    }
}
