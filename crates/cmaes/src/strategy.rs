//! The strategy: drawing candidates, and learning from their ranks.

use crate::margin;
use crate::parameters::Parameters;
use crate::stop::Window;
use crate::{Error, Evaluation, Options, Stop};
use nalgebra::{DMatrix, DVector, SymmetricEigen};
use rand::{Rng, RngExt as _};
use rand_distr::StandardNormal;

/// Growth of the step after which a search counts as diverging (the tutorial's `TolXUp`).
const LARGEST_GROWTH: f64 = 1e4;
/// Condition number beyond which rounding decides about the sampled points.
const LARGEST_CONDITION: f64 = 1e14;

/// A search in progress: ask for candidates, evaluate them, tell the results, until it stops.
///
/// Variables are named as in the tutorial: mean m, step size σ, covariance matrix C = B D² Bᵀ,
/// evolution paths `p_sigma` and `p_c`. All of them are in the unit box; only arguments and results
/// are in the caller's units.
///
/// **Sampling.** The normal vectors of up to d candidates of a generation are made orthogonal to
/// each other, with their lengths kept. Each alone is still standard normal, but together they
/// explore more directions than independent ones, which saves a tenth of the evaluations (H. Wang,
/// M. Emmerich, T. Bäck, *Mirrored orthogonal sampling with pairwise selection in evolution
/// strategies*, SAC 2014; here without mirroring).
///
/// **Bounds.** A candidate that leaves the box is drawn again, up to [`Options::resamples`] times.
/// Near a corner of d variables only one draw in 2ᵈ is inside, so redrawing alone would stall
/// there. After the last try, the coordinates that are out of the box are set onto their bounds,
/// and the strategy learns from the point that was evaluated, not from the one that was drawn. So
/// even an optimum in a corner is reached. Such a point was not drawn from the distribution; its
/// step is therefore shortened to a length that a draw could have (N. Hansen, *Injecting external
/// solutions into CMA-ES*, arXiv:1110.4181).
///
/// Negative weights are left out in a generation with more than three quarters of its candidates
/// drawn again. In a corner, the bad candidates are those that lead inwards; taking variance away
/// there leaves a distribution that is wide only in directions out of the box, and the step size
/// diverges. (All 101 seeds in 2 to 11 variables with the optimum in a corner, at two bounds or at
/// one, converged; with a limit of one half or nine tenths, some did not.)
///
/// **Discrete variables** keep a margin: [`Options::cells`], the module `margin`.
///
/// **Invariant.** Mean and candidates are within the bounds, all coordinates finite.
#[derive(Debug, Clone)]
pub struct CmaEs {
    options: Options,
    parameters: Parameters,
    mean: DVector<f64>,
    sigma: f64,
    /// C; only its lower triangle is kept up to date.
    covariance: DMatrix<f64>,
    /// B: eigenvectors of the covariance, as columns.
    axes: DMatrix<f64>,
    /// D: square roots of its eigenvalues.
    lengths: DVector<f64>,
    /// Stretch of the distribution along each variable, 1 but for discrete ones.
    stretch: DVector<f64>,
    p_sigma: DVector<f64>,
    p_c: DVector<f64>,
    generation: usize,
    decomposed_at: usize,
    evaluations: usize,
    candidates: Vec<Candidate>,
    best: Option<(Vec<f64>, Evaluation)>,
    window: Window,
    stop: Option<Stop>,
}

/// A candidate waiting for its evaluation.
#[derive(Debug, Clone, PartialEq)]
struct Candidate {
    /// D⁻¹Bᵀy: the step in the distribution's own measure.
    z: DVector<f64>,
    /// (x − m)/σ in the unit box, without the stretch, shortened if x was moved to the boundary and is too far out.
    y: DVector<f64>,
    /// x in the caller's units.
    x: Vec<f64>,
    /// Whether an earlier draw was out of bounds.
    redrawn: bool,
}

