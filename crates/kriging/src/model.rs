//! The fitted model and its predictions.

use std::sync::OnceLock;

use crate::covariance::{
    JITTERS, complete, factorise, fill_correlations, half_solve, log_determinant, noise_ratio,
    solve,
};
use crate::data::Points;
use crate::kernel::Kernel;
use crate::{Error, Warning};

/// Points whose correlations are computed together: their intermediate results stay in the cache.
const BLOCK: usize = 128;
/// Points predicted together by [`Model::predict_many`].
const BATCH: usize = 64;

/// The parameters of the process.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameters {
    /// The mean μ, in units of y.
    pub mu: f64,
    /// The process variance σ², in units of y².
    pub sigma2: f64,
    /// The d ranges θ, in units of x; infinite where the model ignores a coordinate.
    pub ranges: Vec<f64>,
}

/// What the model says of the noise-free function at one point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Prediction {
    /// m_OK, equation (19), in units of y.
    pub mean: f64,
    /// s²_OK, equation (20), in units of y². The noise of a new observation is not part of it.
    pub variance: f64,
}

/// An ordinary kriging model: see [`crate::fit`].
#[derive(Debug, Clone)]
pub struct Model {
    pub(crate) kernel: Kernel,
    pub(crate) points: Points,
    pub(crate) parameters: Parameters,
    pub(crate) jitter: f64,
    /// C⁻¹(y − μ1), see [`crate::covariance`].
    pub(crate) weights: Vec<f64>,
    pub(crate) nll: f64,
    /// The coordinates the model depends on.
    active: Vec<usize>,
    /// For each of them, its smallest value among the points: coordinates are taken relative to it.
    origin: Vec<f64>,
    /// For each of them, length factor of the kernel over range.
    scale: Vec<f64>,
    /// For each of them, the points' scaled coordinates.
    columns: Vec<Vec<f64>>,
    /// Computed when a variance is first asked for.
    solved: OnceLock<Solved>,
}

/// The factor of C and what follows from it.
#[derive(Debug, Clone)]
pub(crate) struct Solved {
    pub(crate) factor: Vec<f64>,
    /// C⁻¹1.
    pub(crate) ones: Vec<f64>,
    /// 1ᵀC⁻¹1.
    pub(crate) ones_sum: f64,
}

impl Model {
    /// Computes the mean and the weights for given σ² and ranges; `parameters.mu` is replaced. The
    /// jitter grows until C can be factorised.
    pub(crate) fn new(
        kernel: Kernel,
        points: Points,
        parameters: Parameters,
        jitter: f64,
    ) -> Result<Self, Error> {
        let mut model = Self::assemble(kernel, points, parameters, jitter, Vec::new(), 0.0);
        let n = model.points.len();
        let (solved, used) = model.try_solve().ok_or(Error::NotPositiveDefinite {
            jitter: JITTERS[JITTERS.len() - 1],
        })?;
        if used > jitter {
            model
                .points
                .warnings
                .retain(|w| !matches!(w, Warning::Jitter { .. }));
            model
                .points
                .warnings
                .push(Warning::Jitter { relative: used });
            model.jitter = used;
        }

        let centre = model.points.y.iter().sum::<f64>() / n as f64;
        let mut weights: Vec<f64> = model.points.y.iter().map(|y| y - centre).collect();
        let offset = dot(&weights, &solved.ones) / solved.ones_sum;
        weights.iter_mut().for_each(|w| *w -= offset);
        let z = weights.clone();
        solve(&solved.factor, n, &mut weights);
        let sigma2 = model.parameters.sigma2;
        model.nll = 0.5
            * (n as f64 * (std::f64::consts::TAU.ln() + sigma2.ln())
                + log_determinant(&solved.factor, n)
                + dot(&z, &weights) / sigma2)
            + model.points.within;
        model.parameters.mu = centre + offset;
        model.weights = weights;
        model.solved = OnceLock::from(solved);
        Ok(model)
    }

