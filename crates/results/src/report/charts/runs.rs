//! Lines over evaluations and over the mesh phase.

use super::{HALF, draw, same_length};
use crate::number;
use crate::report::drawing::SteCurves;
use crate::report::error::Error;
use crate::report::runs::OptimiserRun;
use crate::report::svg::{Axis, Chart, Mark, Picture, Scale, Series};
use crate::sheet::amplitude;

/// Dash patterns, so that lines differ by more than colour.
const DASHES: [&str; 4] = ["", "8 3", "3 2", "10 3 2 3"];

/// Ratio of greatest to least value above which the vertical axis is logarithmic. A linear axis would hide the end of
/// a run: a start at a design that cannot be simulated counts 100, an optimum about one.
const LOG_FROM_RATIO: f64 = 8.0;

/// The vertical axis ends at the highest of the starts' best values after 1/`CUT` of their evaluations.
const CUT: f64 = 50.0;

/// Best penalised objective (no unit, Equation (5)) against evaluations, one line per start.
///
/// # Errors
/// [`Error::NothingToDraw`] without a run that recorded a finite value.
pub fn convergence(title: &str, runs: &[OptimiserRun]) -> Result<Picture, Error> {
    let mut series = Vec::new();
    let mut rings = Vec::new();
    for (i, run) in runs.iter().enumerate() {
        let points: Vec<[f64; 2]> = run
            .history
            .iter()
            .filter(|(_, best)| best.is_finite())
            .map(|&(evaluations, best)| [evaluations as f64, best])
            .collect();
        let restarts = run
            .restarts
            .iter()
            .filter_map(|&at| value_at(&points, at as f64));
        rings.push(Series {
            name: None,
            mark: Mark::Rings,
            colour: i,
            points: restarts.collect(),
        });
        series.push(Series {
            name: Some(format!("start {}", run.start)),
            mark: Mark::Curve(DASHES[i % DASHES.len()]),
            colour: i,
            points: steps(&points),
        });
    }
    if let Some(ring) = rings.iter_mut().find(|ring| !ring.points.is_empty()) {
        ring.name = Some("restart".to_owned());
    }
    // The axis leaves out the first values, which are many times as high as the rest.
    let values = || series.iter().flat_map(|s| &s.points).map(|p| p[1]);
    let least = values().fold(f64::INFINITY, f64::min);
    let early = series.iter().filter_map(|s| {
        let last = s.points.last()?;
        value_at(&s.points, last[0] / CUT).map(|p| p[1])
    });
    let top = early.fold(f64::NEG_INFINITY, f64::max);
    let shown = (top - least > 1e-6 * least.abs()).then_some((least, top));
    let scale = if least > 0.0 && top / least > LOG_FROM_RATIO {
        Scale::Log
    } else {
        Scale::Linear
    };
    series.extend(rings);
    let chart = Chart {
        title: title.to_owned(),
        x: Axis::new("evaluations", Scale::Log),
        y: Axis {
            range: shown,
            ..Axis::new("best penalised objective", scale)
        },
        series,
        size: HALF,
    };
    draw(
        chart,
        "convergence plot",
        "no optimiser run recorded a finite value",
    )
}