impl CmaEs {
    /// A search from `start` (d coordinates in the caller's units, within the bounds).
    ///
    /// # Errors
    ///
    /// [`Error::Dimension`] or [`Error::StartOutside`] for a start point that does not fit, and
    /// [`Error::Population`], [`Error::Parents`], [`Error::Step`], [`Error::Tolerance`] for options
    /// out of range.
    pub fn new(start: &[f64], options: Options) -> Result<Self, Error> {
        options.check()?;
        let mean = DVector::from_vec(options.bounds.scale(start)?);
        let n = mean.len();
        Ok(Self {
            parameters: Parameters::new(&options),
            sigma: options.step,
            covariance: DMatrix::identity(n, n),
            axes: DMatrix::identity(n, n),
            lengths: DVector::from_element(n, 1.0),
            stretch: DVector::from_element(n, 1.0),
            p_sigma: DVector::zeros(n),
            p_c: DVector::zeros(n),
            generation: 0,
            decomposed_at: 0,
            evaluations: 0,
            candidates: Vec::new(),
            best: None,
            window: Window::new(n, options.population),
            stop: None,
            mean,
            options,
        })
    }

    /// Draws the next generation: λ candidates of d coordinates, in the caller's units.
    ///
    /// Asking again before telling throws the earlier candidates away.
    pub fn ask<R: Rng + ?Sized>(&mut self, rng: &mut R) -> Vec<Vec<f64>> {
        let directions = self.directions(rng);
        self.candidates = directions.into_iter().map(|z| self.draw(z, rng)).collect();
        self.candidates
            .iter()
            .map(|candidate| candidate.x.clone())
            .collect()
    }

    /// Learns from the evaluations of the candidates last asked for, in their order.
    ///
    /// Equal evaluations are ranked in the order of the candidates. A generation in which every
    /// candidate failed carries no information: only the counters change.
    ///
    /// # Errors
    ///
    /// [`Error::NothingAsked`] without candidates, [`Error::Count`] when `evaluations` is not one
    /// per candidate; the candidates then keep waiting.
    pub fn tell<E: Into<Evaluation> + Copy>(&mut self, evaluations: &[E]) -> Result<(), Error> {
        let (expected, got) = (self.candidates.len(), evaluations.len());
        if expected == 0 {
            return Err(Error::NothingAsked);
        }
        if expected != got {
            return Err(Error::Count { expected, got });
        }
        let evaluations: Vec<Evaluation> = evaluations.iter().map(|&e| e.into()).collect();
        let mut order: Vec<usize> = (0..evaluations.len()).collect();
        order.sort_by(|&a, &b| evaluations[a].rank(&evaluations[b])); // stable
        let mut candidates = std::mem::take(&mut self.candidates);
        self.generation += 1;
        self.evaluations += evaluations.len();
        let sorted: Vec<Evaluation> = order.iter().map(|&i| evaluations[i]).collect();
        if sorted[0].is_usable() {
            let better = |(_, best): &(_, Evaluation)| sorted[0].is_better_than(best);
            if self.best.as_ref().is_none_or(better) {
                self.best = Some((std::mem::take(&mut candidates[order[0]].x), sorted[0]));
            }
            let ranked: Vec<&Candidate> = order.iter().map(|&i| &candidates[i]).collect();
            let redrawn = ranked.iter().filter(|c| c.redrawn).count();
            self.adapt(&ranked, 4 * redrawn > 3 * ranked.len());
        }
        let flat = self.window.record(&sorted, self.options.value_tolerance);
        // A degenerate matrix, found by the update above, remains the reason to stop.
        self.stop = self.stop.or(flat).or_else(|| self.step_stop());
        Ok(())
    }

    /// The reason to end the search, if there is one. A stopped search can still be asked and told,
    /// but gains nothing from it; the first reason stays.
    #[must_use]
    pub fn stop(&self) -> Option<Stop> {
        self.stop
    }

    /// Largest minus smallest value among the candidates of the last generation and the best candidates of the
    /// generations in the window; `None` until the window is full, or if all of these failed.
    pub(crate) fn spread(&self) -> Option<f64> {
        self.window.spread()
    }