    /// Puts a model together from what its predictions need; everything else is computed on demand.
    /// The same input gives the same bits of every prediction.
    pub(crate) fn assemble(
        kernel: Kernel,
        points: Points,
        parameters: Parameters,
        jitter: f64,
        weights: Vec<f64>,
        nll: f64,
    ) -> Self {
        let n = points.len();
        let active: Vec<usize> = (0..points.d)
            .filter(|&j| parameters.ranges[j].is_finite())
            .collect();
        let column = |j: usize| (0..n).map(move |i| (i, j));
        let origin: Vec<f64> = active
            .iter()
            .map(|&j| {
                column(j)
                    .map(|(i, j)| points.row(i)[j])
                    .fold(f64::INFINITY, f64::min)
            })
            .collect();
        let scale: Vec<f64> = active
            .iter()
            .map(|&j| kernel.length_factor() / parameters.ranges[j])
            .collect();
        let columns = active
            .iter()
            .zip(origin.iter().zip(&scale))
            .map(|(&j, (o, s))| column(j).map(|(i, j)| (points.row(i)[j] - o) * s).collect())
            .collect();
        Self {
            kernel,
            points,
            parameters,
            jitter,
            weights,
            nll,
            active,
            origin,
            scale,
            columns,
            solved: OnceLock::new(),
        }
    }

    /// The kriging mean m_OK at `x` (d coordinates), equation (19), in units of y.
    ///
    /// # Panics
    ///
    /// If `x` has another length than [`Model::dimensions`].
    #[must_use]
    pub fn mean(&self, x: &[f64]) -> f64 {
        let at = self.scaled(x);
        let n = self.points.len();
        let (mut exponent, mut correlation) = ([0.0; BLOCK], [0.0; BLOCK]);
        let mut sum = 0.0;
        for start in (0..n).step_by(BLOCK) {
            let end = (start + BLOCK).min(n);
            let block = &mut correlation[..end - start];
            self.kernel.correlations(
                &at,
                |j| &self.columns[j][start..end],
                &mut exponent[..end - start],
                block,
            );
            sum += dot(block, &self.weights[start..end]);
        }
        self.parameters.mu + sum
    }

    /// Mean and variance at `x` (d coordinates), equations (19) and (20). The first call after
    /// reading a stored model factorises the covariance matrix; every call costs about n²/2
    /// multiplications.
    ///
    /// # Panics
    ///
    /// If `x` has another length than [`Model::dimensions`].
    #[must_use]
    pub fn predict(&self, x: &[f64]) -> Prediction {
        let mut out = Vec::with_capacity(1);
        self.predict_batch(&[x], &mut out);
        out[0]
    }

    /// [`Model::predict`] at many points: row-major, any number of rows of d coordinates. Costs less
    /// per point than single predictions and may differ from them by rounding.
    ///
    /// # Errors
    ///
    /// [`Error::Shape`] if `x` is not a whole number of rows.
    pub fn predict_many(&self, x: &[f64]) -> Result<Vec<Prediction>, Error> {
        let d = self.points.d;
        let rows: Vec<&[f64]> = x.chunks_exact(d).collect();
        if rows.len() * d != x.len() {
            let expected = (rows.len() + 1) * d;
            return Err(Error::Shape {
                what: "x",
                expected,
                got: x.len(),
            });
        }
        let mut predictions = Vec::with_capacity(rows.len());
        for batch in rows.chunks(BATCH) {
            self.predict_batch(batch, &mut predictions);
        }
        Ok(predictions)
    }

