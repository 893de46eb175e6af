//! The strategy: drawing candidates, and learning from their ranks.

use nalgebra::{DMatrix, DVector, SymmetricEigen};
use rand::{Rng, RngExt as _};
use rand_distr::StandardNormal;

use crate::parameters::Parameters;
use crate::stop::Window;
use crate::{Error, Evaluation, Options, Stop};

/// Growth of the step after which a search counts as diverging (the tutorial's `TolXUp`).
const LARGEST_GROWTH: f64 = 1e4;
/// Condition number beyond which rounding decides about the sampled points.
const LARGEST_CONDITION: f64 = 1e14;

/// A search in progress: ask for candidates, evaluate them, tell the results, until it stops.
///
/// Variables are named as in the tutorial: mean m, step size σ, covariance matrix C = B D² Bᵀ,
/// evolution paths `p_sigma` and `p_c`. All of them live in the unit box; only what goes in and out
/// is in the caller's units.
///
/// **Bounds.** A candidate that leaves the box is drawn again, up to [`Options::resamples`] times.
/// Near a corner of d variables only one draw in 2ᵈ is inside, so redrawing alone would stall
/// there; after the last try the coordinates that are out are set onto their bounds, and the
/// strategy learns from the point that was evaluated, not from the one that was drawn. So even an
/// optimum in a corner is reached. Such a point was not drawn from the distribution, so
/// its step is shortened to a length that a draw could have (N. Hansen, *Injecting external
/// solutions into CMA-ES*, arXiv:1110.4181).
///
/// In a generation that the bounds cut into, negative weights are left out. In a corner, the bad
/// candidates are those that lead inwards; taking variance away there leaves a distribution that
/// is wide only in directions out of the box, and the step size diverges.
///
/// **Invariant.** Mean and candidates are within the bounds, all coordinates finite.
#[derive(Debug, Clone)]
pub struct CmaEs {
    options: Options,
    parameters: Parameters,
    mean: DVector<f64>,
    sigma: f64,
    covariance: DMatrix<f64>,
    /// B: eigenvectors of the covariance, as columns.
    axes: DMatrix<f64>,
    /// D: square roots of its eigenvalues.
    lengths: DVector<f64>,
    p_sigma: DVector<f64>,
    p_c: DVector<f64>,
    generation: usize,
    decomposed_at: usize,
    evaluations: usize,
    asked: Vec<Candidate>,
    best: Option<(Vec<f64>, Evaluation)>,
    window: Window,
    stop: Option<Stop>,
}