    /// The mean of the sampling distribution, d coordinates in the caller's units.
    #[must_use]
    pub fn mean(&self) -> Vec<f64> {
        self.options.bounds.unscale(self.mean.iter())
    }

    /// The step size σ, as a fraction of the range.
    #[must_use]
    pub fn step(&self) -> f64 {
        self.sigma
    }

    /// The best candidate told so far (the first of equals) and its evaluation; `None` if all
    /// failed.
    #[must_use]
    pub fn best(&self) -> Option<(&[f64], Evaluation)> {
        self.best
            .as_ref()
            .map(|(x, evaluation)| (x.as_slice(), *evaluation))
    }

    /// The number of evaluations told so far.
    #[must_use]
    pub fn evaluations(&self) -> usize {
        self.evaluations
    }

    /// The number of generations told so far.
    #[must_use]
    pub fn generation(&self) -> usize {
        self.generation
    }

    /// The candidates of the last [`ask`](Self::ask), in the caller's units.
    pub(crate) fn candidates(&self) -> impl Iterator<Item = &[f64]> {
        self.candidates
            .iter()
            .map(|candidate| candidate.x.as_slice())
    }

    /// λ standard normal vectors, orthogonal in groups of up to d.
    fn directions<R: Rng + ?Sized>(&self, rng: &mut R) -> Vec<DVector<f64>> {
        let n = self.mean.len();
        let mut drawn: Vec<DVector<f64>> = Vec::with_capacity(self.options.population);
        let mut squares: Vec<f64> = Vec::with_capacity(self.options.population);
        for k in 0..self.options.population {
            let mut z = normal(n, rng);
            let length = z.norm();
            // The modified Gram–Schmidt process, whose rounding errors do not accumulate.
            for (other, squared) in drawn[k / n * n..k].iter().zip(&squares[k / n * n..k]) {
                let share = dot(other.as_slice(), z.as_slice()) / squared;
                add(z.as_mut_slice(), -share, other.as_slice());
            }
            let left = z.norm();
            // A vector nearly in the span of the others, next to impossible, has a direction that
            // rounding decides. It is replaced by a new draw, without orthogonalisation.
            if left > 1e-8 * length {
                z *= length / left;
            } else {
                z = normal(n, rng);
            }
            squares.push(z.norm_squared());
            drawn.push(z);
        }
        drawn
    }

    /// The candidate at the standard normal `z`, drawn again or moved to the boundary if it lies out of
    /// bounds.
    fn draw<R: Rng + ?Sized>(&self, mut z: DVector<f64>, rng: &mut R) -> Candidate {
        let n = self.mean.len();
        let mut y = DVector::zeros(n);
        let mut unit = DVector::zeros(n);
        for attempt in 0..=self.options.resamples {
            if attempt > 0 {
                z.apply(|z| *z = rng.sample(StandardNormal));
            }
            y.fill(0.0);
            let axes = self.axes.as_slice().chunks_exact(n);
            for ((axis, length), z) in axes.zip(&self.lengths).zip(&z) {
                add(y.as_mut_slice(), length * z, axis);
            }
            unit.copy_from(&self.mean);
            for ((u, y), stretch) in unit.iter_mut().zip(&y).zip(&self.stretch) {
                *u += self.sigma * stretch * y;
            }
            if unit.iter().all(|u| (0.0..=1.0).contains(u)) {
                let x = self.options.bounds.unscale(unit.iter());
                return Candidate {
                    z,
                    y,
                    x,
                    redrawn: attempt > 0,
                };
            }
        }
        let centre = self.mean.iter().zip(&self.stretch);
        for ((u, y), (m, stretch)) in unit.iter_mut().zip(&mut y).zip(centre) {
            if !(0.0..=1.0).contains(u) {
                *u = u.clamp(0.0, 1.0);
                *y = (*u - m) / (self.sigma * stretch);
            }
        }
        for ((z, axis), length) in z.iter_mut().zip(self.axes.column_iter()).zip(&self.lengths) {
            *z = axis.dot(&y) / length;
        }
        // In a narrow distribution, a small correction off the long axis is a huge step in the
        // distribution's own measure, and would make the step size explode.
        let n = n as f64;
        let longest = n.sqrt() + 2.0 * n / (n + 2.0);
        let length = z.norm();
        if length > longest {
            y *= longest / length;
            z *= longest / length;
        }
        Candidate {
            z,
            y,
            x: self.options.bounds.unscale(unit.iter()),
            redrawn: true,
        }
    }

