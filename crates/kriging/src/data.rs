//! Observations: checks, and merging at repeated points.

pub(crate) mod contradiction;
pub(crate) mod near;
pub(crate) mod prepared;
pub(crate) mod scaled;

use std::cmp::Ordering;

use crate::error::{check_finite, check_length, check_noise};
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

/// Points sorted by their coordinates, so that no result depends on the order of the observations.
#[derive(Debug, Clone)]
pub(crate) struct Points {
    pub(crate) d: usize,
    /// Row-major, n × d.
    pub(crate) x: Vec<f64>,
    pub(crate) y: Vec<f64>,
    pub(crate) noise: Vec<f64>,
    /// Position of each point's first observation in the data given.
    pub(crate) first: Vec<usize>,
    /// Number of observations, merged ones counted one by one.
    pub(crate) observations: usize,
    /// Negative log likelihood of the merged observations given their means: the difference between the
    /// likelihood of all observations and that of the points.
    pub(crate) within: f64,
}

impl Points {
    pub(crate) fn len(&self) -> usize {
        self.y.len()
    }

    pub(crate) fn row(&self, i: usize) -> &[f64] {
        &self.x[i * self.d..(i + 1) * self.d]
    }

    /// Coordinate j of every point.
    pub(crate) fn coordinate(&self, j: usize) -> impl Iterator<Item = f64> + '_ {
        self.x.iter().skip(j).step_by(self.d).copied()
    }

    /// The lowest and the highest value of coordinate j.
    pub(crate) fn interval(&self, j: usize) -> [f64; 2] {
        let low = self.coordinate(j).fold(f64::INFINITY, f64::min);
        [low, self.coordinate(j).fold(f64::NEG_INFINITY, f64::max)]
    }

    /// The points in the order of their first observations.
    pub(crate) fn by_first(&self) -> Vec<usize> {
        let mut order: Vec<usize> = (0..self.len()).collect();
        order.sort_by_key(|&i| self.first[i]);
        order
    }

    /// [`Warning::MergedDuplicates`] if there are fewer points than observations.
    pub(crate) fn merged_duplicates(&self) -> Option<Warning> {
        (self.observations > self.len()).then_some(Warning::MergedDuplicates {
            observations: self.observations,
            distinct: self.len(),
        })
    }

    /// Number of different rows. The points must be sorted, as [`points()`] returns them.
    pub(crate) fn distinct(&self) -> usize {
        let new = |i: &usize| *i == 0 || self.row(*i) != self.row(*i - 1);
        (0..self.len()).filter(new).count()
    }
}

/// Checks the data and makes points of them; the warnings report merged and contradictory observations. With an
/// unknown nugget, observations at one point are kept apart, else merged.
pub(crate) fn points(
    data: &Data<'_>,
    unknown_nugget: bool,
) -> Result<(Points, Vec<Warning>), Error> {
    match unknown_nugget {
        true => keep_repeated(data),
        false => merge_repeated(data),
    }
}

/// Checks the data and merges observations at equal points; the warnings report merged and
/// contradictory ones.
///
/// Noisy observations at one point are replaced by their precision-weighted mean, a sufficient statistic
/// for the model. A noise-free observation replaces the noisy ones that agree with it. If
/// observations of a point contradict each other (see [`Contradiction`]), the variance pooled over
/// all such points is added to the noise of each.
pub(crate) fn merge_repeated(data: &Data<'_>) -> Result<(Points, Vec<Warning>), Error> {
    merge_where(data, |a, b, row| {
        compare_rows(row(a), row(b)) == Ordering::Equal
    })
}

/// Checks the data and keeps observations at equal points apart: an unknown nugget is estimated
/// from their scatter, which a mean of them would lose. Only copies, noise-free observations of the
/// same value, count once. A row given twice carries no information, and as two measurements it
/// would make the nugget vanish for any other observations.
fn keep_repeated(data: &Data<'_>) -> Result<(Points, Vec<Warning>), Error> {
    merge_where(data, |a, b, row| {
        let exact = data.noise_variance[a] == 0.0 && data.noise_variance[b] == 0.0;
        exact && data.y[a] == data.y[b] && compare_rows(row(a), row(b)) == Ordering::Equal
    })
}