/// A candidate waiting for its evaluation.
#[derive(Debug, Clone)]
struct Candidate {
    /// (x − m)/σ in the unit box, shortened if x was moved to the boundary.
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
    /// that make no search.
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
            p_sigma: DVector::zeros(n),
            p_c: DVector::zeros(n),
            generation: 0,
            decomposed_at: 0,
            evaluations: 0,
            asked: Vec::new(),
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
        self.asked = (0..self.options.population)
            .map(|_| self.draw(rng))
            .collect();
        self.asked
            .iter()
            .map(|candidate| candidate.x.clone())
            .collect()
    }

    /// Learns from the evaluations of the candidates last asked for, in their order.
    ///
    /// Equal evaluations are ranked in the order of the candidates. A generation of which every
    /// candidate failed carries no information, and changes nothing but the counters.
    ///
    /// # Errors
    ///
    /// [`Error::NothingAsked`] without candidates, [`Error::Count`] when `evaluations` is not one
    /// per candidate; the candidates then keep waiting.
    pub fn tell<E: Into<Evaluation> + Copy>(&mut self, evaluations: &[E]) -> Result<(), Error> {
        let (expected, got) = (self.asked.len(), evaluations.len());
        if expected == 0 {
            return Err(Error::NothingAsked);
        }
        if expected != got {
            return Err(Error::Count { expected, got });
        }
        let mut ranked: Vec<(Candidate, Evaluation)> = std::mem::take(&mut self.asked)
            .into_iter()
            .zip(evaluations.iter().map(|&e| e.into()))
            .collect();
        ranked.sort_by(|(_, a), (_, b)| a.rank(b)); // stable

        self.generation += 1;
        self.evaluations += got;
        let (candidate, evaluation) = &ranked[0];
        if evaluation.is_usable() {
            if self
                .best
                .as_ref()
                .is_none_or(|(_, best)| evaluation.is_better_than(best))
            {
                self.best = Some((candidate.x.clone(), *evaluation));
            }
            let steps: Vec<&DVector<f64>> = ranked.iter().map(|(c, _)| &c.y).collect();
            let cut = ranked.iter().any(|(c, _)| c.redrawn);
            self.adapt(&steps, cut);
        }

        let sorted: Vec<Evaluation> = ranked.iter().map(|(_, e)| *e).collect();
        let flat = self.window.record(&sorted, self.options.value_tolerance);
        // A degenerate matrix, found by the update above, stays the reason.
        self.stop = self.stop.or(flat).or_else(|| self.step_stop());
        Ok(())
    }

    /// Why the search should end, if it should. A stopped search can still be asked and told, but
    /// gains nothing from it; the reason stays the first one.
    #[must_use]
    pub fn stop(&self) -> Option<Stop> {
        self.stop
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

    /// The best candidate told so far (the first of equals) and its evaluation; none if all failed.
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

    fn draw<R: Rng + ?Sized>(&self, rng: &mut R) -> Candidate {
        let n = self.mean.len();
        let mut y = DVector::zeros(n);
        let mut unit = DVector::zeros(n);
        for attempt in 0..=self.options.resamples {
            y.fill(0.0);
            for (axis, length) in self.axes.column_iter().zip(&self.lengths) {
                let z: f64 = rng.sample(StandardNormal);
                y.axpy(length * z, &axis, 1.0);
            }
            unit.copy_from(&self.mean);
            unit.axpy(self.sigma, &y, 1.0);
            if unit.iter().all(|u| (0.0..=1.0).contains(u)) {
                let x = self.options.bounds.unscale(unit.iter());
                return Candidate {
                    y,
                    x,
                    redrawn: attempt > 0,
                };
            }
        }
        for ((u, y), m) in unit.iter_mut().zip(&mut y).zip(&self.mean) {
            if !(0.0..=1.0).contains(u) {
                *u = u.clamp(0.0, 1.0);
                *y = (*u - m) / self.sigma;
            }
        }
        // Off the long axis of a narrow distribution, a small correction is a huge step in its own
        // measure, and would make the step size explode.
        let n = n as f64;
        let longest = n.sqrt() + 2.0 * n / (n + 2.0);
        let length = self.whiten(&y).norm();
        if length > longest {
            y *= longest / length;
        }
        Candidate {
            y,
            x: self.options.bounds.unscale(unit.iter()),
            redrawn: true,
        }
    }

    /// One generation's update of mean, paths, step size and covariance from the steps (x − m)/σ,
    /// best first: the tutorial's eqs. (41) to (47). `cut` says that the bounds cut into them.
    fn adapt(&mut self, steps: &[&DVector<f64>], cut: bool) {
        let p = &self.parameters;
        let n = self.mean.len() as f64;

        let mut step = DVector::zeros(self.mean.len());
        for (y, w) in steps.iter().zip(&p.weights[..self.options.parents]) {
            step.axpy(*w, y, 1.0);
        }
        self.mean.axpy(self.sigma, &step, 1.0);
        // An average of points in the box is in the box, up to rounding.
        self.mean.apply(|m| *m = m.clamp(0.0, 1.0));

        let white = self.whiten(&step);
        let kept = 1.0 - p.c_sigma;
        self.p_sigma.axpy(
            (p.c_sigma * (2.0 - p.c_sigma) * p.mu_eff).sqrt(),
            &white,
            kept,
        );
        let norm = self.p_sigma.norm();

        // While the step size catches up with a too small start, pausing p_c keeps the covariance
        // from growing in its stead.
        let age = (2 * self.generation).min(100_000) as i32;
        let unbiased = norm / (1.0 - kept.powi(age)).sqrt();
        let steady = unbiased < (1.4 + 2.0 / (n + 1.0)) * p.chi;
        let gain = if steady {
            (p.c_c * (2.0 - p.c_c) * p.mu_eff).sqrt()
        } else {
            0.0
        };
        self.p_c.axpy(gain, &step, 1.0 - p.c_c);

        let weights: Vec<f64> = steps
            .iter()
            .zip(&p.weights)
            .map(|(y, &w)| {
                if w >= 0.0 {
                    return w;
                }
                if cut {
                    return 0.0;
                }
                // (46): a bad step counts by its direction, so that a long one cannot make C
                // indefinite. A step of zero length has no direction.
                let squared = self.whiten(y).norm_squared();
                if squared > f64::MIN_POSITIVE {
                    w * n / squared
                } else {
                    0.0
                }
            })
            .collect();
        let pause = if steady {
            0.0
        } else {
            p.c_1 * p.c_c * (2.0 - p.c_c)
        };
        let used = if cut { 1.0 } else { p.weights.iter().sum() };
        let decay = 1.0 + pause - p.c_1 - p.c_mu * used;
        self.covariance *= decay;
        self.covariance.ger(p.c_1, &self.p_c, &self.p_c, 1.0);
        for (y, w) in steps.iter().zip(weights) {
            self.covariance.ger(p.c_mu * w, y, y, 1.0);
        }

        // The tutorial's cap on the change of one generation.
        self.sigma *= ((p.c_sigma / p.d_sigma) * (norm / p.chi - 1.0))
            .min(1.0)
            .exp();

        if self.generation >= self.decomposed_at + p.decompose_every {
            self.decompose();
        }
    }

    /// C^(−½) y of the last decomposition.
    fn whiten(&self, y: &DVector<f64>) -> DVector<f64> {
        let mut white = DVector::zeros(y.len());
        for (axis, length) in self.axes.column_iter().zip(&self.lengths) {
            white.axpy(axis.dot(y) / length, &axis, 1.0);
        }
        white
    }

    /// Brings B and D up to date with C. If C has none, they stay as they are and the search stops.
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

    /// Whether the steps have become too small or too large to lead anywhere.
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
