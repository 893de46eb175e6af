//! The points' coordinates in units of the ranges.

use crate::Error;
use crate::data::{Points, near};
use crate::error::check_length;
use crate::kernel::Kernel;

/// The coordinates that a model depends on, those of finite range. Each vector has one entry per
/// such coordinate.
#[derive(Debug, Clone)]
pub(crate) struct Coordinates {
    /// Number of coordinates d of a point.
    d: usize,
    /// Their indices among the points' d coordinates.
    pub(crate) active: Vec<usize>,
    /// Smallest values among the points: coordinates are taken relative to them.
    origin: Vec<f64>,
    /// Largest minus smallest values among the points.
    pub(crate) extents: Vec<f64>,
    /// Length factor of the kernel divided by the range.
    pub(crate) scale: Vec<f64>,
    /// The points' scaled coordinates.
    pub(crate) columns: Vec<Vec<f64>>,
}

impl Coordinates {
    pub(crate) fn new(kernel: Kernel, points: &Points, ranges: &[f64]) -> Self {
        let active: Vec<usize> = (0..points.d).filter(|&j| ranges[j].is_finite()).collect();
        let (mut origin, mut extents) = (Vec::new(), Vec::new());
        for &j in &active {
            let [low, high] = points.interval(j);
            origin.push(low);
            extents.push(high - low);
        }
        let factor = |&j: &usize| kernel.length_factor() / ranges[j];
        let scale: Vec<f64> = active.iter().map(factor).collect();
        let columns = active
            .iter()
            .zip(origin.iter().zip(&scale))
            .map(|(&j, (o, s))| points.coordinate(j).map(|x| (x - o) * s).collect())
            .collect();
        Self {
            d: points.d,
            active,
            origin,
            extents,
            scale,
            columns,
        }
    }

    /// The middle of coordinate k among the points.
    pub(crate) fn centre(&self, k: usize) -> f64 {
        self.origin[k] + 0.5 * self.extents[k]
    }

    /// The scaled coordinates of `x`. Panics unless `x` has d coordinates.
    pub(crate) fn scaled(&self, x: &[f64]) -> Vec<f64> {
        assert_eq!(
            x.len(),
            self.d,
            "a point must have the model's number of coordinates"
        );
        self.active
            .iter()
            .zip(self.origin.iter().zip(&self.scale))
            .map(|(&j, (o, s))| (x[j] - o) * s)
            .collect()
    }

    /// The groups of points that are nearly the same, as [`LeaveOneOut`](super::LeaveOneOut) defines it.
    pub(crate) fn near_groups(&self, kernel: Kernel) -> Vec<Vec<usize>> {
        const NEARLY: f64 = 1e-3;
        let Some(n) = self.columns.first().map(Vec::len) else {
            return Vec::new();
        };
        let spacing = (n as f64).powf(-1.0 / self.columns.len() as f64);
        let extents = self.extents.iter().zip(&self.scale);
        let nearly = extents.map(|(e, s)| NEARLY * kernel.length_factor().min(e * s * spacing));
        near::groups(&self.columns, &nearly.collect::<Vec<f64>>(), n)
    }

    /// [`Error::Extent`] if a coordinate overflows in units of its range.
    pub(crate) fn check(&self) -> Result<(), Error> {
        if self.columns.iter().flatten().all(|c| c.is_finite()) {
            Ok(())
        } else {
            Err(Error::Extent { what: "x" })
        }
    }
}

/// The rows of d coordinates that `x` holds.
pub(crate) fn rows(x: &[f64], d: usize) -> Result<Vec<&[f64]>, Error> {
    check_length("x", x.len().next_multiple_of(d), x.len())?;
    Ok(x.chunks_exact(d).collect())
}
