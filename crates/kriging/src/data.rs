//! Observations: checks, merging of repeated points, scaling for the search.

use std::cmp::Ordering;

use crate::fit::SIGMA2_BOUNDS;
use crate::{Error, Warning};

/// Observations of a function with noise of known variance.
#[derive(Debug, Clone, Copy)]
pub struct Data<'a> {
    /// The points, row-major: n rows of `d` coordinates, in any unit.
    pub x: &'a [f64],
    /// Number of coordinates d, at least 1.
    pub d: usize,
    /// The n observations.
    pub y: &'a [f64],
    /// The n variances of the observations' noise, in units of y², zero where there is none.
    pub noise_variance: &'a [f64],
}

/// Distinct points, sorted by their coordinates: every result is independent of the order in which
/// the observations came.
#[derive(Debug, Clone)]
pub(crate) struct Points {
    pub(crate) d: usize,
    /// Row-major, n × d.
    pub(crate) x: Vec<f64>,
    pub(crate) y: Vec<f64>,
    pub(crate) noise: Vec<f64>,
    /// Position of each point's first observation in the data given.
    pub(crate) first: Vec<usize>,
    /// Negative log likelihood of the merged observations given their means: what the likelihood of
    /// the points lacks to be that of all observations.
    pub(crate) within: f64,
    pub(crate) warnings: Vec<Warning>,
}

impl Points {
    pub(crate) fn len(&self) -> usize {
        self.y.len()
    }

    pub(crate) fn row(&self, i: usize) -> &[f64] {
        &self.x[i * self.d..(i + 1) * self.d]
    }
}

/// Checks the data and merges observations at equal points.
///
/// Noisy observations at one point are replaced by their precision-weighted mean, which is
/// sufficient for everything the model learns from them. Where some are noise-free, those alone
/// count. If noise-free observations of a point differ, the variance pooled over all such points
/// is taken for their noise.
pub(crate) fn merge(data: &Data<'_>) -> Result<Points, Error> {
    check(data)?;
    let d = data.d;
    let row = |i: usize| &data.x[i * d..(i + 1) * d];

    let mut order: Vec<usize> = (0..data.y.len()).collect();
    // Observations at one point are sorted too, so that sums over them have one order.
    order.sort_by(|&a, &b| {
        compare_rows(row(a), row(b))
            .then(data.y[a].total_cmp(&data.y[b]))
            .then(data.noise_variance[a].total_cmp(&data.noise_variance[b]))
            .then(a.cmp(&b))
    });

    let groups: Vec<&[usize]> = order
        .chunk_by(|&a, &b| compare_rows(row(a), row(b)) == Ordering::Equal)
        .collect();
    let contradiction = Contradiction::among(&groups, data);

    let n = groups.len();
    let mut points = Points {
        d,
        x: Vec::with_capacity(n * d),
        y: Vec::with_capacity(n),
        noise: Vec::with_capacity(n),
        first: Vec::with_capacity(n),
        within: 0.0,
        warnings: Vec::new(),
    };
    for group in &groups {
        let first = group.iter().copied().min().expect("chunks are not empty");
        let (y, noise, within) = merge_group(group, data, &contradiction);
        points.x.extend_from_slice(row(first));
        points.y.push(y);
        points.noise.push(noise);
        points.first.push(first);
        points.within += within;
    }
    if n < data.y.len() {
        points.warnings.push(Warning::MergedDuplicates {
            observations: data.y.len(),
            distinct: n,
        });
    }
    if contradiction.points > 0 {
        points.warnings.push(Warning::ContradictoryDuplicates {
            points: contradiction.points,
            sd: contradiction.variance.sqrt(),
        });
    }
    Ok(points)
}

fn compare_rows(a: &[f64], b: &[f64]) -> Ordering {
    // Finite by now, and −0 equals 0 here, unlike in `total_cmp`.
    a.partial_cmp(b).unwrap_or(Ordering::Equal)
}

/// Scatter of noise-free observations of the same points.
struct Contradiction {
    points: usize,
    /// Pooled over the points that are concerned.
    variance: f64,
}

impl Contradiction {
    fn among(groups: &[&[usize]], data: &Data<'_>) -> Self {
        let (mut points, mut squares, mut freedom) = (0, 0.0, 0);
        for group in groups {
            let exact: Vec<f64> = exact(group, data).collect();
            let (Some(first), Some(last)) = (exact.first(), exact.last()) else {
                continue;
            };
            if first == last {
                continue;
            }
            let mean = mean(&exact);
            points += 1;
            squares += exact.iter().map(|y| (y - mean).powi(2)).sum::<f64>();
            freedom += exact.len() - 1;
        }
        let variance = if points == 0 {
            0.0
        } else {
            squares / freedom as f64
        };
        Self { points, variance }
    }
}

/// The noise-free observations of a group, in increasing order.
fn exact<'a>(group: &'a [usize], data: &'a Data<'_>) -> impl Iterator<Item = f64> + 'a {
    group
        .iter()
        .filter(|&&i| data.noise_variance[i] == 0.0)
        .map(|&i| data.y[i])
}

fn mean(values: &[f64]) -> f64 {
    let first = values[0];
    first + values.iter().map(|y| y - first).sum::<f64>() / values.len() as f64
}