    fn predict_batch(&self, rows: &[&[f64]], out: &mut Vec<Prediction>) {
        let n = self.points.len();
        let solved = self.solved();
        let mut correlations = vec![0.0; n * rows.len()];
        let mut exponent = vec![0.0; n];
        let mut from_ones = Vec::with_capacity(rows.len());
        for (x, r) in rows.iter().zip(correlations.chunks_exact_mut(n)) {
            let at = self.scaled(x);
            self.kernel
                .correlations(&at, |j| &self.columns[j], &mut exponent, r);
            from_ones.push(1.0 - dot(r, &solved.ones));
        }
        half_solve(&solved.factor, n, &mut correlations);
        for ((x, half), short) in rows.iter().zip(correlations.chunks_exact(n)).zip(from_ones) {
            let unit = 1.0 - dot(half, half) + short * short / solved.ones_sum;
            // At a noise-free observation the terms cancel but for rounding. A NaN stays one.
            let variance = self.parameters.sigma2 * if unit < 0.0 { 0.0 } else { unit };
            out.push(Prediction {
                mean: self.mean(x),
                variance,
            });
        }
    }

    /// The parameters of the process.
    #[must_use]
    pub fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    /// The correlation function.
    #[must_use]
    pub fn kernel(&self) -> Kernel {
        self.kernel
    }

    /// Number of coordinates d of a point.
    #[must_use]
    pub fn dimensions(&self) -> usize {
        self.points.d
    }

    /// Number of distinct points the model was fitted to.
    #[must_use]
    pub fn points(&self) -> usize {
        self.points.len()
    }

    /// −ln L of the observations, with its n/2 ln 2π. Repeated observations count one by one, but
    /// noise-free ones of the same point as one.
    #[must_use]
    pub fn negative_log_likelihood(&self) -> f64 {
        self.nll
    }

    /// What a user of the model should know about the data and the fit.
    #[must_use]
    pub fn warnings(&self) -> &[Warning] {
        &self.points.warnings
    }

    /// Whether no coordinate overflows in units of its range.
    pub(crate) fn coordinates_are_finite(&self) -> bool {
        self.columns.iter().flatten().all(|c| c.is_finite())
    }

    fn scaled(&self, x: &[f64]) -> Vec<f64> {
        assert_eq!(
            x.len(),
            self.points.d,
            "a point must have the model's number of coordinates"
        );
        self.active
            .iter()
            .zip(self.origin.iter().zip(&self.scale))
            .map(|(&j, (o, s))| (x[j] - o) * s)
            .collect()
    }

    pub(crate) fn solved(&self) -> &Solved {
        self.solved.get_or_init(|| {
            // The matrix could be factorised when the model was fitted. On another processor the
            // last bits may differ, which a little more jitter absorbs.
            let (solved, _) = self
                .try_solve()
                .expect("a correlation matrix with 1e-4 on its diagonal is positive definite");
            solved
        })
    }

    /// Factorises C with the model's jitter or the next that will do.
    fn try_solve(&self) -> Option<(Solved, f64)> {
        let n = self.points.len();
        let sigma2 = self.parameters.sigma2;
        let mut correlation = vec![0.0; n * n];
        fill_correlations(self.kernel, &self.columns, n, &mut correlation);
        let mut factor = vec![0.0; n * n];
        let levels = JITTERS.into_iter().filter(|j| *j > self.jitter);
        for jitter in std::iter::once(self.jitter).chain(levels) {
            let ratio = |i: usize| noise_ratio(self.points.noise[i], sigma2);
            complete(&correlation, ratio, jitter, n, &mut factor);
            if factorise(&mut factor, n).is_ok() {
                let mut ones = vec![1.0; n];
                solve(&factor, n, &mut ones);
                let ones_sum = ones.iter().sum();
                return Some((
                    Solved {
                        factor,
                        ones,
                        ones_sum,
                    },
                    jitter,
                ));
            }
        }
        None
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    const LANES: usize = 8;
    let (a_chunks, a_rest) = a.as_chunks::<LANES>();
    let (b_chunks, b_rest) = b.as_chunks::<LANES>();
    let mut sums = [0.0; LANES];
    for (a, b) in a_chunks.iter().zip(b_chunks) {
        for lane in 0..LANES {
            sums[lane] += a[lane] * b[lane];
        }
    }
    for (lane, (a, b)) in a_rest.iter().zip(b_rest).enumerate() {
        sums[lane] += a * b;
    }
    sums.iter().sum()
}
