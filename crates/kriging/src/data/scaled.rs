//! The data in the units of the likelihood search.

use crate::Error;
use crate::data::{Points, mean};

/// Bounds of σ², relative to the variance of the observations.
pub(crate) const SIGMA2_BOUNDS: (f64, f64) = (1e-8, 1e6);

/// Points in units of their extent, and observations centred and in units of their standard deviation.
#[derive(Debug, Clone)]
pub(crate) struct ScaledData {
    /// Coordinate-major: `columns[j][i]` in 0…1. Coordinates in which all points agree are absent.
    pub(crate) columns: Vec<Vec<f64>>,
    /// Index of each column's coordinate among the d coordinates of the points.
    pub(crate) active: Vec<usize>,
    /// Extent of each column, in units of x.
    pub(crate) extents: Vec<f64>,
    /// Centred, divided by `y_scale`.
    pub(crate) y: Vec<f64>,
    /// Divided by `y_scale`².
    pub(crate) noise: Vec<f64>,
    pub(crate) y_scale: f64,
}

impl ScaledData {
    pub(crate) fn new(points: &Points) -> Result<Self, Error> {
        let (mut columns, mut active, mut extents) = (Vec::new(), Vec::new(), Vec::new());
        for j in 0..points.d {
            let [low, high] = points.interval(j);
            let extent = high - low;
            // The square is the unit of quantities quadratic in x; it and its inverse must be
            // normal numbers.
            if extent != 0.0 && !(extent * extent).is_normal() {
                return Err(Error::Extent { what: "x" });
            }
            if extent > 0.0 {
                columns.push(points.coordinate(j).map(|x| (x - low) / extent).collect());
                active.push(j);
                extents.push(extent);
            }
        }

        let informative = informative(points);
        let observed = || informative.iter().map(|&i| points.y[i]);
        let centre = mean(&observed().collect::<Vec<f64>>());
        let largest = observed().map(|y| (y - centre).abs()).fold(0.0, f64::max);
        let y_scale = if largest > 0.0 {
            // Squares of the ratios neither overflow nor vanish.
            let squares: f64 = observed().map(|y| ((y - centre) / largest).powi(2)).sum();
            largest * (squares / informative.len() as f64).sqrt()
        } else {
            0.0
        };
        // When the observations scatter less than their noise, the noise sets the scale.
        let noise = informative
            .iter()
            .map(|&i| points.noise[i] / informative.len() as f64)
            .sum::<f64>()
            .sqrt();
        // Unlike `max`, this keeps a NaN, which comes from differences that overflow.
        let larger = if noise > y_scale { noise } else { y_scale };
        let y_scale = if larger == 0.0 { 1.0 } else { larger };
        let bounds = [
            SIGMA2_BOUNDS.0 * y_scale * y_scale,
            SIGMA2_BOUNDS.1 * y_scale * y_scale,
        ];
        if !bounds.iter().all(|b| b.is_normal()) {
            return Err(Error::Extent { what: "y" });
        }
        let y: Vec<f64> = points.y.iter().map(|y| (y - centre) / y_scale).collect();
        let noise = points.noise.iter().map(|v| v / y_scale / y_scale).collect();
        if !y.iter().all(|y| (y * y).is_finite()) {
            return Err(Error::Extent { what: "y" });
        }
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

    /// Whether all observations are the same.
    pub(crate) fn is_constant(&self) -> bool {
        self.y.iter().all(|y| *y == self.y[0])
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

/// The observations from which the scale of y is computed: all but those whose noise variance exceeds a
/// million times both the median noise variance and the square of the observations' median distance
/// from their median. Such an observation carries no information, but its noise, or its value,
/// would make all others look alike.
fn informative(points: &Points) -> Vec<usize> {
    const BEYOND: f64 = 1e6;
    let middle = median(points.y.clone());
    let spread = median(points.y.iter().map(|y| (y - middle).abs()).collect());
    let usual = median(points.noise.clone()).max(spread * spread);
    // When most observations are exact and equal, there is no usual size.
    let is_informative = |i: &usize| usual == 0.0 || points.noise[*i] / BEYOND <= usual;
    (0..points.len()).filter(is_informative).collect()
}

/// The median; the larger one of two middle values.
fn median(mut values: Vec<f64>) -> f64 {
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}