/// Observation, noise variance and within-group negative log likelihood of one point.
fn merge_group(group: &[usize], data: &Data<'_>, contradiction: &Contradiction) -> (f64, f64, f64) {
    if let [only] = group {
        return (data.y[*only], data.noise_variance[*only], 0.0);
    }
    let exact: Vec<f64> = exact(group, data).collect();
    if let (Some(first), Some(last)) = (exact.first(), exact.last()) {
        if first == last {
            return (*first, 0.0, 0.0);
        }
        return (
            mean(&exact),
            contradiction.variance / exact.len() as f64,
            0.0,
        );
    }
    // Relative to the smallest variance, so that 1/v cannot overflow.
    let smallest = group
        .iter()
        .map(|&i| data.noise_variance[i])
        .fold(f64::INFINITY, f64::min);
    let base = data.y[group[0]];
    let (mut precision, mut sum) = (0.0, 0.0);
    for &i in group {
        let weight = smallest / data.noise_variance[i];
        precision += weight;
        sum += weight * (data.y[i] - base);
    }
    let y = base + sum / precision;
    let noise = smallest / precision;
    let log_2pi = std::f64::consts::TAU.ln();
    let within: f64 = group
        .iter()
        .map(|&i| {
            let v = data.noise_variance[i];
            0.5 * (log_2pi + v.ln() + (data.y[i] - y).powi(2) / v)
        })
        .sum();
    (y, noise, within - 0.5 * (log_2pi + noise.ln()))
}

fn check(data: &Data<'_>) -> Result<(), Error> {
    let n = data.y.len();
    if data.d == 0 {
        return Err(Error::Shape {
            what: "every point",
            expected: 1,
            got: 0,
        });
    }
    if data.x.len() != n * data.d {
        return Err(Error::Shape {
            what: "x",
            expected: n * data.d,
            got: data.x.len(),
        });
    }
    if data.noise_variance.len() != n {
        let got = data.noise_variance.len();
        return Err(Error::Shape {
            what: "noise variance",
            expected: n,
            got,
        });
    }
    for (what, values) in [
        ("x", data.x),
        ("y", data.y),
        ("noise variance", data.noise_variance),
    ] {
        if let Some(index) = values.iter().position(|v| !v.is_finite()) {
            return Err(Error::NonFinite {
                what,
                index,
                value: values[index],
            });
        }
    }
    match data.noise_variance.iter().position(|v| *v < 0.0) {
        Some(index) => Err(Error::NegativeNoise {
            index,
            value: data.noise_variance[index],
        }),
        None => Ok(()),
    }
}

/// The points in units of their own extent: what the likelihood search works on.
#[derive(Debug, Clone)]
pub(crate) struct Scaled {
    /// Coordinate-major: `columns[j][i]` in 0…1. Coordinates in which all points agree are absent.
    pub(crate) columns: Vec<Vec<f64>>,
    /// For each column, which coordinate of the points it is.
    pub(crate) active: Vec<usize>,
    /// Extent of each column, in units of x.
    pub(crate) extents: Vec<f64>,
    /// Centred, divided by `y_scale`.
    pub(crate) y: Vec<f64>,
    /// Divided by `y_scale`².
    pub(crate) noise: Vec<f64>,
    pub(crate) y_scale: f64,
}

impl Scaled {
    pub(crate) fn new(points: &Points) -> Result<Self, Error> {
        let n = points.len();
        let (mut columns, mut active, mut extents) = (Vec::new(), Vec::new(), Vec::new());
        for j in 0..points.d {
            let column: Vec<f64> = (0..n).map(|i| points.row(i)[j]).collect();
            let low = column.iter().copied().fold(f64::INFINITY, f64::min);
            let high = column.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let extent = high - low;
            if !extent.is_finite() {
                return Err(Error::Extent { what: "x" });
            }
            if extent > 0.0 {
                columns.push(column.iter().map(|x| (x - low) / extent).collect());
                active.push(j);
                extents.push(extent);
            }
        }

        let centre = mean(&points.y);
        let largest = points
            .y
            .iter()
            .map(|y| (y - centre).abs())
            .fold(0.0, f64::max);
        let y_scale = if largest > 0.0 {
            // Squares of the ratios neither overflow nor vanish.
            let squares: f64 = points
                .y
                .iter()
                .map(|y| ((y - centre) / largest).powi(2))
                .sum();
            largest * (squares / n as f64).sqrt()
        } else {
            0.0
        };
        // Noise sets the scale where the observations scatter less than their noise.
        let noise = points
            .noise
            .iter()
            .map(|v| v / n as f64)
            .sum::<f64>()
            .sqrt();
        let y_scale = match y_scale.max(noise) {
            0.0 => 1.0,
            scale => scale,
        };
        let bounds = [
            SIGMA2_BOUNDS.0 * y_scale * y_scale,
            SIGMA2_BOUNDS.1 * y_scale * y_scale,
        ];
        if !bounds.iter().all(|b| b.is_normal()) {
            return Err(Error::Extent { what: "y" });
        }
        let y = points.y.iter().map(|y| (y - centre) / y_scale).collect();
        let noise = points.noise.iter().map(|v| v / y_scale / y_scale).collect();
        Ok(Self {
            columns,
            active,
            extents,
            y,
            noise,
            y_scale,
        })
    }

    pub(crate) fn len(&self) -> usize {
        self.y.len()
    }

    /// The points of the given indices.
    pub(crate) fn subset(&self, indices: &[usize]) -> Self {
        let pick = |values: &[f64]| indices.iter().map(|&i| values[i]).collect::<Vec<f64>>();
        Self {
            columns: self.columns.iter().map(|c| pick(c)).collect(),
            active: self.active.clone(),
            extents: self.extents.clone(),
            y: pick(&self.y),
            noise: pick(&self.noise),
            y_scale: self.y_scale,
        }
    }
}