    /// One generation's update of mean, paths, step size and covariance from the candidates, best
    /// first: the tutorial's eqs. (41) to (47). With `cut`, negative weights are left out, because
    /// the bounds cut off much of the distribution.
    fn adapt(&mut self, ranked: &[&Candidate], cut: bool) {
        let p = &self.parameters;
        let size = self.mean.len();
        let n = size as f64;

        let mut step = DVector::zeros(size);
        let mut own = DVector::zeros(size);
        for (c, w) in ranked.iter().zip(&p.weights[..self.options.parents]) {
            add(step.as_mut_slice(), *w, c.y.as_slice());
            add(own.as_mut_slice(), *w, c.z.as_slice());
        }
        for ((m, step), stretch) in self.mean.iter_mut().zip(&step).zip(&self.stretch) {
            *m += self.sigma * stretch * step;
        }
        // An average of points in the box is in the box, up to rounding.
        self.mean.apply(|m| *m = m.clamp(0.0, 1.0));

        // C^(−½) times the step equals B times the average z.
        let kept = 1.0 - p.c_sigma;
        let gain = (p.c_sigma * (2.0 - p.c_sigma) * p.mu_eff).sqrt();
        self.p_sigma *= kept;
        for (axis, z) in self.axes.column_iter().zip(&own) {
            self.p_sigma.axpy(gain * z, &axis, 1.0);
        }
        let norm = self.p_sigma.norm();

        // A start with too small a step size makes `p_c` grow, and with it the covariance. Pausing
        // `p_c` lets the step size catch up instead.
        let age = (2 * self.generation).min(100_000) as i32;
        let unbiased = norm / (1.0 - kept.powi(age)).sqrt();
        let steady = unbiased < (1.4 + 2.0 / (n + 1.0)) * p.chi;
        let gain = if steady {
            (p.c_c * (2.0 - p.c_c) * p.mu_eff).sqrt()
        } else {
            0.0
        };
        self.p_c.axpy(gain, &step, 1.0 - p.c_c);

        let pause = if steady {
            0.0
        } else {
            p.c_1 * p.c_c * (2.0 - p.c_c)
        };
        let used = if cut { 1.0 } else { p.weights.iter().sum() };
        let decay = 1.0 + pause - p.c_1 - p.c_mu * used;
        self.covariance *= decay;
        add_product(&mut self.covariance, p.c_1, &self.p_c);
        for (c, &w) in ranked.iter().zip(&p.weights) {
            let weight = if w >= 0.0 {
                w
            } else if cut {
                continue;
            } else {
                // (46): a bad step counts by its direction, so that a long one cannot make C
                // indefinite. A step of zero length has no direction.
                let squared = c.z.norm_squared();
                if squared <= f64::MIN_POSITIVE {
                    continue;
                }
                w * n / squared
            };
            add_product(&mut self.covariance, p.c_mu * weight, &c.y);
        }

        // The tutorial's cap on the change of one generation.
        self.sigma *= ((p.c_sigma / p.d_sigma) * (norm / p.chi - 1.0))
            .min(1.0)
            .exp();
        margin::keep(
            &self.options.cells,
            self.options.population,
            |i| self.sigma * self.covariance[(i, i)].sqrt(),
            &mut self.mean,
            &mut self.stretch,
        );

        if self.generation >= self.decomposed_at + p.decompose_every {
            self.decompose();
        }
    }