/// Sorts the observations and merges neighbours for which `one` holds.
fn merge_where<'a>(
    data: &Data<'a>,
    one: impl Fn(usize, usize, &dyn Fn(usize) -> &'a [f64]) -> bool,
) -> Result<(Points, Vec<Warning>), Error> {
    check(data)?;
    let d = data.d;
    let row = |i: usize| &data.x[i * d..(i + 1) * d];

    let mut order: Vec<usize> = (0..data.y.len()).collect();
    // Observations at one point are sorted too, so that sums over them have a fixed order.
    order.sort_by(|&a, &b| {
        compare_rows(row(a), row(b))
            .then(data.y[a].total_cmp(&data.y[b]))
            .then(data.noise_variance[a].total_cmp(&data.noise_variance[b]))
            .then(a.cmp(&b))
    });

    let groups: Vec<&[usize]> = order.chunk_by(|&a, &b| one(a, b, &row)).collect();
    let contradiction = Contradiction::among(&groups, data);

    let n = groups.len();
    let mut points = Points {
        d,
        x: Vec::with_capacity(n * d),
        y: Vec::with_capacity(n),
        noise: Vec::with_capacity(n),
        first: Vec::with_capacity(n),
        observations: data.y.len(),
        within: 0.0,
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
    let contradictory = (contradiction.points > 0).then(|| Warning::ContradictoryDuplicates {
        points: contradiction.points,
        sd: contradiction.variance.sqrt(),
    });
    let warnings = points.merged_duplicates().into_iter().chain(contradictory);
    let warnings = warnings.collect();
    Ok((points, warnings))
}

fn compare_rows(a: &[f64], b: &[f64]) -> Ordering {
    // All numbers are finite, and −0 equals 0 here, unlike in `total_cmp`.
    a.partial_cmp(b).unwrap_or(Ordering::Equal)
}

/// Standard deviations by which the norm of a point's scatter must exceed its expectation under the
/// noise. Normal noise exceeds this limit with a probability of 1.5e-8 at most (‖z‖ of ν standard normal
/// numbers exceeds √ν + t with a probability below exp(−t²/2), by the concentration of Gaussian measure).
const EXCESS: f64 = 6.0;

/// Observations of the same points that differ by more than their noise permits: noise-free ones that
/// differ at all, and noisy ones that lie many standard deviations from each other or from a
/// noise-free one.
struct Contradiction {
    /// Number of such points.
    points: usize,
    /// The variance of their observations, pooled over the points concerned.
    variance: f64,
}

impl Contradiction {
    fn among(groups: &[&[usize]], data: &Data<'_>) -> Self {
        let (mut points, mut squares, mut freedom) = (0, 0.0, 0);
        for group in groups.iter().filter(|group| contradicts(group, data)) {
            let values: Vec<f64> = group.iter().map(|&i| data.y[i]).collect();
            let mean = mean(&values);
            points += 1;
            squares += values.iter().map(|y| (y - mean).powi(2)).sum::<f64>();
            freedom += values.len() - 1;
        }
        let variance = if points == 0 {
            0.0
        } else {
            squares / freedom as f64
        };
        Self { points, variance }
    }
}

/// The value of the first noise-free observation of a group.
fn exact_value(group: &[usize], data: &Data<'_>) -> Option<f64> {
    let mut exact = group.iter().filter(|&&i| data.noise_variance[i] == 0.0);
    exact.next().map(|&i| data.y[i])
}

/// Whether a group's observations contradict each other.
fn contradicts(group: &[usize], data: &Data<'_>) -> bool {
    let exact = exact_value(group, data);
    let centre = exact.unwrap_or_else(|| weighted_mean(group, data, 0.0).0);
    let differing = group.iter().filter(|&&i| data.y[i] != centre);
    let squares = differing.map(|&i| (data.y[i] - centre).powi(2) / data.noise_variance[i]);
    let norm = squares.sum::<f64>().sqrt();
    norm > ((group.len() - 1) as f64).sqrt() + EXCESS
}

/// The mean, relative to the first value so that close values keep their digits.
pub(crate) fn mean(values: &[f64]) -> f64 {
    let first = values[0];
    first + values.iter().map(|y| y - first).sum::<f64>() / values.len() as f64
}

/// Observation, noise variance and within-group negative log likelihood of one point.
fn merge_group(group: &[usize], data: &Data<'_>, contradiction: &Contradiction) -> (f64, f64, f64) {
    if let [only] = group {
        return (data.y[*only], data.noise_variance[*only], 0.0);
    }
    let exact = exact_value(group, data);
    let extra = match (contradicts(group, data), exact) {
        (true, _) => contradiction.variance,
        (false, Some(y)) => return (y, 0.0, 0.0),
        (false, None) => 0.0,
    };
    let (y, noise) = weighted_mean(group, data, extra);
    if exact.is_some() {
        return (y, noise, 0.0);
    }
    let log_2pi = std::f64::consts::TAU.ln();
    let within: f64 = group
        .iter()
        .map(|&i| {
            let v = data.noise_variance[i] + extra;
            0.5 * (log_2pi + v.ln() + (data.y[i] - y).powi(2) / v)
        })
        .sum();
    (y, noise, within - 0.5 * (log_2pi + noise.ln()))
}

/// The precision-weighted mean, and its variance, of a group whose noise variances, with `extra` added, are positive.
fn weighted_mean(group: &[usize], data: &Data<'_>, extra: f64) -> (f64, f64) {
    // Relative to the smallest variance, so that 1/v cannot overflow.
    let smallest = group
        .iter()
        .map(|&i| data.noise_variance[i] + extra)
        .fold(f64::INFINITY, f64::min);
    let base = data.y[group[0]];
    let (mut precision, mut sum) = (0.0, 0.0);
    for &i in group {
        let weight = smallest / (data.noise_variance[i] + extra);
        precision += weight;
        sum += weight * (data.y[i] - base);
    }
    (base + sum / precision, smallest / precision)
}

fn check(data: &Data<'_>) -> Result<(), Error> {
    let n = data.y.len();
    if data.d == 0 {
        check_length("every point", 1, 0)?;
    }
    check_length("x", n * data.d, data.x.len())?;
    check_length("noise variance", n, data.noise_variance.len())?;
    check_finite("x", data.x)?;
    check_finite("y", data.y)?;
    check_finite("noise variance", data.noise_variance)?;
    check_noise(data.noise_variance)
}
