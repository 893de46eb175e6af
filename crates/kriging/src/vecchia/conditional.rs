//! The process at one point, given the observations at a few others.

use crate::kernel::Kernel;
use crate::likelihood::covariance;
use crate::linalg::{JITTERS, Spd, dot};

/// Points of which some are conditioned on.
pub(super) struct Points<'a> {
    pub(super) kernel: Kernel,
    /// In units of the kernel's ranges.
    pub(super) columns: &'a [Vec<f64>],
    /// Noise over process variance, of every point.
    pub(super) noise_ratio: &'a [f64],
}

/// The process at one point, given a few others.
#[derive(Debug, Clone, Copy)]
pub(super) struct ConditionalProcess<const R: usize> {
    /// cᵀC⁻¹v for each vector v of values, with c the correlations of the point with the others.
    pub(super) means: [f64; R],
    /// 1 − cᵀC⁻¹c: the conditional variance over the process variance.
    pub(super) variance: f64,
    /// The jitter that factorising C took.
    pub(super) jitter: f64,
}

impl Points<'_> {
    /// The process at the scaled coordinates `at` given the points `near`, for each vector of `values` of all
    /// points.
    pub(super) fn conditional<const R: usize>(
        &self,
        near: &[u32],
        at: &[f64],
        values: [&[f64]; R],
    ) -> ConditionalProcess<R> {
        let m = near.len();
        let of_near = |values: &[f64]| near.iter().map(|&i| values[i as usize]).collect();
        let columns: Vec<Vec<f64>> = self.columns.iter().map(|c| of_near(c)).collect();
        let factorised = JITTERS.into_iter().find_map(|jitter| {
            let ratio = |i: usize| self.noise_ratio[near[i] as usize];
            let matrix = covariance(self.kernel, &columns, m, jitter, ratio, Vec::new());
            Some((Spd::factor(matrix).ok()?, jitter))
        });
        let Some((factor, jitter)) = factorised else {
            // No such matrix is known. The prior is the result without neighbours.
            return ConditionalProcess {
                means: [0.0; R],
                variance: 1.0,
                jitter: JITTERS[JITTERS.len() - 1],
            };
        };
        let mut solved = vec![0.0; m];
        self.kernel.correlations(at, |j| &columns[j], &mut solved);
        values
            .iter()
            .for_each(|v| solved.extend::<Vec<f64>>(of_near(v)));
        factor.half_solve(&mut solved);
        let (half, values) = solved.split_at(m);
        ConditionalProcess {
            means: std::array::from_fn(|r| dot(half, &values[r * m..(r + 1) * m])),
            variance: (1.0 - dot(half, half)).max(0.0),
            jitter,
        }
    }
}