    /// Recomputes B and D from C. If C is not finite or not positive definite, they stay as they
    /// are and the search stops.
    fn decompose(&mut self) {
        self.decomposed_at = self.generation;
        let n = self.mean.len();
        if !self.covariance.iter().all(|v| v.is_finite()) {
            self.stop
                .get_or_insert(Stop::DegenerateCovariance { smallest: f64::NAN });
            return;
        }
        // QL iterations take two or three sweeps per eigenvalue; the cap only rules out a hang.
        let tried = SymmetricEigen::try_new(self.covariance.clone(), f64::EPSILON, 1000 * n);
        let Some(eigen) = tried else {
            self.stop
                .get_or_insert(Stop::DegenerateCovariance { smallest: f64::NAN });
            return;
        };
        let smallest = eigen.eigenvalues.min();
        let largest = eigen.eigenvalues.max();
        if smallest.is_nan() || smallest <= 0.0 {
            self.stop
                .get_or_insert(Stop::DegenerateCovariance { smallest });
            return;
        }
        if largest > LARGEST_CONDITION * smallest {
            self.stop.get_or_insert(Stop::IllConditioned {
                condition: largest / smallest,
            });
        }
        self.axes = eigen.eigenvectors;
        self.lengths = eigen.eigenvalues.map(f64::sqrt);
    }

    /// The reason to stop because of steps that are too small or too large, if there is one.
    fn step_stop(&self) -> Option<Stop> {
        let along = |i: usize| self.sigma * self.covariance[(i, i)].sqrt();
        let small = self.options.step_tolerance * self.options.step;
        let n = self.mean.len();
        let within = (0..n).all(|i| along(i) < small && self.sigma * self.p_c[i].abs() < small);
        let lost = (0..n).all(|i| self.mean[i] + 0.2 * along(i) == self.mean[i]);
        if within || lost {
            return Some(Stop::StepTooSmall {
                step: (0..n).map(along).fold(0.0, f64::max),
            });
        }
        let longest = self.sigma * self.lengths.max();
        if longest > LARGEST_GROWTH * self.options.step {
            return Some(Stop::StepTooLarge { step: longest });
        }
        None
    }
}

/// n independent standard normal numbers.
fn normal<R: Rng + ?Sized>(n: usize, rng: &mut R) -> DVector<f64> {
    DVector::from_fn(n, |_, _| rng.sample(StandardNormal))
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// a ← a + weight · b.
fn add(a: &mut [f64], weight: f64, b: &[f64]) {
    for (a, b) in a.iter_mut().zip(b) {
        *a += weight * b;
    }
}

/// C ← C + weight · v vᵀ, the lower triangle only.
fn add_product(matrix: &mut DMatrix<f64>, weight: f64, v: &DVector<f64>) {
    let v = v.as_slice();
    let columns = matrix.as_mut_slice().chunks_exact_mut(v.len());
    for (j, column) in columns.enumerate() {
        add(&mut column[j..], weight * v[j], &v[j..]);
    }
}

#[cfg(test)]
mod tests {
    use stats::streams::{Purpose, stream};

    use super::*;
    use crate::Bounds;

    /// Rounding can cost a covariance matrix its positive eigenvalues; this test overwrites it
    /// instead.
    #[test]
    fn a_covariance_that_is_not_definite_is_called_so() {
        let bounds = Bounds::unit(2).unwrap();
        let mut search = CmaEs::new(&[0.3; 2], Options::new(bounds)).unwrap();
        let mut rng = stream(1, Purpose::Test, 0, 0);
        let mut generations = |search: &mut CmaEs, most: usize| {
            for _ in 0..most {
                let told: Vec<f64> = search.ask(&mut rng).iter().map(|x| x[0] + x[1]).collect();
                search.tell(&told).unwrap();
                if search.stop().is_some() {
                    break;
                }
            }
        };
        generations(&mut search, 5);
        // Eigenvalues 3 and −1.
        search.covariance = DMatrix::from_row_slice(2, 2, &[1.0, 2.0, 2.0, 1.0]);
        generations(&mut search, 10);
        let stop = search.stop();
        assert!(
            matches!(stop, Some(Stop::DegenerateCovariance { smallest }) if smallest < 0.0),
            "{stop:?}"
        );
        // The last good distribution is still there to draw from.
        let candidates = search.ask(&mut rng);
        assert!(candidates.iter().flatten().all(|v| (0.0..=1.0).contains(v)));
    }
}