/// Static transmission error over one mesh period in µm, each curve about its own mean.
///
/// # Errors
/// [`Error::NothingToDraw`] without a finite value, [`Error::LengthMismatch`] if a curve that is not
/// empty is not as long as the phases.
pub fn ste(curves: &SteCurves) -> Result<Picture, Error> {
    let mut series = Vec::new();
    let worn = (
        "with the mean wear",
        "the worn STE curve",
        &curves.worn_um,
        Mark::Smooth("8 3"),
        1,
        curves.delta_um[1],
    );
    let unworn = (
        "unworn",
        "the unworn STE curve",
        &curves.unworn_um,
        Mark::Smooth(""),
        0,
        curves.delta_um[0],
    );
    for (name, what, values, mark, colour, delta_um) in [unworn, worn] {
        if values.is_empty() {
            continue;
        }
        same_length(what, &curves.phase, values)?;
        let finite = || values.iter().copied().filter(|v| v.is_finite());
        let mean = finite().sum::<f64>() / finite().count().max(1) as f64;
        series.push(Series {
            name: Some(format!(
                "{name}: mean {} µm, ΔSTE {} µm",
                number::significant(mean, 3),
                number::significant(delta_um, 3)
            )),
            mark,
            colour,
            points: curves
                .phase
                .iter()
                .zip(values)
                .map(|(&p, &v)| [p, v - mean])
                .collect(),
        });
    }
    let chart = Chart {
        title: "Static transmission error over one mesh period".to_owned(),
        x: Axis::new("mesh phase (periods)", Scale::Linear),
        y: Axis::new("STE about its mean (µm)", Scale::Linear),
        series,
        size: HALF,
    };
    draw(
        chart,
        "static transmission error plot",
        "no curve has a finite value",
    )
}

/// The most harmonics of the mesh frequency that are shown.
const ORDERS: usize = 8;

/// The amplitudes of the static transmission error at multiples of the mesh frequency.
///
/// # Errors
/// [`Error::NothingToDraw`] without a finite value.
pub fn spectrum(curves: &SteCurves) -> Result<Picture, Error> {
    let mut series = Vec::new();
    let kinds = [
        ("unworn", &curves.unworn_um, 0),
        ("with the mean wear", &curves.worn_um, 1),
    ];
    for (name, values, colour) in kinds {
        if values.is_empty() {
            continue;
        }
        // Orders from the Nyquist frequency on have no meaningful amplitude.
        let orders = ORDERS.min(values.len().saturating_sub(2) / 2);
        let points = (1..=orders).map(|n| [n as f64, amplitude(&curves.phase, values, n)]);
        let points: Vec<[f64; 2]> = points.collect();
        series.extend(points.iter().map(|&[x, y]| Series {
            name: None,
            mark: Mark::Curve(""),
            colour,
            points: vec![[x, 0.0], [x, y]],
        }));
        series.push(Series {
            name: Some(name.to_owned()),
            mark: Mark::Rings,
            colour,
            points,
        });
    }
    let chart = Chart {
        title: "Spectrum of the static transmission error".to_owned(),
        x: Axis::new("mesh order", Scale::Whole),
        y: Axis::new("amplitude (µm)", Scale::Linear),
        series,
        size: HALF,
    };
    draw(
        chart,
        "spectrum of the static transmission error",
        "no curve has a finite value",
    )
}

/// A staircase through the points: a best value holds until the next one.
fn steps(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let mut out: Vec<[f64; 2]> = Vec::with_capacity(2 * points.len());
    for (i, &point) in points.iter().enumerate() {
        let last = i + 1 == points.len();
        match out.last().copied() {
            // Only the end of a plateau matters.
            Some(before) if before[1] == point[1] && !last => {}
            Some(before) => out.extend([[point[0], before[1]], point]),
            None => out.push(point),
        }
    }
    out
}

/// The best value once `at` evaluations are done.
fn value_at(points: &[[f64; 2]], at: f64) -> Option<[f64; 2]> {
    points
        .iter()
        .take_while(|p| p[0] <= at)
        .last()
        .map(|p| [at, p[1]])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plateau_costs_no_points() {
        let points = [[1.0, 9.0], [2.0, 9.0], [3.0, 4.0], [4.0, 4.0], [5.0, 4.0]];
        let expected = [[1.0, 9.0], [3.0, 9.0], [3.0, 4.0], [5.0, 4.0], [5.0, 4.0]];
        assert_eq!(steps(&points), expected);
        assert_eq!(value_at(&points, 4.5), Some([4.5, 4.0]));
        assert_eq!(value_at(&points, 0.5), None);
    }
}
